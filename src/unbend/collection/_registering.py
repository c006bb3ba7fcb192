"""A template registered to many shapes, in a folder of files."""

from __future__ import annotations

import itertools
import os
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from unbend._text import plural, quoted
from unbend._types import IntArray, Progress, StrPath
from unbend.choices import Partial
from unbend.collection._engine import Engine, attempt_all, engine
from unbend.collection._files import (
    ID_DIGITS,
    REGISTRATIONS,
    find_file,
    find_files,
    hashed,
    make_folder,
    registered_stems,
    stem,
    warn_of_others,
    without_file,
)
from unbend.collection._rows import Entry, Failure, Registered, RegisteredShape
from unbend.collection._store import Store, check_outside
from unbend.correspondence import Registration, check_template, register, write_registration
from unbend.errors import FileError, InputError, file_errors, heard, warn
from unbend.io import (
    atomic_write,
    keeps_all,
    moved_obj,
    path_text,
    read_bytes,
    read_mesh,
    read_table,
    write_table,
)
from unbend.matching import check_partial, landmark_pairs, match, prepare_spectrum
from unbend.mesh import Mesh

_TABLE = "shapes.csv"
_KEPT_FORMATS = (".ply", ".obj", ".off", ".vtp", ".glb")  # .stl does not keep the order of vertices
_DAMAGED = (OSError, ValueError, KeyError, BadZipFile)  # what reading them may raise
_FIELDS = ("distances", "covered", "coverage", "scan_coverage", "tolerance", "confidence")
_NONE = np.empty((0, 2), dtype=np.int64)  # landmarks


class Task(NamedTuple):
    """A shape to register the template to, and where to write the results."""

    shape: Entry
    store: str | None  # path of the collection; None for a file of its own
    template: Path
    landmarks: IntArray
    partial: Partial
    mesh: Path
    result: Path

    @property
    def name(self) -> str:
        return self.shape.path


def register_collection(
    store: Store,
    template: StrPath,
    out: StrPath,
    landmarks: Mapping[str, npt.ArrayLike],
    partial: Partial,
    workers: Engine,
    progress: Progress | None,
) -> Registered:
    """Register a template to all shapes of a collection; see `Collection.register`."""
    check_outside(store.path, out)
    store.check_filled()
    if not os.path.exists(path_text(template)):
        try:
            (shape,) = store.find([template])
        except InputError as error:
            raise InputError(f"there is no file {template}, and {error}") from None
        template = find_file(shape, store.path)
    known: dict[str, IntArray] = {}
    for one, (name, pairs) in zip(store.find(list(landmarks)), landmarks.items(), strict=True):
        if one.id in known:
            raise InputError(f"landmarks: {name} is named twice; put its landmarks together")
        known[one.id] = landmark_pairs(pairs, f"landmarks of {name}")
    shapes = sorted(store.entries(), key=lambda one: one.path)
    return _register(shapes, template, out, known, partial, (), store.path, workers, progress)


def register_files(
    paths: Sequence[str],
    template: str,
    out: str,
    partial: Partial = "auto",
    progress: Progress | None = None,
) -> Registered:
    """Register a template to files, in this process; identical files are one shape.

    The template in `out` and those that were written there before are left out.
    """
    warn_of_others(paths)
    folder = Path(os.path.abspath(out))
    written = {"template", *registered_stems(folder)}  # at first too: later runs tell the same
    scans = (
        path
        for path in map(os.path.abspath, find_files(paths))
        if Path(path).parent != folder or Path(path).stem not in written
    )
    files: dict[str, dict[str, None]] = {}  # paths, each once, by hash
    failures: list[Failure] = []
    for some, bad in hashed(scans):
        failures += bad
        for path, digest in some:
            files.setdefault(digest, {})[path] = None
    if not files and not failures:
        raise FileError(f"{out} holds only what was registered before; name the scans")
    shapes = [
        Entry(digest, path, 0, 0, 0, "", tuple(also)) for digest, (path, *also) in files.items()
    ]
    processes = engine(workers=0)
    return _register(shapes, template, out, {}, partial, failures, None, processes, progress)


