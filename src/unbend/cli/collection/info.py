"""``unbend collection info``: what a collection is, or one shape of it."""

from __future__ import annotations

from typing import Annotated

import typer

from unbend.cli._common import JsonOption, print_json, print_rows
from unbend.cli.collection._common import StoreArgument, opened


def info(
    store: StoreArgument,
    shape: Annotated[
        str | None, typer.Argument(metavar="[SHAPE]", help="A path or id, to show one shape.")
    ] = None,
    thumbnail: Annotated[
        str | None,
        typer.Option("--thumbnail", metavar="PNG", help="Write the picture of SHAPE."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show how many shapes a collection has and how they are described, or show one shape.

    \b
    Examples:
      unbend collection info shapes
      unbend collection info shapes scans/cat0.off --thumbnail cat0.png
    """  # noqa: D301
    from unbend.errors import InputError
    from unbend.io import atomic_write, check_writable

    if thumbnail is not None:
        if shape is None:
            raise InputError("--thumbnail is the picture of one shape: name it after STORE")
        check_writable(thumbnail, (".png",))
    collection = opened(store, thumbnail)
    if shape is None:
        found = collection.info()
        if as_json:
            print_json({"store": store, **vars(found)})
            return
        print_rows(
            {
                "shapes": f"{found.n_shapes:,}",
                "files": f"{found.n_files:,}",
                "size": "unknown" if found.n_bytes is None else f"{found.n_bytes / 2**20:,.1f} MiB",
                "descriptors": f"version {found.version}, {found.descriptor_length} numbers each",
                "indexed": "yes" if found.indexed else "no: every search looks at all",
                **{name: str(value) for name, value in found.parameters.items()},
            }
        )
        return
    (entry,) = collection.find([shape])
    if thumbnail is not None:
        with atomic_write(thumbnail) as file:
            file.write(collection.thumbnail(entry.id))
    if as_json:
        print_json({"store": store, **vars(entry), "thumbnail": thumbnail})
        return
    print_rows(
        {
            "id": entry.id,
            "path": entry.path,
            **({"also": ", ".join(entry.also)} if entry.also else {}),
            "vertices": f"{entry.n_vertices:,}",
            "faces": f"{entry.n_faces:,}",
            "area": f"{entry.area:.6g}",
            "notes": entry.notes or "none",
            **({"written": thumbnail} if thumbnail else {}),
        }
    )
