"""``unbend check``: what is wrong with a mesh, and what unbend will do about it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, NamedTuple

import typer

from unbend._text import printable
from unbend.cli._common import EXIT_REFUSED, JsonOption, MeshArgument, print_json, quoted

if TYPE_CHECKING:
    from unbend.mesh import Mesh
    from unbend.preparation import Diagnosis


# Columns without which numbers are cut; a terminal that has fewer breaks the lines itself.
_LEAST_WIDTH = 72


class Row(NamedTuple):
    """A line of the health table."""

    what: str
    value: str
    action: str


class Verdict(NamedTuple):
    """Whether unbend can work with a mesh, in a sentence, and what to do next."""

    usable: bool
    sentence: str
    next_step: str


def check(mesh: MeshArgument, as_json: JsonOption = False) -> None:
    """Report problems of a mesh, and how unbend will handle them.

    The exit code is 0 if unbend can use the mesh, perhaps with an option that it names, and 2 if
    not.

    \b
    Examples:
      unbend check cat.off
      unbend check scan.ply --json
    """  # noqa: D301 - \b is one character here: it keeps the lines of the examples
    from unbend.io import read_mesh
    from unbend.preparation import diagnose

    shape = read_mesh(mesh)
    health = diagnose(shape)
    verdict = judge(shape, health, mesh)
    if as_json:
        print_json(
            {
                "file": mesh,
                "notes": shape.notes,
                **dataclasses.asdict(health),
                "usable": verdict.usable,
                "verdict": verdict.sentence,
                "next_step": verdict.next_step,
            }
        )
    else:
        _print_table(shape, health, verdict)
    if not verdict.usable:
        raise typer.Exit(EXIT_REFUSED)


def judge(shape: Mesh, health: Diagnosis, path: str) -> Verdict:
    """Try what computations will try."""
    from unbend.errors import InputError
    from unbend.preparation import prepare

    command = f"unbend canonical {quoted(path)} -o OUT.ply"
    try:
        prepared = prepare(shape)
    except InputError as refusal:
        try:
            prepare(shape, component="largest")
        except InputError:
            return Verdict(False, f"unbend cannot work with this mesh: {refusal}", "")
        return Verdict(
            True,
            "unbend can work with one component of this mesh.",
            f"{command} --component largest",
        )
    all_of_it = len(prepared.kept) == prepared.n_original and not prepared.robust_needed
    if health.one_sided:
        return Verdict(True, "unbend can work with this mesh, but cannot match it.", command)
    sentence = "This mesh is healthy." if all_of_it else "unbend can work with this mesh."
    return Verdict(True, sentence, command)


def table_rows(shape: Mesh, health: Diagnosis) -> list[Row]:
    """All lines of the table: facts first, then whatever is out of order."""
    rows = [Row("vertices", f"{health.n_vertices:,}", "")]
    if shape.is_point_cloud:
        rows.append(Row("faces", "0", "treated as a point cloud"))
    else:
        rows.append(Row("faces", f"{health.n_faces:,}", ""))
        rows.append(_component_row(health))
        rows.append(_boundary_row(health))
        rows.append(Row("genus", "-" if health.genus is None else str(health.genus), ""))
        rows.append(Row("area", f"{health.area:.4g}", ""))
        lengths = (health.edge_min, health.edge_median, health.edge_max)
        rows.append(
            Row("edge length", " / ".join(f"{x:.3g}" for x in lengths), "min / median / max")
        )
    collapsed, branching = "leaves them out", "leaves out the faces that repeat others"
    if health.robust_needed:
        branching = "uses the robust Laplacian"
        collapsed = f"{branching}, or leaves them out"
    turned = "nothing; it does not matter"
    if health.one_sided:
        turned = "one side only: match refuses it"
    problems = (
        (health.degenerate_faces, "degenerate faces", collapsed),
        (health.non_manifold_edges, "non-manifold edges", branching),
        (health.non_manifold_vertices, "non-manifold vertices", branching),
        (health.inconsistent_edges, "edges with flipped faces", turned),
        (health.unreferenced_vertices, "unreferenced vertices", "gives them NaN"),
        (health.duplicate_vertices, "duplicate vertices", "keeps them; merge them if unintended"),
        (health.duplicate_faces, "duplicate faces", "leaves them out"),
    )
    rows += [Row(what, f"{count:,}", action) for count, what, action in problems if count]
    rows += [Row("reading", "", note) for note in shape.notes]
    return rows


def _component_row(health: Diagnosis) -> Row:
    sizes = ", ".join(f"{size:,}" for size in health.component_vertices[:4])
    if health.n_components == 1:
        return Row("components", "1", "")
    more = ", ..." if health.n_components > 4 else ""
    action = f"needs --component largest (vertices: {sizes}{more})"
    return Row("components", f"{health.n_components:,}", action)


def _boundary_row(health: Diagnosis) -> Row:
    if health.closed:
        return Row("boundary edges", "0", "closed")
    loops = "1 loop" if health.boundary_loops == 1 else f"{health.boundary_loops:,} loops"
    return Row("boundary edges", f"{health.boundary_edges:,}", f"keeps them ({loops})")


def _print_table(shape: Mesh, health: Diagnosis, verdict: Verdict) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, title_justify="left", header_style="bold")
    table.add_column(Text(printable(shape.name)), no_wrap=True)
    table.add_column("found", justify="right", no_wrap=True)
    table.add_column("what unbend does", overflow="fold")
    for row in table_rows(shape, health):
        # Text: file names and notes may hold [brackets]
        table.add_row(*(Text(printable(cell)) for cell in row))
    console = Console(highlight=False)
    console.width = max(console.width, _LEAST_WIDTH)
    console.print(table)
    console.print()
    style = "green" if verdict.usable else "red"
    console.print(Text(printable(verdict.sentence), style=style), soft_wrap=True)
    if verdict.next_step:
        console.print(Text(f"Next: {verdict.next_step}"), soft_wrap=True)
