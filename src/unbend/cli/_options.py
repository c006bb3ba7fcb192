"""Arguments and options that several commands take."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import typer

import unbend
from unbend.choices import Partial
from unbend.errors import InputError


def written() -> dict[str, tuple[str, ...]]:
    """Options that name files to write, with their suffixes where no command takes others."""
    io = unbend.io
    maps, pictures = (".npz", *io.MAP_SUFFIXES), (".png", ".pdf", ".svg")
    return {
        "out": (),
        "map_out": maps,
        "save_match": maps,
        "page": (".html",),
        "report": (".html",),
        "picture": pictures,
        "figure": pictures,
        "thumbnail": (".png",),
        "csv": (".csv",),
        "colored": io.COLOR_SUFFIXES,
        "expected_error": io.VALUE_SUFFIXES + io.COLOR_SUFFIXES,
    }


def check_files(given: Mapping[str, Any]) -> None:
    """Refuse files that cannot be written, one for two results, and to write over what is read.

    That matplotlib is missing is told here too: a result may take minutes, its picture comes last.
    """
    suffixes = written()
    claimed: dict[str, str] = {}
    read = []
    for name, value in given.items():
        for path in value if isinstance(value, list | tuple) else [value]:
            if name not in suffixes and isinstance(path, str):
                read.append(path)
            elif name in suffixes and path is not None:
                if suffixes[name]:
                    unbend.io.check_writable(path, suffixes[name])
                if (place := os.path.realpath(path)) in claimed:
                    raise InputError(f"two results cannot be written to one file: {path}")
                claimed[place] = path
                if name in ("picture", "figure"):
                    unbend.report.new_figure(1, 1)
    keep_inputs(claimed.values(), read)


def keep_inputs(written: Iterable[str], read: Iterable[str]) -> None:
    """Refuse to write over a file that is read."""
    inputs = {_identity(path) for path in read if os.path.isfile(path)}
    for path in filter(os.path.isfile, written):
        if _identity(path) in inputs:
            raise InputError(f"{path} is one of the inputs; give another place to write to")


def _identity(path: str) -> tuple[int, int]:
    """Tell files apart as os.path.samefile does, whatever their names."""
    status = os.stat(path)
    return status.st_dev, status.st_ino


def _component(text: str | None) -> Any:
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


def out(metavar: str = "OUT") -> Any:
    return typer.Option("-o", "--out", metavar=metavar)


def count(name: str, least: int | None = 1) -> Any:
    return typer.Option("-n", name, metavar="N", min=least)


# Of options that several commands take; the docstring of a command may say something else.
HELP = {
    "meshes": ".off, .obj, .ply, .stl, .vtk or .vtp files, or folders of them; .xyz and .npy by "
    "their names.",
    "mesh": "A .off, .obj, .ply, .stl, .vtk, .vtp, .xyz or .npy file, or one that others read.",
    "source": "The mesh to map from.",
    "target": "The mesh to map to.",
    "store": "The collection: a folder, or s3://bucket/name.",
    "map_out": "Where to write the match: .npz (all of it); .npy, .txt, .csv (the target vertex of "
    "each source vertex, from 0) or .vts (from 1).",
    "report": "Write an interactive page of pictures, for a browser.",
    "csv": "Write the table to a file, too.",
    "up": "The axis that points upward in pictures; for two shapes, the source's.",
    "component": "Which connected component to keep; numbers count from 0, the one "
    "with the most vertices first. For two shapes, this applies to those that have several.",
    "laplacian": "auto: robust for degenerate faces or non-manifold edges.",
    "cache": "Keep eigenpairs on disk for later runs.",
    "map": "A map that unbend match wrote, best as .npz; without it the shapes are matched first.",
    "base": "What MAP counts from; .vts from 1, others from 0.",
    "partial": "Which shape may lack what the other has: torn, cut, seen from one side, or without "
    "a part; auto: either; none: every point gets a partner.",
    "landmarks": "Landmarks: a .csv file, on each line a source vertex and a target vertex, "
    "counted from 0, or the other way round below the names target,source; or, given twice, a "
    "file of points for each shape: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or a table of "
    "x,y,z.",
    "property_name": "Which values of a mesh file: a property of its vertices.",
    "save_match": "Keep the match that was made, as unbend match -o does.",
    "min_confidence": "If the match's confidence is below X, write no file and exit with code 3.",
    "workers": "Local processes; by default as many as there are processors and memory for; 0: "
    "work in this process.",
    "scheduler": "A Dask scheduler to use; its workers must see the files under these paths.",
    "as_json": "Print one JSON object: the result, files written, warnings, and seconds taken.",
    "quiet": "No progress, notes or hints; only results, warnings and errors.",
}

Figure = Annotated[str | None, typer.Option(metavar="PNG")]
Report = Annotated[str | None, typer.Option(metavar="HTML")]
Csv = Annotated[str | None, typer.Option(metavar="OUT")]
Component = Annotated[str | None, typer.Option(metavar="largest|NUMBER", callback=_component)]
Cache = Annotated[bool, typer.Option(callback=_switch_cache)]
Workers = Annotated[int | None, typer.Option(metavar="N", min=0)]
Scheduler = Annotated[str | None, typer.Option(metavar="tcp://HOST:PORT")]
MapOut = Annotated[str | None, out("MAP")]
Base = Annotated[int | None, typer.Option(metavar="0|1")]
Landmarks = Annotated[list[str] | None, typer.Option(metavar="FILE")]
Property = Annotated[str | None, typer.Option("--property", metavar="NAME")]
MinConfidence = Annotated[float | None, typer.Option(metavar="X", min=0, max=1)]


@dataclass(frozen=True)
class MatchOptions:
    """Options of commands that read a map, or make one."""

    map: Annotated[str | None, typer.Option(metavar="MAP")] = None
    base: Base = None
    partial: Partial = "auto"
    landmarks: Landmarks = None
    save_match: Annotated[str | None, typer.Option(metavar="MAP")] = None
    min_confidence: MinConfidence = None
