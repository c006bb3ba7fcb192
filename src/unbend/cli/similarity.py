"""``unbend similarity``: how alike shapes are, whatever their poses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from unbend._text import printable
from unbend.choices import Axis, DistanceKind
from unbend.cli._common import (
    CacheOption,
    ComponentOption,
    JsonOption,
    UpOption,
    command_line,
    parse_component,
    print_json,
    print_notes,
    print_written,
    steps_on_stderr,
    write_table,
)

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
        list[str], typer.Argument(metavar="PROBES...", help="Meshes to compare it with.")
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
    n_components: Annotated[
        int, typer.Option("--n-components", help="Dimension that is compared.")
    ] = 3,
    distance: Annotated[
        DistanceKind, typer.Option("--distance", help="The distance that the forms approximate.")
    ] = "biharmonic",
    component: ComponentOption = None,
    csv: Annotated[
        str | None, typer.Option("--csv", metavar="OUT", help="Write the table, too.")
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure", metavar="PNG", help="With --matrix: a heat map (.png, .pdf, .svg)."
        ),
    ] = None,
    report: Annotated[
        str | None,
        typer.Option(
            "--report",
            metavar="HTML",
            help="Write a page to look at in a browser: the probes as pictures, the most alike "
            "first; with --matrix a heat map with its dendrogram, and pictures that open.",
        ),
    ] = None,
    up: UpOption = "y",
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Measure how similar shapes are, whatever their poses: 1 for the same shape.

    The measure is the cosine of the canonical forms after the best alignment.

    \b
    Examples:
      unbend similarity cat0.off cat1.off dog0.off
      unbend similarity wolf0.off wolf1.off wolf2.off --known-correspondence --json
      unbend similarity shapes/*.off --matrix --csv table.csv --figure heat.png
      unbend similarity cat0.off cat1.off dog0.off --matrix --report similarity.html
    """  # noqa: D301
    from unbend.errors import InputError
    from unbend.io import check_writable, read_mesh
    from unbend.preparation import only_component

    if figure is not None:
        check_writable(figure, (".png", ".pdf", ".svg"))
        if not matrix:
            raise InputError("a heat map shows all pairs; add --matrix to --figure")
    if csv is not None:
        check_writable(csv, (".csv",))
    if report is not None:
        check_writable(report, (".html",))
    paths = [model, *probes]
    with steps_on_stderr() as progress:
        progress("reading", 0)
        chosen = parse_component(component)
        shapes = [only_component(read_mesh(path), chosen) for path in paths]
        if known:
            _check_sizes(shapes)
        pairs = compare(shapes, known, matrix, n_components, distance, progress)
        table = _matrix(pairs, len(shapes)) if matrix else None
        if csv is not None:
            _write_csv(csv, paths, pairs, table)
        if figure is not None:
            from unbend.report.match_figures import draw_similarities

            draw_similarities([Path(path).stem for path in paths], table or [], figure)
        if report is not None:
            _write_page(report, shapes, pairs, table, up, progress)
    for shape in shapes:
        print_notes(shape.notes)
    if as_json:
        named = [
            pair._asdict() | {"model": paths[pair.model], "probe": paths[pair.probe]}
            for pair in pairs
        ]
        print_json({"pairs": named, "csv": csv, "figure": figure, "report": report})
        return
    if table is not None:
        _print_matrix([printable(path) for path in paths], table)
    else:
        _print_list([printable(path) for path in paths], pairs, known)
    print_written(csv, figure)
    if report is not None:
        typer.echo(f"next: open {report} in a browser")


def _check_sizes(shapes: list[Mesh]) -> None:
    from unbend.errors import InputError

    for shape in shapes[1:]:
        if shape.n_vertices != shapes[0].n_vertices:
            raise InputError(
                f"{shapes[0].name} and {shape.name} have {shapes[0].n_vertices} and "
                f"{shape.n_vertices} vertices, so they do not correspond one by one; leave out "
                "--known-correspondence"
            )


