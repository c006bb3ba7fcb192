"""``unbend check``: what is wrong with meshes, and what unbend will do about it."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from unbend._text import quoted
from unbend.cli._batch import expand_folders
from unbend.cli._output import EXIT_REFUSED, progress_on_stderr, say, table, tell
from unbend.errors import UnbendError

if TYPE_CHECKING:
    from unbend.mesh import Mesh
    from unbend.preparation import Diagnosis


class Verdict(NamedTuple):
    """Whether unbend can work with a mesh, in a sentence, and what to do next."""

    usable: bool
    sentence: str
    next_step: str | None = None


class Checked(NamedTuple):
    """What was found in a file; no health where it could not be read."""

    file: str
    verdict: Verdict
    health: Diagnosis | None = None
    name: str = ""
    notes: tuple[str, ...] = ()


def check(
    meshes: Annotated[
        list[str],
        typer.Argument(
            metavar="MESHES", help=".off, .obj, .ply, .stl, .xyz or .npy files, or folders of them."
        ),
    ],
) -> None:
    """Report problems of meshes, and how unbend will handle them.

    Several meshes get one table, a line each; a file that cannot be read does not end the check.
    The exit code is 0 if unbend can use all meshes, perhaps with an option that it names, and 2 if
    not.

    Examples
    --------
      unbend check cat.off
      unbend check scans/
      unbend check scan.ply --json
    """
    paths = expand_folders(meshes)
    with progress_on_stderr() as progress:
        found = []
        for i, path in enumerate(paths):
            progress(f"{i + 1} of {len(paths)}, {path}", i / len(paths))
            found.append(_checked(path))
    several = len(found) > 1
    tell(
        {"files": [_as_dict(one) for one in found]},
        _overview(found) if several else _details(found[0]),
        next_step="unbend check MESH shows the details of one"
        if several
        else found[0].verdict.next_step,
    )
    if not all(one.verdict.usable for one in found):
        raise typer.Exit(EXIT_REFUSED)


def _checked(path: str) -> Checked:
    from unbend.io import read_mesh
    from unbend.preparation import diagnose

    try:
        shape = read_mesh(path)
        health = diagnose(shape)
    except UnbendError as error:
        say("error", str(error))
        return Checked(path, Verdict(False, str(error)))
    return Checked(path, _judge(shape, health, path), health, shape.name, shape.notes)


def _judge(shape: Mesh, health: Diagnosis, path: str) -> Verdict:
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
            return Verdict(False, f"unbend cannot work with this mesh: {refusal}")
        sentence = "unbend can work with one component of this mesh."
        return Verdict(True, sentence, f"{command} --component largest")
    if health.one_sided:
        return Verdict(True, "unbend can work with this mesh, but cannot match it.", command)
    as_it_is = len(prepared.kept) == prepared.n_original and not prepared.robust_needed
    healthy = as_it_is and not health.inconsistent_edges
    sentence = "This mesh is healthy." if healthy else "unbend can work with this mesh."
    return Verdict(True, sentence, command)


def _as_dict(one: Checked) -> dict[str, Any]:
    return {
        "file": one.file,
        "usable": one.verdict.usable,
        "verdict": one.verdict.sentence,
        "next_step": one.verdict.next_step,
        "notes": one.notes,
        "health": None if one.health is None else dataclasses.asdict(one.health),
    }


def _overview(found: list[Checked]) -> list[str]:
    lines = [["mesh", "vertices", "faces", "components", "boundary edges", "verdict"]]
    for one in found:
        health = one.health
        counts = ["-"] * 4
        if health is not None:
            numbers = (
                health.n_vertices,
                health.n_faces,
                health.n_components,
                health.boundary_edges,
            )
            counts = [f"{number:,}" for number in numbers]
        lines.append([one.file, *counts, one.verdict.sentence])
    return table("<>>>><", *lines)


def _details(one: Checked) -> list[str]:
    """All lines about a mesh: facts first, then whatever is out of order, and the verdict."""
    health = one.health
    if health is None:
        return []
    lines = [(one.name, "found", "what unbend does"), ("vertices", f"{health.n_vertices:,}", "")]
    if not health.n_faces:
        lines.append(("faces", "0", "treated as a point cloud"))
    else:
        lengths = (health.edge_min, health.edge_median, health.edge_max)
        lines += [
            ("faces", f"{health.n_faces:,}", ""),
            ("components", f"{health.n_components:,}", _component_action(health)),
            ("boundary edges", f"{health.boundary_edges:,}", _boundary_action(health)),
            ("genus", "-" if health.genus is None else str(health.genus), ""),
            ("area", f"{health.area:.4g}", ""),
            ("edge length", " / ".join(f"{x:.3g}" for x in lengths), "min / median / max"),
        ]
    collapsed, branching = "leaves them out", "leaves out the faces that repeat others"
    if health.robust_needed:
        branching = "uses the robust Laplacian"
        collapsed = f"{branching}, or leaves them out"
    turned = "turns them to match; pictures may show spots"
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
    lines += [(what, f"{count:,}", action) for count, what, action in problems if count]
    lines += [("reading", "", note) for note in one.notes]
    return [*table("<><", *lines), "", one.verdict.sentence]


def _component_action(health: Diagnosis) -> str:
    if health.n_components == 1:
        return ""
    sizes = ", ".join(f"{size:,}" for size in health.component_vertices[:4])
    more = ", ..." if health.n_components > 4 else ""
    return f"matches the largest; else needs --component largest (vertices: {sizes}{more})"


def _boundary_action(health: Diagnosis) -> str:
    if health.closed:
        return "closed"
    loops = "1 loop" if health.boundary_loops == 1 else f"{health.boundary_loops:,} loops"
    return f"keeps them ({loops})"
