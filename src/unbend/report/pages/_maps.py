"""A map from one shape to another, packed for a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray, IntArray
from unbend.correspondence import as_point_map, carry, evaluate, morph
from unbend.io import invert_map
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends
from unbend.report.figures import fit_rigidly
from unbend.report.pages._packing import pack_places, pack_whole
from unbend.report.pages._shown import Shown, places_as_colors

# Shares at which the morph is computed; pages interpolate with cubics. Maps other than the first
# have fewer, to keep pages small.
_FRAMES, _FEW_FRAMES = (0.2, 0.4, 0.6, 0.8, 1.0), (0.5, 1.0)
# Vertices without ground truth take the mean error of their neighbours, up to so many rings away.
_FILLED_RINGS = 3


def pack_map(
    source: Mesh,
    target: Mesh,
    match: Match | IntArray,
    shown: tuple[Shown, Shown],
    forms: tuple[FloatArray, FloatArray],
    truth: Sequence[npt.ArrayLike] | None,
    *,
    first: bool,
) -> dict[str, Any]:
    """Pack all that a page shows of one map.

    The target is aligned with the source already. `forms` are the canonical forms of both;
    `first` says that the page shows this map first.
    """
    ours, theirs = shown
    forward = as_point_map(match)
    backward = match.target_to_source if isinstance(match, Match) else invert_map(forward, target)
    carried = carry(source.vertices, match, "scalar", source, target)
    colors = places_as_colors(source, ours, carried)[theirs.ids]
    shares = _FRAMES if first else _FEW_FRAMES
    errors = None if truth is None else _errors_of_vertices(source, target, match, truth)
    expected = match.expected_error if isinstance(match, Match) else None
    return {
        "source": _links(forward[ours.ids], theirs),
        "target": _links(backward[theirs.ids], ours) | {"colors": pack_places(colors)},
        "frames": [pack_places(one) for one in _frames(source, target, match, ours, shares)],
        "errors": None if errors is None else _pack_errors(errors[ours.ids]),
        "expected": None if expected is None else _pack_errors(expected[ours.ids]),
        **_motion(forms, forward),
    }


def _pack_errors(errors: FloatArray) -> dict[str, Any]:
    """Pack errors up to 1; unknown ones are -1."""
    return pack_places(np.nan_to_num(np.minimum(errors, 1.0), nan=-1.0)[:, None])


def _links(partners: IntArray, other: Shown) -> dict[str, Any]:
    """Pack partners, -1 for none, and the shown vertices that stand for them."""
    seen = np.where(partners >= 0, other.stand_ins[partners], -1)
    same = (seen == partners).all()
    return {
        "partners": pack_whole(partners),
        "standIns": None if same else pack_whole(seen),
    }


def _frames(
    source: Mesh, target: Mesh, match: Match | IntArray, ours: Shown, shares: Sequence[float]
) -> list[FloatArray]:
    """Positions of the shown vertices along the morph; none if fewer than three have an image."""
    images = as_point_map(match)[ours.ids]
    if (images >= 0).sum() < 3:
        return []
    along: Match | IntArray = images
    if isinstance(match, Match) and match.faces is not None and match.weights is not None:
        along = replace(
            match,
            source_to_target=images,
            faces=match.faces[ours.ids],
            weights=match.weights[ours.ids],
        )
    thin = Mesh(source.vertices[ours.ids], ours.faces)
    return [morph(thin, target, along, share).vertices for share in shares]


def _motion(forms: tuple[FloatArray, FloatArray], forward: IntArray) -> dict[str, Any]:
    """Rigid motion, perhaps with a reflection, of the source's form onto the target's."""
    images = np.full_like(forms[0], np.nan)
    there = forward >= 0
    images[there] = forms[1][forward[there]]
    turn, shift = fit_rigidly(forms[0], images)
    return {"rotation": turn.tolist(), "translation": shift.tolist()}


def _errors_of_vertices(
    source: Mesh, target: Mesh, match: Match | IntArray, truth: Sequence[npt.ArrayLike]
) -> FloatArray:
    """Error of each source vertex, or mean error of its neighbours, or -1."""
    forward = as_point_map(match)
    direct = evaluate(match, target, *truth).direct
    sources, images = (np.asarray(one) for one in truth[:2])
    counted = (forward[sources] >= 0) & (images >= 0)
    errors = np.full(len(forward), -1.0)
    errors[sources[counted]] = np.minimum(direct, 1.0)
    ends = edge_ends(source.faces, len(forward))
    for _ in range(_FILLED_RINGS):
        known = errors >= 0
        i, j = np.concatenate([ends, ends[:, ::-1]]).T
        i, j = i[known[i]], j[known[i]]
        count = np.bincount(j, minlength=len(errors))
        mean = np.bincount(j, errors[i], len(errors)) / np.maximum(count, 1)
        errors = np.where(known | (count == 0), errors, mean)
    return errors
