"""One number from every kind of result, under what may round it otherwise.

``PYTHONPATH=tests python tests/reproducible.py`` prints by how much results differ from those of
one thread: in two threads, with the kernels of OpenBLAS for other processors, and with every engine
that factorises. The tests hold them to what ``docs/numerical-honesty.md`` states.
"""

import functools
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import unbend
from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.linalg import factorization
from unbend.spectral import use_cache

Results = dict[str, npt.NDArray[Any]]

KERNELS = ("Nehalem", "Haswell", "SkylakeX")
# Sizes from which solves are compiled, and from which the multifrontal method is used, so that each
# engine does all the work.
ENGINES = {"qdldl": (10**9, 10**9), "qdldl+numba": (0, 10**9), "multifrontal": (0, 0)}
# By how much a result may differ, as a share of its largest number; of a match, the mean distance
# between partners, in lengths of the shape.
TOLERANCES = {
    "laplacian": 1e-12,
    "spectrum": 1e-8,
    "biharmonic": 1e-7,
    "commute-time": 1e-7,
    "diffusion": 1e-7,
    "geodesic": 1e-7,
    "form, exact": 1e-7,
    "form, by area": 1e-7,
    "form, sampled": 1e-6,
    "descriptor": 1e-5,
    "alignment": 1e-9,
    "register": 1e-6,
    "morph": 1e-7,
    "functional map": 1e-3,
    "confidence": 1e-3,
    "match": 1e-3,
}


@functools.cache
def shapes() -> tuple[Mesh, Mesh]:
    """Give a ball with three limbs, and the same with limbs bent, meshed otherwise."""
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    found = []
    for around, bend in ((np.eye(3), 0.0), (turn, 0.6)):
        ball = make_sphere(3)
        points = ball.vertices @ around
        for limb, length in (((1, 0.2, 0), 2.0), ((0, 1, 0.3), 1.2), ((-0.5, -0.4, 1), 0.7)):
            way = np.array(limb) / np.linalg.norm(limb)
            far = length * np.exp(-6 * (1 - ball.vertices @ around @ way))[:, None]
            points = points + far * (way + bend * far * np.roll(way, 1))
        found.append(Mesh(points, ball.faces))
    return found[0], found[1]


@use_cache(gib=0)
def compute(matching: bool = True) -> Results:
    """Compute every kind of result once, from nothing kept."""
    one, other = shapes()
    found: Results = {
        "laplacian": unbend.laplacian(one).stiffness.toarray(),
        "spectrum": unbend.spectrum(one, 30).eigenfunctions,
    }
    for kind in ("biharmonic", "commute-time", "diffusion", "geodesic"):
        found[kind] = unbend.distance(one, [0, 99], distance=kind)  # type: ignore[arg-type]
    forms = {
        "exact": unbend.canonical_form(one),
        "by area": unbend.canonical_form(one, weighting="area"),
        "sampled": unbend.sampled_canonical_form(one, n_eigenpairs=40, n_samples=80),
    }
    found |= {f"form, {name}": form.points for name, form in forms.items()}
    found["descriptor"] = unbend.collection.descriptor(one)
    found["alignment"] = unbend.align(found["form, exact"], found["form, sampled"]).rotation
    some = np.arange(one.n_vertices) % other.n_vertices
    found["morph"] = unbend.morph(one, other, some, 0.5).vertices
    if matching:
        match = unbend.match(one, other)
        found["match"] = match.source_to_target
        found["functional map"] = np.abs(match.functional_map)
        found["confidence"] = np.array([match.confidence])
        # From a map that is always the same: what differs then is the registration.
        every = np.arange(one.n_vertices)
        found["register"] = unbend.register(one, (2 * one.vertices, one.faces), every).mesh.vertices
    return found


def differences(ours: Results, theirs: Results) -> dict[str, float]:
    """By how much each result differs, as the tolerances count it."""
    other = shapes()[1]
    size = float(np.ptp(other.vertices, axis=0).max())
    found = {}
    for name in ours.keys() & theirs.keys():
        if name == "match":
            places = [other.vertices[one[name]] for one in (ours, theirs)]
            found[name] = float(np.linalg.norm(places[0] - places[1], axis=1).mean()) / size
        else:
            apart = np.abs(ours[name].astype(float) - theirs[name]).max()
            found[name] = float(apart / np.abs(ours[name]).max())
    return found


def elsewhere(twice: bool = False, **environment: str) -> tuple[Results, str]:
    """Compute in a process of its own, with no cache; tell its BLAS and that one's kernels.

    With `twice`, assert there that the same bits come out again.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "results.npz")
        settings = {
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(
                str(one) for one in (Path(unbend.__file__).parents[1], Path(__file__).parent)
            ),
        }
        subprocess.run(
            [sys.executable, __file__, str(place), "twice" if twice else "once"],
            env=os.environ | settings | environment,
            check=True,
        )
        with np.load(place) as file:
            results = dict(file)
    return results, str(results.pop("blas"))


def with_engine(name: str, set_to: Any) -> Results:
    """Compute with one engine for all factorisations; `set_to` is monkeypatch's, or setattr."""
    compiled, dense_blocks = ENGINES[name]
    set_to(factorization, "_NUMBA_PAYS", compiled)
    set_to(factorization, "_DENSE_BLOCKS_PAY", dense_blocks)
    return compute(matching=False)


def kernels() -> str:
    """BLAS of NumPy, and the processor that its kernels are for."""
    from threadpoolctl import threadpool_info

    found = [one for one in threadpool_info() if one["user_api"] == "blas"]
    return " ".join(sorted({f"{one['internal_api']} {one.get('architecture')}" for one in found}))


def _write(place: str, how_often: str) -> None:
    found = compute()
    if how_often == "twice":
        again = compute()
        unlike = [name for name in found if found[name].tobytes() != again[name].tobytes()]
        assert not unlike, f"other bits the second time: {unlike}"
    np.savez(place, blas=np.array(kernels()), **found)  # type: ignore[arg-type]


def main() -> None:
    """Print a table of what differs."""
    first, blas = elsewhere()
    print(f"one thread, {blas}")
    runs = {"again": {}, "two threads": {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}}
    runs |= {name: {"OPENBLAS_CORETYPE": name} for name in KERNELS}
    columns = {}
    for name, environment in runs.items():
        results, blas = elsewhere(**environment)
        columns[name] = differences(first, results)
        print(f"{name}: {blas}", flush=True)
    plain = compute(matching=False)
    for name in ENGINES:
        columns[name] = differences(plain, with_engine(name, setattr))
    print(f"{'':18}" + "".join(f"{name:>13}" for name in columns))
    for row in TOLERANCES:
        shown = [f"{one[row]:13.1e}" if row in one else f"{'':13}" for one in columns.values()]
        print(f"{row:18}" + "".join(shown), flush=True)


if __name__ == "__main__":
    warnings.simplefilter("error")
    if sys.argv[1:]:
        _write(*sys.argv[1:])
    else:
        main()
