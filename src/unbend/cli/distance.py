"""``unbend distance``: distances from vertices to all others."""

from __future__ import annotations

from typing import Annotated, Any

import typer

import unbend
from unbend.choices import Axis, DistanceKind, LaplacianKind
from unbend.cli import _options as options
from unbend.cli._input import read_shapes
from unbend.cli._output import progress, rows, tell, what_to_keep
from unbend.errors import InputError


def _vertex(text: str) -> int:
    if not text.isdecimal():
        raise typer.BadParameter(f"{text!r} is no vertex number; vertices are counted from 0")
    return int(text)


def distance(
    mesh: str,
    sources: Annotated[list[int], typer.Option("--from", metavar="VERTEX", parser=_vertex)],
    out: Annotated[str | None, options.out()] = None,
    kind: Annotated[DistanceKind, typer.Option("--distance")] = "geodesic",
    n_eigenpairs: int | None = None,
    time: float | None = None,
    laplacian: LaplacianKind = "auto",
    component: options.Component = None,
    figure: options.Figure = None,
    report: options.Report = None,
    up: Axis = "y",
    cache: options.Cache = True,
) -> None:
    """Measure distances on the surface from vertices to all others, in the mesh's unit.

      sources: A vertex id, from 0; may be repeated.
      out: .npy or .csv: a row per vertex, a column per source; .ply, .vtp: the mesh with one value
          per vertex and source, distance_VERTEX.
      kind: geodesic: the length of the shortest path on the surface, by the heat method;
          geodesic-exact: without its error, slower. The others are spectral: they measure how far
          apart points are in the shape as a whole, and are not lengths of paths.
      n_eigenpairs: Number of eigenpairs; by default no truncation.
      time: Diffusion time, in units of the mesh's area; by default 0.1.
      figure: Draw the mesh, coloured by the distance to the nearest VERTEX (.png, .pdf, .svg).
      report: Write a page to look at these distances in a browser.

    $ unbend distance cat.off --from 12 -o field.ply
    $ unbend distance cat.off --from 12 --from 480 --figure distances.png
    $ unbend distance cat.off --from 12 --distance biharmonic -o field.npy
    """
    import numpy as np

    from unbend._arrays import first_largest

    twice = max(sources, key=sources.count)
    if sources.count(twice) > 1:
        raise InputError(f"--from {twice} is given twice; leave one out")
    if out is not None:
        unbend.io.check_writable(out, (".ply", ".vtp", ".npy", ".csv"))
    (shape,) = read_shapes([mesh])
    progress(f"{kind} distance", 0)
    field = unbend.distance(
        shape,
        sources,
        distance=kind,
        n_eigenpairs=n_eigenpairs,
        time=time,
        laplacian=laplacian,
        component=component,
    )
    names = [f"distance_{source}" for source in sources]
    if out is not None and out.lower().endswith(unbend.io.SCALAR_SUFFIXES):
        what_to_keep(out, mesh)
        unbend.write_mesh(out, shape, scalars=dict(zip(names, field, strict=True)))
    elif out is not None:
        unbend.io.write_values(out, field.T, shape, names=names)
    nearest = field.min(axis=0)
    if figure is not None:
        unbend.report.draw_values(shape, nearest, figure, label=f"{kind} distance", up=up)
    if report is not None:
        starts = "the nearest of the vertices" if len(sources) > 1 else "vertex"
        note = f"From {starts} {', '.join(map(str, sources))}."
        looks: Any = {"label": f"{kind} distance", "note": note, "up": up}
        unbend.report.view(shape, values=nearest, path=report, **looks)
    farthest = first_largest(np.nan_to_num(field, nan=-1.0).T)
    lines = {"mesh": f"{shape.name}, {shape.n_vertices:,} vertices", "distance": kind}
    reached = []
    for source, vertex, lengths in zip(sources, farthest.tolist(), field, strict=True):
        reached.append({"vertex": source, "farthest": vertex, "distance": lengths[vertex]})
        lines[f"from {source}"] = f"farthest is vertex {vertex}, at {lengths[vertex]:.5g}"
    tell(
        {"file": mesh, "distance": kind, "sources": reached},
        rows(lines),
        shapes=[shape],
        written=[out, figure],
        report=report,
        next_step=None if out else "add -o OUT.ply to write the distances",
    )
