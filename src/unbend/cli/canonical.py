"""``unbend canonical``: the canonical form of a mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import Detail, DistanceKind, Interpolation, Method, Weighting
from unbend.cli._common import (
    CacheOption,
    ComponentOption,
    JsonOption,
    LaplacianOption,
    MeshArgument,
    RandomStateOption,
    TimeOption,
    UpOption,
    command_line,
    parse_component,
    print_json,
    print_notes,
    print_rows,
    steps_on_stderr,
)

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.canonical import CanonicalForm
    from unbend.mesh import Mesh

_MESH_SUFFIXES = (".ply", ".off", ".obj")
_TABLE_SUFFIXES = (".npy", ".csv")


def canonical(
    mesh: MeshArgument,
    out: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--out",
            metavar="OUT",
            help="Where to write the form: .ply, .off or .obj with the mesh's faces "
            "(dimension 3), .npy or .csv (any dimension).",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="PNG",
            help="Draw the shape beside its form (.png, .pdf, .svg), in the same colours.",
        ),
    ] = None,
    report: Annotated[
        str | None,
        typer.Option(
            "--report",
            metavar="HTML",
            help="Write a page to look at the form in a browser, beside the shape.",
        ),
    ] = None,
    up: UpOption = "y",
    n_components: Annotated[int, typer.Option("--n-components", help="Dimension of the form.")] = 3,
    distance: Annotated[
        DistanceKind, typer.Option("--distance", help="The distance that the form approximates.")
    ] = "biharmonic",
    method: Annotated[
        Method,
        typer.Option("--method", help="auto: exact where it exists (all but the geodesics)."),
    ] = "auto",
    weighting: Annotated[
        Weighting, typer.Option("--weighting", help="Weight vertices equally, or by their area.")
    ] = "uniform",
    n_eigenpairs: Annotated[
        int | None,
        typer.Option("--n-eigenpairs", help="Eigenfunctions of a sampled form, by default 100."),
    ] = None,
    n_samples: Annotated[
        int | None,
        typer.Option("--n-samples", help="Sampled vertices, likewise; by default 200."),
    ] = None,
    mu: Annotated[
        float | None,
        typer.Option("--mu", help="Weight of samples over smoothness, likewise; by default 1e4."),
    ] = None,
    interpolation: Annotated[
        Interpolation | None,
        typer.Option(
            "--interpolation", help="The paper's Eq. 15 (by default) or Eq. 14, likewise."
        ),
    ] = None,
    time: TimeOption = None,
    laplacian: LaplacianOption = "auto",
    component: ComponentOption = None,
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
    random_state: RandomStateOption = 0,
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Compute the canonical form of a mesh: a pose-invariant version of the shape.

    The form has the vertices of the mesh, in the same order. It has unit area unless --keep-scale
    is given.

    \b
    Examples:
      unbend canonical cat.off -o cat_canonical.ply
      unbend canonical cat.off -o cat_unbent.ply --detail preserved
      unbend canonical cat.off --report form.html --up z
      unbend canonical cat.off --detail preserved --figure form.pdf --up z
      unbend canonical cat.off -o cat.npy --n-components 10 --weighting area
      unbend canonical cat.off --distance geodesic --n-samples 300 --json
    """  # noqa: D301
    from unbend.canonical import canonical_form, lay_into_pose, sampled_canonical_form
    from unbend.distances import SPECTRAL
    from unbend.errors import InputError
    from unbend.io import check_writable, read_mesh

    exact = method == "exact" or (method == "auto" and distance in SPECTRAL)
    make: Callable[..., CanonicalForm] = canonical_form if exact else sampled_canonical_form
    given = {
        "n_eigenpairs": n_eigenpairs,
        "n_samples": n_samples,
        "mu": mu,
        "interpolation": interpolation,
    }
    sampling = {name: value for name, value in given.items() if value is not None}
    if exact and sampling:
        option = next(iter(sampling)).replace("_", "-")
        raise InputError(f"--{option} is for sampled forms; add --method sampled, or leave it out")
    if detail is not None and n_components < 3:
        raise InputError(f"--detail needs a form of at least 3 dimensions, not {n_components}")
    if out is not None:
        suffix = check_writable(out, _MESH_SUFFIXES + _TABLE_SUFFIXES).suffix.lower()
        if suffix in _MESH_SUFFIXES and n_components != 3:
            raise InputError(
                f"{suffix} files hold 3 dimensions, not {n_components}; write the form as .npy "
                "or .csv"
            )
    if figure is not None:
        check_writable(figure, (".png", ".pdf", ".svg"))
    if report is not None:
        check_writable(report, (".html",))
    with steps_on_stderr() as progress:
        progress("reading", 0)
        shape = read_mesh(mesh)
        form = make(
            shape,
            n_components=n_components,
            distance=distance,
            weighting=weighting,
            time=time,
            laplacian=laplacian,
            component=parse_component(component),
            keep_scale=keep_scale,
            random_state=random_state,
            progress=progress,
            **sampling,
        )
        posed = None
        if detail is not None:
            start = perf_counter()
            posed = lay_into_pose(shape, form, progress=progress)
            form = replace(form, seconds=form.seconds | {"detail": perf_counter() - start})
            posed = posed if keep_scale else posed / form.area**0.5
        if out is not None:
            progress("writing", 0)
            write_form(out, shape, form.points if posed is None else posed)
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
    print_notes(shape.notes)
    if as_json:
        files = {"out": out, "figure": figure, "report": report}
        _print_json(mesh, shape, form, files)
    else:
        _print_summary(shape, form, [path for path in (out, figure) if path], report)


