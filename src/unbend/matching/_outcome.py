"""From the best candidates to a match of the meshes' vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from unbend._arrays import first_largest, snap
from unbend._types import FloatArray, IntArray
from unbend.deformation import closest_faces
from unbend.matching._inputs import Input, expand, expand_rows
from unbend.matching._plan import MEDIUM, Sides, mean_differences
from unbend.matching._registration import Registered, landing_places
from unbend.matching._result import Hypothesis, Match
from unbend.matching._score import (
    Candidate,
    alike_share,
    confidence_bound,
    disorder,
    expected_errors,
    in_one_unit,
    nearly_as_good,
    plausibility,
)
from unbend.matching._shape import Shape

_MOST_HINTS = 3  # places where a landmark would help


def make_match(
    ours: Input,
    theirs: Input,
    sides: Sides,
    chosen: Candidate,
    ranks: Sequence[Candidate],
    shares: FloatArray,
    apart: FloatArray,
    most: float = 1.0,
) -> Match:
    """Describe the finished map, and how far to trust it beside the candidates in ``ranks``.

    ``shares`` (r,) are their probabilities, ``apart`` (r, n) how far from the first they lead, and
    ``most`` is the highest confidence.
    """
    left, right, registered = ours.shape, theirs.shape, chosen.registered
    source = sides.source.proxies[MEDIUM]
    means = mean_differences(sides, ranks[0], apart)
    in_disorder = disorder(left, right, chosen)
    taken = as_taken(theirs, chosen)
    partners = _own_partners(ours, taken, registered)
    there = registered.source.overlap
    forward = expand(partners, there, ours, theirs)
    backward = vertex_images(taken, ours, registered.back())
    bound = confidence_bound(in_disorder)
    plausible = min(plausibility(ranks[0].energy, in_disorder), most)
    confidence = min(alike_share(shares, means) * plausible, bound)
    ratio = _area_ratio(ours, theirs, forward, backward) if sides.partial else 1.0
    confidence = in_one_unit(confidence, ratio)
    scale = np.sqrt(theirs.surface.area / theirs.areas.sum())  # below 1 of several components
    lost = ~there[left.landmarks] | ~registered.target.overlap[right.landmarks]
    elsewhere = (shares @ apart)[source.parents]
    errors = expected_errors(left, right, chosen, elsewhere, 1 - confidence)
    # Beyond what the matcher knows, the next vertex of a coarse mesh may be far.
    errors += np.linalg.norm(right.vertices[registered.forward] - right.vertices[partners], axis=1)
    return Match(
        source_to_target=forward,
        target_to_source=backward,
        functional_map=_functional_map(left, right, registered.forward, left.areas * there),
        orientation=_orientation(chosen),
        confidence=confidence,
        overlap_source=_share_matched(ours, forward),
        overlap_target=_share_matched(theirs, backward),
        confidence_bound=bound,
        area_ratio=ratio,
        disorder=in_disorder,
        hypotheses=tuple(
            Hypothesis(one.energy, _orientation(one), mean)
            for one, mean in zip(ranks, (scale * means).tolist(), strict=True)
        ),
        missed_landmarks=tuple(np.flatnonzero(chosen.missed | lost).tolist()),
        expected_error=scale * (expand_rows(errors, ours, np.nan) + ours.away),
    )


def landmark_hints(
    ours: Input, sides: Sides, ranks: Sequence[Candidate], apart: FloatArray
) -> tuple[int, ...]:
    """Source vertices around which the first candidate and others nearly as good differ most."""
    source = sides.source.proxies[MEDIUM]
    hints: list[int] = []
    for other, far in zip(ranks[1:], apart[1:], strict=True):
        if len(hints) == _MOST_HINTS or not nearly_as_good(other, ranks[0]):
            break
        around = source.shape.averaged(source.shape.areas * far, source.shape.detail)
        off = (
            ours.shape.vertices[: len(ours.kept)]
            - source.shape.vertices[first_largest(snap(around))]
        )
        hints.append(int(ours.kept[np.linalg.norm(off, axis=1).argmin()]))
    return tuple(dict.fromkeys(hints))


def below_vertices(result: Match, ours: Input, theirs: Input, chosen: Candidate) -> Match:
    """Add where each source vertex falls within a face of the target, if that has faces."""
    if (theirs.uncut or theirs).own_faces is None:
        return result
    registered, taken = chosen.registered, as_taken(theirs, chosen)
    landing = landing_places(ours.shape, taken.shape, registered)
    faces, weights = closest_faces(
        *landing, theirs.shape.faces, theirs.shape.fans, registered.forward
    )
    if theirs.uncut is not None:
        partners = _own_partners(ours, taken, registered)
        faces, weights = theirs.on_uncut_faces(faces, weights, partners)
    faces, weights = (theirs.uncut or theirs).on_own_faces(faces, weights)
    faces = np.where(registered.source.overlap, faces, -1)
    weights = np.where(registered.source.overlap[:, None], weights, np.nan)
    return replace(
        result, faces=expand_rows(faces, ours, -1), weights=expand_rows(weights, ours, np.nan)
    )


def vertex_images(source: Input, target: Input, found: Registered) -> IntArray:
    """Vertices (n,) of the target's mesh that vertices of the source's have as partners, or -1."""
    return expand(_own_partners(source, target, found), found.source.overlap, source, target)


def _own_partners(source: Input, target: Input, found: Registered) -> IntArray:
    """Partners that are vertices of the target's mesh; within a face, its corner nearest there."""
    partners = found.forward.copy()
    split = partners >= len(target.kept)
    if split.any():
        landing, places = landing_places(source.shape, target.shape, found)
        shape = target.shape
        faces, _ = closest_faces(landing[split], places, shape.faces, shape.fans, partners[split])
        corners = target.own_corners[faces]
        off = np.linalg.norm(places[corners] - landing[split, None], axis=2)
        partners[split] = np.take_along_axis(corners, off.argmin(axis=1)[:, None], axis=1)[:, 0]
    return partners


def as_taken(target: Input, chosen: Candidate) -> Input:
    """Take the target as a candidate does: as it is, or as its mirror image."""
    return target._replace(shape=target.shape.reflected()) if chosen.reflected else target


def _functional_map(
    source: Shape, target: Shape, forward: IntArray, areas: FloatArray
) -> FloatArray:
    """Functional map of a point map, the constant function first."""
    k = min(source.k, target.k)
    carried = target.basis[forward, :k]
    carried *= areas[:, None]
    basis = source.basis[:, :k]
    return np.block(
        [[areas.sum(), carried.sum(axis=0)], [(basis.T @ areas)[:, None], basis.T @ carried]]
    )


def _share_matched(given: Input, images: IntArray) -> float:
    """Share of the area of all that was given: far components and outliers have no partner."""
    matched, areas = images >= 0, given.areas
    return 1.0 if matched[areas > 0].all() else float(areas @ matched / areas.sum())


def _area_ratio(ours: Input, theirs: Input, forward: IntArray, backward: IntArray) -> float:
    """Area of what has a partner on the target, by that on the source, in units of the meshes."""
    source, target = ours.areas[forward >= 0].sum(), theirs.areas[backward >= 0].sum()
    return float(target / source) if min(source, target) > 0 else 1.0


def _orientation(one: Candidate) -> float:
    return -one.orientation if one.reflected else one.orientation
