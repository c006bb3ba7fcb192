"""Evaluation of point maps against ground truth, by stated protocols."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice
from unbend._display import Brief, table
from unbend._memory import available_memory
from unbend._text import plural
from unbend._types import BoolArray, FloatArray, IntArray, Progress
from unbend.choices import GeodesicKind
from unbend.correspondence._archive import mesh_hashes
from unbend.correspondence._transfer import as_point_map
from unbend.distances import GEODESIC, geodesic_solver
from unbend.errors import InputError, MeshError, heard, warn
from unbend.io import MeshLike, as_mesh, checked_map
from unbend.matching import Match
from unbend.mesh import Mesh, vertex_areas, vertex_ids
from unbend.preparation import join_seams

THRESHOLDS = np.arange(17) / 80
"""Error thresholds of the paper's curves (Table 1, Fig. 2), in units of sqrt(target area)."""
THRESHOLDS.setflags(write=False)
_SHOWN = (4, 8)  # thresholds that a table shows

# Distances, and what they warned of, are kept for the meshes used last, up to this size; for the
# last one if memory is free.
_KEPT_BYTES = 2**30
_kept: dict[tuple[int, ...], dict[int, tuple[FloatArray, list[str]]]] = {}
_ROUNDED = 1 + 1e-6  # they are in single precision


@dataclass(frozen=True)
class Overlap:
    """How well a map found which part of the source has a partner at all.

    Attributes
    ----------
    precision : float
        Of the rows that were given an image, the share that truly has one.
    recall : float
        Of the rows that truly have an image, the share that was given one.
    iou : float
        Intersection over union: rows with both over rows with either.
    """

    precision: float
    recall: float
    iou: float


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation(Brief):
    """Geodesic errors of a point map, by three protocols.

    Errors are geodesic distances on the target from the true image to the image found, divided by
    the square root of the target's area; infinite where no path joins them.

    Attributes
    ----------
    direct : (r,) ndarray of float64
        By the ground truth as given, one for each of its rows that has an image.
    map_min, vertex_min : (q,) ndarray of float64, or None
        One for each of these rows that also has a mirrored image, by the better of the direct and
        the mirrored ground truth for the whole map, or for every row, which is the loosest.
    coverage : float
        Share of the target's area at vertices that some source vertex is mapped to.
    overlap : Overlap
        Of parts: rows of the ground truth whose target vertex is -1 have no true image.
    """

    direct: FloatArray
    map_min: FloatArray | None
    vertex_min: FloatArray | None
    coverage: float
    overlap: Overlap

    def errors(self, protocol: str = "direct") -> FloatArray:
        """Errors by ``"direct"``, ``"map-min"`` or ``"vertex-min"``.

        Raises
        ------
        InputError
            If there is no such protocol, or it needs a mirrored ground truth.
        """
        known = {"direct": self.direct, "map-min": self.map_min, "vertex-min": self.vertex_min}
        check_choice(protocol, "protocol", known)
        found = known[protocol]
        if found is None:
            raise InputError(f"protocol {protocol!r} needs the mirrored ground truth")
        return found

    def mean(self, protocol: str = "direct") -> float:
        """Mean error."""
        return float(self.errors(protocol).mean())

    def median(self, protocol: str = "direct") -> float:
        """Median error."""
        return float(np.median(self.errors(protocol)))

    def curve(self, protocol: str = "direct") -> FloatArray:
        """Percentage of rows with an error of at most each of `THRESHOLDS`: (17,)."""
        errors = self.errors(protocol)
        return np.asarray(100 * (errors[:, None] <= THRESHOLDS * _ROUNDED).mean(axis=0))

    def auc(self, protocol: str = "direct") -> float:
        """Area under the curve from 0 to 0.2, as a share of the best possible: 0 to 1."""
        curve = self.curve(protocol) / 100
        return float(((curve[1:] + curve[:-1]) / 2).mean())

    def _repr_html_(self) -> str:
        rows = []
        for name in ["direct"] + ["map-min", "vertex-min"] * (self.map_min is not None):
            shares = [f"{self.curve(name)[i]:.1f}%" for i in _SHOWN]
            rows.append((name, f"{self.mean(name):.4f}", f"{self.median(name):.4f}", *shares))
        within = [f"within {THRESHOLDS[i]:g}" for i in _SHOWN]
        return table(rows, ("protocol", "mean error", "median", *within))


