"""What the app does with shapes, each by the same public functions as the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from unbend._text import plural
from unbend._types import Progress
from unbend.app import _matching, _uses
from unbend.app._work import Result, Work
from unbend.datasets import make_quadruped
from unbend.errors import InputError
from unbend.io import read_mesh, write_mesh
from unbend.mesh import Mesh
from unbend.preparation import diagnose, prepare

_MANY = 200_000


def look(work: Work) -> Result:
    """Draw a shape, and say what should be known of it."""
    (mesh,) = work.meshes
    work.progress("checking", 0.3)
    usable, told = _health(mesh)
    work.progress("drawing", 0.6)
    work.draw(mesh.name, mesh)
    kind = f"{mesh.n_faces:,} faces" if mesh.n_faces else "points only"
    size = f"{mesh.n_vertices:,} vertices, {kind}"
    return {"size": size, "usable": usable, "told": told, "pictures": work.pictures}


def _health(mesh: Mesh) -> tuple[bool, list[str]]:
    """Tell whether a shape can be used, and what should be known of it, a sentence each."""
    found = diagnose(mesh)
    several = found.n_components > 1
    try:
        prepare(mesh, component="largest" if several else None)
    except InputError as refusal:
        return False, [f"unbend cannot work with this shape: {refusal}"]
    pieces = (
        f"It has {found.n_components:,} separate pieces; the largest is used. If that is wrong, "
        "delete the small pieces in a program such as MeshLab or Blender."
    )
    holes, loose = plural(found.boundary_loops, "hole"), found.unreferenced_vertices
    turned = found.inconsistent_edges and not found.one_sided
    damaged = found.non_manifold_edges or found.non_manifold_vertices or found.degenerate_faces
    problems = (
        (mesh.is_point_cloud, "These are points without faces. A surface between them is used."),
        (several, pieces),
        (found.one_sided, "It has one side only, like a Möbius strip, and cannot be matched."),
        (
            found.inside_out,
            "Its faces point inward. They are turned. If left and right look exchanged, mirror it.",
        ),
        (
            found.seems_inside_out,
            "It is open, and its faces seem to point inward. If they should not, turn them.",
        ),
        (turned, "Some faces point inward. They are turned; pictures may show spots."),
        (found.boundary_edges, f"It is open, with {holes} or boundaries. That is fine."),
        (damaged, "Some faces are damaged. unbend works around them."),
        (loose, f"{plural(loose, 'vertex')} in no face: left out."),
        (found.seam_vertices, "It is cut open along seams, as of a texture. It is joined there."),
        (
            mesh.n_vertices > _MANY,
            "It is large: expect minutes. A reduced copy gives nearly the same map.",
        ),
    )
    return True, [*mesh.notes, *(sentence for is_so, sentence in problems if is_so)]


def sample(work: Work) -> Result:
    for i, pose in enumerate(("standing", "galloping")):
        work.progress("making two dogs", i / 2)
        mesh = make_quadruped(pose, n_vertices=2600 - 400 * i, meshing=i).mesh
        write_mesh(work.new_file(f"dog-{pose}.ply", "a sample"), mesh)
    return {"samples": work.files}


JOBS: dict[str, Callable[..., Result]] = {
    one.__name__: one
    for one in (
        *(look, sample),
        *(_matching.match, _matching.choose, _matching.symmetry, _matching.landmarks),
        *(_uses.distance, _uses.form, _uses.search, _uses.groups),
        *(_uses.transfer, _uses.register, _uses.morph),
    )
}


def run(job: dict[str, Any], progress: Progress) -> Result:
    """Run a job of JSON.

    It says what to do, where the files go, the shapes (each a path, and the name that the user
    knows it by), perhaps their map, and options.
    """
    folder, paths, meshes = Path(job.pop("folder")), [], []
    folder.mkdir()
    for path, name in job.pop("shapes"):
        progress(f"reading {name}", 0.0)
        meshes.append(replace(read_mesh(path), name=name))
        paths.append(path)
    known = {key: job.pop(key) for key in ("map_file", "map_name") if key in job}
    work = Work(folder, progress, job.pop("up"), paths, meshes, **known)
    return JOBS[job.pop("do")](work, **job)
