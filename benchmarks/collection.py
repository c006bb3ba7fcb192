"""Collections: shapes a second, bytes a shape, and the time of a search, beside ShapeDNA.

    python benchmarks/collection.py [--shapes 60] [--vertices 5000] [--rows 1000 100000 1000000]

Adding is measured from files to the store, on one worker and on two, without the start of the
workers, and in processor time in this process. The peer is ShapeDNA (Reuter, Wolter & Peinecke
2006): the 30 leading eigenvalues of the cotangent Laplacian by SciPy, sought by scikit-learn's
brute force, as a script of one's own would do.

Searches are for the ten nearest, without describing the query. Their rows are synthetic: mixtures
of descriptors of real shapes, with noise, and no forms or pictures. ``found`` is the share of the
exact ten that the index finds. ``asked``: whether 256 files are there; ``committed``: 64 shapes.
"""

import argparse
import itertools
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from sklearn.neighbors import NearestNeighbors

from unbend import laplacian, read_mesh, write_mesh
from unbend.collection import Collection
from unbend.collection._adding import make_row
from unbend.datasets import make_biped, make_octopus, make_quadruped

KINDS = (
    (make_quadruped, ("dog", "cat", "horse"), ("standing", "walking", "sitting", "galloping")),
    (make_biped, ("human",), ("standing", "walking", "sitting", "running")),
    (make_octopus, ("octopus",), ("crawling",)),
)
N_VALUES, N_FOUND, REPEATS = 30, 10, 21


def write_shapes(folder: Path, count: int, vertices: int) -> list[Path]:
    """Animals of our own in several poses and meshings."""
    made = (
        (make, species, pose, meshing)
        for meshing in itertools.count()
        for make, all_species, poses in KINDS
        for species in all_species
        for pose in poses
    )
    paths = []
    for make, species, pose, meshing in itertools.islice(made, count):
        paths.append(folder / f"{species}-{pose}-{meshing}.ply")
        write_mesh(
            paths[-1], make(pose, species=species, n_vertices=vertices, meshing=meshing).mesh
        )
    return paths


def add(place: Path, paths: list[Path], workers: int) -> tuple[float, float]:
    """Add shapes; shapes a second from the first that is done to the last, and bytes a shape."""
    times: list[tuple[float, int]] = []

    def told(stage: str, share: float) -> None:
        count = int(stage.split(" of ")[0].replace(",", ""))
        if not times or count > times[-1][1]:
            times.append((time.perf_counter(), count))

    collection = Collection(place)
    done = collection.add(paths, workers=workers, progress=told)
    assert not done.failures, done.failures
    # The first ones of each worker wait for its libraries and compiled code.
    (start, first), (end, last) = times[2 * workers], times[-1]
    store = collection._store
    size = sum(batch.nbytes for batch in store.batches(store.schema.names))
    return (last - first) / (end - start), size / len(paths)


def shape_dna(path: Path) -> np.ndarray[Any, Any]:
    """Leading eigenvalues at unit area, over the first."""
    operator = laplacian(read_mesh(path), laplacian="cotangent")
    mass = operator.areas
    values = sla.eigsh(
        operator.stiffness, N_VALUES + 1, sp.diags_array(mass), sigma=-1e-8 / mass.sum(),
        return_eigenvectors=False,
    )  # fmt: skip
    values = np.sort(values)[1:]
    return values / values[0]


def processor_seconds(work: Callable[[Path], Any], paths: list[Path]) -> float:
    """Median of the processor time for a shape."""
    work(paths[0])  # compiles
    times = []
    for path in paths:
        start = time.process_time()
        work(path)
        times.append(time.process_time() - start)
    return statistics.median(times)


