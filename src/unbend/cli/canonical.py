"""``unbend canonical``: the canonical forms of meshes."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

import unbend
from unbend.choices import Axis, Detail, DistanceKind, LaplacianKind, Weighting
from unbend.cli import _options as options
from unbend.cli import _output as output
from unbend.cli._input import expand_folders, is_batch, make_form
from unbend.errors import InputError, UnbendError

if TYPE_CHECKING:
    from unbend._types import FloatArray

_MESH_SUFFIXES = (".ply", ".off", ".obj", ".glb", ".vtp")
_TOLD = ("method", "distance", "weighting", "laplacian", "area", "eigenvalues", "stress")


def canonical(
    meshes: list[str],
    out: Annotated[str | None, options.out()] = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
    n_components: int = 3,
    distance: DistanceKind = "biharmonic",
    weighting: Weighting = "uniform",
    n_samples: int | None = None,
    n_eigenpairs: int | None = None,
    laplacian: LaplacianKind = "auto",
    component: options.Component = None,
    keep_scale: Annotated[bool, typer.Option("--keep-scale")] = False,
    detail: Detail | None = None,
    cache: options.Cache = True,
) -> None:
    """Compute the canonical form of meshes: a pose-invariant version of each shape.

    The form has the vertices of the mesh, in the same order. Its unit of length is the square root
    of the mesh's area, unless --keep-scale is given. Several meshes get one table, and a file each
    in the format of the mesh if that holds the form, else .ply or .npy; those that cannot be used
    are listed, with exit code 1.

      out: Where to write the form: .ply, .off, .obj, .glb or .vtp with the mesh's faces (dimension
          3; from .obj to .obj or .glb to .glb, textures and all else stay), .npy or .csv (any
          dimension). For several meshes, a folder.
      figure: Draw the shape beside its form, in the same colours (.png, .pdf, .svg).
      report: Write a page to look at the form in a browser, beside the shape.
      n_components: Dimension of the form.
      distance: The distance that the form approximates.
      weighting: Weight vertices equally, or by their area.
      n_samples: Compute the paper's form, from so many vertices, instead of the exact one. Geodesic
          distances have no exact form; for them it is 200 by default.
      n_eigenpairs: Eigenfunctions of the paper's form, likewise; 100 by default.
      keep_scale: Keep the mesh's unit; otherwise its area becomes 1.
      detail: preserved: write the surface, deformed as rigidly as possible into the form's pose.

    $ unbend canonical cat.off -o cat_canonical.ply
    $ unbend canonical scans/ -o forms
    $ unbend canonical cat.off -o cat_unbent.ply --detail preserved
    $ unbend canonical cat.off --report form.html --up z
    $ unbend canonical cat.off --detail preserved --figure form.pdf --up z
    $ unbend canonical cat.off -o cat.npy --n-components 10 --weighting area
    $ unbend canonical cat.off --distance geodesic --n-samples 300 --json
    """
    if detail is not None and n_components < 3:
        raise InputError(f"--detail needs a form of at least 3 dimensions, not {n_components}")
    paths = expand_folders(meshes)
    if out is None and len(paths) > 1 and not os.path.exists(paths[-1]):
        raise InputError(f"cannot read {paths[-1]}: there is no such file; or was -o meant?")
    batch = is_batch(meshes, paths, out, {"figure": figure, "report": report})
    files, n_written = [], n_components if detail is None else 3
    if out is not None:
        files = _files_in(out, paths, n_written) if batch else [out]
    options.keep_inputs(files, paths)
    for file in files:
        suffix = unbend.io.check_writable(file, (*_MESH_SUFFIXES, ".npy", ".csv")).suffix.lower()
        if suffix in _MESH_SUFFIXES and n_written != 3:
            raise InputError(
                f"{suffix} files hold 3 dimensions, not {n_components}; write the form as .npy "
                "or .csv"
            )
    of_all: dict[str, Any] = {"n_components": n_components, "distance": distance}
    of_all |= {"weighting": weighting, "n_samples": n_samples, "n_eigenpairs": n_eigenpairs}
    of_all |= {"laplacian": laplacian, "component": component, "keep_scale": keep_scale}

    def compute(i: int, path: str) -> dict[str, Any]:
        def step(stage: str, share: float) -> None:
            of_many = f"{i + 1} of {len(paths)}, {path}: " if batch else ""
            output.progress(of_many + stage, (i + share) / len(paths))

        step("reading", 0)
        shape = unbend.read_mesh(path)
        form = make_form(shape, **of_all, progress=step)
        points, posed, seconds = form.points, None, form.seconds
        if detail is not None:
            start = perf_counter()
            posed = unbend.lay_into_pose(shape, form, progress=step)
            points = posed = posed if keep_scale else posed / form.area**0.5
            seconds = seconds | {"detail": perf_counter() - start}
        if files:
            step("writing", 0)
            _write(files[i], path, shape, points)
        if figure is not None:
            step("drawing", 0)
            unbend.report.draw_form(shape, form, figure, posed=posed, up=up)
        if report is not None:
            looks: dict[str, Any] = {"posed": posed, "up": up, "keep_scale": keep_scale}
            looks |= {"command": output.command_line(), "progress": step}
            unbend.report.form_page(shape, form, report, **looks)
        of_shape = output.fields_of(shape, "n_vertices", "n_faces", "notes")
        return {"file": path, **of_shape, **output.fields_of(form, *_TOLD), "steps": seconds}

    done: list[dict[str, Any]] = []
    failures: list[unbend.collection.Failure] = []
    for i, path in enumerate(paths):
        try:
            done.append(compute(i, path))
        except (UnbendError, MemoryError) as error:
            if not batch:
                raise
            failures.append(unbend.collection.Failure.of(path, error))
    for one in done:
        for note in one["notes"]:
            output.say("note", f"{one['file']}: {note}")
    hint = "add -o OUT.ply to write the form, --report HTML to look at it"
    if batch:
        hint = "add -o FOLDER to write the forms"
    output.tell(
        {"files": done},
        _overview(done, failures) if batch else output.rows(_summary(done[0])),
        written=[out, figure],
        report=report,
        next_step=None if out or figure else hint,
        failures=failures,
    )


def _files_in(folder: str, paths: Sequence[str], n_written: int) -> list[str]:
    """Make the folder; name a file in it after each mesh."""
    found: dict[str, tuple[str, str]] = {}
    for path in paths:
        own = Path(path).suffix.lower()
        suffix = ".npy" if n_written != 3 else own if own in _MESH_SUFFIXES else ".ply"
        file = os.path.join(folder, Path(path).stem + suffix)
        name = file.casefold()  # Windows and macOS do not tell Cat.ply from cat.ply
        if name in found:
            raise InputError(f"{found[name][0]} and {path} would both be written to {file}")
        found[name] = path, file
    unbend.collection.make_folder(folder)
    return [file for _, file in found.values()]


def _write(out: str, path: str, shape: unbend.Mesh, points: FloatArray) -> None:
    """Write points, one for each vertex of the shape, in the format that the suffix names."""
    import numpy as np

    if not out.lower().endswith(_MESH_SUFFIXES):
        names = [f"x{i + 1}" for i in range(points.shape[1])]
        unbend.io.write_values(out, points, shape, names=names)
        return
    # Faces outside the chosen component have lost their vertices: no viewer could draw them.
    there = np.isfinite(points.sum(axis=1))
    faces = shape.faces if there.all() else shape.faces[there[shape.faces].all(axis=1)]
    like = output.what_to_keep(out, path, whole=len(faces) == shape.n_faces)
    unbend.write_mesh(out, unbend.Mesh(points, faces), like=like)


def _summary(one: dict[str, Any]) -> dict[str, str]:
    kind = f"{one['n_faces']:,} faces" if one["n_faces"] else "a point cloud"
    shown = [f"{value:.5g}" for value in one["eigenvalues"][:8]]
    return {
        "mesh": f"{Path(one['file']).name}, {one['n_vertices']:,} vertices, {kind}",
        "form": f"{one['method']} {one['distance']}, {one['weighting']} weights, "
        f"{one['laplacian']} Laplacian",
        "eigenvalues": "  ".join(shown + ["..."] * (len(one["eigenvalues"]) > len(shown))),
        "stress": f"{one['stress']:.3f}",
        "time": f"{sum(one['steps'].values()):.2f} s",
    }


def _overview(done: list[dict[str, Any]], failures: list[unbend.collection.Failure]) -> list[str]:
    lines = [("mesh", "vertices", "faces", "stress", "time", "")]
    for one in done:
        counts = f"{one['n_vertices']:,}", f"{one['n_faces']:,}"
        seconds = f"{sum(one['steps'].values()):.2f} s"
        lines.append((one["file"], *counts, f"{one['stress']:.3f}", seconds, ""))
    lines += [(one.path, "-", "-", "-", "-", "failed") for one in failures]
    return output.table("<>>>><", *lines)
