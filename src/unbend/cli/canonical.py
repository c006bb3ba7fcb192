"""``unbend canonical``: the canonical form of a mesh."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from unbend.choices import Detail, DistanceKind, Weighting
from unbend.cli import _options as options
from unbend.cli._input import make_form, parse_component
from unbend.cli._output import (
    command_line,
    lines_to_keep,
    look_at,
    progress_on_stderr,
    rows,
    tell,
    write_columns,
)

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.canonical import CanonicalForm
    from unbend.mesh import Mesh

_MESH_SUFFIXES = (".ply", ".off", ".obj", ".glb", ".vtp")
_TABLE_SUFFIXES = (".npy", ".csv")


def canonical(
    mesh: options.Mesh,
    out: Annotated[
        str | None,
        options.out(
            "Where to write the form: .ply, .off, .obj, .glb or .vtp with the mesh's faces "
            "(dimension 3; from .obj to .obj texture, materials, groups and polygons stay), .npy "
            "or .csv (any dimension)."
        ),
    ] = None,
    figure: Annotated[
        str | None, options.figure("Draw the shape beside its form, in the same colours")
    ] = None,
    report: Annotated[
        str | None,
        options.report("Write a page to look at the form in a browser, beside the shape."),
    ] = None,
    up: options.Up = "y",
    n_components: Annotated[int, typer.Option("--n-components", help="Dimension of the form.")] = 3,
    distance: Annotated[
        DistanceKind, typer.Option("--distance", help="The distance that the form approximates.")
    ] = "biharmonic",
    weighting: Annotated[
        Weighting, typer.Option("--weighting", help="Weight vertices equally, or by their area.")
    ] = "uniform",
    n_samples: Annotated[
        int | None,
        typer.Option(
            "--n-samples",
            help="Compute the paper's form, from so many vertices, instead of the exact one. "
            "Geodesic distances have no exact form; for them it is 200 by default.",
        ),
    ] = None,
    n_eigenpairs: Annotated[
        int | None,
        typer.Option(
            "--n-eigenpairs", help="Eigenfunctions of the paper's form, likewise; 100 by default."
        ),
    ] = None,
    laplacian: options.Laplacian = "auto",
    component: options.Component = None,
    keep_scale: Annotated[
        bool,
        typer.Option("--keep-scale", help="Keep the mesh's unit; otherwise its area becomes 1."),
    ] = False,
    detail: Annotated[
        Detail | None,
        typer.Option(
            "--detail",
            help="preserved: write the surface itself instead of the form, deformed as rigidly as "
            "possible into the form's pose.",
        ),
    ] = None,
    cache: options.Cache = True,
) -> None:
    """Compute the canonical form of a mesh: a pose-invariant version of the shape.

    The form has the vertices of the mesh, in the same order. It has unit area unless --keep-scale
    is given.

    Examples
    --------
      unbend canonical cat.off -o cat_canonical.ply
      unbend canonical cat.off -o cat_unbent.ply --detail preserved
      unbend canonical cat.off --report form.html --up z
      unbend canonical cat.off --detail preserved --figure form.pdf --up z
      unbend canonical cat.off -o cat.npy --n-components 10 --weighting area
      unbend canonical cat.off --distance geodesic --n-samples 300 --json
    """
    from unbend.canonical import lay_into_pose
    from unbend.errors import InputError
    from unbend.io import check_writable, read_mesh

    if detail is not None and n_components < 3:
        raise InputError(f"--detail needs a form of at least 3 dimensions, not {n_components}")
    if out is not None:
        suffix = check_writable(out, _MESH_SUFFIXES + _TABLE_SUFFIXES).suffix.lower()
        if suffix in _MESH_SUFFIXES and n_components != 3:
            raise InputError(
                f"{suffix} files hold 3 dimensions, not {n_components}; write the form as .npy "
                "or .csv"
            )
    given = {"n_samples": n_samples, "n_eigenpairs": n_eigenpairs}
    with progress_on_stderr() as progress:
        progress("reading", 0)
        shape = read_mesh(mesh)
        form = make_form(
            shape,
            distance,
            {name: number for name, number in given.items() if number is not None},
            n_components=n_components,
            weighting=weighting,
            laplacian=laplacian,
            component=parse_component(component),
            keep_scale=keep_scale,
            progress=progress,
        )
        posed = None
        if detail is not None:
            start = perf_counter()
            posed = lay_into_pose(shape, form, progress=progress)
            form = replace(form, seconds=form.seconds | {"detail": perf_counter() - start})
            posed = posed if keep_scale else posed / form.area**0.5
        if out is not None:
            progress("writing", 0)
            _write(out, mesh, shape, form.points if posed is None else posed)
        if figure is not None:
            from unbend.report.form_figures import draw_form

            progress("drawing", 0)
            draw_form(shape, form, figure, posed=posed, up=up)
        if report is not None:
            from unbend.report.pages import form_page

            form_page(
                shape,
                form,
                report,
                posed=posed,
                up=up,
                keep_scale=keep_scale,
                command=command_line(),
                progress=progress,
            )
    tell(
        {"file": mesh, "n_vertices": shape.n_vertices, "n_faces": shape.n_faces, **_numbers(form)},
        rows(_summary(shape, form)),
        shapes=[shape],
        written=[out, figure, report],
        next_step=look_at(report)
        or (
            None
            if out or figure
            else "add -o OUT.ply to write the form, --report HTML to look at it"
        ),
    )


def _write(out: str, path: str, shape: Mesh, points: FloatArray) -> None:
    """Write points, one for each vertex of the shape, in the format that the suffix names."""
    import numpy as np

    from unbend.io import write_mesh
    from unbend.mesh import Mesh

    if not out.lower().endswith(_MESH_SUFFIXES):
        write_columns(out, points, [f"x{i + 1}" for i in range(points.shape[1])])
        return
    # Faces outside the chosen component have lost their vertices: no viewer could draw them.
    there = np.isfinite(points.sum(axis=1))
    faces = shape.faces if there.all() else shape.faces[there[shape.faces].all(axis=1)]
    like = lines_to_keep(out, path, whole=len(faces) == shape.n_faces)
    write_mesh(out, Mesh(points, faces), like=like)


def _numbers(form: CanonicalForm) -> dict[str, Any]:
    names = ("method", "distance", "weighting", "laplacian", "area", "eigenvalues", "stress")
    return {name: getattr(form, name) for name in names} | {"steps": form.seconds}


def _summary(shape: Mesh, form: CanonicalForm) -> dict[str, str]:
    kind = f"{shape.n_faces:,} faces" if shape.n_faces else "a point cloud"
    shown = [f"{value:.5g}" for value in form.eigenvalues[:8]]
    return {
        "mesh": f"{shape.name}, {shape.n_vertices:,} vertices, {kind}",
        "form": f"{form.method} {form.distance}, {form.weighting} weights, "
        f"{form.laplacian} Laplacian",
        "eigenvalues": "  ".join(shown + ["..."] * (len(form.eigenvalues) > len(shown))),
        "stress": f"{form.stress:.3f}",
        "time": f"{sum(form.seconds.values()):.2f} s",
    }
