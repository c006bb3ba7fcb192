"""The shapes of a run: what a folder holds, or our own made in its place."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from hashlib import blake2b
from pathlib import Path

import numpy as np

from paper.collection import Collection
from paper.loading import load_scape, load_tosca
from paper.run import Arrays, kept
from paper.synthetic import make_people, make_species
from unbend._text import plural
from unbend.errors import FileError
from unbend.io import atomic_write

SYNTHETIC = "synthetic"

_TOSCA_FOLDERS = ("", "TOSCA", "tosca")
_REMESHED_FOLDERS = ("tosca_remeshed", "TOSCA_remeshed")
_SCAPE_FOLDERS = ("", "SCAPE", "scape")
_OTHER_FOLDERS = ("tosca_original",)
_SHIFTED = (
    "mesh072 of this copy is the shape that SCAPE calls mesh071: whoever made the copy put another "
    "one in its place."
)


@dataclass(frozen=True)
class Described:
    """A collection and what a page says of it.

    Attributes
    ----------
    collection : Collection
    about : str
        How many shapes there are, of how many vertices.
    caveats : tuple of str
        Sentences: how they differ from the paper's.
    left_out : tuple of str
        Sentences: which files were passed over, and why.
    """

    collection: Collection
    about: str
    caveats: tuple[str, ...]
    left_out: tuple[str, ...]


@dataclass(frozen=True)
class Data:
    """Shapes to run on, and where pieces made from them are kept."""

    shapes: Described | None
    scape: Described | None
    store: Path
    synthetic: bool


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
    asked = None if data == SYNTHETIC else _find(Path(data), quick)
    make_folder(pieces)
    with atomic_write(pieces / ".gitignore") as file:
        file.write(b"*\n")  # made from shapes that may not be passed on
    if asked is None:
        found: list[Collection | None] = [
            make_species(pieces, quick, progress),
            make_people(pieces, quick, progress),
        ]
    else:
        found = asked
    store = pieces / _digest(found)
    progress("reading the shapes")
    shapes, scape = (
        None if one is None else _describe(one, store, quick, data == SYNTHETIC) for one in found
    )
    return Data(shapes, scape, store, data == SYNTHETIC)


def _describe(collection: Collection, store: Path, quick: bool, ours: bool) -> Described:
    sizes = _sizes(store, collection)
    collection, left_out = without_strangers(collection, sizes)
    counts = [sizes[name] for name in collection.names]
    low, high = min(counts), max(counts)
    vertices = f"{low:,}" if low == high else f"{low:,} to {high:,}"
    alike = "numbered alike" if collection.corres is None else "each meshed on its own"
    kinds = plural(len(collection.classes), "kind")
    caveats = []
    if ours:
        caveats.append(
            "These shapes are our own: the paper's figures, which are for others, are given for "
            "orientation only."
        )
    elif collection.corres is not None:
        caveats.append(
            "The paper used the original shapes; these are the same poses, remeshed each on its "
            "own, so that no method can profit from vertices that are numbered or placed alike."
        )
    else:
        caveats.append(
            "As in the paper, vertices are numbered and placed alike, from which a method may "
            "profit."
        )
    if quick:
        caveats.append("A quick run: few pairs, which decide nothing.")
    return Described(
        collection,
        f"{collection.title}: {len(collection)} shapes of {kinds}, {vertices} vertices, {alike}",
        tuple(caveats),
        left_out,
    )


def make_folder(folder: Path) -> Path:
    """Make a folder, or say in one sentence why it cannot be.

    Raises
    ------
    FileError
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot make the folder {folder}: {error.strerror}") from None
    return folder


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