def _register(
    shapes: Sequence[Entry],
    template: StrPath,
    out: StrPath,
    landmarks: Mapping[str, IntArray],  # by id
    partial: Partial,
    failures: Sequence[Failure],
    store: str | None,
    workers: Engine,
    progress: Progress | None,
) -> Registered:
    start, began = time.monotonic(), time.time()
    check_partial(partial)
    mesh = read_mesh(template)
    check_template(mesh)
    prepare_spectrum(mesh)  # before anything is written: the template may be unusable
    folder = make_folder(out).absolute()  # workers elsewhere have another current folder
    original = Path(template).absolute()
    _copy(original, folder)
    make_folder(folder / REGISTRATIONS)
    suffix = original.suffix if original.suffix.lower() in _KEPT_FORMATS else ".ply"
    names = [f"{stem(one)}-{one.id[:ID_DIGITS]}" for one in shapes]
    _follow(folder, suffix, names)
    tasks, left, done = [], [], []
    for one, name in zip(shapes, names, strict=True):
        files = folder / f"{name}{suffix}", folder / REGISTRATIONS / f"{name}.npz"
        before, of_parts = _given(files[1])
        pairs = landmarks.get(one.id, before)
        tasks.append(Task(one, store, original, pairs, partial, *files))
        if of_parts == partial and np.array_equal(before, pairs) and files[0].exists():
            done.append(one)
        else:
            left.append(tasks[-1])
    lost = [] if store is None else without_file(done, store)
    if any(task.result.exists() for task in left):
        with file_errors(f"write into {folder}"):
            (folder / _TABLE).unlink(missing_ok=True)  # it lists what is now replaced
    with workers as run:
        failed = attempt_all(run, register_shape, left, "shapes", progress)
    every = (*failures, *lost, *failed)
    bad = {one.path for one in every}
    good = [task for task in tasks if task.name not in bad]
    rows = _write_tables(folder, mesh, good, every, began)
    seconds = time.monotonic() - start
    return Registered(len(left) - len(failed), len(done) - len(lost), rows, every, seconds)


def _copy(template: Path, folder: Path) -> None:
    """Copy the template into the folder, whose shapes are registered to no other."""
    copy = folder / f"template{template.suffix}"
    is_obj = copy.suffix.lower() == ".obj"
    data = moved_obj(template, folder) if is_obj else read_bytes(template, ())

    def shape(data: bytes) -> bytes:  # material files are elsewhere when folders were moved
        return re.sub(rb"(?m)^[ \t]*mtllib[^\r\n]*", b"", data) if is_obj else data

    for other in folder.glob("template.*"):
        if other.name != copy.name or shape(read_bytes(other, ())) != shape(data):
            raise FileError(
                f"the shapes in {folder} are registered to another template, {other.name} there; "
                "give another folder"
            )
    if not copy.exists():
        with atomic_write(copy) as file:
            file.write(data)


def _follow(folder: Path, suffix: str, names: Sequence[str]) -> None:
    """Rename what is registered of shapes that were renamed; names end with digits of ids.

    Warns of what is registered of other shapes.
    """
    now = {name[-ID_DIGITS:]: name for name in names}
    with file_errors(f"write into {folder}"):
        results = list((folder / REGISTRATIONS).glob(f"*-{'?' * ID_DIGITS}.npz"))
        if others := sum(one.stem[-ID_DIGITS:] not in now for one in results):
            told = f"{plural(others, 'registered shape')} that {_TABLE} does not list"
            warn(f"{folder} also holds {told}; give another folder to keep them apart")
        for result in results:
            name = now.get(result.stem[-ID_DIGITS:], result.stem)
            if name == result.stem:
                continue
            (folder / _TABLE).unlink(missing_ok=True)  # it lists what was there
            for old in (folder / f"{result.stem}{suffix}", result):
                new = old.with_name(f"{name}{old.suffix}")
                if old.exists() and (not new.exists() or new.samefile(old)):  # but for its case
                    old.replace(new)
                else:
                    old.unlink(missing_ok=True)


def _given(result: Path) -> tuple[IntArray, str | None]:
    """Landmarks and `partial` of a registered shape; None if it is not, or nobody can tell."""
    try:
        with np.load(result, allow_pickle=False) as arrays:
            pairs = np.asarray(arrays["landmarks"], dtype=np.int64).reshape(-1, 2)
            return pairs, str(arrays["partial"])
    except _DAMAGED:
        return _NONE, None


def register_shape(task: Task) -> list[str]:
    """Register the template to a shape and write the result."""
    store = task.store
    path = task.shape.path if store is None else find_file(task.shape, store)
    with heard() as said:
        template, scan = read_mesh(task.template), read_mesh(path)
        landmarks, partial = task.landmarks, task.partial
        given = match(template, scan, landmarks=landmarks, partial=partial, barycentric=True)
        found = register(template, scan, given)
    ours, own = f"{template.name}: ", f"{scan.name}: "
    # What is to be said of the template was told once, before.
    told = [one.removeprefix(own) for one in said if ours == own or not one.startswith(ours)]
    fields: dict[str, Any] = {name: getattr(found, name) for name in _FIELDS}
    fields |= {"landmarks": task.landmarks, "partial": np.array(task.partial)}
    fields["warnings"] = np.array(told, dtype=np.str_)
    with file_errors(f"write {task.mesh}"):
        task.mesh.unlink(missing_ok=True)  # a shape is done if it has both files: never of two runs
    with atomic_write(task.result) as file:
        np.savez(file, vertices=found.mesh.vertices, **fields)
    like = task.template if keeps_all(task.mesh, task.template) else None
    write_registration(task.mesh, found, like=like)
    return told