def write_form(out: str, shape: Mesh, points: FloatArray) -> None:
    """Write points, one for each vertex of the shape, in the format that the suffix names."""
    import numpy as np

    from unbend.io import atomic_write, write_mesh
    from unbend.mesh import Mesh

    suffix = Path(out).suffix.lower()
    if suffix in _MESH_SUFFIXES:
        # Faces outside the chosen component have lost their vertices: no viewer could draw them.
        there = np.isfinite(points.sum(axis=1))
        faces = shape.faces if there.all() else shape.faces[there[shape.faces].all(axis=1)]
        write_mesh(out, Mesh(points, faces))
        return
    with atomic_write(out) as file:
        if suffix == ".npy":
            np.save(file, points)
        else:
            names = ",".join(f"x{i + 1}" for i in range(points.shape[1]))
            np.savetxt(file, points, "%.17g", ",", header=names, comments="")


def _print_json(mesh: str, shape: Mesh, form: CanonicalForm, files: dict[str, str | None]) -> None:
    print_json(
        {
            "mesh": mesh,
            **files,
            "vertices": shape.n_vertices,
            "faces": shape.n_faces,
            "method": form.method,
            "distance": form.distance,
            "weighting": form.weighting,
            "laplacian": form.laplacian,
            "area": form.area,
            "eigenvalues": form.eigenvalues,
            "stress": form.stress,
            "seconds": form.seconds,
            "warnings": [*shape.notes, *form.notes],
        }
    )


def _print_summary(
    shape: Mesh, form: CanonicalForm, written: list[str], report: str | None
) -> None:
    kind = f"{shape.n_faces:,} faces" if shape.n_faces else "a point cloud"
    shown = [f"{value:.5g}" for value in form.eigenvalues[:8]]
    rows = {
        "mesh": f"{shape.name}, {shape.n_vertices:,} vertices, {kind}",
        "form": f"{form.method} {form.distance}, {form.weighting} weights, "
        f"{form.laplacian} Laplacian",
        "eigenvalues": "  ".join(shown + ["..."] * (len(form.eigenvalues) > len(shown))),
        "stress": f"{form.stress:.3f}",
        "time": f"{sum(form.seconds.values()):.2f} s",
    }
    if written:
        rows["written"] = ", ".join(written)
    if report is not None:
        rows["next"] = f"open {report} in a browser"
    elif not written:
        rows["next"] = "add -o OUT.ply to write the form, --report HTML to look at it"
    print_rows(rows)
