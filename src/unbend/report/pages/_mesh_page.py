"""A page with one mesh, shown in notebooks."""

from __future__ import annotations

from html import escape

from unbend.errors import InputError
from unbend.io import MeshLike, as_mesh
from unbend.report.pages._document import Page, canvas, controls, make_page, readout
from unbend.report.pages._packing import pack_places
from unbend.report.pages._shown import cells_of, places_as_colors, show

# Notebooks are saved with what they show, so their pages must be small.
_MOST_VERTICES = 20_000
_HINT = (
    "Point at a place to read its vertex. Drag to turn, shift-drag to shift, wheel or + and - to "
    "zoom, 0 to start over."
)


def mesh_page(mesh: MeshLike) -> Page:
    """Put a mesh onto a page, which a notebook shows.

    Parameters
    ----------
    mesh : mesh-like
        Anything :func:`unbend.as_mesh` accepts, with faces. Of more than 20,000 vertices, so many
        are drawn.

    Returns
    -------
    Page

    Raises
    ------
    InputError
        If the mesh has no faces.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from unbend.report import mesh_page
    >>> mesh_page(make_sphere(2))
    Page('sphere', 0.0 MB)
    """
    mesh = as_mesh(mesh)
    if mesh.is_point_cloud:
        raise InputError(f"{mesh.name} has no faces to draw")
    shown = show(mesh, _MOST_VERTICES)
    facts = [
        f"{mesh.n_vertices:,} vertices, {mesh.n_faces:,} faces",
        *mesh.notes,
        *shown.facts(mesh),
    ]
    return make_page(
        title=mesh.name,
        heading=escape(mesh.name),
        lead="; ".join(facts),
        body=f"""{controls("", "y", several=False)}
<div class="pair">{canvas("shape", mesh.name, f"The mesh {mesh.name}.", "vertex")}</div>
{readout(_HINT)}""",
        data={
            "shape": shown.packed(mesh.vertices)
            | {"colors": pack_places(places_as_colors(mesh, shown)[shown.ids])},
            "cells": cells_of(mesh.vertices[shown.ids]),
        },
        scripts=("mesh.js",),
    )
