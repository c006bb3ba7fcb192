"""The text of the match page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from unbend._display import MIRROR_FITS, confidence_told, is_doubtful, table, where_landmarks_help
from unbend.correspondence import THRESHOLDS, Evaluation
from unbend.matching import Match, faults_of
from unbend.report.pages import _document as parts
from unbend.report.pages._shown import Shown

WORST = 0.1  # the error at the end of the colour scale
_SIDES = ("source", "target")


def doubt(match: Match | None, mirror: bool, landmarks: bool) -> str:
    """Warning above the page of a match that may well be wrong; empty for other matches."""
    if match is None:
        return ""
    faults = [f"{one[0].upper()}{one[1:]}." for one in faults_of(match)]
    return " ".join([*faults, _low_confidence(match, mirror, landmarks)]).strip()


def _low_confidence(match: Match, mirror: bool, landmarks: bool) -> str:
    if not is_doubtful(match.confidence):
        return ""
    if mirror:
        return (
            f"This symmetry is doubtful: its confidence is {match.confidence:.2f}. Look whether "
            "places on the left have the colours of their mirror partners on the right."
        )
    if match.mirror_fits:
        return (
            f"This match is doubtful: its confidence is {match.confidence:.2f}, because "
            f"{MIRROR_FITS}."
        )
    others = "from the menu Map" if match.alternatives else "by asking for alternatives"
    exchanged = ", and whether each landmark is at one place on both" if landmarks else ""
    return (
        f"This match is doubtful: its confidence is {match.confidence:.2f}. Look whether the same "
        f"places have the same colour{exchanged}. If they do not, place one to three landmarks"
        f"{where_landmarks_help(match.landmark_hints)}, as with unbend view, and match again, or "
        f"take another map {others}."
    )


def pictures(
    names: Sequence[str], up: str, maps: Sequence[str], first: dict[str, Any], mirror: bool
) -> str:
    """Both shapes, with controls that move and colour them as the first map, packed, allows."""
    own = ""
    if len(maps) > 1:
        own += parts.select("Map", "map", {str(i): one for i, one in enumerate(maps)})
    if first["frames"]:
        own += (
            '<label>Morph <input type="range" id="morph" min="0" max="1" step="0.005" value="0">'
            '</label><button type="button" id="play">Play</button>'
        )
    same = "mirror partners" if mirror else "same place"
    paints = {"0": f"{same}, same colour"}
    if first["errors"] is not None:
        paints["1"] = "by error"
    if first["expected"] is not None:
        paints["expected"] = "by expected error"
    own += parts.select("Colours", "paint", paints | {"2": "plain"})
    views = [
        parts.canvas(
            side,
            f"{side.capitalize()}: {name}",
            f"The {side} shape, {name}, in three dimensions. Colours of both shapes: {same}, same "
            "colour; the numbers of a vertex and its partner are shown below.",
            f"{side}-vertex",
        )
        for side, name in zip(_SIDES, names, strict=True)
    ]
    usage = "Point at a place on either shape to see its partner on the other; click to keep it."
    return parts.side_by_side(own, up, views, usage)


def form_section() -> str:
    described = "The canonical forms of both shapes, one over the other, "
    return parts.section(
        "Canonical forms",
        '<div class="pair low">'
        + parts.canvas("before", "As they were computed", described + "before they are aligned.")
        + parts.canvas("after", "Aligned by the match", described + "after they are aligned.")
        + "</div>",
        parts.hint(
            '<span class="chip ours"></span>source '
            '<span class="chip theirs"></span>target. Limbs of forms are thin; every surface is '
            "drawn 1.5 pixels thicker on each side."
        ),
    )


def error_section(found: Evaluation, of_map: str) -> str:
    curves = [("against the ground truth", found.curve())]
    rows = [("mean error", f"{found.mean():.4f}"), ("median error", f"{found.median():.4f}")]
    if found.map_min is not None:
        curves.append(("reflection allowed", found.curve("map-min")))
        rows.append(("mean, reflection allowed (dashed)", f"{found.mean('map-min'):.4f}"))
    rows += [
        ("points counted", f"{len(found.direct):,}"),
        ("target covered", f"{found.coverage:.1%} of its area"),
    ]
    if found.overlap.iou < 1:
        rows += [
            ("share of partners found that exist", f"{found.overlap.precision:.1%}"),
            ("share of existing partners found", f"{found.overlap.recall:.1%}"),
        ]
    x = "geodesic error, in units of the square root of the target's area"
    return parts.section(
        f"Errors{of_map}",
        parts.curve_svg(THRESHOLDS, curves, x),
        table(rows),
        parts.hint(
            f'Coloured by error: 0 <span class="scale"></span> {WORST:g} and more. '
            "Vertices without ground truth take the mean of their neighbours, and are grey far "
            "from any with ground truth; the target shows the error of the points mapped to it."
        ),
    )


def alternatives(match: Match, mirror: bool) -> str:
    taken = min(one.energy for one in match.hypotheses)
    rows: list[tuple[str, ...]] = [
        (
            "taken" if i == 0 else str(i + 1),
            f"{one.energy:.2%}",
            f"{one.energy - taken:+.2%}",
            f"{one.difference:.1%}",
            _right_side_out(one.orientation),
        )
        for i, one in enumerate(match.hypotheses)
    ]
    heads = ["map", "energy", "more than the least", "apart", "right side out"]
    side = " Right side out is the share of the surface that a map does not turn inside out."
    if mirror:  # which turns the surface inside out
        rows, heads, side = [row[:-1] for row in rows], heads[:-1], ""
    return parts.section(
        "Alternatives",
        table(rows, heads),
        parts.hint(
            "The energy is the share of the surfaces' local shape that differs once each patch is "
            "turned and scaled to fit, and more where parts have no partner; a map with hardly "
            "more than the first may well be a symmetry of the shape. Apart is the mean distance "
            "between where it and the first "
            f"lead, as a share of the square root of the area.{side}"
        ),
    )


def _right_side_out(orientation: float) -> str:
    return f"{abs(1 + orientation) / 2:.0%}"


def facts(
    shown: tuple[Shown, Shown],
    match: Match | None,
    command: str,
    ignored: Sequence[str],
    of_map: str,
    mirror: bool,
) -> str:
    rows, own = [], []  # of the shapes, and of the map
    for side, one in zip(("shape",) if mirror else _SIDES, shown, strict=False):
        rows.append((side, "; ".join([one.mesh.name, one.size, *one.mesh.notes, *one.facts])))
    if not mirror:
        rotated = "the target is rotated as a whole, and scaled to the source's size"
        rows.append(("for display", rotated))
    if ignored:
        which = ", ".join(ignored)
        own.append(
            (
                "landmarks ignored",
                f"{which}: they contradict the best-fitting map, or have no partner by it",
            )
        )
    if match is not None:
        own += _measures(match, mirror)
    return parts.how_made([*rows, *((f"{name}{of_map}", told) for name, told in own)], command)


def _measures(match: Match, mirror: bool) -> list[tuple[str, str]]:
    overlap = (
        f"{match.overlap_source:.0%} of the source's, {match.overlap_target:.0%} of the target's"
    )
    rows = [("confidence", confidence_told(match.confidence))]
    if not mirror:
        rows.append(("right side out", f"{_right_side_out(match.orientation)} of the surface"))
    rows.append(("area with a partner", overlap))
    if match.expected_error is not None:
        median, high = match.expected_error_quantiles()
        told = (
            f"up to {median:.3f} at half of the vertices, {high:.3f} at 95% (in square roots of "
            f"the target's area; coloured from 0 to {WORST:g} and more)"
        )
        rows.append(("expected error", told))
    return rows