def compare(
    shapes: list[Mesh],
    known: bool,
    matrix: bool,
    n_components: int,
    distance: DistanceKind,
    progress: Progress,
) -> list[Pair]:
    """Compare the first shape with the others, or all with all; each form is computed once."""
    import itertools

    from unbend.canonical import canonical_form, sampled_canonical_form
    from unbend.correspondence import similarity as likeness
    from unbend.distances import SPECTRAL
    from unbend.matching import match
    from unbend.mesh import vertex_areas

    wanted = (
        itertools.combinations(range(len(shapes)), 2)
        if matrix
        else ((0, i) for i in range(1, len(shapes)))
    )
    forms = []
    for shape in shapes:
        progress(f"{shape.name}, canonical form", 0)
        make = canonical_form if distance in SPECTRAL else sampled_canonical_form
        form = make(
            shape,
            n_components=n_components,
            distance=distance,
            weighting="uniform" if known else "area",
        )
        forms.append(form)
    pairs = []
    for i, j in wanted:
        names = f"{shapes[i].name} to {shapes[j].name}"
        found = None
        if not known:
            found = match(
                shapes[i],
                shapes[j],
                progress=lambda stage, share, names=names: progress(  # type: ignore[misc]
                    f"{names}: {stage}", share
                ),
            )
        areas = None if known else (vertex_areas(shapes[i]), vertex_areas(shapes[j]))
        value = likeness(forms[i], forms[j], match=found, n_components=n_components, areas=areas)
        pairs.append(Pair(i, j, value, None if found is None else found.confidence))
    return pairs


def _matrix(pairs: list[Pair], n: int) -> list[list[float]]:
    table = [[1.0 if i == j else float("nan") for j in range(n)] for i in range(n)]
    for pair in pairs:
        table[pair.model][pair.probe] = table[pair.probe][pair.model] = pair.similarity
    return table


def _write_page(
    report: str,
    shapes: list[Mesh],
    pairs: list[Pair],
    table: list[list[float]] | None,
    up: Axis,
    progress: Progress,
) -> None:
    from unbend.report.pages import search_page, similarity_page

    told: dict[str, Any] = {"up": up, "command": command_line(), "progress": progress}
    if table is not None:
        similarity_page(shapes, table, report, **told)
        return
    pairs = sorted(pairs, key=lambda pair: -pair.similarity)
    probes, values = [shapes[one.probe] for one in pairs], [one.similarity for one in pairs]
    search_page(shapes[0], probes, values, report, measure="similarity", **told)


def _write_csv(
    out: str, paths: list[str], pairs: list[Pair], table: list[list[float]] | None
) -> None:
    if table is not None:
        rows = ([path, *row] for path, row in zip(paths, table, strict=True))
        write_table(out, [["shape", *paths], *rows])
    else:
        head = ["model", "probe", "similarity", "match_confidence"]
        write_table(out, [head, *([paths[one.model], paths[one.probe], *one[2:]] for one in pairs)])


def _print_list(paths: list[str], pairs: list[Pair], known: bool) -> None:
    width = max(len(paths[pair.probe]) for pair in pairs) + 2
    typer.echo(f"{'probe':<{width}}similarity" + ("" if known else "  confidence of the match"))
    for pair in sorted(pairs, key=lambda pair: -round(pair.similarity, 9)):
        trust = "" if pair.confidence is None else f"{pair.confidence:8.2f}"
        typer.echo(f"{paths[pair.probe]:<{width}}{pair.similarity:10.4f}{trust}")


def _print_matrix(paths: list[str], table: list[list[float]]) -> None:
    width = max(map(len, paths)) + 2
    typer.echo(" " * width + "".join(f"{i:>8}" for i in range(len(paths))))
    for i, (path, row) in enumerate(zip(paths, table, strict=True)):
        typer.echo(f"{path:<{width}}" + "".join(f"{value:8.4f}" for value in row) + f"  {i}")
