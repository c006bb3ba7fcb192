"""What commands read: shapes, maps, truths, and the match of two shapes, read or made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from unbend._text import plural
from unbend.choices import DistanceKind, Partial
from unbend.cli._output import EXIT_UNSURE, say, warn_if_doubtful
from unbend.errors import InputError

if TYPE_CHECKING:
    from unbend._types import IntArray, Progress
    from unbend.canonical import CanonicalForm
    from unbend.matching import Match
    from unbend.mesh import Mesh


def parse_component(text: str | None) -> str | int | None:
    """Turn the value of ``--component`` into what the library takes."""
    if text is None or text == "largest":
        return text
    if text.isdecimal():
        return int(text)
    raise InputError(f"--component must be largest or a number counted from 0, not {text!r}")


def read_shapes(paths: Iterable[str], component: str | None = None) -> list[Mesh]:
    """Read meshes, or one component of each."""
    from unbend.io import read_mesh
    from unbend.preparation import only_component

    chosen = parse_component(component)
    return [only_component(read_mesh(path), chosen) for path in paths]


def make_form(
    mesh: Mesh, distance: DistanceKind, sampling: Mapping[str, Any] | None = None, **options: Any
) -> CanonicalForm:
    """Compute the exact form; the paper's if it is sampled, or the distance has no exact one."""
    from unbend.canonical import canonical_form, sampled_canonical_form
    from unbend.distances import SPECTRAL

    if distance in SPECTRAL and not sampling:
        return canonical_form(mesh, distance=distance, **options)
    return sampled_canonical_form(mesh, distance=distance, **(sampling or {}), **options)


def read_any_map(path: str, base: int | None, target: Mesh) -> IntArray:
    """Read the point map of a .npz match, or of any other map file."""
    from unbend.correspondence import read_match
    from unbend.io import read_map

    if path.lower().endswith(".npz"):
        return read_match(path, target=target).source_to_target
    return read_map(path, base=base, n_target=target.n_vertices)


def read_truth(paths: Sequence[str], n_source: int, n_target: int) -> list[IntArray]:
    """Read source vertices whose images are known, and those images, in one or more files."""
    from unbend.io import read_map

    sources = read_map(paths[0], n_target=n_source)
    if (sources < 0).any():
        row = int((sources < 0).argmax())
        raise InputError(f"{paths[0]}: row {row} is -1, but each must be a source vertex")
    truths = [read_map(path, n_target=n_target) for path in paths[1:]]
    for path, images in zip(paths[1:], truths, strict=True):
        if len(images) != len(sources):
            raise InputError(
                f"{path} holds {plural(len(images), 'row')}, but {paths[0]} {len(sources)}; each "
                "row of the one is the image of that row of the other"
            )
    return [sources, *truths]


def keeps_all(path: str | None) -> bool:
    """Whether a file will hold all of a match, not its point map alone."""
    return path is not None and Path(path).suffix.lower() == ".npz"


def write_result(path: str, found: Match, shapes: Sequence[Mesh]) -> None:
    """Write all of a match to a .npz file, or its point map to any other."""
    from unbend.correspondence import write_match
    from unbend.io import write_map

    if keeps_all(path):
        write_match(path, found, source=shapes[0], target=shapes[1])
    else:
        write_map(path, found.source_to_target)


def landmarks_of(paths: Sequence[str] | None, shapes: Sequence[Mesh]) -> IntArray | None:
    """Read the hints for matching two shapes, if there are any: a table, or points on each."""
    from unbend.io import MARKUP_SUFFIXES, read_landmarks, read_markup_pairs

    source, target = shapes
    if not paths:
        return None
    if len(paths) == 2:
        return read_markup_pairs(paths, source, target)
    if len(paths) > 2 or paths[0].lower().endswith(MARKUP_SUFFIXES):
        raise InputError(
            "--landmarks takes one .csv file of vertex pairs, or is given twice: a .mrk.json or "
            ".fcsv file for the source, then one for the target"
        )
    return read_landmarks(paths[0], source.n_vertices, target.n_vertices)


def is_unsure(found: Match, least: float | None) -> bool:
    """Say whether a match's confidence is below --min-confidence."""
    if least is None or found.confidence >= least:
        return False
    say(
        "error",
        f"the match's confidence is {found.confidence:.4g}, below {least:g}: no file written",
    )
    return True


def read_or_match(
    shapes: Sequence[Mesh],
    map_file: str | None,
    base: int | None,
    partial: Partial,
    landmarks: Sequence[str] | None,
    save_match: str | None,
    min_confidence: float | None,
    progress: Progress,
) -> Match | IntArray:
    """Read the map from one shape to another, or match them; exit if the match is too unsure."""
    from unbend.correspondence import read_match
    from unbend.io import read_map
    from unbend.matching import match

    source, target = shapes
    if map_file is None:
        found = match(
            source,
            target,
            partial=partial,
            landmarks=landmarks_of(landmarks, shapes),
            barycentric=True,
            progress=progress,
        )
    else:
        if landmarks or save_match is not None or partial != "auto":
            raise InputError(
                "--landmarks, --partial and --save-match are for matching; leave them out, or --map"
            )
        if not keeps_all(map_file):
            if min_confidence is not None:
                raise InputError(f"--min-confidence needs a .npz match, and {map_file} is none")
            sizes = {"n_source": source.n_vertices, "n_target": target.n_vertices}
            return read_map(map_file, base=base, **sizes)
        found = read_match(map_file, source=source, target=target)
    warn_if_doubtful(found.confidence)
    if is_unsure(found, min_confidence):
        raise typer.Exit(EXIT_UNSURE)
    if save_match is not None:
        write_result(save_match, found, shapes)
    return found
