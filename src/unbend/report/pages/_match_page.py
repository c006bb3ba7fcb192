"""A page with two matched shapes, on which a point of one shows its partner on the other."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._display import is_doubtful, table, where_landmarks_help
from unbend._types import BoolArray, FloatArray, IntArray, Progress, StrPath
from unbend.canonical import canonical_form
from unbend.choices import Axis
from unbend.correspondence import THRESHOLDS, Evaluation, as_point_map, carry, evaluate, morph
from unbend.errors import InputError, UnbendWarning
from unbend.io import MeshLike, invert_map
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends, vertex_areas
from unbend.report.figures import drawable, fit_rigidly
from unbend.report.pages import _document as parts
from unbend.report.pages._document import Page
from unbend.report.pages._shown import Shown, checked_landmarks, pack_places, pack_whole, show

_Map = Match | IntArray

# Shares at which the morph is computed; pages interpolate with cubics. Maps other than the first
# have fewer, to keep pages small.
_FRAMES, _FEW_FRAMES = (0.2, 0.4, 0.6, 0.8, 1.0), (0.5, 1.0)
# Vertices without ground truth take the mean error of their neighbours, up to so many rings away.
_FILLED_RINGS = 3
_WORST = 0.1  # the error at the end of the colour scale
_SIDES = ("source", "target")


def match_page(
    source: MeshLike,
    target: MeshLike,
    match: Match | npt.ArrayLike,
    path: StrPath | None = None,
    *,
    up: Axis = "y",
    truth: Sequence[npt.ArrayLike] | None = None,
    landmarks: npt.ArrayLike | None = None,
    command: str = "",
    progress: Progress | None = None,
) -> Page:
    """Write a match as a page that opens in any browser, without a network: one HTML file.

    Both shapes turn together, the same place in the same colour; pointing at one marks the partner
    on the other; a slider morphs the source into the target. Below are both canonical forms,
    before and after they are aligned, and what is known of the match.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none:
        such vertices are grey. The page lets choose among a match's alternatives and mirror image.
    path : path, optional
        The file to write, .html. In a notebook the page that is returned shows itself, and its
        method :meth:`Page.open` opens it in a browser.
    up : {"x", "y", "z"}, default="y"
        The source's axis that points upward.
    truth : sequence of 2 or 3 (r,) array_like of int, optional
        Source vertices, their true target vertices and perhaps the mirrored ones, as for
        :func:`unbend.evaluate`: the page then shows the errors.
    landmarks : (l, 2) array_like of int, optional
        Source and target vertices that were given to :func:`unbend.match`, shown with numbers.
    command : str, default=""
        What made the match, shown on the page.
    progress : callable, optional
        Called with a stage's name and the share of it that is done.

    Returns
    -------
    Page

    Raises
    ------
    InputError
        If the map, the truth or the landmarks do not fit, or there is no such axis.
    MeshError, FileError
        If a point cloud has no surface, or the file cannot be written.

    Notes
    -----
    Of a shape with more than 60,000 vertices so many are drawn; all are computed on. The target is
    turned as a whole, and scaled to the area of what is matched, to stand as the source does.

    Examples
    --------
    >>> from unbend.report import match_page
    >>> from unbend.datasets import make_octopus
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> match_page(mesh, mesh, range(600), "match.html")
    Page('octopus to octopus', 0.1 MB)
    """
    step = parts.begin_page(path, up, progress)
    source, target = drawable(source), drawable(target)
    if truth is not None and len(truth) not in (2, 3):
        raise InputError("truth must be 2 or 3 lists: source points, images and mirror images")
    step("page, places", 0.0)
    maps = _maps(match)
    first = next(iter(maps.values()))
    known = first if isinstance(first, Match) else None
    there = as_point_map(first) >= 0
    carried = carry(source.vertices, first, "scalar", source, target)
    target = _standing_alike(target, source, carried, there)
    shown = show(source), show(target)
    step("page, canonical forms", 0.1)
    forms = _form(source), _form(target)
    pairs = checked_landmarks(landmarks, [source, target])
    ignored = known.missed_landmarks if known is not None and pairs else ()
    packed, found = [], []
    for i, one in enumerate(maps.values()):
        step("page, maps", 0.3 + 0.6 * i / len(maps))
        errors = None
        if truth is not None:
            found.append(evaluate(one, target, *truth))
            errors = _errors_of_vertices(source, one, truth, found[-1].direct)
        shares = _FEW_FRAMES if i else _FRAMES
        packed.append(_pack_map(one, shown, forms, errors, shares))
    columns = [_error_section(found[0])] if found else []
    if known is not None and len(known.hypotheses) > 1:
        columns.append(_alternatives(known))
    part = f"{there.sum():,}" if there.all() else f"{there.sum():,} of {len(there):,}"
    trust = ""
    if known is not None and not math.isnan(known.confidence):
        trust = f"; confidence {known.confidence:.2f}"
    return parts.make_page(
        f"{source.name} to {target.name}",
        f"{part} vertices matched to a shape of {target.n_vertices:,}{trust}.",
        [
            _pictures((source.name, target.name), up, list(maps), packed[0]),
            _form_section(),
            '<div class="columns">',
            *columns,
            "</div>",
            _facts(shown, known, command, ignored),
        ],
        {
            "sides": [one.packed() for one in shown],
            "forms": [one.moved(form) for one, form in zip(shown, forms, strict=True)],
            "maps": packed,
            "landmarks": [
                {
                    "label": f"{i + 1} (ignored)" if i in ignored else f"{i + 1}",
                    "at": [int(one.stand_ins[k]) for one, k in zip(shown, pair, strict=True)],
                }
                for i, pair in enumerate(pairs)
            ],
            "worst": _WORST,
        },
        ["match.js"],
        path=path,
        heading=f'{escape(source.name)}<span class="arrow">→</span>{escape(target.name)}',
        band=_doubt(known),
    )


def _maps(match: Match | npt.ArrayLike) -> dict[str, _Map]:
    """Name the maps to choose from."""
    if not isinstance(match, Match):
        return {"as given": as_point_map(match)}
    maps: dict[str, _Map] = {}
    for i, one in enumerate((match, *match.alternatives)):
        trust = "" if math.isnan(one.confidence) else f", confidence {one.confidence:.2f}"
        maps[f"{i + 1}{trust}"] = one
    if match.mirrored is not None:
        maps["reflection"] = match.mirrored
    return maps


def _form(mesh: Mesh) -> FloatArray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnbendWarning)  # match has warned already
        return canonical_form(mesh, component="largest").points


def _standing_alike(target: Mesh, source: Mesh, carried: FloatArray, matched: BoolArray) -> Mesh:
    """Scale and move the target rigidly onto the source, as the map says."""
    there = np.asarray(np.isfinite(carried).all(axis=1))
    areas = vertex_areas(source)[matched].sum(), vertex_areas(target)[there].sum()
    places = target.vertices * (math.sqrt(areas[0] / areas[1]) if min(areas) > 0 else 1.0)
    turn, shift = fit_rigidly(places, carried, reflect=False)
    return Mesh(places @ turn.T + shift, target.faces, name=target.name, notes=target.notes)


def _pack_map(
    match: _Map,
    shown: tuple[Shown, Shown],
    forms: tuple[FloatArray, FloatArray],
    errors: FloatArray | None,
    shares: Sequence[float],
) -> dict[str, Any]:
    """Pack all that a page shows of one map, with its morph at some shares.

    The target is aligned with the source already. `forms` are the canonical forms of both,
    `errors` those of the source's vertices.
    """
    ours, theirs = shown
    source, target = ours.mesh, theirs.mesh
    forward = as_point_map(match)
    backward = match.target_to_source if isinstance(match, Match) else invert_map(forward, target)
    carried = carry(source.vertices, match, "scalar", source, target)
    expected = match.expected_error if isinstance(match, Match) else None
    # Rigid motion, perhaps with a reflection, of the source's form onto the target's.
    images = np.where(forward[:, None] >= 0, forms[1][forward], np.nan)
    turn, shift = fit_rigidly(forms[0], images)
    return {
        "links": [_links(forward[ours.ids], theirs), _links(backward[theirs.ids], ours)],
        "carried": pack_places(carried[theirs.ids]),
        "frames": [pack_places(one) for one in _frames(ours, target, match, shares)],
        "errors": _pack_errors(errors, ours),
        "expected": _pack_errors(expected, ours),
        "rotation": turn.tolist(),
        "translation": shift.tolist(),
    }


def _pack_errors(errors: FloatArray | None, shown: Shown) -> dict[str, Any] | None:
    """Pack errors of shown vertices up to 1; unknown ones are -1."""
    if errors is None:
        return None
    return pack_places(np.nan_to_num(np.minimum(errors[shown.ids, None], 1.0), nan=-1.0))


def _links(partners: IntArray, other: Shown) -> dict[str, Any]:
    """Pack partners, -1 for none, and the shown vertices that stand for them."""
    seen = np.where(partners >= 0, other.stand_ins[partners], -1)
    same = (seen == partners).all()
    return {"partners": pack_whole(partners), "standIns": None if same else pack_whole(seen)}


def _frames(ours: Shown, target: Mesh, match: _Map, shares: Sequence[float]) -> list[FloatArray]:
    """Positions of the shown vertices along the morph; none if fewer than three have an image."""
    images = as_point_map(match)[ours.ids]
    if (images >= 0).sum() < 3:
        return []
    along: _Map = images
    if isinstance(match, Match) and match.faces is not None and match.weights is not None:
        faces, weights = match.faces[ours.ids], match.weights[ours.ids]
        along = replace(match, source_to_target=images, faces=faces, weights=weights)
    thin = Mesh(ours.places, ours.faces)
    return [morph(thin, target, along, share).vertices for share in shares]


def _errors_of_vertices(
    source: Mesh, match: _Map, truth: Sequence[npt.ArrayLike], direct: FloatArray
) -> FloatArray:
    """Error of each source vertex, or mean error of its neighbours, or NaN."""
    forward = as_point_map(match)
    sources, images = (np.asarray(one) for one in truth[:2])
    counted = (forward[sources] >= 0) & (images >= 0)
    errors = np.full(len(forward), np.nan)
    errors[sources[counted]] = np.minimum(direct, 1.0)
    ends = edge_ends(source.faces, len(forward))
    i, j = np.concatenate([ends, ends[:, ::-1]]).T
    for _ in range(_FILLED_RINGS):
        known = np.isfinite(errors)
        near, of = i[known[i]], j[known[i]]
        count = np.bincount(of, minlength=len(errors))
        mean = np.bincount(of, errors[near], len(errors)) / np.maximum(count, 1)
        errors = np.where(known | (count == 0), errors, mean)
    return errors


def _doubt(match: Match | None) -> str:
    """Warning above the page of a match that may well be wrong; empty for other matches."""
    if match is None or not is_doubtful(match.confidence):
        return ""
    others = "from the menu Map" if match.alternatives else "by asking for alternatives"
    return (
        f"This match is doubtful: its confidence is {match.confidence:.2f}. Look whether the same "
        "places have the same colour. If they do not, place one to three landmarks"
        f"{where_landmarks_help(match.landmark_hints)} and match again, or take another map "
        f"{others}."
    )


def _pictures(names: Sequence[str], up: str, maps: Sequence[str], first: dict[str, Any]) -> str:
    """Both shapes, with controls that move and colour them as the first map, packed, allows."""
    own = ""
    if len(maps) > 1:
        own += parts.select("Map", "map", {str(i): one for i, one in enumerate(maps)})
    if first["frames"]:
        own += (
            '<label>Morph <input type="range" id="morph" min="0" max="1" step="0.005" value="0">'
            '</label><button type="button" id="play">Play</button>'
        )
    paints = {"0": "same place, same colour"}
    if first["errors"] is not None:
        paints["1"] = "by error"
    if first["expected"] is not None:
        paints["expected"] = "by expected error"
    own += parts.select("Colours", "paint", paints | {"2": "plain"})
    views = [
        parts.canvas(
            side,
            f"{side.capitalize()}: {name}",
            f"The {side} shape, {name}, in three dimensions. The same place has the same colour on "
            "both shapes; the numbers of a vertex and its partner are shown below.",
            f"{side}-vertex",
        )
        for side, name in zip(_SIDES, names, strict=True)
    ]
    usage = "Point at a place on either shape to see its partner on the other; click to keep it."
    return parts.side_by_side(own, up, views, usage)


def _form_section() -> str:
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


def _error_section(found: Evaluation) -> str:
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
        "Errors",
        parts.curve_svg(THRESHOLDS, curves, x, "points within it, %"),
        table(rows),
        parts.hint(
            f'Coloured by error: 0 <span class="scale"></span> {_WORST:g} and more. '
            "Vertices without ground truth take the mean of their neighbours, and are grey far "
            "from any with ground truth; the target shows the error of the points mapped to it."
        ),
    )


def _alternatives(match: Match) -> str:
    taken = min(one.energy for one in match.hypotheses)
    rows = [
        (
            "taken" if i == 0 else str(i + 1),
            f"{one.energy:.2%}",
            f"{one.energy - taken:+.2%}",
            f"{one.difference:.1%}",
            f"{(1 + one.orientation) / 2:.0%}",
        )
        for i, one in enumerate(match.hypotheses)
    ]
    return parts.section(
        "Alternatives",
        table(rows, ("map", "unexplained", "more than the least", "apart", "right side out")),
        parts.hint(
            "Unexplained is the share of the surfaces' local shape that differs once each patch is "
            "turned and scaled to fit; a map that leaves hardly more than the first may well be a "
            "symmetry of the shape. Apart is the mean distance between where it and the first "
            "lead, as a share of the square root of the area. Right side out is the share of the "
            "surface that a map does not turn inside out."
        ),
    )


def _facts(
    shown: tuple[Shown, Shown], match: Match | None, command: str, ignored: Sequence[int]
) -> str:
    rows = []
    for side, one in zip(_SIDES, shown, strict=True):
        rows.append((side, "; ".join([one.mesh.name, one.size, *one.mesh.notes, *one.facts])))
    rows.append(
        ("for display", "the target is rotated as a whole, and scaled to the source's size")
    )
    if ignored:
        which = ", ".join(str(i + 1) for i in ignored)
        rows.append(("landmarks ignored", f"{which}: they contradict the best-fitting map"))
    if match is None:
        return parts.how_made(rows, command)
    known = not math.isnan(match.confidence)
    overlap = (
        f"{match.overlap_source:.0%} of the source's, {match.overlap_target:.0%} of the target's"
    )
    rows += [
        ("confidence", f"{match.confidence:.2f}" if known else "not estimated"),
        ("right side out", f"{(1 + match.orientation) / 2:.0%} of the surface"),
        ("area with a partner", overlap),
        ("residual of the aligned forms", f"{match.residual:.3f}"),
    ]
    if match.expected_error is not None:
        median, high = match.expected_error_quantiles()
        told = (
            f"up to {median:.3f} at half of the vertices, {high:.3f} at 95 % (in square roots of "
            f"the target's area; coloured from 0 to {_WORST:g} and more)"
        )
        rows.append(("expected error", told))
    return parts.how_made(rows, command)
