"""``unbend app``: a window in the browser."""

from __future__ import annotations

import os
import webbrowser
from typing import Annotated

import typer

from unbend.cli._input import expand_folders
from unbend.cli._output import tell
from unbend.errors import FileError


def app(
    files: Annotated[list[str] | None, typer.Argument(metavar="FILES")] = None,
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535)] = 0,
    browser: bool = True,
    collection: Annotated[str | None, typer.Option(metavar="STORE")] = None,
) -> None:
    """Open a window in the browser in which shapes are matched without typing.

    The window is served to this machine alone, at an address that nobody else can guess. Closing
    it, or Ctrl-C here, ends the command and removes its temporary files.

    Options
    -------
      files: Meshes to begin with, or folders of them.
      port: By default any.
      browser: Open the window in a browser.
      collection: A collection to search in the window.

    Examples
    --------
      unbend app
      unbend app cat0.off cat1.off
      unbend app scans/ --collection shapes
    """
    from unbend.app import serve

    paths = expand_folders(files or [])
    for path in paths:
        if not os.path.exists(path):
            raise FileError(f"cannot read {path}: there is no such file")
    if collection is not None:
        from unbend.cli.collection._common import opened

        opened(collection)

    def ready(address: str) -> None:
        stop = "close the window, or press Ctrl-C here, to stop"
        tell({"address": address}, [address], next_step=stop)
        if browser:
            webbrowser.open(address)

    serve(paths, port=port, collection=collection, ready=ready)
