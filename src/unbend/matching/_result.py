"""What the matcher returns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from unbend._display import confidence_told, table
from unbend._types import FloatArray, IntArray
from unbend.errors import warn
from unbend.matching._score import in_one_unit

_SURE = 0.9  # confidence from which sizes that differ are those of two kinds of bodies


@dataclass(frozen=True)
class Hypothesis:
    """What the search knows of one way to match two shapes.

    Attributes
    ----------
    energy : float
        Share of the surfaces' local shape that the map's turned patches leave unexplained, both
        directions, on coarse copies, and 0.06 times minus the logarithm of either share of the area
        that has a partner; lower is better.
    orientation : float
        Share of the surface that is kept right side out, less the rest: -1 to 1.
    difference : float
        Mean geodesic distance, in square roots of the target's area, between where it and the map
        of the match lead; 0 for the one that was taken.
    """

    energy: float
    orientation: float
    difference: float = 0.0


@dataclass(frozen=True, eq=False)
class Match:
    """A map between two shapes.

    Attributes
    ----------
    source_to_target : (n_source,) ndarray of int64
        Target vertex of each source vertex; -1 where there is no partner: at source vertices that
        no face uses, outliers of a point cloud, and what only the source has.
    target_to_source : (n_target,) ndarray of int64
        Source vertex of each target vertex, likewise.
    functional_map : (k, k) ndarray of float64
        Pulls functions back from target to source, in the first k eigenfunctions (the constant
        among them, unit total area) of the largest components, their long edges split if they are
        coarse, or of the surfaces of points, as of a cloud and of a mesh of which parts are cut
        apart: ``source_basis @ functional_map`` is close to ``target_basis[source_to_target]``
        if all of the source has partners; if not, to that continued by 0, which is far off around
        where partners end. It is
        ``source_basis.T @ diag(a) @ target_basis[source_to_target]`` for the areas `a` of the
        source's :func:`unbend.laplacian`, as shares of the whole, but 0 where there is no partner.
    orientation : float
        Share of the surface that is kept right side out, less the rest: about 1 for a good map,
        and -1 for its mirror image.
    confidence : float
        Estimate, 0 to 1, of the probability that the map is right as a whole: that its mean
        geodesic error is below 0.08 of the square root of the area. It is low if a shape is round
        and there are not two landmarks, because nothing shows how far it is turned; and lower if
        parts are matched whose areas differ, unless they must be in different units.
    confidence_bound : float
        The highest confidence, 0 to 1, that the finished map allows. It is below 1 if more than a
        tenth of the surface is turned inside out, crowded together, or not cycle-consistent; then
        part of the map is wrong. `confidence` is never higher.
    area_ratio : float
        Of shapes that may be partial, and 1 of others: the area on the target that has a partner,
        by that on the source, in the units of the meshes.
    disorder : float
        The largest of those shares of the area, what is turned inside out counted twice: 0 to 2.
        `confidence` falls with it from 0 on.
    hypotheses : tuple of Hypothesis
        The best one, then the runners-up. Those that differ from it by less than 0.06 on average
        are right together with it.
    faces, weights : (n_source,) ndarray of int64, (n_source, 3) ndarray of float64, or None
        When asked for, and the target has faces: the face that each source vertex falls on, and
        its barycentric coordinates there; -1 and NaN at source vertices without partner.
    mirrored : (n_source,) ndarray of int64, or None
        When asked for: the best map that turns the surface inside out, for a symmetric shape the
        map composed with its left-right symmetry.
    overlap_source, overlap_target : float
        Share of either shape's area, all components included, that has a partner on the other
        one, 0 to 1.
    alternatives : tuple of Match
        When asked for: the runners-up as full matches, each with its own confidence. A symmetric
        body has several maps that are equally good, and they share the probability.
    mirror_fits : bool
        Whether the target's mirror image fits clearly better, as if one shape were a left hand and
        the other a right one; then `confidence` is next to 0. A symmetric body in two mirrored
        poses looks like that, too.
    missed_landmarks : tuple of int
        Rows of the landmarks that were ignored, because they contradict the map, and of those that
        it gives no partner.
    landmark_hints : tuple of int
        Source vertices where landmarks would help most, because runners-up that are nearly as good
        differ most there. Empty if none is as good.
    expected_error : (n_source,) ndarray of float64, or None
        Where to trust the map: a geodesic distance, in square roots of the target's area, that
        about nine errors in ten stay below; NaN without partner. It is large where `hypotheses`
        that may be right differ. None for a match from a file of an early version.
    """

    source_to_target: IntArray
    target_to_source: IntArray
    functional_map: FloatArray
    orientation: float
    confidence: float
    hypotheses: tuple[Hypothesis, ...] = ()
    faces: IntArray | None = None
    weights: FloatArray | None = None
    mirrored: IntArray | None = None
    overlap_source: float = 1.0
    overlap_target: float = 1.0
    confidence_bound: float = 1.0
    area_ratio: float = 1.0
    disorder: float = 0.0
    alternatives: tuple[Match, ...] = ()
    mirror_fits: bool = False
    missed_landmarks: tuple[int, ...] = ()
    landmark_hints: tuple[int, ...] = ()
    expected_error: FloatArray | None = None

    def expected_error_quantiles(self) -> tuple[float, float]:
        """Median and 95th percentile of `expected_error`; NaN if nothing is known."""
        known = np.empty(0) if self.expected_error is None else self.expected_error
        known = known[np.isfinite(known)]
        if not len(known):
            return math.nan, math.nan
        median, high = np.quantile(known, (0.5, 0.95))
        return float(median), float(high)

    def __repr__(self) -> str:
        part = min(self.overlap_source, self.overlap_target)
        overlap = "" if part == 1 else f"overlap {part:.0%}, "
        return (
            f"Match({len(self.source_to_target)} to {len(self.target_to_source)} vertices, "
            f"{overlap}confidence {confidence_told(self.confidence)})"
        )

    def _repr_html_(self) -> str:
        matched, n = int((self.source_to_target >= 0).sum()), len(self.source_to_target)
        mirror = self.orientation < 0
        kept, there, back = (
            (1 + abs(self.orientation)) / 2,
            self.overlap_source,
            self.overlap_target,
        )
        overlap = ("overlap", f"{there:.0%} of the source's area, {back:.0%} of the target's")
        rows = [
            ("match", f"{matched:,} of {n:,} vertices, to {len(self.target_to_source):,}"),
            *([overlap] if min(there, back) < 1 else []),
            ("confidence", confidence_told(self.confidence)),
            ("mirrored" if mirror else "right side out", f"{kept:.0%} of the surface"),
            *(
                ("another map" if i else "this map", f"energy {one.energy:.1%}")
                for i, one in enumerate(self.hypotheses[:5])
            ),
        ]
        return table(rows)


def faults_of(match: Match) -> list[str]:
    """Say what shows that a map is wrong, in part or altogether."""
    faults = []
    if round(match.confidence_bound, 2) < 1:
        faults.append(
            "part of the map is wrong: in places it turns the surface inside out, crowds it "
            f"together or is not cycle-consistent (orientation {match.orientation:+.2f}, "
            f"confidence at most {match.confidence_bound:.2f}); look at it, and give landmarks"
        )
    # Where the ratio makes even odds less than one to nine.
    if match.confidence < _SURE and in_one_unit(0.5, match.area_ratio) < 0.1:
        faults.append(
            f"the matched part of the target is {match.area_ratio:.2g} times as large as that of "
            "the source: if both are in one unit, the map is probably wrong"
        )
    return faults


def warn_of_faults(match: Match) -> None:
    """Warn of each."""
    for fault in faults_of(match):
        warn(fault)
