"""Jobs that find maps, and the page on which landmarks are placed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from unbend._display import is_doubtful
from unbend._text import plural, quoted
from unbend.app._work import Landmarks, Result, Work, by_label
from unbend.correspondence import write_match
from unbend.io import write_map
from unbend.matching import Match
from unbend.matching import match as find_match
from unbend.matching import symmetry as find_symmetry
from unbend.report import match_colors, match_page, view

_N_MATCHES, _LARGE = 3, 60_000  # vertices beyond which other maps would take too long


def match(work: Work, landmarks: Landmarks = (), mirror: bool = False) -> Result:
    count = _N_MATCHES if max(mesh.n_vertices for mesh in work.meshes) <= _LARGE else 1
    found = find_match(
        *work.meshes,
        landmarks=by_label(landmarks),
        n_matches=count,
        allow_mirror=mirror,
        barycentric=True,
        progress=work.progress,
    )
    stem = "-".join(work.stems)
    out = f"{stem}.npz"
    command = ["match", *work.names, "-n", str(count), "-o", out, *work.report]
    more = ""
    if landmarks:
        command += ["--landmarks", "landmarks.csv"]
        more += f", landmarks={by_label(landmarks)}"
    if mirror:
        command.append("--allow-mirror")
        more += ", allow_mirror=True"
    python = work.python(
        "match, read_mesh, write_match",
        f"found = match(source, target, n_matches={count}{more}, barycentric=True)",
        f"write_match({out!r}, found, source=source, target=target)",
    )
    result = _matched(work, found, out, landmarks, command, python)
    source, target = work.meshes
    for i, other in enumerate(found.alternatives):
        path, name = work.folder / f"alternative-{i}.npz", f"{stem}-{i + 2}.npz"
        write = python[-1].replace(repr(out), repr(name))
        write_match(path, other, source=source, target=target)
        work.draw("", target, match_colors(source, target, other)[1])
        result["alternatives"].append(
            {
                "path": str(path),
                "picture": len(work.pictures) - 1,
                "words": _in_words(other.confidence),
                "name": name,
                "command": command,
                "python": [*python[:-1], f"found = found.alternatives[{i}]", write],
            }
        )
    return result


def choose(
    work: Work, command: Sequence[str], python: Sequence[str], landmarks: Landmarks = ()
) -> Result:
    result = _matched(work, work.read_map(), work.map_name, landmarks, command, python)
    return result | {"title": f"{result['title']}, another map"}


def symmetry(work: Work) -> Result:
    found = find_symmetry(work.meshes[0], progress=work.progress)
    (name,) = work.names
    command = ["symmetry", name, "-o", "partners.csv", *work.report]
    python = [
        "from unbend import symmetry, write_map",
        f"found = symmetry({name!r})",
        'write_map("partners.csv", found.source_to_target)',
    ]
    work.meshes *= 2
    return _matched(work, found, "partners.npz", (), command, python)


def landmarks(work: Work, landmarks: Landmarks = ()) -> Result:
    """Show one or two shapes on which landmarks are placed."""
    work.progress("drawing", 0.0)
    a, b = work.meshes[0], work.meshes[1] if len(work.meshes) > 1 else None
    view(a, b, by_label(landmarks), work.page, up=work.up)
    call = f"report.view({', '.join(map(repr, work.names))}).open()"
    title = f"Landmarks on {' and '.join(work.names)}"
    return work.result(title, ["view", *work.names], ["from unbend import report", call])


def _matched(
    work: Work,
    found: Match,
    name: str,
    landmarks: Landmarks,
    command: Sequence[str],
    python: Sequence[str],
) -> Result:
    work.progress("writing", 0.0)
    source, target = work.meshes
    whole = work.new_file(name, "the map with all that is known of it, for unbend")
    write_match(whole, found, source=source, target=target)
    for suffix, about in ((".csv", "the map as a table"), (".vts", "the map, counted from 1")):
        write_map(work.new_file(Path(name).stem + suffix, about), found.source_to_target)
    if landmarks:
        table = work.new_file("landmarks.csv", "the landmarks")
        rows = "".join("{},{}\n".format(*one["at"]) for one in landmarks)
        table.write_text(f"source,target\n{rows}", encoding="utf-8", newline="\n")
    colors = match_colors(source, target, found)
    for i, (mesh, own) in enumerate(zip(work.meshes, colors, strict=True)):
        if i == 0 or target is not source:
            about = f"{mesh.name} in the colours of the match"
            work.keep_mesh(f"{work.stems[i]}-coloured", about, mesh, own, i)
        work.draw(mesh.name, mesh, own)
    match_page(
        source,
        target,
        found,
        work.page,
        up=work.up,
        landmarks=by_label(landmarks),
        command=quoted("unbend", *command),
        progress=work.progress,
    )
    title = " to ".join(work.names)
    matched = int((found.source_to_target >= 0).sum())
    matched_of = f"{matched:,} of {source.n_vertices:,} vertices"
    facts = {
        "matched": matched_of,
        "overlap": f"{found.overlap_source:.0%} of the first surface, "
        f"{found.overlap_target:.0%} of the second",
    }
    if target is source:
        title, facts = f"Left and right of {source.name}", {"with a mirror partner": matched_of}
    elif landmarks:
        title += f", with {plural(len(landmarks), 'landmark')}"
    return work.result(title, command, python, facts) | {
        "map_file": str(whole),
        "confidence": _in_words(found.confidence),
        "doubtful": is_doubtful(found.confidence),
        "landmarks": list(landmarks),
        "alternatives": [],
    }


def _in_words(confidence: float) -> str:
    sure = "very likely right" if confidence >= 0.9 else "likely right"
    words = "doubtful" if is_doubtful(confidence) else sure
    return f"{words} (confidence {confidence:.2f} of 1)"