def evaluate(
    match: Match | npt.ArrayLike,
    target: MeshLike,
    source_points: Any,
    target_points: Any,
    mirrored_target_points: Any = None,
    *,
    distance: GeodesicKind = "geodesic",
    progress: Progress | None = None,
) -> Evaluation:
    """Measure a point map against ground truth.

    Parameters
    ----------
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none.
    target : mesh-like
        Anything :func:`unbend.as_mesh` accepts.
    source_points, target_points : (r,) array_like of int
        Ground truth: source vertex ``source_points[i]`` is target vertex ``target_points[i]``.
        A row whose target vertex is -1 has no true image. Rows without a true image, or without an
        image in the map, count for `overlap` only.
    mirrored_target_points : (r,) array_like of int, optional
        The ground truth composed with the target's left-right symmetry; -1 where a row has no
        mirrored image.
    distance : {"geodesic", "geodesic-exact"}, default="geodesic"
        The heat method, no shorter than the straight line (means of errors up to 0.3 are within
        2 % of exact ones, those of larger errors 1 to 7 % too large), or exact polyhedral
        distances, which are slow and need the extra ``exact``.
    progress : callable, optional
        Called with a stage's name and the share of it that is done.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        If lengths differ, an index is out of range, a ground truth names a target vertex that no
        face uses, or none of its rows counts.
    MeshError
        If the target is a point cloud: errors are measured along faces.
    MissingExtraError
        If exact geodesics are asked for and pygeodesic is not installed.

    Warns
    -----
    UnbendWarning
        If no path joins some images to the truth, or to the mirrored truth alone.

    References
    ----------
    Kim, Lipman & Funkhouser, "Blended intrinsic maps", ACM TOG 2011 (the protocol); Crane,
    Weischedel & Wardetzky, "Geodesics in heat", ACM TOG 2013; Mitchell, Mount & Papadimitriou,
    "The discrete geodesic problem", 1987.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import evaluate
    >>> ball = make_sphere(2)
    >>> every = np.arange(ball.n_vertices)
    >>> evaluate(every, ball, every, every).mean()
    0.0
    """
    check_choice(distance, "distance", GEODESIC)
    target = as_mesh(target, "target")
    if target.is_point_cloud:
        raise MeshError(f"{target.name}: errors are measured along faces; this is a point cloud")
    images = as_point_map(match, target=target)
    found = images[vertex_ids(source_points, len(images), "source_points")]
    direct, true = _errors(target, target_points, found, "target_points", distance, progress)
    if apart := np.count_nonzero(np.isinf(direct)):
        warn(
            f"{target.name}: no path joins {apart:,} of {plural(len(direct), 'image')} to the "
            "truth, as between components: their errors and the mean are infinite; give -1 in the "
            "ground truth for rows that do not count"
        )
    given = found >= 0
    map_min = vertex_min = None
    if mirrored_target_points is not None:
        name, counted = "mirrored_target_points", np.where(true, found, -1)
        mirrored, both = _errors(target, mirrored_target_points, counted, name, distance, progress)
        ours = direct[both[given & true]]
        # Where no path leads counts as the farthest place: one such row does not decide alone.
        worst = max(float(one[np.isfinite(one)].max(initial=0.0)) for one in (ours, mirrored))
        map_min = min(ours, mirrored, key=lambda one: float(np.minimum(one, worst).mean()))
        if apart := np.count_nonzero(np.isinf(mirrored) & np.isfinite(ours)):
            warn(
                f"{target.name}: no path joins {apart:,} of "
                f"{plural(len(mirrored), 'image')} to the mirrored truth alone, as between "
                "components; give -1 there for rows that do not count"
            )
        vertex_min = np.minimum(ours, mirrored)
    whole, number = join_seams(target)
    areas = vertex_areas(whole)
    return Evaluation(
        direct=direct,
        map_min=map_min,
        vertex_min=vertex_min,
        coverage=float(areas[np.unique(number[images[images >= 0]])].sum() / areas.sum()),
        overlap=Overlap(*(len(direct) / int(some.sum()) for some in (given, true, given | true))),
    )


def _errors(
    target: Mesh,
    points: Any,
    found: IntArray,
    name: str,
    kind: str,
    progress: Progress | None,
) -> tuple[FloatArray, BoolArray]:
    """Geodesic errors of rows with an image and a true one, and which rows have a true one."""
    truth = checked_map(points, target.n_vertices, name)
    if len(truth) != len(found):
        raise InputError(
            f"the ground truth has {len(found)} source and {len(truth)} target vertices"
        )
    rows = np.flatnonzero((found >= 0) & (truth >= 0))
    if not len(rows):
        raise InputError(f"{name}: no row has both an image and a true image to compare")
    unused = rows[~np.isin(truth[rows], target.faces)]
    if len(unused):
        raise InputError(
            f"{name}: row {unused[0]} is {truth[unused[0]]}, a vertex that no face of "
            f"{target.name} uses; give -1 for rows that do not count"
        )
    key = target.n_vertices, kind == "geodesic-exact", *mesh_hashes(target)
    kept = _kept[key] = _kept.pop(key, {})  # the last one used
    errors, order = np.empty(len(rows)), np.argsort(truth[rows], kind="stable")
    vertices, starts = np.unique(truth[rows][order], return_index=True)
    told: dict[str, None] = {}
    if not kept.keys() >= set(vertices.tolist()):
        with heard() as of_all:
            from_vertex = geodesic_solver(target, exact=kind == "geodesic-exact")
        scale = np.sqrt(vertex_areas(target).sum())
    for i, some in enumerate(np.split(order, starts[1:])):
        vertex = int(vertices[i])
        row = kept.get(vertex)
        if row is None:
            if progress is not None:
                progress(f"{kind} distances", i / len(vertices))
            with heard() as of_one:
                distances = (from_vertex(vertex) / scale).astype(np.float32)
            row = distances, [*of_all, *of_one]
            size = distances.nbytes * (len(kept) + 1)
            room = available_memory() if size > _KEPT_BYTES else None
            if room is None or size <= room:
                kept[vertex] = row
        errors[some] = row[0][found[rows[some]]]
        told |= dict.fromkeys(row[1])
    for message in told:
        warn(message)
    _forget()
    return errors, truth >= 0


def _forget() -> None:
    """Drop the distances of meshes used long ago; other threads may add and drop some meanwhile."""
    while len(_kept) > 1:
        if sum(4 * key[0] * len(rows) for key, rows in list(_kept.items())) <= _KEPT_BYTES:
            return
        _kept.pop(next(iter(_kept)), None)
