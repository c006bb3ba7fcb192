"""A collection of shapes: added from files, searched by shape, whatever the pose."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy.typing as npt

from unbend._arrays import check_whole
from unbend._text import plural
from unbend._types import FloatArray, Progress, StrPath
from unbend.choices import Partial
from unbend.collection._adding import add_files
from unbend.collection._descriptor import descriptor
from unbend.collection._engine import engine
from unbend.collection._files import is_gone, warn_of_changed
from unbend.collection._pairs import match_pairs
from unbend.collection._ranking import compare_all, rank_by_match
from unbend.collection._registering import register_collection
from unbend.collection._rows import Added, Entry, Hit, Info, Matched, Registered
from unbend.collection._store import Store, among, check_outside
from unbend.errors import FileError, InputError
from unbend.io import MeshLike, as_mesh, check_writable, path_text

_LEAST_INDEXED = 10_000  # rows: with fewer an index finds nothing sooner


def _listed(names: StrPath | Iterable[StrPath]) -> list[str]:
    """Make a list of one name, or of several."""
    several = [names] if isinstance(names, str | os.PathLike) else names
    if not isinstance(several, Iterable):
        raise InputError(f"shapes are given by their paths, not {names!r}")
    return [path_text(name) for name in several]


class Collection:
    """Shapes on disk that can be searched by shape, whatever the pose.

    Parameters
    ----------
    path : path
        A folder of its own, made when the first shape is added; or an address of an object
        store, such as ``s3://bucket/shapes``.

    Raises
    ------
    FileError
        If the path is a file, or a folder of something else.
    MissingExtraError
        If LanceDB is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from unbend.collection import Collection
    >>> from unbend.datasets import make_quadruped
    >>> folder = Path(tempfile.mkdtemp())
    >>> for species in ("dog", "giraffe"):
    ...     animal = make_quadruped("walking", species=species, n_vertices=600)
    ...     write_mesh(folder / f"{species}.ply", animal.mesh)
    >>> shapes = Collection(folder / "shapes")
    >>> shapes.add(folder, workers=0).added
    2
    >>> (found,) = shapes.search(make_quadruped("galloping", n_vertices=600).mesh, n=1)
    >>> Path(found.path).name
    'dog.ply'
    """

    def __init__(self, path: StrPath) -> None:
        self._store = Store(path)

    def __reduce__(self) -> tuple[type[Collection], tuple[str]]:
        """Pickle the path alone: its copies open the table themselves."""
        return type(self), (self.path,)

    @property
    def path(self) -> str:
        """Where the collection is."""
        return self._store.path

    @property
    def exists(self) -> bool:
        """Whether anything was ever added."""
        return self._store.exists

    def info(self) -> Info:
        """Size of the collection and how its shapes are described.

        Raises
        ------
        FileError
            If nothing was added yet.
        """
        return self._store.info()

    def __len__(self) -> int:
        return self._store.n_shapes()

    def __iter__(self) -> Iterator[Entry]:
        """Iterate over the shapes in the order of the store, in bounded memory."""
        return self._store.entries()

    def __repr__(self) -> str:
        return f"Collection({self.path!r}, {plural(len(self), 'shape')})"

    def add(
        self,
        paths: StrPath | Iterable[StrPath],
        *,
        workers: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
    ) -> Added:
        """Describe shapes and store their descriptors; the files stay where they are.

        Files whose content is stored are skipped, so an interrupted run resumes. A file that cannot
        be used does not stop the others. Identical files are one shape with several paths: new
        paths are added, and those without a file dropped. After you move a folder, add it again.

        Parameters
        ----------
        paths : path or iterable of paths
            Files, folders (searched for .off, .obj, .ply, .stl, .vtk, .vtp), and patterns such
            as ``"scans/**/*.ply"``.
        workers : int, optional
            Local processes, by default as many as there are processors; 0: work in this one.
        scheduler : str, optional
            Address of a Dask scheduler, ``tcp://host:port``, whose workers see the same paths.
        progress : callable, optional
            Called with how far it is, in words, and the share that is done.

        Returns
        -------
        Added

        Raises
        ------
        InputError
            If the collection is of another version, or no scheduler answers.
        """
        self._store.check_version()
        processes = engine(workers=workers, scheduler=scheduler)
        return add_files(self._store, _listed(paths), processes, progress)

    def search(
        self,
        mesh: MeshLike,
        n: int = 10,
        *,
        by_match: bool = False,
        index: bool = False,
        progress: Progress | None = None,
    ) -> list[Hit]:
        """Find the shapes most like one, whatever the pose.

        Parameters
        ----------
        mesh : mesh-like
            It need not be in the collection.
        n : int, default=10
            How many to find.
        by_match : bool, default=False
            Rank the best 2 n again, by the energy of the query's match with each; seconds each,
            from their files.
        index : bool, default=False
            Search approximately, with an index that is created or updated first: faster beyond
            100,000 shapes.
        progress : callable, optional
            See :meth:`add`.

        Returns
        -------
        list of Hit
            The most alike first.

        Raises
        ------
        InputError
            If an option is out of range, or the collection is of another version.
        FileError
            If the collection is empty.
        MeshError
            If the query cannot be described.

        Warns
        -----
        UnbendWarning
            If a file that was found has changed since it was added.
        """
        check_whole(n, "n", 1)
        self._store.check_version()
        self._store.check_filled()
        index = index and len(self._store) >= _LEAST_INDEXED
        if index:
            self._store.build_index()
        query = as_mesh(mesh)
        hits = self._store.nearest(descriptor(query), 2 * n if by_match else n, index=index)
        if by_match:
            hits = rank_by_match(query, hits, self.path, progress)[:n]
        warn_of_changed(hits, self.path)
        return hits

    def distances(self) -> tuple[list[Entry], FloatArray]:
        """Compare every shape with every other by descriptor.

        Returns
        -------
        entries : list of Entry
            Sorted by path.
        distances : (n, n) ndarray of float64

        Raises
        ------
        InputError
            If the collection is of another version, or the table does not fit into memory.
        FileError
            If the collection is empty.
        """
        self._store.check_version()
        self._store.check_filled()
        return compare_all(self._store)

    def find(self, names: StrPath | Iterable[StrPath]) -> list[Entry]:
        """Entries of ids, beginnings of ids (8 digits or more), or paths, in their order.

        Raises
        ------
        InputError
            If one is not there, or may mean several.
        """
        return self._store.find(_listed(names))

    def missing(self) -> list[str]:
        """Paths of all files that are certainly not there any more, for :meth:`remove`.

        Raises
        ------
        FileError
            If none of the files is there, as where a disk is not mounted.
        """
        paths = [path for one in self for path in (one.path, *one.also)]
        gone = [path for path in paths if is_gone(path)]
        if gone and len(gone) == len(paths):
            raise FileError(f"none of the files of {self.path} is there: is a disk not mounted?")
        return gone

    def remove(self, names: StrPath | Iterable[StrPath]) -> list[Entry]:
        """Take shapes out of the collection; their files stay.

        Parameters
        ----------
        names : str or path, or iterable of them
            See :meth:`find`. An id removes the shape with all its paths; a path removes that path
            alone, and the shape stays while it has others.

        Returns
        -------
        list of Entry
            With the paths that were removed.

        Raises
        ------
        InputError
            If one is not there; then nothing is removed.
        """
        entries: dict[Entry, None] = {}  # each once
        names = _listed(names)
        for name, entry in zip(names, self._store.find(names), strict=True):
            named = {entry.path, *entry.also} & {name, os.path.abspath(name)}
            entries[replace(entry, path=named.pop(), also=()) if named else entry] = None
        self._store.remove([path for one in entries for path in (one.path, *one.also)])
        return list(entries)

    def match(
        self,
        pairs: Iterable[tuple[StrPath, StrPath]] | None,
        out: StrPath,
        *,
        partial: Partial = "auto",
        workers: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
    ) -> Matched:
        """Match pairs of shapes, each spectrum computed once; what is there already is skipped.

        Parameters
        ----------
        pairs : iterable of (str or path, str or path), or None
            Source and target, named as for :meth:`find`. None: each shape with each that follows
            it in the order of their paths.
        out : path
            Folder, of all workers alike, for a .npz file a pair (see
            :func:`unbend.read_match`), its map as .csv, the table ``matches.csv``, and the spectra.
        partial : {"auto", "none", "source", "target", "both"}, default="auto"
            Which shapes may be partial, see :func:`unbend.match`. Files of every choice but "auto"
            are named after it.
        workers, scheduler, progress
            See :meth:`add`.

        Returns
        -------
        Matched
            A shape that cannot be matched at all is among the failures once, by itself.

        Raises
        ------
        InputError
            If a name is not in the collection.
        FileError
            If the folder cannot be made, or is inside the collection's.
        """
        processes = engine(workers=workers, scheduler=scheduler)
        return match_pairs(self._store, pairs, out, partial, processes, progress)

    def register(
        self,
        template: StrPath,
        out: StrPath,
        *,
        landmarks: Mapping[str, npt.ArrayLike] | None = None,
        partial: Partial = "auto",
        workers: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
    ) -> Registered:
        """Register a template to every shape, as :func:`unbend.register` does to one.

        Shapes that are registered already are skipped: an interrupted run resumes. A shape that
        cannot be used stops nothing. :func:`read_registrations` reads what is written.

        Parameters
        ----------
        template : path
            The mesh to deform: a file, or a shape of the collection, see :meth:`find`.
        out : path
            Folder, of all workers alike and of this template alone, for

            - a mesh per shape with the template's vertices and faces, in its format where that
              keeps their order, otherwise .ply;
            - ``vertices.npy``, all positions (n_shapes, n_template, 3), and ``vertices.csv``, the
              same with the columns shape,vertex,x,y,z,covered;
            - ``shapes.csv``, a row per shape: in the order of ``vertices.npy``, then what failed.
        landmarks : mapping of str to (l, 2) array_like of int, optional
            For names of shapes, vertices of the template and of the shape that correspond. A shape
            whose landmarks have changed is registered again. One that is not named keeps those it
            was registered with; an empty list removes them.
        partial : {"auto", "none", "source", "target", "both"}, default="auto"
            Whether the template, the source, or the shapes may be partial, see
            :func:`unbend.match`. Shapes that were registered otherwise are registered again.
        workers, scheduler, progress
            See :meth:`add`.

        Returns
        -------
        Registered

        Raises
        ------
        InputError, MeshError
            If the template cannot be used, or a name is not in the collection.
        FileError
            If the folder cannot be made, is inside the collection's, or its shapes are registered
            to another template.
        """
        processes = engine(workers=workers, scheduler=scheduler)
        return register_collection(
            self._store, template, out, landmarks or {}, partial, processes, progress
        )

    def thumbnail(self, name: str) -> bytes:
        """Picture of a shape as a small PNG file; empty for a point cloud."""
        (entry,) = self._store.find([name])
        rows = self._store.select(["thumbnail"], among("id", [entry.id]))
        if not rows:
            raise InputError(f"{name} is not in the collection {self.path} any more")
        return bytes(rows[0]["thumbnail"])

    def export(self, path: StrPath) -> int:
        """Write what is kept of every file's shape, in bounded memory.

        Parameters
        ----------
        path : path
            ``.parquet``: every column, descriptors and thumbnails too. ``.csv``: all but
            thumbnails, a column for each number of the descriptor.

        Returns
        -------
        int
            Number of rows: one for each file.

        Raises
        ------
        FileError
            If the collection is empty, or the file cannot be written or is in its folder.
        """
        check_outside(self.path, path)
        check_writable(path, (".parquet", ".csv"))
        self._store.check_filled()
        return self._store.export(path)
