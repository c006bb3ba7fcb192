"""What :func:`unbend.diagnose` finds, in plain words."""

from __future__ import annotations

from unbend._text import plural
from unbend.errors import InputError
from unbend.mesh import Mesh
from unbend.preparation import diagnose, prepare

_MANY = 200_000


def health(mesh: Mesh) -> tuple[bool, list[str]]:
    """Tell whether a shape can be used, and what should be known of it, a sentence each."""
    found = diagnose(mesh)
    told = list(mesh.notes)
    if mesh.is_point_cloud:
        told.append("These are points without faces. A surface between them is used.")
    try:
        prepare(mesh)
    except InputError as refusal:
        try:
            prepare(mesh, component="largest")
        except InputError:
            return False, [f"unbend cannot work with this shape: {refusal}"]
        told.append(
            f"It has {found.n_components:,} separate pieces; the largest is used. If that is "
            "wrong, delete the small pieces in a program such as MeshLab or Blender."
        )
    if found.one_sided:
        told.append("It has one side only, like a Möbius strip, and cannot be matched.")
    elif found.inconsistent_edges:
        told.append("Some faces point inward. They are turned; pictures may show spots.")
    if found.boundary_edges:
        told.append(
            f"It is open, with {plural(found.boundary_loops, 'hole')} or rims. That is fine."
        )
    if found.non_manifold_edges or found.non_manifold_vertices or found.degenerate_faces:
        told.append("Some faces are damaged. unbend works around them.")
    if found.unreferenced_vertices:
        told.append(f"{plural(found.unreferenced_vertices, 'vertex')} in no face: left out.")
    if found.duplicate_vertices and found.n_components > 1:
        told.append(
            "Some points lie exactly on others. If the surface is cut there, merge them first "
            "(in Blender: Merge by Distance)."
        )
    if mesh.n_vertices > _MANY:
        told.append("It is large: expect minutes. A reduced copy gives nearly the same map.")
    return True, told
