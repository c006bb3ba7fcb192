"""``unbend view`` and ``unbend app``: shapes in a browser."""

from __future__ import annotations

import os
import webbrowser
from typing import Annotated, Any

import typer

import unbend
from unbend._text import quoted
from unbend.choices import Axis
from unbend.cli import _options as options
from unbend.cli._input import expand_folders, landmarks_of, opened, read_shapes
from unbend.cli._output import progress, tell
from unbend.errors import FileError, InputError


def view(
    mesh: str,
    other: Annotated[str | None, typer.Argument(metavar="[MESH]")] = None,
    page: Annotated[str | None, options.out("HTML")] = None,
    landmarks: options.Landmarks = None,
    values: Annotated[str | None, typer.Option(metavar="FILE")] = None,
    property_name: options.Property = None,
    show: Annotated[bool, typer.Option("--open/--no-open")] = True,
    up: Axis = "y",
) -> None:
    """Show one or two meshes in a browser, and place landmarks on them.

    The page shows the number of the vertex under the pointer, counted from 0. A click places a
    landmark; on two meshes landmarks are pairs. The page saves them for --landmarks of other
    commands, and for 3D Slicer.

      other: A second mesh, for pairs of landmarks.
      page: The page to write, .html; by default a temporary file.
      values: Numbers or labels per vertex of the first mesh (.npy, .csv, .txt), or a mesh with
          them. Whole numbers are labels.
      show: Open the page in a browser.

    $ unbend view cat.off
    $ unbend view cat0.off cat1.off
    $ unbend view cat0.off cat1.off --landmarks landmarks.csv -o cats.html --no-open
    $ unbend view scan.ply --landmarks scan.mrk.json --values distances.npy
    """
    if page is None and not show:
        raise InputError("--no-open needs -o: name the page to write")
    if property_name is not None and values is None:
        raise InputError("--property is for --values; leave it out, or add the file")
    shapes = read_shapes([path for path in (mesh, other) if path is not None])
    hints = _landmarks(landmarks, shapes) if landmarks else None
    shown: Any = None
    names: list[str] = []
    if values is not None:
        n = shapes[0].n_vertices
        shown, names = unbend.io.read_named_values(values, n_vertices=n, name=property_name)
    progress("drawing", 0)
    second = shapes[1] if len(shapes) > 1 else None
    label = names[0] if len(names) == 1 else "value"
    made = unbend.report.view(shapes[0], second, hints, values=shown, label=label, up=up)
    if page is None or show:
        page = str(made.open(page))
    else:
        made.write(page)
    next_step = f"open {page} in a browser"
    if other is not None:
        match = quoted("unbend", "match", mesh, other)
        next_step = f"{match} --landmarks landmarks.csv, once they are saved"
    tell({"a": mesh, "b": other}, [], shapes=shapes, written=[page], next_step=next_step)


def _landmarks(paths: list[str], shapes: list[unbend.Mesh]) -> Any:
    """Read landmarks of one mesh or of two, by label if they have any."""
    if len(shapes) == 2:
        return landmarks_of(paths, shapes)
    if len(paths) > 1:
        raise InputError("--landmarks of one mesh takes one file of points; leave out the others")
    labels, vertices = unbend.io.read_markups(paths[0], shapes[0])
    if not any(labels):
        return vertices
    if len(set(labels)) < len(labels):
        raise InputError(f"{paths[0]}: give each point a label of its own")
    return dict(zip(labels, vertices.tolist(), strict=True))


def app(
    files: Annotated[list[str] | None, typer.Argument(metavar="FILES")] = None,
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535)] = 0,
    browser: bool = True,
    collection: Annotated[str | None, typer.Option(metavar="STORE")] = None,
) -> None:
    """Open a window in the browser in which shapes are matched without typing.

    The window is served to this machine alone, at an address that nobody else can guess. Closing
    it, or Ctrl-C here, ends the command and removes its temporary files.

      files: Meshes to begin with, or folders of them.
      port: The port to listen on; 0: any that is free.
      browser: Open the window in a browser.
      collection: A collection to search in the window.

    $ unbend app
    $ unbend app cat0.off cat1.off
    $ unbend app scans/ --collection shapes
    """
    from unbend.app import serve

    paths = expand_folders(files or [])
    for path in paths:
        if not os.path.exists(path):
            raise FileError(f"cannot read {path}: there is no such file")
    if collection is not None:
        opened(collection)

    def ready(address: str) -> None:
        stop = "close the window, or press Ctrl-C here, to stop"
        tell({"address": address}, [address], next_step=stop)
        if browser:
            webbrowser.open(address)

    serve(paths, port=port, collection=collection, ready=ready)