def milliseconds(work: Callable[[], Any]) -> float:
    """Median of the time that a call takes."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def fill(store: Any, like: np.ndarray[Any, Any], count: int) -> None:
    """Put synthetic rows into a store."""
    chance = np.random.default_rng(0)
    d = like.shape[1]
    for start in range(0, count, 20_000):
        n = min(20_000, count - start)
        one, other = like[chance.integers(len(like), size=(2, n))]
        share = chance.random((n, 1), dtype=np.float32)
        noise = chance.normal(size=(n, d)).astype(np.float32)
        rows = share * one + (1 - share) * other + 0.1 * like.std(axis=0) * noise
        numbers = range(start, start + n)
        columns: dict[str, Any] = {
            "id": [f"{i:032x}" for i in numbers],
            "path": [f"/nowhere/{i}.ply" for i in numbers],
            "descriptor": pa.FixedSizeListArray.from_arrays(pa.array(rows.ravel()), d),
        }
        schema = store.schema
        arrays = [
            pa.array(columns[field.name], field.type)
            if isinstance(columns.get(field.name), list)
            else columns.get(field.name, pa.nulls(n, field.type))
            for field in schema
        ]
        store._table.add(pa.table(arrays, schema=schema))
    store.tidy()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--shapes", type=int, default=60)
    parser.add_argument("--vertices", type=int, default=5000)
    parser.add_argument("--rows", type=int, nargs="*", default=[1000, 100_000, 1_000_000])
    options = parser.parse_args()
    cores, load = os.cpu_count(), os.getloadavg()[0]
    print(f"{cores} cores, load {load:.1f}; {options.shapes} shapes of {options.vertices} vertices")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = write_shapes(folder, options.shapes, options.vertices)
        for workers in (1, 2):
            rate, size = add(folder / f"store{workers}", paths, workers)
            print(f"{workers} worker(s): {rate:.2f} shapes a second, {size:,.0f} bytes a shape")
        few = paths[:10]
        ours = processor_seconds(lambda path: make_row((str(path), "")), few)
        peer = processor_seconds(shape_dna, few)
        print(f"processor time a shape, one thread of ours: {ours:.3f} s; ShapeDNA {peer:.3f} s")
        rows = Collection(folder / "store1")._store.select(["descriptor"])
        like = np.array([row["descriptor"] for row in rows], dtype=np.float32)
        print("     rows     exact     index  found    build     asked  committed  ShapeDNA, brute")
        for count in options.rows:
            print(search(folder / f"rows{count}", like, count), flush=True)


def search(place: Path, like: np.ndarray[Any, Any], count: int) -> str:
    """Time searches among so many rows."""
    from unbend.collection._store import Store

    store = Store(place)
    store.commit([_empty_row(like.shape[1])])
    fill(store, like, count - 1)
    queries = itertools.cycle(like)

    def ids(query: np.ndarray[Any, Any], index: bool) -> set[str]:
        return {hit.id for hit in store.nearest(query, N_FOUND, index=index)}

    exact = milliseconds(lambda: ids(next(queries), False))
    cells = f"{count:>9,}  {exact:5.1f} ms"
    if count >= 100_000:
        start = time.perf_counter()
        store.build_index()
        build = time.perf_counter() - start
        near = milliseconds(lambda: ids(next(queries), True))
        found = statistics.mean(
            len(ids(query, True) & ids(query, False)) / N_FOUND for query in like[:10]
        )
        cells += f"  {near:5.1f} ms  {found:5.0%}  {build:5.1f} s"
    else:
        cells += " " * 27
    some = [f"{i:032x}" for i in range(256)]
    asked = milliseconds(lambda: store.paths_of(some))
    fresh = ({**_empty_row(like.shape[1]), "id": f"x{i}", "path": f"x{i}"} for i in range(10**6))
    committed = milliseconds(lambda: store.commit(list(itertools.islice(fresh, 64))))
    cells += f"  {asked:5.1f} ms  {committed:6.1f} ms"
    values = np.random.default_rng(0).random((count, N_VALUES), dtype=np.float32)
    brute = NearestNeighbors(n_neighbors=N_FOUND, algorithm="brute").fit(values)
    return cells + f"  {milliseconds(lambda: brute.kneighbors(values[:1])):6.1f} ms"


def _empty_row(width: int) -> dict[str, Any]:
    text = dict.fromkeys(("id", "path", "notes", "version"), "-")
    numbers = dict.fromkeys(("n_vertices", "n_faces", "area"), 0)
    vector = np.zeros(width, dtype=np.float32)
    return {
        **text,
        **numbers,
        "descriptor": vector,
        "thumbnail": b"",
    }


if __name__ == "__main__":
    main()
