"""``unbend view``: look at shapes and place landmarks on them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import unbend
from unbend._text import quoted
from unbend.choices import Axis
from unbend.cli import _options as options
from unbend.cli._input import landmarks_of, read_shapes
from unbend.cli._output import progress_on_stderr, tell
from unbend.errors import InputError


def view(
    mesh: str,
    other: Annotated[str | None, typer.Argument(metavar="[MESH]")] = None,
    out: Annotated[str | None, options.out("HTML", options.html_file)] = None,
    landmarks: options.Landmarks = None,
    values: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open")] = True,
    up: Axis = "y",
) -> None:
    """Show one or two meshes in a browser, and place landmarks on them.

    The page shows the number of the vertex under the pointer, counted from 0. A click places a
    landmark; on two meshes landmarks are pairs. The page saves them for --landmarks of other
    commands, and for 3D Slicer.

    Options
    -------
      other: A second mesh, for pairs of landmarks.
      out: The page to write, .html; by default a temporary file.
      values: Numbers per vertex of the first mesh.
      show: Open the page in a browser.

    Examples
    --------
      unbend view cat.off
      unbend view cat0.off cat1.off
      unbend view cat0.off cat1.off --landmarks landmarks.csv -o cats.html --no-open
      unbend view scan.ply --landmarks scan.mrk.json --values distances.npy
    """
    if out is None and not show:
        raise InputError("--no-open needs -o: name the page to write")
    with progress_on_stderr() as progress:
        shapes = read_shapes([mesh] if other is None else [mesh, other])
        hints = _landmarks(landmarks, shapes) if landmarks else None
        scalars = None
        if values is not None:
            scalars = unbend.io.read_values(values, n_vertices=shapes[0].n_vertices)
        progress("drawing", 0)
        second = None if other is None else shapes[1]
        page = unbend.report.view(shapes[0], second, hints, values=scalars, up=up)
        if out is None or show:
            out = str(page.open(out))
        else:
            page.write(out)
    next_step = f"open {out} in a browser"
    if other is not None:
        match = quoted("unbend", "match", mesh, other)
        next_step = f"{match} --landmarks landmarks.csv, once they are saved"
    tell({"a": mesh, "b": other}, [], shapes=shapes, written=[out], next_step=next_step)


def _landmarks(paths: list[str], shapes: list[unbend.Mesh]) -> Any:
    """Read landmarks of one mesh by name, or pairs of vertices of two."""
    if len(shapes) == 2:
        return landmarks_of(paths, shapes)
    if len(paths) > 1 or not paths[0].lower().endswith(unbend.io.MARKUP_SUFFIXES):
        raise InputError(
            "--landmarks of one mesh is one .mrk.json or .fcsv file; drop a .csv file onto the page"
        )
    labels, vertices = unbend.io.read_markups(paths[0], shapes[0])
    if len(set(labels)) < len(labels):
        raise InputError(f"{paths[0]}: give each point a label of its own")
    return dict(zip(labels, vertices.tolist(), strict=True))
