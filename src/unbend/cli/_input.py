"""What commands read: shapes, maps, truths, and the match of two shapes, read or made."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import unbend
from unbend._text import plural
from unbend.choices import DistanceKind
from unbend.cli._options import MatchOptions
from unbend.cli._output import EXIT_UNSURE, command_line, say, warn_if_doubtful
from unbend.errors import InputError

if TYPE_CHECKING:
    from unbend._types import IntArray, Progress


def read_shapes(paths: Iterable[str], component: str | None = None) -> list[unbend.Mesh]:
    """Read meshes; choose a component of those that have several, if any has."""
    shapes = [unbend.read_mesh(path) for path in paths]
    if component is None:
        return shapes
    counts = [
        len(unbend.mesh.find_components(one.faces, one.n_vertices).n_vertices) for one in shapes
    ]
    return [
        unbend.preparation.only_component(one, component) if n > 1 or max(counts) < 2 else one
        for one, n in zip(shapes, counts, strict=True)
    ]


def make_form(
    mesh: unbend.Mesh,
    distance: DistanceKind,
    sampling: Mapping[str, Any] | None = None,
    **options: Any,
) -> unbend.canonical.CanonicalForm:
    """Compute the exact form; the paper's if it is sampled, or the distance has no exact one."""
    if distance not in unbend.distances.GEODESIC and not sampling:
        return unbend.canonical_form(mesh, distance=distance, **options)
    return unbend.sampled_canonical_form(mesh, distance=distance, **(sampling or {}), **options)


def expand_folders(paths: Iterable[str]) -> list[str]:
    """Replace folders by the meshes in and below them, in order."""
    found: list[str] = []
    unbend.collection.warn_of_others(paths := list(paths))
    for path in paths:
        if not os.path.isdir(path):
            found.append(path)
            continue
        inside = unbend.collection.find_files([path])
        found += [os.path.join(path, os.path.relpath(one, path)) for one in inside]
    return found


def is_batch(
    given: Sequence[str], paths: Sequence[str], out: str | None, of_one: Mapping[str, object]
) -> bool:
    """Whether results go to a folder: there are several meshes, or `out` is a folder.

    `paths` are the meshes of what was `given`; the one mesh of a folder goes to one, too.

    Raises InputError if `out` is named like a file then, or if options of a single mesh are given.
    """
    suffixes = unbend.io.WRITE_SUFFIXES + unbend.io.VALUE_SUFFIXES
    is_file = out is not None and Path(out).suffix.lower() in suffixes
    into_folder = out is not None and any(map(os.path.isdir, (out, *given)))
    if len(paths) == 1 and (is_file or not into_folder):
        return False
    if is_file:
        raise InputError(f"{len(paths)} meshes need a folder to write to, and {out} is a file")
    for name, value in of_one.items():
        if value is not None:
            raise InputError(f"{name} is for a single mesh; leave it out, or -o FOLDER")
    return True


def files_in(folder: str, paths: Sequence[str], suffix: Callable[[str], str]) -> list[str]:
    """Make the folder; name a file in it after each mesh."""
    found: dict[str, str] = {}
    for path in paths:
        file = os.path.join(folder, Path(path).stem + suffix(path))
        if file in found:
            raise InputError(f"{found[file]} and {path} would both be written to {file}")
        found[file] = path
    unbend.collection.make_folder(folder)
    return list(found)


def read_truth(paths: Sequence[str], n_source: int, n_target: int) -> list[IntArray]:
    """Read source vertices whose images are known, and those images, in one or more files."""
    sources = unbend.read_map(paths[0], n_target=n_source)
    if (sources < 0).any():
        row = int((sources < 0).argmax())
        raise InputError(f"{paths[0]}: row {row} is -1, but each must be a source vertex")
    found = [sources]
    for path in paths[1:]:
        found.append(unbend.read_map(path, n_target=n_target))
        if len(found[-1]) != len(sources):
            raise InputError(
                f"{path} holds {plural(len(found[-1]), 'row')}, but {paths[0]} {len(sources)}; "
                "each row of the one is the image of that row of the other"
            )
    return found


def landmarks_of(paths: Sequence[str] | None, shapes: Sequence[unbend.Mesh]) -> IntArray | None:
    """Read the hints for matching two shapes, if there are any: a table, or points on each."""
    source, target = shapes
    if not paths:
        return None
    if len(paths) == 2:
        return unbend.io.read_markup_pairs(paths, source, target)
    if len(paths) > 2 or paths[0].lower().endswith(unbend.io.MARKUP_SUFFIXES):
        raise InputError(
            "--landmarks takes one .csv file of vertex pairs, or is given twice: a .mrk.json or "
            ".fcsv file for the source, then one for the target"
        )
    return unbend.io.read_landmarks(paths[0], source.n_vertices, target.n_vertices)


def keeps_all(path: str | None) -> bool:
    """Whether a file will hold all of a match, not its point map alone."""
    return path is not None and path.lower().endswith(".npz")


def write_result(path: str, found: unbend.Match, shapes: Sequence[unbend.Mesh]) -> None:
    """Write all of a match to a .npz file, or its point map to any other."""
    if keeps_all(path):
        unbend.write_match(path, found, source=shapes[0], target=shapes[1])
    else:
        unbend.write_map(path, found.source_to_target)


def show_match(
    shapes: Sequence[unbend.Mesh],
    found: unbend.Match,
    figure: str | None,
    report: str | None,
    **options: Any,
) -> None:
    """Write the figure and the page of a match, if they are asked for."""
    if figure is not None:
        options["progress"]("drawing", 0)
        unbend.report.draw_match(shapes[0], shapes[1], found, figure, up=options["up"])
    if report is not None:
        unbend.report.match_page(
            shapes[0], shapes[1], found, report, command=command_line(), **options
        )


def is_unsure(found: unbend.Match, least: float | None) -> bool:
    if least is None or found.confidence >= least:
        return False
    told = f"the match's confidence is {found.confidence:.4g}, below {least:g}"
    say("error", f"{told}: no file written")
    return True


def read_or_match(
    shapes: Sequence[unbend.Mesh], given: MatchOptions, progress: Progress
) -> unbend.Match | IntArray:
    """Read the map from one shape to another, or match them; exit if the match is too unsure."""
    source, target = shapes
    if given.map is None:
        found = unbend.match(
            source,
            target,
            partial=given.partial,
            landmarks=landmarks_of(given.landmarks, shapes),
            barycentric=True,
            progress=progress,
        )
    else:
        if given.landmarks or given.save_match is not None or given.partial != "auto":
            raise InputError(
                "--landmarks, --partial and --save-match are for matching; leave them out, or --map"
            )
        if not keeps_all(given.map):
            if given.min_confidence is not None:
                raise InputError(f"--min-confidence needs a .npz match, and {given.map} is none")
            sizes = {"n_source": source.n_vertices, "n_target": target.n_vertices}
            return unbend.read_map(given.map, base=given.base, **sizes)
        found = unbend.read_match(given.map, source=source, target=target)
    warn_if_doubtful(found)
    if is_unsure(found, given.min_confidence):
        raise typer.Exit(EXIT_UNSURE)
    if given.save_match is not None:
        write_result(given.save_match, found, shapes)
    return found
