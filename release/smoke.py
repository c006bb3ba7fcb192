"""What an installed unbend must do, with one extra or none: ``python smoke.py [EXTRA]``.

It imports nothing of the repository's, so that it tests what was installed.
"""

from __future__ import annotations

import doctest
import importlib
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import suppress
from pathlib import Path

import numpy as np

import unbend
from unbend import canonical_form, match, read_match, read_mesh, write_mesh
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import MissingExtraError

DOCTESTS = ("unbend.io", "unbend.mesh._mesh", "unbend.alignment._alignment", "unbend._parallel")


def command(*words: str | Path) -> str:
    """Run the command line as a module and give what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "unbend", *map(str, words)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def none(folder: Path) -> None:
    """Match two poses, from Python and from the shell; write and read files."""
    for name in unbend.__all__:
        with suppress(MissingExtraError):
            getattr(unbend, name)
    assert command("--version") == f"unbend {unbend.__version__}\n"
    assert "canonical" in command("--help")
    standing = make_quadruped("standing", n_vertices=600).mesh
    walking = make_quadruped("walking", n_vertices=600).mesh
    source, target = folder / "standing.ply", folder / "walking.ply"
    write_mesh(source, standing)
    write_mesh(target, walking)
    start = time.perf_counter()
    command("match", source, target, "-o", folder / "map.npz", "--report", folder / "map.html")
    print(f"first match of two files after {time.perf_counter() - start:.0f} s")
    found = match(standing, walking)
    right = np.mean(found.source_to_target == np.arange(len(standing.vertices)))
    assert right > 0.5, f"{right:.0%} of the vertices were matched to themselves in another pose"
    assert "healthy" in command("check", source)
    assert np.array_equal(
        read_match(folder / "map.npz").source_to_target,
        match(read_mesh(source), read_mesh(target)).source_to_target,
    )
    assert (folder / "map.html").stat().st_size > 10_000
    command("canonical", source, "-o", folder / "form.off")
    form = canonical_form(read_mesh(source))
    np.testing.assert_allclose(read_mesh(folder / "form.off").vertices, form.points, atol=1e-8)
    for name in DOCTESTS:
        failed, tried = doctest.testmod(
            importlib.import_module(name),
            optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS,
        )
        assert not failed, f"{failed} of the {tried} examples of {name}"


def plot(folder: Path) -> None:
    """Draw a match."""
    paths = [folder / "standing.off", folder / "walking.off"]
    for path in paths:
        write_mesh(path, make_quadruped(path.stem, n_vertices=600).mesh)
    command("match", *paths, "--figure", folder / "match.png")
    assert (folder / "match.png").read_bytes().startswith(b"\x89PNG")


def sklearn(folder: Path) -> None:
    """Fit the estimator."""
    dog = make_quadruped("standing", n_vertices=600).mesh
    assert unbend.canonical.SpectralMDS().fit_transform((dog.vertices, dog.faces)).shape[1] == 3


def exact(folder: Path) -> None:
    """Half-way round the unit sphere is pi."""
    ball = make_sphere(3)
    far = unbend.distance(ball, 0, distance="geodesic-exact").max()
    assert abs(far - np.pi) < 0.05, far


def data(folder: Path) -> None:
    """Check a file that is there already, downloading nothing."""
    from unbend.datasets.fetch import fetch_files

    (folder / "empty.txt").touch()
    nothing = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    fetch_files({"empty.txt": nothing}, folder, "https://example.org", "no terms")


def formats(folder: Path) -> None:
    """Read what trimesh, meshio and nibabel write."""
    import meshio
    import nibabel
    import trimesh

    ball = make_sphere(2)
    for suffix in ("glb", "3mf", "dae"):
        trimesh.Trimesh(ball.vertices, ball.faces).export(folder / f"ball.{suffix}")
    meshio.Mesh(ball.vertices, [("triangle", ball.faces)]).write(folder / "ball.mesh")
    kinds = {"NIFTI_INTENT_POINTSET": ball.vertices, "NIFTI_INTENT_TRIANGLE": ball.faces}
    arrays = [
        nibabel.gifti.GiftiDataArray(rows.astype(dtype), kind)
        for (kind, rows), dtype in zip(kinds.items(), ("float32", "int32"), strict=True)
    ]
    nibabel.save(nibabel.GiftiImage(darrays=arrays), folder / "ball.gii")
    for suffix in ("glb", "3mf", "dae", "mesh", "gii"):
        assert read_mesh(folder / f"ball.{suffix}").n_faces == ball.n_faces, suffix


def collection(folder: Path) -> None:
    """Add two shapes from another process, and find one."""
    shapes = folder / "shapes"
    shapes.mkdir()
    for species in ("dog", "giraffe"):
        animal = make_quadruped("walking", species=species, n_vertices=600)
        write_mesh(shapes / f"{species}.ply", animal.mesh)
    store = unbend.collection.Collection(folder / "store")
    assert store.add(shapes, workers=1).added == 2
    (hit,) = store.search(make_quadruped("galloping", n_vertices=500).mesh, n=1)
    assert Path(hit.path).name == "dog.ply"


def app(folder: Path) -> None:
    """Open the window without a browser, and ask for it."""
    run = [sys.executable, "-m", "unbend", "app", "--no-browser"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            with urllib.request.urlopen(process.stdout.readline().strip()) as answer:
                assert b"unbend" in answer.read()
        finally:
            process.terminate()


CHECKS = {one.__name__: one for one in (none, plot, sklearn, exact, data, formats, collection, app)}

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        CHECKS[sys.argv[1] if len(sys.argv) > 1 else "none"](Path(folder))
