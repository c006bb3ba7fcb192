"""``unbend similarity``: how alike shapes are, whatever their poses."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

import unbend
from unbend._display import is_doubtful
from unbend.choices import Axis, DistanceKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import make_form, read_shapes
from unbend.errors import InputError


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

    Options
    -------
      model: The mesh to compare with.
      probes: Meshes to compare it with.
      known: Vertex i is the same point on all shapes; else they are matched, in seconds a pair.
      matrix: Compare all pairs.
      n_components: Dimension that is compared.
      distance: The distance that the forms approximate.
      figure: With --matrix: draw a heat map (.png, .pdf, .svg).
      report: Write a page to look at in a browser: the probes as pictures, the most alike first;
          with --matrix a heat map with its dendrogram, and pictures that open.

    Examples
    --------
      unbend similarity cat0.off cat1.off dog0.off
      unbend similarity wolf0.off wolf1.off wolf2.off --known-correspondence --json
      unbend similarity shapes/*.off --matrix --csv table.csv --figure heat.png
      unbend similarity cat0.off cat1.off dog0.off --matrix --report similarity.html
    """
    if figure is not None and not matrix:
        raise InputError("a heat map shows all pairs; add --matrix to --figure")
    paths = [model, *probes]
    square: list[list[float]] = []
    with output.progress_on_stderr() as progress:
        shapes = read_shapes(paths, component)
        for shape in shapes[1:]:
            if known and shape.n_vertices != shapes[0].n_vertices:
                raise InputError(
                    f"{shapes[0].name} and {shape.name} have {shapes[0].n_vertices} and "
                    f"{shape.n_vertices} vertices, so they do not correspond one by one; leave out "
                    "--known-correspondence"
                )
        forms = []
        for shape in shapes:
            progress(f"{shape.name}, canonical form", 0)
            weighting = "uniform" if known else "area"
            forms.append(make_form(shape, distance, n_components=n_components, weighting=weighting))
        pairs: list[tuple[int, int, float, float | None]] = []
        for i, j in itertools.combinations(range(len(shapes)), 2):
            if i and not matrix:
                break
            found = areas = None
            if not known:
                areas = unbend.mesh.vertex_areas(shapes[i]), unbend.mesh.vertex_areas(shapes[j])

                def step(stage: str, share: float, i: int = i, j: int = j) -> None:
                    progress(f"{shapes[i].name} to {shapes[j].name}: {stage}", share)

                found = unbend.match(shapes[i], shapes[j], progress=step)
            value = unbend.similarity(
                forms[i], forms[j], match=found, n_components=n_components, areas=areas
            )
            pairs.append((i, j, value, None if found is None else found.confidence))
        ranked = sorted(pairs, key=lambda one: -round(one[2], 9))
        named = [
            {"model": paths[i], "probe": paths[j], "similarity": value, "confidence": confidence}
            for i, j, value, confidence in pairs
        ]
        cells: list[list[Any]] = [["model", "probe", "similarity", "match_confidence"]]
        cells += [list(one.values()) for one in named]
        if matrix:
            square = [[1.0] * len(paths) for _ in paths]
            for i, j, value, _ in pairs:
                square[i][j] = square[j][i] = value
            cells = [["shape", *paths], *([paths[i], *row] for i, row in enumerate(square))]
        if csv is not None:
            unbend.io.write_table(csv, cells)
        if figure is not None:
            unbend.report.draw_similarities([Path(path).stem for path in paths], square, figure)
        if report is not None:
            looks: Any = {"up": up, "command": output.command_line(), "progress": progress}
            if matrix:
                unbend.report.similarity_page(shapes, square, report, **looks)
            else:
                looks["measure"] = "similarity"
                alike, values = [], [one[2] for one in ranked]
                for _, j, _, confidence in ranked:
                    doubt = confidence is not None and is_doubtful(confidence)
                    name = f"{shapes[j].name} (doubtful match)" if doubt else shapes[j].name
                    alike.append(replace(shapes[j], name=name))
                unbend.report.search_page(shapes[0], alike, values, report, **looks)
    lines = [["probe", "similarity", "" if known else "confidence of the match"]]
    for _, j, value, confidence in ranked:
        lines.append([paths[j], f"{value:.4f}", "" if known else f"{confidence:.2f}"])
    output.tell(
        {"pairs": named},
        output.matrix(paths, square) if matrix else output.table("<>>", *lines),
        shapes=shapes,
        written=[csv, figure],
        report=report,
    )
