"""A page with two matched shapes, on which a point of one shows its partner on the other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._types import BoolArray, FloatArray, IntArray, Progress, StrPath
from unbend.canonical import canonical_form
from unbend.choices import Axis
from unbend.correspondence import as_point_map, carry, evaluate, inverted, morph
from unbend.errors import InputError, heard
from unbend.io import MeshLike
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends, vertex_areas
from unbend.preparation import join_seams
from unbend.report.figures import drawable, fit_rigidly
from unbend.report.match_figures import is_symmetry
from unbend.report.pages import _document as parts
from unbend.report.pages import _match_words as words
from unbend.report.pages._document import Page
from unbend.report.pages._shown import Shown, checked_landmarks, pack_places, pack_whole, show

_Map = Match | IntArray

# Shares at which the morph is computed; pages interpolate with cubics. Maps other than the first
# have fewer, to keep pages small.
_FRAMES, _FEW_FRAMES = (0.2, 0.4, 0.6, 0.8, 1.0), (0.5, 1.0)
# Vertices without ground truth take the mean error of their neighbours, up to so many rings away.
_FILLED_RINGS = 3


def match_page(
    source: MeshLike,
    target: MeshLike,
    match: Match | npt.ArrayLike,
    path: StrPath | None = None,
    *,
    up: Axis = "y",
    truth: Sequence[npt.ArrayLike] | None = None,
    landmarks: npt.ArrayLike | Mapping[str, Any] | None = None,
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
        such vertices are grey. The page offers the match's alternatives and mirror image, too.
    path : path, optional
        The file to write, .html. In a notebook the returned page is shown; :meth:`Page.open` opens
        it in a browser.
    up : {"x", "y", "z"}, default="y"
        The source's axis that points upward.
    truth : sequence of 2 or 3 (r,) array_like of int, optional
        Source vertices, their true target vertices and perhaps the mirrored ones, as for
        :func:`unbend.evaluate`: the page then shows the errors.
    landmarks : (l, 2) array_like of int, or mapping of str to such pairs, optional
        Source and target vertices that were given to :func:`unbend.match`, shown with their labels
        or numbers.
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
    At most 60,000 vertices of a shape are drawn. The target is rotated and scaled to the source.
    For a :func:`unbend.symmetry`, with the same object as source and target, the page shows the
    shape twice, without a morph.

    Examples
    --------
    >>> from unbend.report import match_page
    >>> from unbend.datasets import make_octopus
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> match_page(mesh, mesh, range(600), "match.html")
    Page('octopus to octopus', 0.1 MB)
    """
    step = parts.begin_page(path, up, progress)
    mirror = is_symmetry(source, target, match)
    source, target = drawable(source), drawable(target)
    if truth is not None and len(truth) not in (2, 3):
        raise InputError("truth must be 2 or 3 lists: source points, images and mirror images")
    step("page, places", 0.0)
    maps = _maps(match)
    first = next(iter(maps.values()))
    known = first if isinstance(first, Match) else None
    there = as_point_map(first) >= 0
    if not mirror:
        carried = carry(source.vertices, first, "scalar", source, target)
        target = _standing_alike(target, source, carried, there)
    shown = show(source), show(target)
    step("page, canonical forms", 0.1)
    forms = _form(source), _form(target)
    named = checked_landmarks(landmarks, [source, target])
    if named and max((i for one in maps.values() for i in _ignored(one)), default=0) >= len(named):
        raise InputError("landmarks must be all those that match was given, in the same order")
    ignored = [named[i][0] for i in _ignored(first)] if named else []
    packed, found = [], []
    for i, one in enumerate(maps.values()):
        step("page, maps", 0.3 + 0.6 * i / len(maps))
        errors = None
        if truth is not None:
            # A runner-up may leave all rows of the ground truth without partner.
            with suppress(InputError) if i else nullcontext():
                found.append(evaluate(one, target, *truth))
                errors = _errors_of_vertices(source, one, truth, found[-1].direct)
        shares = () if mirror else _FEW_FRAMES if i else _FRAMES
        packed.append(_pack_map(one, shown, forms, errors, shares))
    of_first = " of map 1" if len(maps) > 1 else ""
    columns = [words.error_section(found[0], of_first)] if found else []
    if known is not None and len(known.hypotheses) > 1:
        columns.append(words.alternatives(known, mirror))
    part = f"{there.sum():,}" if there.all() else f"{there.sum():,} of {len(there):,}"
    trust = ""
    if known is not None and not math.isnan(known.confidence):
        trust = f"; confidence {known.confidence:.2f}"
    title = f"{source.name} to {target.name}"
    heading = f'{escape(source.name)} <span class="arrow">→</span> {escape(target.name)}'
    which = "Map 1: " if len(maps) > 1 else ""
    lead = f"{which}{part} vertices matched to a shape of {target.n_vertices:,}{trust}."
    if mirror:
        title, heading = f"Left and right of {source.name}", ""
        lead = f"{part} vertices have a mirror partner{trust}."
    return parts.make_page(
        title,
        lead,
        [
            words.pictures((source.name, target.name), up, list(maps), packed[0], mirror),
            words.form_section(),
            '<div class="columns">',
            *columns,
            "</div>",
            words.facts(shown, known, command, ignored, of_first, mirror),
        ],
        {
            "sides": [one.packed() for one in shown],
            "forms": [one.moved(form) for one, form in zip(shown, forms, strict=True)],
            "maps": packed,
            "landmarks": [
                {
                    "label": label,
                    "at": [int(one.stand_ins[k]) for one, k in zip(shown, pair, strict=True)],
                }
                for label, pair in named
            ],
            "worst": words.WORST,
        },
        ["match.js"],
        path=path,
        heading=heading,
        band=words.doubt(known, mirror, bool(named)),
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


def _ignored(match: _Map) -> list[int]:
    """Landmarks that a map does not follow."""
    return list(match.missed_landmarks) if isinstance(match, Match) else []


def _form(mesh: Mesh) -> FloatArray:
    with heard():  # match has warned already
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
    backward = match.target_to_source if isinstance(match, Match) else inverted(forward, target)
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
        "ignored": _ignored(match),
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
    with heard():  # that a map is a reflection, or units differ, is seen, and told where it matters
        return [morph(thin, target, along, share).vertices for share in shares]


def _errors_of_vertices(
    source: Mesh, match: _Map, truth: Sequence[npt.ArrayLike], direct: FloatArray
) -> FloatArray:
    """Error of each source vertex, or mean error of its neighbours, or NaN."""
    forward = as_point_map(match)
    sources, images = (np.asarray(one) for one in truth[:2])
    counted = (forward[sources] >= 0) & (images >= 0)
    joined, number = join_seams(source)
    errors = np.full(len(forward), np.nan)
    errors[number[sources[counted]]] = np.minimum(direct, 1.0)
    ends = edge_ends(joined.faces, len(forward))
    i, j = np.concatenate([ends, ends[:, ::-1]]).T
    for _ in range(_FILLED_RINGS):
        known = np.isfinite(errors)
        near, of = i[known[i]], j[known[i]]
        count = np.bincount(of, minlength=len(errors))
        mean = np.bincount(of, errors[near], len(errors)) / np.maximum(count, 1)
        errors = np.where(known | (count == 0), errors, mean)
    return np.asarray(errors[number])
