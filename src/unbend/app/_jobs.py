"""What the app does with shapes, each by the same public functions as the command line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from unbend._types import Progress
from unbend.app import _matching, _uses
from unbend.app._health import health
from unbend.app._work import Result, Work, begin
from unbend.datasets import make_quadruped
from unbend.io import write_mesh


def look(work: Work) -> Result:
    """Draw a shape, and say what should be known of it."""
    (mesh,) = work.meshes
    work.progress("checking", 0.3)
    usable, told = health(mesh)
    work.progress("drawing", 0.6)
    work.draw(mesh.name, mesh)
    kind = f"{mesh.n_faces:,} faces" if mesh.n_faces else "points only"
    size = f"{mesh.n_vertices:,} vertices, {kind}"
    return {"size": size, "usable": usable, "told": told, "pictures": work.pictures}


def sample(work: Work) -> Result:
    """Make two dogs with different meshes."""
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
    """Run a job of JSON: what to do, the shapes, the folder for files, and options."""
    given = {key: job.pop(key) for key in ("folder", "shapes", "up")}
    return JOBS[job.pop("do")](begin(progress=progress, **given), **job)
