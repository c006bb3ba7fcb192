"""``unbend evaluate``, ``transfer`` and ``morph``: what a map is good for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import GeodesicKind, ValueKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import keeps_all, read_or_match, read_shapes, read_truth
from unbend.errors import InputError

_SHOWN = (0.025, 0.05, 0.1, 0.15)


def evaluate(
    map_file: Annotated[str, typer.Argument(metavar="MAP")],
    target: str,
    source_truth: str,
    target_truth: str,
    mirrored_truth: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    distance: GeodesicKind = "geodesic",
    base: options.Base = None,
    figure: options.Figure = None,
) -> None:
    """Measure the geodesic errors of a map against the ground truth, in units of sqrt(target area).

    The protocols are: direct, against the ground truth as given; map-min, the better of the ground
    truth and its reflection for the whole map; vertex-min, the better for each row. For partial
    shapes, -1 in the ground truth means no partner, and the overlap is measured too.

      map_file: A map: .npz, .npy, .txt, .csv or .vts.
      target: The mesh that MAP maps to.
      source_truth: Source vertices whose image is known (.vts, .txt, .csv or .npy).
      target_truth: Their true images, row by row.
      mirrored_truth: Their images on the other side, left-right.
      distance: geodesic: heat method, within 1 % on average; geodesic-exact: slow.
      figure: Draw the error curves (.png, .pdf, .svg).

    $ unbend evaluate map.vts cat1.off cat0.vts cat1.vts
    $ unbend evaluate map.npz b.off a.vts b.vts --mirrored-truth b.sym.vts --figure curves.png
    $ unbend evaluate map.npz b.off a.vts b.vts --distance geodesic-exact --json
    """
    (shape,) = read_shapes([target])
    if keeps_all(map_file):
        point_map = unbend.read_match(map_file, target=shape).source_to_target
    else:
        point_map = unbend.read_map(map_file, base=base, n_target=shape.n_vertices)
    files = source_truth, target_truth, mirrored_truth
    sources, *truths = read_truth(files, len(point_map), shape.n_vertices)
    output.progress(f"{distance} distances", 0)
    found = unbend.evaluate(point_map, shape, sources, *truths, distance=distance)
    if figure is not None:
        unbend.report.draw_error_curves({Path(map_file).stem: found}, figure)
    thresholds = unbend.correspondence.THRESHOLDS
    columns = [int(abs(thresholds - shown).argmin()) for shown in _SHOWN]
    cells = [["protocol", "mean", "median", "AUC", *(f"<= {shown:g}" for shown in _SHOWN)]]
    protocols: dict[str, Any] = {}
    for name in ["direct"] + ["map-min", "vertex-min"] * (found.map_min is not None):
        mean, median, auc = found.mean(name), found.median(name), found.auc(name)
        curve = found.curve(name)
        cells.append([name, f"{mean:.4f}", f"{median:.4f}", f"{auc:.3f}"])
        cells[-1] += [f"{curve[i]:.1f} %" for i in columns]
        measures = {"mean": mean, "median": median, "auc": auc, "curve": curve}
        protocols[name] = {"n_rows": len(found.errors(name)), **measures}
    told = {"map": map_file, "target": target, "distance": distance, "n_rows": len(found.direct)}
    told |= {"coverage": found.coverage, "overlap": found.overlap}
    told |= {"thresholds": thresholds, "protocols": protocols}
    counts = f"{len(found.direct):,} rows"
    if found.map_min is not None and len(found.map_min) < len(found.direct):
        counts += f", {len(found.map_min):,} of them with a mirrored truth"
    lines = ["", f"{counts}; {found.coverage:.1%} of the target's area is hit"]
    part = found.overlap
    if part.iou < 1:
        lines.append(
            f"overlap: {part.iou:.1%} intersection over union, {part.precision:.1%} precision, "
            f"{part.recall:.1%} recall"
        )
    lines = output.table("<>>>>>>>", *cells) + lines
    output.tell(told, lines, shapes=[shape], written=[figure])


def transfer(
    source: str,
    target: str,
    values: Annotated[str, typer.Option(metavar="FILE")],
    out: Annotated[str, options.out()],
    kind: ValueKind = "auto",
    property_name: Annotated[str | None, typer.Option("--property", metavar="NAME")] = None,
    expected_error: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    *,
    matching: options.MatchOptions,
    cache: options.Cache = True,
) -> None:
    """Transfer values from source to target: numbers are averaged, labels by majority.

      values: A row per source vertex (.npy, .csv, .txt): numbers, labels, weights, colours; a mesh
          with such values (.ply, .obj ...); or landmarks (.mrk.json, .fcsv).
      out: .npy, .csv or .txt: a row per target vertex; .ply, .vtp: the target with the values;
          .obj, .glb: the target with colours or texture coordinates. Numbers and labels are
          coloured, for Blender and MeshLab. Landmarks: .mrk.json.
      kind: auto: scalar for fractions, label for whole numbers and text; for several columns color
          from 0 to 255, uv for that property, else scalar.
      property_name: Which values of a mesh file: a property of its vertices, color or uv.
      expected_error: Write too how far off each target vertex's source may be, in square roots of
          the target's area (.npy, .csv, .txt, .ply, .vtp): `Match.expected_error`, carried.

    $ unbend transfer dog.ply cat.ply --values weights.npy --kind weights -o cat_weights.npy
    $ unbend transfer dog.ply cat.ply --values parts.csv --map dog_cat.npz -o cat_parts.csv
    $ unbend transfer dog.ply cat.ply --values colors.npy --kind color -o cat_colored.ply
    $ unbend transfer dog.ply cat.ply --values parts.csv --save-match map.npz -o cat_parts.glb
    $ unbend transfer dog.ply cat.ply --values parts.csv --min-confidence 0.7 -o cat_parts.csv
    $ unbend transfer dog.ply cat.ply --values dog.ply --property color -o cat_colored.ply
    $ unbend transfer dog.ply cat.ply --values dog.mrk.json -o cat.mrk.json
    """
    import numpy as np

    io = unbend.io
    is_markup = values.lower().endswith(io.MARKUP_SUFFIXES)
    io.check_writable(out, (".json",) if is_markup else io.VALUE_SUFFIXES + io.COLOR_SUFFIXES)
    shapes = a, b = read_shapes((source, target))
    chosen: Any = "landmarks"
    if is_markup:
        labels, array = io.read_markups(values, a)
    else:
        array = io.read_values(values, n_vertices=a.n_vertices, name=property_name)
        if kind == "auto" and property_name == "uv" and array.ndim == 2:
            kind = "uv"
        chosen = unbend.correspondence.value_kind(array, kind)
        io.check_storable(out, array, chosen)
    found = read_or_match(shapes, matching)
    if isinstance(found, unbend.Match):
        forward, back = found.source_to_target, found.target_to_source
    else:
        forward, back = found, io.invert_map(found, b)
    output.progress("carrying", 0)
    errors: Any = getattr(found, "expected_error", None)
    if expected_error is not None and errors is None:
        raise InputError(f"{matching.map} has no expected errors; leave out --map to match")
    if is_markup:
        carried = forward[array]
        there = np.flatnonzero(carried >= 0)
        io.write_markups(out, b, carried[there], [labels[i] for i in there])
        for i in np.flatnonzero(carried < 0):
            output.say("note", f"landmark {labels[i]} corresponds to no vertex of {b.name}")
    else:
        carried = unbend.transfer(array, found, kind=chosen, source=a, target=b)
        is_mesh = out.lower().endswith(io.COLOR_SUFFIXES)
        like = output.lines_to_keep(out, target, whole=chosen != "uv") if is_mesh else None
        io.write_values(out, carried, b, kind=chosen, like=like)
        filled = int((back >= 0).sum()) - len(np.unique(forward[forward >= 0]))
        if filled > 0 and not isinstance(found, unbend.Match):
            output.say(
                "note",
                f"{filled:,} of {len(back):,} vertices of {b.name} are the image of none, and "
                "take the value of the nearest that is one; a .npz map leaves out those beyond "
                "the overlap",
            )
    if expected_error is not None:
        errors = unbend.transfer(errors, found, kind="scalar", source=a, target=b)
        io.write_values(expected_error, errors, b)
    lost = int((back < 0).sum())
    if lost:
        output.say("note", f"{lost:,} vertices of {b.name} correspond to none of the source")
    width = "" if carried.ndim == 1 else f" x {carried.shape[1]}"
    told = {"source": source, "target": target, "values": values, "kind": chosen}
    told |= {"shape": carried.shape, "n_without_preimage": lost}
    told |= {"confidence": getattr(found, "confidence", None)}
    output.tell(
        told,
        output.rows({"carried": f"{len(carried):,}{width} values ({chosen})"}),
        shapes=shapes,
        written=[out, matching.save_match, expected_error],
    )


def morph(
    source: str,
    target: str,
    out: Annotated[str, options.out()],
    steps: Annotated[int, typer.Option(metavar="N", min=1)] = 1,
    *,
    matching: options.MatchOptions,
    component: options.Component = None,
    cache: options.Cache = True,
) -> None:
    """Morph one shape into another: write the shapes between them.

    They have the source's vertices and faces. Limbs rotate about their joints rather than shrink.

      source: The mesh to begin with.
      target: The mesh to end on.
      out: The shape between (.ply, .obj, .glb, .off, .stl); of several steps OUT-1, OUT-2 ...
      steps: How many shapes between the two, evenly spaced; 1 is the one halfway.

    $ unbend morph standing.ply leaping.ply -o halfway.ply
    $ unbend morph standing.ply leaping.ply --steps 9 -o frame.ply
    $ unbend morph standing.ply leaping.ply --map map.npz -o halfway.glb
    """
    unbend.io.check_writable(out, (".ply", ".obj", ".glb", ".off", ".stl"))
    files, digits = [out], len(str(steps))
    if steps > 1:
        files = [output.numbered(out, f"{i + 1:0{digits}}") for i in range(steps)]
    options.keep_inputs(files, (source, target))
    shapes = read_shapes((source, target), component)
    match = read_or_match(shapes, matching)
    told = output.numbered(out, "*") if steps > 1 else out
    like = output.lines_to_keep(told, source, whole=component is None)
    for i, file in enumerate(files):
        output.progress("morphing", i / steps)
        between = unbend.morph(shapes[0], shapes[1], match, (i + 1) / (steps + 1))
        unbend.write_mesh(file, between, like=like)
    confidence = getattr(match, "confidence", None)
    count = f"{steps} between {shapes[0].name} and {shapes[1].name}"
    output.tell(
        {"source": source, "target": target, "steps": steps, "confidence": confidence},
        output.rows({"shapes": count, "confidence": output.confidence_of(match)}),
        shapes=shapes,
        written=[*files, matching.save_match],
        next_step=f"open {files[0]} in MeshLab or Blender",
    )
