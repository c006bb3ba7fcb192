"""``unbend transfer``: values, labels, weights, colours or landmarks of one shape on another."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import unbend
from unbend.choices import ValueKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import read_or_match, read_shapes
from unbend.errors import InputError


def transfer(
    source: str,
    target: str,
    values: Annotated[str, typer.Option(metavar="FILE")],
    out: Annotated[str, options.out()],
    kind: ValueKind = "auto",
    property_name: options.Property = None,
    expected_error: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    *,
    matching: options.MatchOptions,
    component: options.Component = None,
    cache: options.Cache = True,
) -> None:
    """Transfer values from source to target: numbers are averaged, labels by majority.

      values: A row per source vertex (.npy, .csv, .txt): numbers, labels, weights, colours; a mesh
          with such values (.ply, .obj ...); or landmarks (.mrk.json, .fcsv, .pp, or a table of
          x,y,z if -o is .mrk.json).
      out: .npy, .csv or .txt: a row per target vertex; .ply, .vtp: the target with the values;
          .obj, .glb: the target with colours or texture coordinates. Numbers and labels are
          coloured, for Blender and MeshLab. Landmarks: .mrk.json.
      kind: auto: scalar for fractions, label for whole numbers and text; for several columns color
          from 0 to 255, uv for texture coordinates, else scalar.
      property_name: Which values of a mesh file: a property of its vertices, color or uv.
      expected_error: Also write the expected error of the map at each target vertex, a bound for
          nine in ten of them, in square roots of the target's area (.npy, .csv, .txt, .ply, .vtp);
          at each landmark (.csv).

    $ unbend transfer dog.ply cat.ply --values weights.npy --kind weights -o cat_weights.npy
    $ unbend transfer dog.ply cat.ply --values parts.csv --map dog_cat.npz -o cat_parts.csv
    $ unbend transfer dog.ply cat.ply --values colors.npy --kind color -o cat_colored.ply
    $ unbend transfer dog.ply cat.ply --values parts.csv --save-match map.npz -o cat_parts.glb
    $ unbend transfer dog.ply cat.ply --values parts.csv --min-confidence 0.7 -o cat_parts.csv
    $ unbend transfer dog.ply cat.ply --values dog.ply --property color -o cat_colored.ply
    $ unbend transfer dog.ply cat.ply --values dog.mrk.json -o cat.mrk.json
    $ unbend transfer dog.ply cat.ply --values dog_points.csv -o cat.mrk.json
    """
    import numpy as np

    io = unbend.io
    # A table holds points if landmarks shall be written: values never are in .json files.
    is_markup = any(path.lower().endswith(io.MARKUP_SUFFIXES) for path in (values, out))
    if is_markup and not out.lower().endswith(".json"):
        raise InputError(
            f"cannot write {out}: {values} is read as landmarks, which go into a .mrk.json file; "
            "give other values in a .npy, .csv or .txt file"
        )
    if is_markup and not values.lower().endswith((*io.MARKUP_SUFFIXES, ".csv", ".txt")):
        raise InputError(
            f"cannot write {out}: .json files hold landmarks, which {values} does not; write "
            ".csv, .npy, .txt, .ply, .vtp, .obj or .glb"
        )
    io.check_writable(out, (".json",) if is_markup else io.VALUE_SUFFIXES + io.COLOR_SUFFIXES)
    if is_markup and expected_error is not None:
        io.check_writable(expected_error, (".csv",))
    shapes = a, b = read_shapes((source, target), component)
    chosen: Any = "landmarks"
    if is_markup:
        if kind != "auto" or property_name is not None:
            raise InputError(
                f"{values} is read as landmarks, which have no --kind or --property; leave them "
                "out, or give and write other values in a .npy, .csv or .txt file"
            )
        labels, array = io.read_markups(values, a)
    else:
        array, names = io.read_named_values(values, n_vertices=a.n_vertices, name=property_name)
        chosen = unbend.correspondence.value_kind(array, kind, names)
        io.check_storable(out, array, chosen)
        if chosen != "label":
            unbend.correspondence.checked_numbers(array, chosen)
        if chosen == "scalar" and kind == "auto" and array.ndim == 2:
            whole = ((array == np.round(array)) | np.isnan(array)).all(axis=0)
            whole &= (array != array[0]).any(axis=0)
            columns = [names[k] if names else f"{k + 1}" for k in np.flatnonzero(whole)]
            if columns:
                output.say(
                    "note",
                    f"columns of whole numbers ({', '.join(columns)}) are averaged, as others; if "
                    "they are labels, transfer each from a file of its own",
                )
    found = read_or_match(shapes, matching)
    if isinstance(found, unbend.Match):
        forward, back = found.source_to_target, found.target_to_source
    else:
        forward, back = found, unbend.correspondence.inverted(found, b)
    output.progress("carrying", 0)
    errors: Any = getattr(found, "expected_error", None)
    if expected_error is not None and errors is None:
        raise InputError(f"{matching.map} has no expected errors; leave out --map to match")
    if is_markup:
        labels, carried = unbend.correspondence.transfer_landmarks(labels, array, forward, b)
        io.write_markups(out, b, carried, labels)
        if expected_error is not None:
            bounds = errors[array[forward[array] >= 0]].tolist()
            table = zip(labels, bounds, strict=True)
            io.write_table(expected_error, [["label", "expected_error"], *table])
    else:
        carried = unbend.transfer(array, found, kind=chosen, source=a, target=b)
        is_mesh = out.lower().endswith(io.COLOR_SUFFIXES)
        whole = component is None and chosen != "uv"
        like = output.what_to_keep(out, target, whole=whole, moved=False) if is_mesh else None
        stored, written = carried, chosen
        if is_mesh and chosen == "label" and names[:1] == ["color_0"]:  # painted labels
            stored, written = np.where(carried < 0, 128, carried).astype(np.uint8), "color"
        io.write_values(out, stored, b, kind=written, names=names, like=like)
        filled = int((back >= 0).sum()) - len(np.unique(forward[forward >= 0]))
        if filled > 0 and not isinstance(found, unbend.Match):
            output.say(
                "note",
                f"{filled:,} of {len(back):,} vertices of {b.name} are the partner of no vertex of "
                f"{a.name}, and take the value of the nearest one that is; with a .npz map, those "
                "beyond the overlap take none",
            )
        if expected_error is not None:
            errors = unbend.transfer(errors, found, kind="scalar", source=a, target=b)
            io.write_values(expected_error, errors, b)
    lost = int((back < 0).sum())
    if lost:
        output.say("note", f"{lost:,} vertices of {b.name} correspond to none of the source")
    width = "".join(f" x {k}" for k in carried.shape[1:])
    n_known = len(carried) if is_markup else len(carried) - lost
    if carried.dtype.kind == "f":
        n_known = int((~np.isnan(carried)).reshape(len(carried), -1).any(axis=1).sum())
    count = f"{n_known:,}" if n_known == len(carried) else f"{n_known:,} of {len(carried):,}"
    told = {"source": source, "target": target, "values": values, "kind": chosen}
    told |= {"shape": carried.shape, "n_without_preimage": lost}
    told |= {"confidence": getattr(found, "confidence", None)}
    output.tell(
        told,
        output.rows({"carried": f"{count}{width} values ({chosen})"}),
        shapes=shapes,
        written=[out, matching.save_match, expected_error],
    )
