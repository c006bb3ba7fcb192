"""``unbend similarity``: how alike shapes are, whatever their poses."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from unbend.choices import DistanceKind
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import make_form, read_shapes
from unbend.errors import InputError

if TYPE_CHECKING:
    from unbend._types import Progress
    from unbend.mesh import Mesh


class Pair(NamedTuple):
    """How alike two of the shapes are; the confidence is that of their match, if one was made."""

    model: int
    probe: int
    similarity: float
    confidence: float | None


def similarity(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="The mesh to compare with.")],
    probes: Annotated[
        list[str], typer.Argument(metavar="PROBES", help="Meshes to compare it with.")
    ],
    known: Annotated[
        bool,
        typer.Option(
            "--known-correspondence",
            help="Vertex i is the same point on every shape; otherwise the shapes are matched, "
            "which takes seconds a pair.",
        ),
    ] = False,
    matrix: Annotated[bool, typer.Option("--matrix", help="Compare all pairs.")] = False,
    n_components: Annotated[int, typer.Option(help="Dimension that is compared.")] = 3,
    distance: Annotated[
        DistanceKind, typer.Option(help="The distance that the forms approximate.")
    ] = "biharmonic",
    component: options.Component = None,
    csv: options.Csv = None,
    figure: Annotated[str | None, options.figure("With --matrix: draw a heat map")] = None,
    report: Annotated[
        str | None,
        options.report(
            "Write a page to look at in a browser: the probes as pictures, the most alike first; "
            "with --matrix a heat map with its dendrogram, and pictures that open."
        ),
    ] = None,
    up: options.Up = "y",
    cache: options.Cache = True,
) -> None:
    """Measure how similar shapes are, whatever their poses: 1 for the same shape.

    The measure is the cosine of the canonical forms after the best alignment.

    Examples
    --------
      unbend similarity cat0.off cat1.off dog0.off
      unbend similarity wolf0.off wolf1.off wolf2.off --known-correspondence --json
      unbend similarity shapes/*.off --matrix --csv table.csv --figure heat.png
      unbend similarity cat0.off cat1.off dog0.off --matrix --report similarity.html
    """
    if figure is not None and not matrix:
        raise InputError("a heat map shows all pairs; add --matrix to --figure")
    from unbend.io import write_table

    paths = [model, *probes]
    with output.progress_on_stderr() as progress:
        progress("reading", 0)
        shapes = read_shapes(paths, component)
        if known:
            _check_sizes(shapes)
        pairs = _compare(shapes, known, matrix, n_components, distance, progress)
        square = _square(pairs, len(shapes)) if matrix else None
        named = [
            one._asdict() | {"model": paths[one.model], "probe": paths[one.probe]} for one in pairs
        ]
        if csv is not None and square is None:
            head = ["model", "probe", "similarity", "match_confidence"]
            write_table(csv, [head, *(one.values() for one in named)])
        elif csv is not None and square is not None:
            cells = ([path, *row] for path, row in zip(paths, square, strict=True))
            write_table(csv, [["shape", *paths], *cells])
        if figure is not None and square is not None:
            from unbend.report.collection_figures import draw_similarities

            draw_similarities([Path(path).stem for path in paths], square, figure)
        ranked = sorted(pairs, key=lambda one: -round(one.similarity, 9))
        if report is not None:
            from unbend.report.pages import search_page, similarity_page

            options: Any = {"up": up, "command": output.command_line(), "progress": progress}
            if square is not None:
                similarity_page(shapes, square, report, **options)
            else:
                alike, values = [shapes[one.probe] for one in ranked], [one[2] for one in ranked]
                search_page(shapes[0], alike, values, report, measure="similarity", **options)
    output.tell(
        {"pairs": named},
        _lines(paths, ranked) if square is None else output.matrix(paths, square),
        shapes=shapes,
        written=[csv, figure, report],
        next_step=output.look_at(report),
    )


def _check_sizes(shapes: list[Mesh]) -> None:
    for shape in shapes[1:]:
        if shape.n_vertices != shapes[0].n_vertices:
            raise InputError(
                f"{shapes[0].name} and {shape.name} have {shapes[0].n_vertices} and "
                f"{shape.n_vertices} vertices, so they do not correspond one by one; leave out "
                "--known-correspondence"
            )


def _compare(
    shapes: list[Mesh],
    known: bool,
    matrix: bool,
    n_components: int,
    distance: DistanceKind,
    progress: Progress,
) -> list[Pair]:
    """Compare the first shape with the others, or all with all; each form is computed once."""
    from unbend.correspondence import similarity as likeness
    from unbend.matching import match
    from unbend.mesh import vertex_areas

    forms = []
    for shape in shapes:
        progress(f"{shape.name}, canonical form", 0)
        weighting = "uniform" if known else "area"
        forms.append(make_form(shape, distance, n_components=n_components, weighting=weighting))
    pairs = []
    for i, j in itertools.combinations(range(len(shapes)), 2):
        if i and not matrix:
            break
        names = f"{shapes[i].name} to {shapes[j].name}"
        found = areas = None
        if not known:
            areas = vertex_areas(shapes[i]), vertex_areas(shapes[j])
            found = match(
                shapes[i],
                shapes[j],
                progress=lambda stage, share, names=names: progress(  # type: ignore[misc]
                    f"{names}: {stage}", share
                ),
            )
        value = likeness(forms[i], forms[j], match=found, n_components=n_components, areas=areas)
        pairs.append(Pair(i, j, value, None if found is None else found.confidence))
    return pairs


def _square(pairs: list[Pair], n: int) -> list[list[float]]:
    table = [[1.0] * n for _ in range(n)]
    for pair in pairs:
        table[pair.model][pair.probe] = table[pair.probe][pair.model] = pair.similarity
    return table


def _lines(paths: list[str], ranked: list[Pair]) -> list[str]:
    matched = ranked[0].confidence is not None
    cells = [["probe", "similarity", "confidence of the match" if matched else ""]]
    for pair in ranked:
        trust = "" if pair.confidence is None else f"{pair.confidence:.2f}"
        cells.append([paths[pair.probe], f"{pair.similarity:.4f}", trust])
    return output.table("<>>", *cells)
