"""``unbend transfer``: carry values from one shape to another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import ValueKind
from unbend.cli._common import (
    BaseOption,
    CacheOption,
    JsonOption,
    SourceArgument,
    TargetArgument,
    print_json,
    print_notes,
    print_rows,
    say,
    steps_on_stderr,
    warn_if_doubtful,
)

if TYPE_CHECKING:
    from unbend._types import IntArray, Progress
    from unbend.matching import Match
    from unbend.mesh import Mesh


def transfer(
    source: SourceArgument,
    target: TargetArgument,
    values: Annotated[
        str,
        typer.Option(
            "--values",
            metavar="FILE",
            help="A row per source vertex (.npy, .csv, .txt): numbers, labels, weights, colours.",
        ),
    ],
    out: Annotated[
        str,
        typer.Option(
            "-o",
            "--out",
            metavar="OUT",
            help=".npy, .csv or .txt: a row per target vertex; .ply: the target with the values; "
            ".obj, .glb: the target with colours or texture coordinates. Numbers and labels are "
            "coloured, for Blender and MeshLab.",
        ),
    ],
    map_file: Annotated[
        str | None,
        typer.Option(
            "--map",
            metavar="MAP",
            help="The map from SOURCE to TARGET that unbend match wrote, best as .npz. "
            "Without it the shapes are matched first.",
        ),
    ] = None,
    kind: Annotated[
        ValueKind,
        typer.Option("--kind", help="auto: scalar for fractions, label for whole numbers, text."),
    ] = "auto",
    base: BaseOption = None,
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Transfer values from source to target: numbers are averaged, labels by majority.

    \b
    Examples:
      unbend transfer dog.ply cat.ply --values weights.npy --kind weights -o cat_weights.npy
      unbend transfer dog.ply cat.ply --values parts.csv --map dog_cat.npz -o cat_parts.csv
      unbend transfer dog.ply cat.ply --values colors.npy --kind color -o cat_colored.ply
      unbend transfer dog.ply cat.ply --values parts.csv -o cat_parts.glb
    """  # noqa: D301
    from unbend.correspondence import transfer as carry
    from unbend.correspondence import value_kind
    from unbend.io import (
        COLOR_SUFFIXES,
        VALUE_SUFFIXES,
        check_storable,
        check_writable,
        read_mesh,
        read_values,
        write_values,
    )

    check_writable(out, VALUE_SUFFIXES + COLOR_SUFFIXES)
    with steps_on_stderr() as progress:
        progress("reading", 0)
        shapes = [read_mesh(path) for path in (source, target)]
        array = read_values(values, n_vertices=shapes[0].n_vertices)
        chosen = value_kind(array, kind)
        check_storable(out, array, chosen)
        found = found_match(map_file, base, shapes, progress)
        progress("carrying", 0)
        carried = carry(array, found, kind=chosen, source=shapes[0], target=shapes[1])
        write_values(out, carried, shapes[1], kind=chosen)
    for shape in shapes:
        print_notes(shape.notes)
    lost = _count_lost(found, shapes[1])
    if lost:
        say("note", f"{lost:,} vertices of {shapes[1].name} correspond to none of the source")
    if as_json:
        print_json(
            {
                "source": source,
                "target": target,
                "values": values,
                "kind": chosen,
                "shape": carried.shape,
                "without_preimage": lost,
                "out": out,
            }
        )
        return
    width = "" if carried.ndim == 1 else f" x {carried.shape[1]}"
    print_rows({"carried": f"{len(carried):,}{width} values ({chosen})", "written": out})


def found_match(
    map_file: str | None, base: int | None, shapes: list[Mesh], progress: Progress
) -> Match | IntArray:
    """Read the map, or match the shapes."""
    from unbend.correspondence import read_match
    from unbend.errors import InputError
    from unbend.io import read_map
    from unbend.matching import match

    source, target = shapes
    if map_file is None:
        found = match(
            source,
            target,
            barycentric=True,
            progress=lambda stage, share: progress(f"{stage}, {share:.0%}", 0),
        )
        warn_if_doubtful(found.confidence)
        return found
    if Path(map_file).suffix.lower() != ".npz":
        return read_map(map_file, base=base, n_source=source.n_vertices, n_target=target.n_vertices)
    found = read_match(map_file)
    warn_if_doubtful(found.confidence)
    sizes = len(found.source_to_target), len(found.target_to_source)
    if sizes != (source.n_vertices, target.n_vertices):
        raise InputError(
            f"{Path(map_file).name}: maps {sizes[0]} vertices to {sizes[1]}, but {source.name} and "
            f"{target.name} have {source.n_vertices} and {target.n_vertices}"
        )
    return found


def _count_lost(found: Match | IntArray, target: Mesh) -> int:
    from unbend.io import invert_map
    from unbend.matching import Match

    back = found.target_to_source if isinstance(found, Match) else invert_map(found, target)
    return int((back < 0).sum())
