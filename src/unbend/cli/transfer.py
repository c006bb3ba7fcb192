"""``unbend transfer``: carry values from one shape to another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import ValueKind
from unbend.cli import _options as options
from unbend.cli._input import read_or_match, read_shapes
from unbend.cli._output import progress_on_stderr, rows, say, tell

if TYPE_CHECKING:
    from unbend._types import IntArray
    from unbend.matching import Match
    from unbend.mesh import Mesh


def transfer(
    source: options.Source,
    target: options.Target,
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
        options.out(
            ".npy, .csv or .txt: a row per target vertex; .ply: the target with the values; "
            ".obj, .glb: the target with colours or texture coordinates. Numbers and labels are "
            "coloured, for Blender and MeshLab."
        ),
    ],
    kind: Annotated[
        ValueKind,
        typer.Option("--kind", help="auto: scalar for fractions, label for whole numbers, text."),
    ] = "auto",
    map_file: options.Map = None,
    base: options.Base = None,
    partial: options.Partial = "auto",
    landmarks: options.Landmarks = None,
    save_match: options.SaveMatch = None,
    min_confidence: options.MinConfidence = None,
    cache: options.Cache = True,
) -> None:
    """Transfer values from source to target: numbers are averaged, labels by majority.

    Examples
    --------
      unbend transfer dog.ply cat.ply --values weights.npy --kind weights -o cat_weights.npy
      unbend transfer dog.ply cat.ply --values parts.csv --map dog_cat.npz -o cat_parts.csv
      unbend transfer dog.ply cat.ply --values colors.npy --kind color -o cat_colored.ply
      unbend transfer dog.ply cat.ply --values parts.csv --save-match map.npz -o cat_parts.glb
      unbend transfer dog.ply cat.ply --values parts.csv --min-confidence 0.7 -o cat_parts.csv
    """
    from unbend.correspondence import transfer as carry
    from unbend.correspondence import value_kind
    from unbend.io import (
        COLOR_SUFFIXES,
        VALUE_SUFFIXES,
        check_storable,
        check_writable,
        read_values,
        write_values,
    )

    check_writable(out, VALUE_SUFFIXES + COLOR_SUFFIXES)
    with progress_on_stderr() as progress:
        progress("reading", 0)
        shapes = read_shapes((source, target))
        array = read_values(values, n_vertices=shapes[0].n_vertices)
        chosen = value_kind(array, kind)
        check_storable(out, array, chosen)
        found = read_or_match(
            shapes,
            map_file,
            base=base,
            partial=partial,
            landmarks=landmarks,
            save_match=save_match,
            min_confidence=min_confidence,
            progress=progress,
        )
        progress("carrying", 0)
        carried = carry(array, found, kind=chosen, source=shapes[0], target=shapes[1])
        write_values(out, carried, shapes[1], kind=chosen)
    lost = _count_lost(found, shapes[1])
    if lost:
        say("note", f"{lost:,} vertices of {shapes[1].name} correspond to none of the source")
    width = "" if carried.ndim == 1 else f" x {carried.shape[1]}"
    tell(
        {
            "source": source,
            "target": target,
            "values": values,
            "kind": chosen,
            "shape": carried.shape,
            "n_without_preimage": lost,
            "confidence": getattr(found, "confidence", None),
        },
        rows({"carried": f"{len(carried):,}{width} values ({chosen})"}),
        shapes=shapes,
        written=[out, save_match],
    )


def _count_lost(found: Match | IntArray, target: Mesh) -> int:
    from unbend.io import invert_map
    from unbend.matching import Match

    back = found.target_to_source if isinstance(found, Match) else invert_map(found, target)
    return int((back < 0).sum())
