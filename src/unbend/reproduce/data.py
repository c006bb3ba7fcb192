"""The shapes of a run: what a folder holds, or our own made in its place."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path

import numpy as np

from unbend.datasets import Collection, load_scape, load_tosca
from unbend.errors import FileError
from unbend.reproduce.run import Arrays, kept
from unbend.reproduce.synthetic import make_people, make_species

SYNTHETIC = "synthetic"

_TOSCA_FOLDERS = ("", "TOSCA", "tosca")
_REMESHED_FOLDERS = ("tosca_remeshed", "TOSCA_remeshed")
_SCAPE_FOLDERS = ("", "SCAPE", "scape")
_OTHER_FOLDERS = ("tosca_original",)
_NO_SHAPES = Collection("TOSCA", {}, {}, None, {})
_SHIFTED = (
    "mesh072 of this copy is the shape that SCAPE calls mesh071: whoever made the copy put another "
    "one in its place."
)


@dataclass(frozen=True)
class Data:
    """Shapes to run on, where pieces made from them are kept, and what a page says of them.

    Attributes
    ----------
    shapes : Collection
        Empty where there is only SCAPE.
    scape : Collection or None
    store : Path
    synthetic : bool
    rows : list of dict
        For each collection: its title, numbers of shapes, classes and vertices.
    notes : tuple of str
        Sentences: what was left out, and why.
    """

    shapes: Collection
    scape: Collection | None
    store: Path
    synthetic: bool
    rows: list[dict[str, object]]
    notes: tuple[str, ...]


def open_data(data: str, pieces: Path, quick: bool, progress: Callable[[str], None]) -> Data:
    """Find the shapes in a folder, or make our own.

    Parameters
    ----------
    data : str
        A folder with the shapes of TOSCA or SCAPE, directly or in folders of these names; or
        ``"synthetic"``.
    pieces : Path
        Where finished pieces and our own shapes are kept.
    quick : bool
        Prefer the remeshed shapes, which are smaller, and make our own ones small.
    progress : callable
        Called with what is under way.

    Raises
    ------
    FileError
        If there is nothing to run on.
    """
    if data == SYNTHETIC:
        found: list[Collection | None] = [
            make_species(pieces, quick, progress),
            make_people(pieces, quick, progress),
        ]
    else:
        found = _find(Path(data), quick)
    store = pieces / _digest(found)
    progress("reading the shapes")
    rows: list[dict[str, object]] = []
    notes: list[str] = []
    chosen: list[Collection | None] = []
    for collection in found:
        if collection is None:
            chosen.append(None)
            continue
        sizes = _sizes(store, collection)
        collection, said = without_strangers(collection, sizes)
        counts = [sizes[name] for name in collection.names]
        rows.append(
            {
                "collection": collection.title,
                "shapes": len(collection),
                "classes": len(collection.classes),
                "fewest vertices": min(counts),
                "most vertices": max(counts),
                "numbered alike": collection.corres is None,
            }
        )
        notes += said
        chosen.append(collection)
    shapes, scape = chosen
    return Data(shapes or _NO_SHAPES, scape, store, data == SYNTHETIC, rows, tuple(notes))


def without_strangers(
    collection: Collection, sizes: dict[str, int]
) -> tuple[Collection, tuple[str, ...]]:
    """Leave out files that are no shapes of the collection, and say so.

    The copies in circulation hold shapes that somebody edited. Where vertices are numbered alike,
    these give themselves away: they have another number of vertices than most of their class.

    Parameters
    ----------
    collection : Collection
    sizes : dict of str to int
        The number of vertices of each shape.
    """
    if collection.corres is not None:
        return collection, ()
    strangers: dict[str, int] = {}
    for names in collection.classes.values():
        numbers, counts = np.unique([sizes[name] for name in names], return_counts=True)
        usual = int(numbers[counts.argmax()])
        strangers |= {name: usual for name in names if sizes[name] != usual}
    if not strangers:
        return collection, ()
    notes = [
        f"{name} was left out: it has {sizes[name]:,} vertices where its class has {usual:,}, so "
        f"it is an edited shape and not one of {collection.title}."
        for name, usual in strangers.items()
    ]
    if "mesh071" in strangers and "mesh072" not in strangers:
        notes.append(_SHIFTED)
    kinds = {name: kind for name, kind in collection.class_of.items() if name not in strangers}
    files = {name: collection.files[name] for name in kinds}
    return replace(collection, class_of=kinds, files=files), tuple(notes)


def _find(folder: Path, quick: bool) -> list[Collection | None]:
    if not folder.is_dir():
        raise FileError(
            f"there is no folder {folder}; give one that holds the shapes of TOSCA and SCAPE in "
            "folders of these names, or --data synthetic"
        )
    places = (*_TOSCA_FOLDERS, *_REMESHED_FOLDERS)
    if quick:  # smaller shapes first
        places = (*_REMESHED_FOLDERS, *_TOSCA_FOLDERS)
    shapes = _first(folder, (*places, *_OTHER_FOLDERS), load_tosca)
    scape = _first(folder, _SCAPE_FOLDERS, load_scape)
    if shapes is not None and scape is not None and set(shapes.files) & set(scape.files):
        shapes = None  # mesh000.off and so on look like a class of TOSCA, too
    if shapes is None and scape is None:
        raise FileError(
            f"{folder} holds no shapes of TOSCA or SCAPE; put cat0.off and so on into "
            f"{folder / 'TOSCA'} and mesh000.off and so on into {folder / 'SCAPE'}, or give "
            "--data synthetic"
        )
    return [shapes, scape]


def _first(
    folder: Path, places: tuple[str, ...], load: Callable[[str | os.PathLike[str]], Collection]
) -> Collection | None:
    for place in places:
        if (folder / place).is_dir():
            try:
                found = load(folder / place)
            except FileError:
                continue
            # Processes are handed the collection: plain mappings can be.
            return replace(
                found,
                class_of=dict(found.class_of),
                files=dict(found.files),
                feature_files=dict(found.feature_files),
            )
    return None


def _digest(collections: list[Collection | None]) -> str:
    """Name of the store: the same shapes, the same store."""
    digest = blake2b(digest_size=6)
    for collection in collections:
        for name, path in collection.files.items() if collection else ():
            digest.update(f"{name} {path.stat().st_size}\n".encode())
    return digest.hexdigest()


def _sizes(store: Path, collection: Collection) -> dict[str, int]:
    def read() -> Arrays:
        return {name: np.array(collection.mesh(name).n_vertices) for name in collection.names}

    return {name: int(n) for name, n in kept(store, f"sizes-{collection.title}", read).items()}


def describe(rows: list[dict[str, object]]) -> str:
    """Say in one sentence what the shapes are; commas in their numbers."""
    parts = []
    for row in rows:
        low, high = row["fewest vertices"], row["most vertices"]
        vertices = f"{low:,}" if low == high else f"{low:,} to {high:,}"
        alike = "numbered alike" if row["numbered alike"] else "each meshed on its own"
        parts.append(
            f"{row['collection']}: {row['shapes']} shapes of {row['classes']} kinds, "
            f"{vertices} vertices, {alike}"
        )
    return "; ".join(parts)
