"""Shapes of a collection on disk, and what is known of how they correspond."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from paper.shape_files import read_rows, read_shape
from unbend._text import plural
from unbend._types import BoolArray, IntArray
from unbend.errors import FileError, InputError
from unbend.mesh import Mesh, edge_ends

# Poses with one numbering share more than 80 % of their edges in the collections we know (some
# have edges flipped per pose), poses meshed each on its own less than 20 %.
_SHARED_EDGES = 0.5


class Truth(NamedTuple):
    """Points of two shapes that truly correspond, row by row.

    Attributes
    ----------
    source_points, target_points : (k,) ndarray of int64
        0-based vertex ids; ids may repeat.
    mirrored_target_points : (k,) ndarray of int64, or None
        Where the left-right mirror image of each source point lies on the target, if known.
    """

    source_points: IntArray
    target_points: IntArray
    mirrored_target_points: IntArray | None


@dataclass(frozen=True, eq=False, repr=False)
class Collection:
    """Shapes by name, each read from its file when it is asked for; only the last few are kept.

    Attributes
    ----------
    title : str
        What messages call the collection.
    class_of : mapping of str to str
        The class of each shape. Its keys are the names of all shapes, in order.
    files : mapping of str to Path
        The file of each shape.
    corres : Path or None
        The folder of ``NAME.vts`` and ``NAME.sym.vts`` files whose rows correspond. None where
        vertex ``i`` is the same point on every shape of a class.

    See Also
    --------
    load_tosca, load_scape : Make one from a folder.

    Examples
    --------
    >>> import tempfile
    >>> from itertools import combinations
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from paper.loading import load_tosca
    >>> from unbend.datasets import make_sphere
    >>> folder, sphere = Path(tempfile.mkdtemp()), make_sphere(1)
    >>> for name in ("cat0", "cat1", "dog0"):
    ...     write_mesh(folder / f"{name}.off", sphere)
    >>> shapes = load_tosca(folder)
    >>> shapes.classes
    {'cat': ('cat0', 'cat1'), 'dog': ('dog0',)}
    >>> for source, target in combinations(shapes.classes["cat"], 2):
    ...     print(shapes.mesh(source), len(shapes.truth(source, target).target_points))
    Mesh(42 vertices, 80 faces) 42
    """

    title: str
    class_of: Mapping[str, str]
    files: Mapping[str, Path]
    corres: Path | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all shapes."""
        return tuple(self.class_of)

    @property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """Names of the shapes of each class."""
        groups: dict[str, tuple[str, ...]] = {}
        for name, kind in self.class_of.items():
            groups[kind] = (*groups.get(kind, ()), name)
        return groups

    def __len__(self) -> int:
        return len(self.files)

    def __repr__(self) -> str:
        return f"Collection({self.title}: {plural(len(self), 'shape')})"

    def mesh(self, name: str) -> Mesh:
        """Read a shape.

        Parameters
        ----------
        name : str
            One of ``names``.

        Returns
        -------
        Mesh
            Its vertices in the order and the unit of the file.

        Raises
        ------
        InputError
            If there is no such shape.
        FileError, MeshError
            If its file cannot be read or holds no valid mesh.
        """
        self._check(name)
        return read_shape(self.files[name])

    def truth(self, source: str, target: str) -> Truth:
        """Return points of two shapes of one class that truly correspond.

        Where vertices are numbered alike these are all vertices that both shapes use, each with
        itself; otherwise the rows of the two ``.vts`` files.

        Parameters
        ----------
        source, target : str
            Names of two shapes.

        Returns
        -------
        Truth

        Raises
        ------
        InputError
            If there is no such shape or the two are of different classes.
        FileError
            If the ground truth is missing or does not fit the meshes.
        """
        for name in (source, target):
            self._check(name)
        if self.class_of[source] != self.class_of[target]:
            raise InputError(
                f"{source} and {target} are of different classes; {self.title} has ground truth "
                "within each class only"
            )
        meshes = self.mesh(source), self.mesh(target)
        if self.corres is None:
            same = _numbered_alike(source, target, *meshes)
            return Truth(same, same.copy(), None)
        paths = [self.corres / f"{source}.vts", self.corres / f"{target}.vts"]
        mirrored = self.corres / f"{target}.sym.vts"
        if mirrored.exists():
            paths.append(mirrored)
        lists = [
            _rows(path, meshes[min(i, 1)], self.files[name])
            for i, (path, name) in enumerate(zip(paths, (source, target, target), strict=False))
        ]
        for path, rows in zip(paths[1:], lists[1:], strict=True):
            if len(rows) != len(lists[0]):
                raise FileError(
                    f"{paths[0]} has {plural(len(lists[0]), 'row')} and {path.name} has "
                    f"{len(rows)}, so they do not correspond; put the collection's files there "
                    "again"
                )
        return Truth(lists[0], lists[1], lists[2] if len(lists) == 3 else None)

    def _check(self, name: str) -> None:
        if name not in self.files:
            known = ", ".join(self.names[:5]) + (", ..." if len(self) > 5 else "")
            raise InputError(f"there is no shape {name!r} in {self.title}; it has {known}")


def _rows(path: Path, mesh: Mesh, shape: Path) -> IntArray:
    if not path.is_file():
        raise FileError(f"{shape.name} has no ground truth: put {path.name} into {path.parent}")
    rows = read_rows(path)
    if rows.max() >= mesh.n_vertices:
        raise FileError(
            f"{path}: row {int(rows.argmax()) + 1} names vertex {rows.max() + 1}, but {shape.name} "
            f"has {mesh.n_vertices}; put files of one collection there"
        )
    return rows


def _numbered_alike(source: str, target: str, first: Mesh, second: Mesh) -> IntArray:
    """Vertices that both shapes use, if the two are numbered alike."""
    remedy = "put the files NAME.vts of their ground truth into a folder corres beside them"
    if first.n_vertices != second.n_vertices:
        raise FileError(
            f"{source} has {first.n_vertices} vertices and {target} has {second.n_vertices}, so "
            f"their numbers do not say what corresponds; {remedy}"
        )
    if not np.array_equal(first.faces, second.faces):
        n = first.n_vertices
        ours, theirs = (edge_ends(mesh.faces, n) @ [n, 1] for mesh in (first, second))
        shared = np.isin(ours, theirs)
        if len(shared) and shared.mean() < _SHARED_EDGES:
            raise FileError(
                f"{source} and {target} are meshed each on its own, so their vertex numbers do "
                f"not say what corresponds; {remedy}"
            )
    return np.flatnonzero(_used(first) & _used(second)).astype(np.int64)


def _used(mesh: Mesh) -> BoolArray:
    used = np.full(mesh.n_vertices, mesh.is_point_cloud)
    used[mesh.faces] = True
    return used
