"""``unbend check``: what is wrong with meshes, and what unbend will do about it."""

from __future__ import annotations

from typing import Any

import typer

import unbend
from unbend._text import quoted
from unbend.cli._input import expand_folders
from unbend.cli._output import EXIT_REFUSED, progress, say, table, tell
from unbend.errors import InputError, UnbendError


def check(meshes: list[str]) -> None:
    """Report problems of meshes, and how unbend will handle them.

    Several meshes get one table, a line each; a file that cannot be read does not end the check.
    The exit code is 0 if unbend can use all meshes, perhaps with an option that it names, and 2 if
    not.

    $ unbend check cat.off
    $ unbend check scans/
    $ unbend check scan.ply --json
    """
    paths, found = expand_folders(meshes), []
    lines: list[str] = []
    for i, path in enumerate(paths):
        progress(f"{i + 1} of {len(paths)}, {path}", i / len(paths))
        one, lines = _checked(path)
        found.append(one)
    next_step = found[0]["next_step"]
    if len(found) > 1:
        lines, next_step = _overview(found), "unbend check MESH shows the details of one"
    tell({"files": found}, lines, next_step=next_step)
    if not all(one["usable"] for one in found):
        raise typer.Exit(EXIT_REFUSED)


def _checked(path: str) -> tuple[dict[str, Any], list[str]]:
    """Give what was found in a file, and all lines about it."""
    health: Any
    try:
        shape = unbend.read_mesh(path)
        health = unbend.diagnose(shape)
        usable, verdict, next_step = _judge(shape, health, path)
        notes, lines = shape.notes, [*_details(shape, health), "", verdict]
    except (UnbendError, MemoryError) as error:
        usable, verdict, next_step, notes, health, lines = False, str(error), None, (), None, []
        if isinstance(error, MemoryError):
            verdict = f"{path}: there is too little memory; reduce it to fewer vertices"
        say("error", verdict)
    one = {"file": path, "usable": usable, "verdict": verdict, "next_step": next_step}
    return one | {"notes": notes, "health": health}, lines


def _judge(
    shape: unbend.Mesh, health: unbend.preparation.Diagnosis, path: str
) -> tuple[bool, str, str | None]:
    """Try what computations will try: whether they can, in a sentence, and what to do next."""
    command = f"unbend canonical {quoted(path)} -o OUT.ply"
    several = health.n_components > 1
    try:
        prepared = unbend.preparation.prepare(shape, component="largest" if several else None)
    except InputError as refusal:
        return False, f"unbend cannot work with this mesh: {refusal}", None
    sentence = "unbend can work with this mesh."
    if shape.is_point_cloud:
        sentence = "unbend can work with this point cloud."
        try:
            unbend.preparation.surface_of_points(shape)
        except InputError as refusal:
            sentence = f"unbend can work with this point cloud, but cannot match it: {refusal}"
    elif several:
        sentence = "unbend can work with one component of this mesh."
        command = f"{command} --component largest"
    elif health.one_sided:
        sentence = "unbend can work with this mesh, but cannot match it."
    elif not (
        prepared.notes or health.inconsistent_edges or health.inside_out or health.seems_inside_out
    ):
        sentence = "This mesh is healthy."
    if wrong := unbend.preparation.describe_positions(prepared.mesh, prepared.kept):
        sentence = f"{sentence[:-1]}, but its {wrong}"
    return True, sentence, command


def _overview(found: list[dict[str, Any]]) -> list[str]:
    lines = [["mesh", "vertices", "faces", "components", "boundary edges", "verdict"]]
    for one in found:
        counts, health = ["-"] * 4, one["health"]
        if health is not None:
            numbers = health.n_vertices, health.n_faces, health.n_components, health.boundary_edges
            counts = [f"{number:,}" for number in numbers]
        lines.append([one["file"], *counts, one["verdict"]])
    return table("<>>>><", *lines)


def _details(shape: unbend.Mesh, health: unbend.preparation.Diagnosis) -> list[str]:
    """Facts about a mesh, then whatever is out of order."""
    lines = [(shape.name, "found", "what unbend does"), ("vertices", f"{shape.n_vertices:,}", "")]
    if shape.is_point_cloud:
        lines.append(("faces", "0", "treated as a point cloud"))
    else:
        lengths = (health.edge_min, health.edge_median, health.edge_max)
        sizes = ", ".join(f"{size:,}" for size in health.component_vertices[:4])
        sizes += ", ..." if health.n_components > 4 else ""
        several = f"matches the largest; else needs --component largest (vertices: {sizes})"
        loops = "1 loop" if health.boundary_loops == 1 else f"{health.boundary_loops:,} loops"
        boundary = "closed" if health.closed else f"keeps them ({loops})"
        is_long = health.edge_max > health.area**0.5 / 2
        long = "; divide long ones to register" if is_long else ""
        lines += [
            ("faces", f"{health.n_faces:,}", ""),
            ("components", f"{health.n_components:,}", "" if health.n_components == 1 else several),
            ("boundary edges", f"{health.boundary_edges:,}", boundary),
            ("genus", "-" if health.genus is None else str(health.genus), ""),
            ("area", f"{health.area:.4g}", ""),
            ("edge length", " / ".join(f"{x:.3g}" for x in lengths), f"min / median / max{long}"),
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
        (health.seam_vertices, "vertices doubled at seams", "joins the surface there"),
        (
            health.duplicate_vertices - health.seam_vertices,
            "duplicate vertices",
            "keeps them; merge them if unintended",
        ),
        (health.duplicate_faces, "duplicate faces", "leaves them out"),
    )
    lines += [(what, f"{count:,}", action) for count, what, action in problems if count]
    if health.inside_out:
        inward = "turns them to match; mirror the mesh instead if two axes were exchanged"
        lines.append(("faces", "inward", inward))
    elif health.seems_inside_out:
        lines.append(
            ("faces", "inward?", "keeps them: growth counts as loss; turn them if not hollow")
        )
    lines += [("reading", "", note) for note in shape.notes]
    return table("<><", *lines)
