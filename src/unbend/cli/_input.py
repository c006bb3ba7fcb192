"""What commands read: shapes, maps, truths, and the match of two shapes, read or made."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import unbend
from unbend._text import plural, quoted
from unbend.cli import _output as output
from unbend.cli._options import MatchOptions
from unbend.errors import FileError, InputError

if TYPE_CHECKING:
    from unbend._types import IntArray

_SAMPLING = {"n_samples", "n_eigenpairs"}


def read_shapes(paths: Iterable[str], component: str | None = None) -> list[unbend.Mesh]:
    """Read meshes; choose a component of those that have several, if any has."""
    output.progress("reading", 0)
    shapes = [unbend.read_mesh(path) for path in paths]
    if component is None:
        return shapes
    joined = [unbend.preparation.join_seams(one)[0] for one in shapes]
    sizes = [unbend.mesh.find_components(one.faces, one.n_vertices).n_vertices for one in joined]
    several = [(one.name, n) for one, n in zip(shapes, sizes, strict=True) if len(n) > 1]
    chosen = [
        unbend.preparation.only_component(one, component) if len(n) > 1 or not several else one
        for one, n in zip(shapes, sizes, strict=True)
    ]
    if component not in ("largest", 0) and len(several) > 1:
        held = ", ".join(f"{n[int(component)]:,} vertices of {name}" for name, n in several)
        sentence = "numbers go by size, so look whether these are the same part"
        output.say("note", f"component {component} is {held}: {sentence}")
    return chosen


def make_form(mesh: unbend.Mesh, **options: Any) -> unbend.canonical.CanonicalForm:
    """Compute the exact form; the paper's if it is sampled, or the distance has no exact one."""
    given = {name: value for name, value in options.items() if value is not None}
    if given["distance"] not in unbend.distances.GEODESIC and not given.keys() & _SAMPLING:
        return unbend.canonical_form(mesh, **given)
    return unbend.sampled_canonical_form(mesh, **given)


def expand_folders(paths: Sequence[str]) -> list[str]:
    """Replace folders by the meshes in and below them, and patterns by what matches, in order."""
    unbend.collection.warn_of_others(paths)
    named = [path for one in paths for path in sorted(unbend.collection.matches(one))]
    return list(unbend.collection.find_files(named))


def is_batch(
    given: Sequence[str], paths: Sequence[str], out: str | None, of_one: Mapping[str, object]
) -> bool:
    """Whether results go to a folder: there are several meshes, or `out` is a folder.

    `paths` are the meshes of what was `given`; the one mesh of a folder goes to one, too.

    Raises InputError if `out` is named like a file then, or if options of a single mesh are given.
    """
    suffixes = unbend.io.WRITE_SUFFIXES + unbend.io.VALUE_SUFFIXES
    is_file = out is not None and Path(out).suffix.lower() in suffixes
    if len(paths) == 1 and (is_file or out is None or not any(map(os.path.isdir, (out, *given)))):
        return False
    if is_file:
        raise InputError(f"{len(paths)} meshes need a folder to write to, and {out} is a file")
    for name, value in of_one.items():
        if value not in (None, "auto"):
            option = f"--{name.replace('_', '-')}"
            raise InputError(f"{option} is for one mesh and no folder; leave it out")
    return True


def read_truth(paths: Sequence[str | None], n_source: int, n_target: int) -> list[IntArray]:
    """Read source vertices whose images are known, and those images, in as many files as given."""
    first, *others = [path for path in paths if path is not None]
    sources = unbend.read_map(first, n_target=n_source)
    if (sources < 0).any():
        row = int((sources < 0).argmax())
        raise InputError(f"{first}: row {row} is -1, but each must be a source vertex")
    found = [sources]
    for path in others:
        found.append(unbend.read_map(path, n_target=n_target))
        if len(found[-1]) != len(sources):
            raise InputError(
                f"{path} holds {plural(len(found[-1]), 'row')}, but {first} {len(sources):,}; "
                "each row of one is the image of the same row of the other"
            )
    return found


