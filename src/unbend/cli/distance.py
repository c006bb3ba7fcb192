"""``unbend distance``: distances from vertices to all others."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from unbend.choices import DistanceKind
from unbend.cli._common import (
    CacheOption,
    ComponentOption,
    JsonOption,
    LaplacianOption,
    MeshArgument,
    TimeOption,
    parse_component,
    print_json,
    print_notes,
    print_rows,
    steps_on_stderr,
)

if TYPE_CHECKING:
    from unbend._types import FloatArray
    from unbend.mesh import Mesh

_SUFFIXES = (".ply", ".npy", ".csv")


def distance(
    mesh: MeshArgument,
    sources: Annotated[
        list[int],
        typer.Option("--from", metavar="VERTEX", help="A vertex id, from 0; may be repeated."),
    ],
    out: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--out",
            metavar="OUT",
            help=".npy or .csv: a row per vertex, a column per source; .ply: the mesh with one "
            "value per vertex and source, distance_VERTEX.",
        ),
    ] = None,
    kind: Annotated[
        DistanceKind, typer.Option("--distance", help="Which distance.")
    ] = "biharmonic",
    n_eigenpairs: Annotated[
        int | None,
        typer.Option("--n-eigenpairs", help="Number of eigenpairs; by default no truncation."),
    ] = None,
    time: TimeOption = None,
    laplacian: LaplacianOption = "auto",
    component: ComponentOption = None,
    cache: CacheOption = True,
    as_json: JsonOption = False,
) -> None:
    """Measure the distance from vertices to all others, in the mesh's unit.

    \b
    Examples:
      unbend distance cat.off --from 12 -o field.ply
      unbend distance cat.off --from 12 --from 480 --distance geodesic -o field.npy
    """  # noqa: D301
    from unbend.distances import distance as measure
    from unbend.io import check_writable, read_mesh

    if out is not None:
        check_writable(out, _SUFFIXES)
    with steps_on_stderr() as progress:
        progress("reading", 0)
        shape = read_mesh(mesh)
        progress(f"{kind} distance", 0)
        field = measure(
            shape,
            sources,
            distance=kind,
            n_eigenpairs=n_eigenpairs,
            time=time,
            laplacian=laplacian,
            component=parse_component(component),
        )
    if out is not None:
        write_field(out, shape, sources, field)
    print_notes(shape.notes)
    _print_summary(mesh, shape, kind, sources, field, out, as_json)


def write_field(out: str, shape: Mesh, sources: list[int], field: FloatArray) -> None:
    """Write distances (s, n) in the format that the file's suffix names."""
    import numpy as np

    from unbend.io import atomic_write, write_mesh

    suffix = Path(out).suffix.lower()
    if suffix == ".ply":
        rows = zip(sources, field, strict=True)
        write_mesh(out, shape, scalars={f"distance_{source}": row for source, row in rows})
        return
    with atomic_write(out) as file:
        if suffix == ".npy":
            np.save(file, field.T)
        else:
            names = ",".join(f"distance_{source}" for source in sources)
            np.savetxt(file, field.T, "%.17g", ",", header=names, comments="")


def _print_summary(
    mesh: str,
    shape: Mesh,
    kind: str,
    sources: list[int],
    field: FloatArray,
    out: str | None,
    as_json: bool,
) -> None:
    import numpy as np

    from unbend._arrays import first_largest

    farthest = first_largest(np.nan_to_num(field, nan=-1.0).T)
    largest = field[np.arange(len(sources)), farthest]
    if as_json:
        reached = [
            {"vertex": source, "farthest": int(vertex), "distance": float(length)}
            for source, vertex, length in zip(sources, farthest, largest, strict=True)
        ]
        print_json({"mesh": mesh, "out": out, "distance": kind, "sources": reached})
        return
    rows = {"mesh": f"{shape.name}, {shape.n_vertices:,} vertices", "distance": kind}
    for source, vertex, length in zip(sources, farthest, largest, strict=True):
        rows[f"from {source}"] = f"farthest is vertex {vertex}, at {length:.5g}"
    rows |= {"written": out} if out else {"next": "add -o OUT.ply to write the distances"}
    print_rows(rows)
