"""A template registered to every shape of a collection, in a folder of files."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from unbend._types import IntArray, Progress
from unbend.collection._engine import attempt, attempt_all, engine
from unbend.collection._files import find_file, make_folder, stem
from unbend.collection._progress import counted
from unbend.collection._rows import Entry, Failure, Registered, RegisteredShape
from unbend.collection._store import Store, check_outside
from unbend.correspondence import Registration, register, write_registration
from unbend.errors import FileError, InputError
from unbend.io import atomic_write, read_bytes, read_mesh, read_table, write_table
from unbend.matching import match, prepare_spectrum
from unbend.mesh import Mesh

# Folder of one file a shape with all of its registration. It is written last, and marks the end.
_RESULTS = "registrations"
_KEPT_FORMATS = (".ply", ".obj", ".off")  # others do not keep the order of vertices, or all digits
_NO_LANDMARKS = np.empty((0, 2), dtype=np.int64)


class Registrations(NamedTuple):
    """What a folder of registered shapes holds.

    Attributes
    ----------
    template : Mesh
    shapes : tuple of Registration
        In the order of ``shapes.csv`` and ``vertices.npy``; ``mesh.name`` is the shape's path.
    failures : tuple of Failure
        Shapes that could not be registered.
    """

    template: Mesh
    shapes: tuple[Registration, ...]
    failures: tuple[Failure, ...]


class Task(NamedTuple):
    """A shape to register the template to."""

    entry: Entry
    template: str  # its copy in the folder of all results
    store: str  # path of the collection
    landmarks: IntArray

    @property
    def name(self) -> str:
        return self.entry.path

    @property
    def stem(self) -> str:
        return f"{stem(self.entry)}-{self.entry.id[:8]}"

    @property
    def mesh(self) -> Path:
        suffix = Path(self.template).suffix
        kept = suffix.lower() in _KEPT_FORMATS
        return Path(self.template).with_name(self.stem + (suffix if kept else ".ply"))

    @property
    def result(self) -> Path:
        return Path(self.template).with_name(_RESULTS) / f"{self.stem}.npz"

    def done(self) -> bool:
        """Whether both files are there, made with these landmarks."""
        try:
            with np.load(self.result) as arrays:
                same = np.array_equal(arrays["landmarks"], self.landmarks)
        except (OSError, ValueError, KeyError):  # a damaged file is replaced
            return False
        return same and self.mesh.exists()


def register_shapes(
    store: Store,
    template: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    landmarks: Mapping[str, npt.ArrayLike],
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Registered:
    """Register a template to all shapes, and write tables of them; see `Collection.register`."""
    start = time.monotonic()
    check_outside(store.path, out)
    store.check_filled()
    path = _template_file(template, store)
    mesh = read_mesh(path)
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name}: a template needs faces, and this is a point cloud")
    known: dict[str, IntArray] = {}
    for name, pairs in landmarks.items():
        known[store.find(name).id] = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    prepare_spectrum(mesh)  # before anything is written: the template may be unusable
    folder = make_folder(out)
    copy = _copy(path, folder)
    make_folder(folder / _RESULTS)
    tasks = [
        Task(entry, str(copy), store.path, known.get(entry.id, _NO_LANDMARKS))
        for entry in sorted(store.entries(), key=lambda entry: entry.path)
    ]
    left = [task for task in tasks if not task.done()]
    failures: list[Failure] = []
    if left:
        with engine(workers=workers, scheduler=scheduler) as run:
            tell = counted(progress, "shapes", len(left))
            failures += filter(None, attempt_all(run, register_shape, left, tell))
    failed = {one.path for one in failures}
    shapes = _write_tables(
        folder, mesh, [task for task in tasks if task.name not in failed], failures
    )
    return Registered(
        registered=len(left) - len(failures),
        skipped=len(tasks) - len(left),
        shapes=shapes,
        failures=tuple(failures),
        seconds=time.monotonic() - start,
    )


def _template_file(template: str | os.PathLike[str], store: Store) -> Path:
    if Path(template).exists():
        return Path(template)
    try:
        entry = store.find(template)
    except InputError:
        raise FileError(
            f"cannot read {template}: there is no such file, and no such shape in the collection "
            f"{store.path}"
        ) from None
    return Path(find_file(entry, store.path))


def _copy(template: Path, folder: Path) -> Path:
    """Copy the template into the folder, which is that of one template."""
    copy, data = folder / f"template{template.suffix}", read_bytes(template, ())
    for other in folder.glob("template.*"):
        if other.name != copy.name or read_bytes(other, ()) != data:
            raise FileError(
                f"the shapes in {folder} are registered to another template, {other.name} there; "
                "give another folder"
            )
    if not copy.exists():
        with atomic_write(copy) as file:
            file.write(data)
    return copy


def register_shape(task: Task) -> Failure | None:
    """Register the template to a shape and write the result."""

    def work() -> None:
        template = read_mesh(task.template)
        scan = read_mesh(find_file(task.entry, task.store))
        landmarks = task.landmarks if len(task.landmarks) else None
        given = match(template, scan, landmarks=landmarks, barycentric=True)
        found = register(template, scan, given)
        write_registration(task.mesh, found)
        with atomic_write(task.result) as file:
            np.savez(
                file,
                vertices=found.mesh.vertices,
                distances=found.distances,
                covered=found.covered,
                numbers=[found.coverage, found.tolerance, found.confidence],
                landmarks=task.landmarks,
            )

    return attempt(task.name, work)


def _load(path: Path, template: Mesh, name: str) -> Registration:
    try:
        with np.load(path) as arrays:
            coverage, tolerance, confidence = arrays["numbers"].tolist()
            return Registration(
                mesh=Mesh(arrays["vertices"], template.faces, name=name),
                distances=arrays["distances"],
                covered=arrays["covered"],
                coverage=coverage,
                tolerance=tolerance,
                confidence=confidence,
            )
    except (OSError, ValueError, KeyError) as error:
        raise FileError(
            f"cannot read {path}: run unbend collection register again, which replaces it"
        ) from error


def _write_tables(
    folder: Path, template: Mesh, tasks: Iterable[Task], failures: Iterable[Failure]
) -> tuple[RegisteredShape, ...]:
    """Write all positions and one row for each shape, in bounded memory."""
    tasks = list(tasks)
    shapes = []
    with atomic_write(folder / "vertices.npy") as file:
        shape = len(tasks), template.n_vertices, 3
        header = {"descr": "<f8", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, header)
        for task in tasks:
            found = _load(task.result, template, task.name)
            file.write(found.mesh.vertices.astype("<f8").tobytes())
            distances = found.distances[np.isfinite(found.distances)]
            shapes.append(
                RegisteredShape(
                    name=task.stem,
                    path=task.name,
                    file=task.mesh.name,
                    confidence=found.confidence,
                    coverage=found.coverage,
                    mean_distance=float(distances.mean()),
                    distance_95=float(np.quantile(distances, 0.95)),
                )
            )
    rows = [(*vars(one).values(), "doubtful" if one.doubtful else "registered") for one in shapes]
    head = ("shape", "path", "file", "confidence", "coverage", "mean_distance", "distance_95")
    bad = [(Path(one.path).stem, one.path, *[""] * 5, f"failed: {one.reason}") for one in failures]
    write_table(folder / "shapes.csv", [(*head, "status"), *rows, *bad])
    write_table(folder / "vertices.csv", _vertices(folder, [one.name for one in shapes]))
    return tuple(shapes)


def _vertices(folder: Path, names: Iterable[str]) -> Iterator[Iterable[Any]]:
    yield "shape", "vertex", "x", "y", "z"
    for name, points in zip(names, np.load(folder / "vertices.npy", mmap_mode="r"), strict=True):
        for i, place in enumerate(points.tolist()):
            yield name, i, *place


def read_registrations(folder: str | os.PathLike[str]) -> Registrations:
    """Read the shapes that :meth:`Collection.register` wrote.

    Parameters
    ----------
    folder : path

    Returns
    -------
    Registrations

    Raises
    ------
    FileError
        If the folder is none of registered shapes, or a file in it cannot be read.
    """
    folder = Path(folder)
    templates = list(folder.glob("template.*"))
    if len(templates) != 1 or not (folder / "shapes.csv").exists():
        raise FileError(
            f"{folder} holds no registered shapes, or not all yet: unbend collection register "
            f"STORE --template MESH -o {folder} writes them"
        )
    template = read_mesh(templates[0])
    shapes, failures = [], []
    for name, path, status in read_table(folder / "shapes.csv", ("shape", "path", "status")):
        if status.startswith("failed: "):
            failures.append(Failure(path, status.removeprefix("failed: ")))
        else:
            shapes.append(_load(folder / _RESULTS / f"{name}.npz", template, path))
    return Registrations(template, tuple(shapes), tuple(failures))