def landmarks_of(
    paths: Sequence[str] | None, shapes: Sequence[unbend.Mesh]
) -> dict[str, IntArray] | IntArray | None:
    """Read landmarks of two shapes, if there are any, by label if each has one of its own."""
    source, target = shapes
    if not paths:
        return None
    if len(paths) == 2:
        labels, pairs = unbend.io.read_markup_pairs(paths, source, target)
        return dict(zip(labels, pairs, strict=True)) if len(set(labels)) == len(labels) else pairs
    if len(paths) > 2 or paths[0].lower().endswith((*unbend.io.MARKUP_SUFFIXES, ".pts")):
        raise InputError(
            "--landmarks takes one .csv file of vertex pairs, or is given twice: a .mrk.json, "
            ".fcsv, .pp or .csv file of points for the source, then one for the target"
        )
    return unbend.io.read_landmarks(paths[0], source.n_vertices, target.n_vertices)


def keeps_all(path: str) -> bool:
    """Whether a file holds all of a match, not its point map alone."""
    return path.lower().endswith(".npz")


def read_given(
    path: str, base: int | None, source: unbend.Mesh | None, target: unbend.Mesh
) -> unbend.Match | IntArray:
    """Read all of a match from a .npz file, or a point map from any other."""
    if not keeps_all(path):
        n_source = None if source is None else source.n_vertices
        found = unbend.read_map(path, base=base, n_source=n_source, n_target=target.n_vertices)
        if base is None and source is not None:
            rough = unbend.io.roughness(source, target)
            unbend.io.refuse_other_base(path, found, target.n_vertices, rough)
        return found
    if base is not None:
        raise InputError(f"--base is for tables, and {path} is a .npz match; leave it out")
    return unbend.read_match(path, source=source, target=target)


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
    **looks: Any,
) -> None:
    """Write the figure and the page of a match, if they are asked for."""
    source, target = shapes
    if figure is not None:
        output.progress("drawing", 0)
        unbend.report.draw_match(source, target, found, figure, up=looks["up"])
    if report is not None:
        looks |= {"command": output.command_line(), "progress": output.progress}
        unbend.report.match_page(source, target, found, report, **looks)


def is_unsure(found: unbend.Match, least: float | None) -> bool:
    if least is None or found.confidence >= least:
        return False
    told = f"the match's confidence is {found.confidence:.4g}, below {least:g}"
    output.say("error", f"{told}: no file written")
    return True


def read_or_match(shapes: Sequence[unbend.Mesh], given: MatchOptions) -> unbend.Match | IntArray:
    """Read the map from one shape to another, or match them; exit if the match is too unsure."""
    source, target = shapes
    if given.map is None:
        if given.base is not None:
            raise InputError("--base is for --map; leave it out, or add the map")
        options: Any = {"partial": given.partial, "barycentric": True}
        options["landmarks"] = landmarks_of(given.landmarks, shapes)
        found = unbend.match(source, target, **options, progress=output.progress)
    elif given.landmarks or given.save_match is not None or given.partial != "auto":
        raise InputError(
            "--landmarks, --partial and --save-match are for matching; leave them out, or --map"
        )
    elif given.min_confidence is not None and not keeps_all(given.map):
        raise InputError(f"--min-confidence needs a .npz match, and {given.map} is none")
    else:
        read = read_given(given.map, given.base, source, target)
        if not isinstance(read, unbend.Match):
            return read
        found = read
    output.warn_if_doubtful(found)
    if is_unsure(found, given.min_confidence):
        output.tell(output.fields_of(found, "confidence"), [], unsure=True)
    if given.save_match is not None:
        write_result(given.save_match, found, shapes)
    return found


def opened(store: str, *outputs: str | None) -> unbend.collection.Collection:
    """Open a collection that must be there, and in whose folder nothing else shall be written."""
    output.progress("reading", 0)
    found = unbend.collection.Collection(store)
    if not found.exists:
        raise FileError(
            f"there is no collection at {store}: unbend collection add {quoted(store)} MESHES "
            "makes one"
        )
    for out in filter(None, outputs):
        unbend.collection.check_outside(store, out)
    return found


def read_shown(
    shapes: Sequence[unbend.collection.Entry | unbend.collection.Hit], store: str
) -> list[unbend.Mesh]:
    """Read shapes to show them, and name on stderr what cannot be read."""
    meshes, failures = unbend.collection.read_found(shapes, store)
    output.list_failures(failures)
    return meshes
