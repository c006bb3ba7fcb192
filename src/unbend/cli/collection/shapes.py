"""Commands on what is in a collection: add, list, info, remove, export."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Annotated

import typer

import unbend
from unbend._text import plural, quoted
from unbend.cli import _options as options
from unbend.cli._input import opened
from unbend.cli._output import SHORT_ID, progress, rows, shown, shown_shape, tell
from unbend.errors import InputError


def add(
    store: str,
    paths: list[str],
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Describe shapes and store their descriptors; the files stay where they are.

    Files whose content is stored already are skipped, so run the same command again to resume. A
    file that cannot be used is listed at the end, with exit code 1. Identical files are one shape
    with several paths. After you move a folder, add it again to update the paths.

      paths: Meshes, folders of them (and all folders below), quoted patterns like 'scans/**/*.ply'.

    $ unbend collection add shapes scans/
    $ unbend collection add shapes 'models/**/*.obj' --workers 8
    $ unbend collection add shapes /data/models --scheduler tcp://10.0.0.1:8786 --json
    """
    progress("reading", 0)
    collection = unbend.collection.Collection(store)
    done = collection.add(paths, workers=workers, scheduler=scheduler, progress=progress)
    rate = f", {done.added / done.seconds:.3g} a second" if done.added else ""
    moved = f" ({done.new_paths:,} copied or moved)" if done.new_paths else ""
    count = len(collection)
    line = (
        f"added {done.added:,}, already there {done.skipped:,}{moved}, failed "
        f"{len(done.failures):,}; {store} has {plural(count, 'shape')} ({done.seconds:.1f} s{rate})"
    )
    hint = f"unbend collection search {quoted(store)} MESH, to find what is like it"
    told = {"store": store, "n_added": done.added, "n_skipped": done.skipped}
    told |= {"n_new_paths": done.new_paths, "n_shapes": count}
    tell(told, [line], next_step=hint if count else None, failures=done.failures)


def list_(store: str, n: Annotated[int | None, options.count("--n-shapes")] = None) -> None:
    """List the shapes of a collection: id, vertices, faces and path.

      n: Show the first N only.

    $ unbend collection list shapes
    $ unbend collection list shapes -n 20 --json
    """
    collection = opened(store)
    entries = itertools.islice(collection, n)
    more = [f"... of {len(collection):,}"] if n is not None and len(collection) > n else []
    tell({"store": store, "shapes": entries}, itertools.chain(_lines(entries), more))


def _lines(entries: Iterator[unbend.collection.Entry]) -> Iterator[str]:
    """Print as they are read: there may be millions."""
    first = list(itertools.islice(entries, 1))  # before anything is printed: it may fail
    yield f"{'id':<{SHORT_ID}}  {'vertices':>10}  {'faces':>10}  path"
    for one in itertools.chain(first, entries):
        sizes = f"{one.n_vertices:>10,}  {one.n_faces:>10,}"
        yield f"{one.id[:SHORT_ID]}  {sizes}  {shown_shape(one)}"


def info(
    store: str,
    shape: Annotated[str | None, typer.Argument(metavar="[SHAPE]")] = None,
    thumbnail: Annotated[str | None, typer.Option(metavar="PNG")] = None,
) -> None:
    """Show how many shapes a collection has and how they are described, or show one shape.

      shape: A path or id, to show one shape.
      thumbnail: Write the picture of SHAPE.

    $ unbend collection info shapes
    $ unbend collection info shapes scans/cat0.off --thumbnail cat0.png
    """
    if thumbnail is not None and shape is None:
        raise InputError("--thumbnail is the picture of one shape: name it after STORE")
    collection = opened(store, thumbnail)
    if shape is None:
        found = collection.info()
        lines = {
            "shapes": f"{found.n_shapes:,}",
            "files": f"{found.n_files:,}",
            "size": "unknown" if found.n_bytes is None else f"{found.n_bytes / 2**20:,.1f} MiB",
            "descriptors": f"version {found.version}, {found.descriptor_length} numbers each",
            "indexed": "yes" if found.indexed else "no: every search looks at all",
        }
        tell({"store": store, **vars(found)}, rows(lines))
        return
    (entry,) = collection.find([shape])
    if thumbnail is not None:
        picture = collection.thumbnail(entry.id)
        if not picture:
            raise InputError(f"{shape} is a point cloud, of which no picture is kept")
        with unbend.io.atomic_write(thumbnail) as file:
            file.write(picture)
    lines = {
        "id": entry.id,
        "path": entry.path,
        **({"also": ", ".join(entry.also)} if entry.also else {}),
        "vertices": f"{entry.n_vertices:,}",
        "faces": f"{entry.n_faces:,}",
        "area": f"{entry.area:.6g}",
        "notes": entry.notes or "none",
    }
    tell({"store": store, **vars(entry)}, rows(lines), written=[thumbnail])


def remove(
    store: str,
    shapes: Annotated[list[str] | None, typer.Argument(metavar="[SHAPES]")] = None,
    missing: Annotated[bool, typer.Option("--missing")] = False,
) -> None:
    """Remove shapes from a collection; their files stay where they are.

    A path removes only that path of a shape that has several. An id removes the shape.

      shapes: Paths, or ids (8 digits or more of them).
      missing: Also remove all paths whose files are not there any more.

    $ unbend collection remove shapes scans/cat0.off
    $ unbend collection remove shapes 3287ee037b25 9f0c11d2a4b7
    $ unbend collection remove shapes --missing
    """
    if not shapes and not missing:
        raise InputError("name the shapes to remove, or give --missing")
    collection = opened(store)
    shapes = [*(shapes or []), *(collection.missing() if missing else [])]
    left = {one.id: {one.path, *one.also} for one in collection.find(shapes)}
    removed = collection.remove(shapes)
    for entry in removed:
        left[entry.id] -= {entry.path, *entry.also}
    lines = []
    for entry in removed:
        kept = f"; the shape stays as {shown(min(left[entry.id]))}" if left[entry.id] else ""
        lines.append(f"removed {shown_shape(entry)}{kept}")
    count = len(collection)
    lines.append(f"{store} has {plural(count, 'shape')}")
    tell({"store": store, "removed": removed, "n_shapes": count}, lines)


def export(store: str, out: Annotated[str, options.out()]) -> None:
    """Write the stored data of every shape into one table.

    There is a row for each file. Identical files have the same id.

      out: .parquet: every column; .csv: all but thumbnails.

    $ unbend collection export shapes -o shapes.parquet
    $ unbend collection export shapes -o shapes.csv
    """
    count = opened(store).export(out)
    line = f"wrote {plural(count, 'row')} to {out}, one for each file"
    tell({"store": store, "n_rows": count}, [line], written=[out])
