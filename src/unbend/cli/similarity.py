"""``unbend similarity``: how alike shapes are, whatever their poses."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

import unbend
from unbend._display import is_doubtful
from unbend._text import plural
from unbend.choices import Axis, DistanceKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import make_form, read_shapes
from unbend.errors import InputError, heard, warn


def similarity(
    model: str,
    probes: list[str],
    known: Annotated[bool, typer.Option("--known-correspondence")] = False,
    matrix: Annotated[bool, typer.Option("--matrix")] = False,
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    component: options.Component = None,
    csv: options.Csv = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Measure how similar shapes are, whatever their poses: 1 for the same shape.

    The measure is the cosine of the canonical forms after the best alignment.

      model: The mesh to compare with.
      probes: Meshes to compare it with.
      known: Vertex i is the same point on all shapes; otherwise they are matched, which takes
          seconds for each pair.
      matrix: Compare all pairs.
      n_components: Dimension that is compared.
      distance: The distance that the forms approximate.
      figure: With --matrix: draw a heat map (.png, .pdf, .svg).
      report: Write a page to look at in a browser: the probes as pictures, the most alike first;
          with --matrix a heat map with its dendrogram, and pictures that open.

    $ unbend similarity cat0.off cat1.off dog0.off
    $ unbend similarity wolf0.off wolf1.off wolf2.off --known-correspondence --json
    $ unbend similarity shapes/*.off --matrix --csv table.csv --figure heat.png
    $ unbend similarity cat0.off cat1.off dog0.off --matrix --report similarity.html
    """
    if figure is not None and not matrix:
        raise InputError("a heat map shows all pairs; add --matrix to --figure")
    paths = [model, *probes]
    if report is not None:
        unbend.report.check_count(len(paths))
    shapes = read_shapes(paths, component)
    for shape in shapes[1:]:
        if known and shape.n_vertices != shapes[0].n_vertices:
            raise InputError(
                f"{shapes[0].name} and {shape.name} have {shapes[0].n_vertices:,} and "
                f"{plural(shape.n_vertices, 'vertex')}, so they do not correspond one by one; "
                "leave out --known-correspondence"
            )
    kind: Any = {"distance": distance, "weighting": "uniform" if known else "area"}
    forms = []
    for shape in shapes:
        output.progress(f"{shape.name}, canonical form", 0)
        forms.append(make_form(shape, n_components=n_components, **kind))
    pairs: list[tuple[str, str, float, float | None]] = []
    square = [[1.0] * len(paths) for _ in paths]
    noted = list(shapes)
    once: set[tuple[int, str]] = set()
    for i, j in itertools.combinations(range(len(paths)), 2):
        if i and not matrix:
            break
        given: Any = {"n_components": n_components}
        confidence = None
        if not known:
            both = f"{shapes[i].name} to {shapes[j].name}"

            def step(stage: str, share: float, both: str = both) -> None:
                output.progress(f"{both}: {stage}", share)

            with heard() as said:
                given["match"] = unbend.match(shapes[i], shapes[j], progress=step)
            for one in said:
                alone = {(k, one) for k in (i, j) if one.startswith(f"{shapes[k].name}: ")}
                if not alone or alone - once:  # of one shape it is said with its first pair
                    warn(f"{both}: {one}")
                once |= alone
            given["areas"] = tuple(unbend.mesh.vertex_areas(shapes[k]) for k in (i, j))
            confidence = given["match"].confidence
            if matrix and is_doubtful(confidence):  # a matrix has values alone
                told = f"doubtful match to {shapes[j].name}, confidence {confidence:.2f}"
                noted[i] = replace(noted[i], notes=(*noted[i].notes, told))
        value = unbend.similarity(forms[i], forms[j], **given)
        square[i][j] = square[j][i] = value
        pairs.append((paths[i], paths[j], value, confidence))
    # With --matrix these pairs are not all, and are not shown.
    ranked = sorted(zip(shapes[1:], pairs, strict=False), key=lambda one: -round(one[1][2], 9))
    if csv is not None:
        cells: list[Any] = [("model", "probe", "similarity", "match_confidence"), *pairs]
        if matrix:
            cells = [
                ["shape", *paths],
                *([path, *row] for path, row in zip(paths, square, strict=True)),
            ]
        unbend.io.write_table(csv, cells)
    if figure is not None:
        unbend.report.draw_similarities([Path(path).stem for path in paths], square, figure)
    looks: Any = {"up": up, "command": output.command_line(), "progress": output.progress}
    if report is not None and matrix:
        unbend.report.similarity_page(noted, square, report, **looks)
    elif report is not None:
        alike = []
        for shape, (_, _, _, confidence) in ranked:
            doubt = confidence is not None and is_doubtful(confidence)
            alike.append(replace(shape, name=f"{shape.name} (doubtful match)") if doubt else shape)
        values = [one[2] for _, one in ranked]
        looks["measure"] = "similarity"
        unbend.report.search_page(shapes[0], alike, values, report, **looks)
    lines = [["probe", "similarity", "" if known else "confidence of the match"]]
    for _, (_, probe, value, confidence) in ranked:
        lines.append([probe, f"{value:.4f}", "" if confidence is None else f"{confidence:.2f}"])
    names = ("model", "probe", "similarity", "confidence")
    output.tell(
        {"pairs": [dict(zip(names, one, strict=True)) for one in pairs]},
        output.matrix(paths, square) if matrix else output.table("<>>", *lines),
        shapes=noted,
        written=[csv, figure],
        report=report,
    )