def _load(path: Path, template: Mesh, name: str) -> tuple[Registration, tuple[str, ...]]:
    """Read a registration and what was told of it: nothing in files of earlier versions."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            mesh = Mesh(arrays["vertices"], template.faces, name=name)
            told = arrays["warnings"].tolist() if "warnings" in arrays else ()
            return Registration(mesh, **{name: arrays[name][()] for name in _FIELDS}), tuple(told)
    except _DAMAGED as error:
        raise FileError(
            f"cannot read {path}: remove it, and run unbend collection register again"
        ) from error


def _write_tables(
    folder: Path, template: Mesh, tasks: Sequence[Task], failures: Iterable[Failure], began: float
) -> tuple[RegisteredShape, ...]:
    """Write all positions in bounded memory, then the rows that say whose they are."""
    table = folder / _TABLE
    with file_errors(f"write {table}"):
        table.unlink(missing_ok=True)
    for part in folder.glob(".vertices.*.part"):
        with suppress(OSError):
            if part.stat().st_mtime < began:  # of a run that was killed, not of one beside this
                part.unlink()
    shapes: list[RegisteredShape] = []
    covered: list[npt.NDArray[np.uint8]] = []  # packed
    head = "shape", "path", "file", "confidence", "coverage", "scan_coverage"
    spread = "mean_distance", "distance_95"
    lines: list[Iterable[object]] = [(*head, *spread, "status", "warnings", "also")]
    with atomic_write(folder / "vertices.npy") as file:
        shape = len(tasks), template.n_vertices, 3
        header = {"descr": "<f8", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, header)
        for task in tasks:
            found, said = _load(task.result, template, task.name)
            file.write(found.mesh.vertices.astype("<f8").tobytes())
            covered.append(np.packbits(found.covered))
            distances = found.distances[np.isfinite(found.distances)]
            middle, most = float(distances.mean()), float(np.quantile(distances, 0.95))
            shares = float(found.confidence), float(found.coverage), float(found.scan_coverage)
            known = task.result.stem, task.name, task.mesh.name, *shares, middle, most
            also = task.shape.also
            shapes.append(RegisteredShape(*known, said, also))
            status = "doubtful" if shapes[-1].doubtful else "registered"
            lines.append((*known, status, "; ".join(said), "; ".join(also)))
    every = np.load(folder / "vertices.npy", mmap_mode="r", allow_pickle=False)
    places = (
        (one.name, i, *place, on_scan)
        for one, points, bits in zip(shapes, every, covered, strict=True)
        for i, (place, on_scan) in enumerate(
            zip(points.tolist(), np.unpackbits(bits, count=len(points)).tolist(), strict=True)
        )
    )
    columns = "shape", "vertex", "x", "y", "z", "covered"
    write_table(folder / "vertices.csv", itertools.chain([columns], places))
    for bad in failures:
        lines.append((Path(bad.path).stem, bad.path, *[""] * 6, f"failed: {bad.reason}", "", ""))
    write_table(table, lines)
    return tuple(shapes)


def read_registrations(folder: StrPath) -> tuple[Mesh, list[Registration], list[Failure]]:
    """Read the shapes that :meth:`Collection.register` wrote.

    Parameters
    ----------
    folder : path

    Returns
    -------
    template : Mesh
    registrations : list of Registration
        In the order of ``vertices.npy``; ``mesh.name`` is the path of the shape.
    failures : list of Failure
        Shapes that could not be registered.

    Raises
    ------
    FileError
        If the folder has no such shapes, or a file in it cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from unbend.collection import Collection, read_registrations
    >>> from unbend.datasets import make_sphere
    >>> folder, ball = Path(tempfile.mkdtemp()), make_sphere(2)
    >>> write_mesh(folder / "egg.ply", (ball.vertices * [1, 0.8, 0.6], ball.faces))
    >>> shapes = Collection(folder / "shapes")
    >>> _ = shapes.add(folder, workers=0)
    >>> _ = shapes.register(folder / "egg.ply", folder / "registered", workers=0)
    >>> template, registrations, failures = read_registrations(folder / "registered")
    >>> template, len(registrations), failures
    (Mesh(162 vertices, 320 faces), 1, [])
    """
    folder = Path(folder)
    templates = list(folder.glob("template.*"))
    if len(templates) != 1 or not (folder / _TABLE).exists():
        raise FileError(
            f"{folder} holds no registered shapes, or not all yet: unbend collection register "
            f"STORE --template MESH -o {quoted(str(folder))} writes them"
        )
    template = read_mesh(templates[0])
    shapes, failures = [], []
    for name, path, status in read_table(folder / _TABLE, ("shape", "path", "status")):
        if status.startswith("failed: "):
            failures.append(Failure(path, status.removeprefix("failed: ")))
        else:
            shapes.append(_load(folder / REGISTRATIONS / f"{name}.npz", template, path)[0])
    return template, shapes, failures
