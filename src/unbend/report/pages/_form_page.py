"""A page with a shape, its canonical form and its spectrum."""

from __future__ import annotations

from html import escape

import numpy as np

from unbend._display import table
from unbend._types import BoolArray, FloatArray, Progress, StrPath
from unbend.canonical import CanonicalForm, check_form
from unbend.choices import Axis
from unbend.distances import spectral_filter
from unbend.errors import heard
from unbend.io import MeshLike
from unbend.mesh import Mesh
from unbend.preparation import join_seams
from unbend.report.figures import drawable
from unbend.report.pages import _document as parts
from unbend.report.pages._document import Page
from unbend.report.pages._shown import Shown, pack_places, pack_whole, show
from unbend.report.shape_figures import posed_to_fit, turned_to_fit
from unbend.spectral import spectrum

# Eigenfunctions that distances on the page are summed over, and eigenfunctions to choose from.
_N_EIGENPAIRS, _OFFERED = 60, 12
# Distances on the page are exact to this share of the widest coordinate of their embedding.
_STEPS = 2**13


def form_page(
    mesh: MeshLike,
    form: CanonicalForm,
    path: StrPath | None = None,
    *,
    posed: FloatArray | None = None,
    up: Axis = "y",
    keep_scale: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> Page:
    """Write a canonical form as a page that opens in any browser, without a network.

    The shape and its form turn together, the same place in the same colour; both can be coloured
    by the first eigenfunctions and by the biharmonic distance from any vertex. Below are the
    spectrum and the form's eigenvalues and stress.

    Parameters
    ----------
    mesh, form, posed
        As for :func:`draw_form`.
    keep_scale : bool, default=False
        Whether the form was made with this option.
    path, up, command, progress
        As for :func:`match_page`.

    Returns
    -------
    Page

    Raises
    ------
    InputError, FileError
        If the form is of another mesh, there is no such axis, or the file cannot be written.

    Notes
    -----
    At most 60,000 vertices are drawn, and the first three dimensions of a form. Distances on the
    page are biharmonic, whatever the form's, and use the first 60 eigenfunctions.

    Examples
    --------
    >>> from unbend import canonical_form
    >>> from unbend.report import form_page
    >>> from unbend.datasets import make_octopus
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> form_page(mesh, canonical_form(mesh), "form.html")
    Page('octopus, canonical form', 0.1 MB)
    """
    step = parts.begin_page(path, up, progress)
    mesh = drawable(mesh)
    check_form(mesh, form)
    step("page, places", 0.0)
    inside = np.asarray(np.isfinite(form.points).all(axis=1))
    shown = show(mesh)
    surface = None
    if posed is not None:
        surface = shown.moved(posed_to_fit(posed, inside[:, None], mesh))
    step("page, eigenfunctions", 0.2)
    values, embedding = _embedding(mesh, form, inside)
    # Length in the form of a biharmonic distance of 1.
    unit = float(np.sqrt(form.area)) if keep_scale else 1.0
    embedding = embedding[shown.ids]
    exact = float(np.ptp(embedding[inside[shown.ids]])) / _STEPS
    return parts.make_page(
        f"{mesh.name}, canonical form",
        f"{form.method} {form.distance} form of {int(inside.sum()):,} vertices; "
        f"stress {form.stress:.3f}.",
        [
            _pictures(mesh.name, up, min(_OFFERED, embedding.shape[1]), surface is not None),
            '<div class="columns">',
            parts.section(
                "Spectrum",
                parts.dots_svg(values),
                parts.hint(
                    "The lowest eigenvalues of the shape's Laplacian. They are the same in every "
                    "pose."
                ),
            ),
            _form_facts(form),
            "</div>",
            _facts(shown, form, command),
        ],
        {
            "shape": shown.packed() | {"known": pack_whole(inside[shown.ids])},
            "form": shown.moved(turned_to_fit(form.points, mesh)),
            "surface": surface,
            "embedding": pack_places(embedding, exact),
            "unit": unit if form.distance == "biharmonic" and form.points.shape[1] < 4 else None,
        },
        ["form.js"],
        path=path,
        heading=f'{escape(mesh.name)} <span class="arrow">and</span> its canonical form',
    )


def _embedding(mesh: Mesh, form: CanonicalForm, inside: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvalues at unit area, and eigenfunctions whose Euclidean distances are biharmonic."""
    part = Mesh(mesh.vertices, mesh.faces[inside[mesh.faces].all(axis=1)], name=mesh.name)
    part = join_seams(part)[0]
    with heard():  # canonical_form has warned already
        count = min(_N_EIGENPAIRS + 1, int(inside.sum()) // 2)
        found = spectrum(part, count, laplacian=form.laplacian)  # type: ignore[arg-type]
    values = found.eigenvalues * form.area
    weights = np.sqrt(spectral_filter("biharmonic", values, 1.0)) * np.sqrt(form.area)
    return values, (found.eigenfunctions * weights)[:, 1:]


def _pictures(name: str, up: str, n_functions: int, detailed: bool) -> str:
    paints = {"place": "same place, same colour", "distance": "distance from the clicked vertex"}
    paints |= {f"function-{k}": f"eigenfunction {k + 1}" for k in range(n_functions)}
    own = parts.select("Colours", "paint", paints | {"plain": "plain"}) + (
        '<label>Thicken the form <input type="range" id="thicken" min="0" max="4" step="0.25" '
        'value="1.5"></label>'
    )
    same = "The same place has the same colour on the shape and on its form."
    views = [
        parts.canvas("shape", f"Shape: {name}", f"The shape {name}. {same}", "shape-vertex"),
        parts.canvas("form", "Its canonical form", f"The canonical form of {name}. {same}"),
    ]
    if detailed:
        views.append(
            parts.canvas("surface", "The surface in its form's pose", f"{name}, unbent. {same}")
        )
    usage = "Click on a place to keep it, and point at another to read how far apart they are."
    return parts.side_by_side(own, up, views, usage)


def _form_facts(form: CanonicalForm) -> str:
    values = form.eigenvalues[:8]
    rows = [(f"eigenvalue {i + 1}", f"{value:.5g}") for i, value in enumerate(values)]
    meaning = (
        "An eigenvalue is how far the form reaches along one of its axes, squared and summed "
        "over vertices. Stress is how far straight distances within the form miss the "
        f"{escape(form.distance)} distances on the shape: 0 is perfect. "
        "Of more than three dimensions the first three are drawn."
    )
    return parts.section(
        "Form", table([*rows, ("stress", f"{form.stress:.4f}")]), parts.hint(meaning)
    )


def _facts(shown: Shown, form: CanonicalForm, command: str) -> str:
    mesh = shown.mesh
    kind = f"{form.method} {form.distance}, {form.weighting} weights, {form.laplacian} Laplacian"
    display = (
        "the form is rotated or reflected as a whole to align with the shape; its surface is drawn "
        "thicker on each side by the chosen number of pixels"
    )
    distances = (
        f"biharmonic, at unit area, summed over the first {_N_EIGENPAIRS} eigenfunctions at most"
    )
    rows = [
        ("shape", f"{mesh.name}; {shown.size}"),
        ("done to it", "; ".join([*mesh.notes, *form.notes, *shown.facts]) or "nothing"),
        ("form", kind),
        ("for display", display),
        ("distances here", distances),
    ]
    return parts.how_made(rows, command)
