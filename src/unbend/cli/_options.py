"""Arguments and options that several commands take."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import typer

import unbend
from unbend import choices
from unbend.errors import InputError


def claim(ctx: typer.Context, given: Any) -> Any:
    """Refuse one file for two results, of which the second would take the place of the first."""
    claimed = ctx.meta.setdefault("unbend.claimed", [])
    for path in [given] if isinstance(given, str) else given or ():
        if (place := os.path.realpath(path)) in claimed:
            raise InputError(f"two results cannot be written to one file: {path}")
        claimed.append(place)
    return given


def _writable(*suffixes: str) -> Callable[[typer.Context, str | None], Any]:
    """Refuse a file that cannot be written before anything is read."""

    def check(ctx: typer.Context, path: str | None) -> Any:
        if path is not None:
            unbend.io.check_writable(path, suffixes)
        return claim(ctx, path)

    return check


html_file = _writable(".html")
figure_file = _writable(".png", ".pdf", ".svg")


def _map_file(ctx: typer.Context, path: str | None) -> Any:
    return _writable(".npz", *unbend.io.MAP_SUFFIXES)(ctx, path)


def parse_component(text: str | None) -> Any:
    """Turn the value of ``--component`` into what the library takes."""
    if text is None or text == "largest":
        return text
    if text.isdecimal():
        return int(text)
    raise InputError(f"--component must be largest or a number counted from 0, not {text!r}")


def _switch_cache(ctx: typer.Context, keep: bool) -> bool:
    if not keep:
        ctx.with_resource(unbend.spectral.use_cache(gib=0))
    return keep


def out(metavar: str = "OUT", callback: Any = claim) -> Any:
    """Make the option that names the file to write."""
    return typer.Option("-o", "--out", metavar=metavar, callback=callback)


def count(name: str, least: int | None = 1) -> Any:
    """Make the option -n, how many there are of something."""
    return typer.Option("-n", name, metavar="N", min=least)


Figure = Annotated[str | None, typer.Option(metavar="PNG", callback=figure_file)]
Report = Annotated[
    str | None,
    typer.Option(
        metavar="HTML",
        callback=html_file,
        help="Write an interactive page of pictures, for a browser.",
    ),
]
Meshes = Annotated[
    list[str],
    typer.Argument(
        metavar="MESHES", help=".off, .obj, .ply, .stl, .xyz or .npy files, or folders of them."
    ),
]
Mesh = Annotated[
    str,
    typer.Argument(
        metavar="MESH",
        help="A .off, .obj, .ply, .stl, .xyz or .npy file, or what trimesh and meshio read.",
    ),
]
Source = Annotated[str, typer.Argument(metavar="SOURCE", help="The mesh to map from.")]
Target = Annotated[str, typer.Argument(metavar="TARGET", help="The mesh to map to.")]
Csv = Annotated[
    str | None,
    typer.Option(metavar="OUT", callback=_writable(".csv"), help="Write the table to a file, too."),
]
Up = Annotated[
    choices.Axis,
    typer.Option(help="The axis that points upward in pictures; for two shapes, the source's."),
]
Component = Annotated[
    str | None,  # a number where it is one
    typer.Option(
        metavar="largest|NUMBER",
        callback=parse_component,
        help="Which connected component to keep; numbers count from 0, largest first.",
    ),
]
Laplacian = Annotated[
    choices.LaplacianKind,
    typer.Option(help="auto: robust for degenerate faces or non-manifold edges."),
]
Cache = Annotated[
    bool, typer.Option(callback=_switch_cache, help="Keep eigenpairs on disk for later runs.")
]

# Of commands that read a map or make a match.
MapOut = Annotated[
    str | None,
    typer.Option(
        "-o",
        "--out",
        metavar="MAP",
        callback=_map_file,
        help="Where to write the match: .npz (all of it); .npy, .txt, .csv (the target vertex of "
        "each source vertex, from 0) or .vts (from 1).",
    ),
]
Base = Annotated[
    int | None,
    typer.Option(metavar="0|1", help="What MAP counts from; .vts from 1, others from 0."),
]
Partial = Annotated[
    choices.Partial,
    typer.Option(
        help="Which shape may be partial: torn, cut, or seen from one side; auto: those with a "
        "boundary."
    ),
]
Landmarks = Annotated[
    list[str] | None,
    typer.Option(
        metavar="FILE",
        help="Landmarks: a .csv file, on each line a source vertex and a target vertex, counted "
        "from 0; or, given twice, a .mrk.json or .fcsv file of 3D Slicer for each shape.",
    ),
]
MinConfidence = Annotated[
    float | None,
    typer.Option(
        metavar="X",
        min=0,
        max=1,
        help="If the match's confidence is below X, write no file and exit with code 3.",
    ),
]


@dataclass(frozen=True)
class MatchOptions:
    """Options of commands that read a map, or make one."""

    map: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            help="The map that unbend match wrote, best as .npz. Without it the shapes are matched "
            "first.",
        ),
    ] = None
    base: Base = None
    partial: Partial = "auto"
    landmarks: Landmarks = None
    save_match: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            callback=_map_file,
            help="Keep the match that was made, as unbend match -o does.",
        ),
    ] = None
    min_confidence: MinConfidence = None

    def given(self) -> dict[str, Any]:
        """Values of the options that were given."""
        defaults = vars(MatchOptions())
        return {
            f"--{name.replace('_', '-')}": value
            for name, value in vars(self).items()
            if value != defaults[name] and value != []
        }


# Of collections.
Store = Annotated[
    str, typer.Argument(metavar="STORE", help="The collection: a folder, or s3://bucket/name.")
]
Workers = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        min=0,
        help="Local processes; by default as many as there are processors and memory for. 0: none "
        "beside this one.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="A Dask scheduler whose workers to use; they must see the files under these paths.",
    ),
]
