"""Public functions of the matcher."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice, check_whole
from unbend._display import MIRROR_FITS
from unbend._parallel import one_blas_thread, run_all
from unbend._types import Progress
from unbend.choices import Partial
from unbend.errors import InputError, warn
from unbend.io import MeshLike, as_mesh
from unbend.matching import _constants as constants
from unbend.matching._inputs import Input, prepare_shape, prepare_shapes
from unbend.matching._landmarks import MISLED, labelled, warn_of_misleading, warn_of_missed
from unbend.matching._outcome import (
    as_taken,
    below_vertices,
    landmark_hints,
    make_match,
    vertex_images,
)
from unbend.matching._plan import (
    Sides,
    candidates,
    differences,
    distinct,
    kept_extremities,
    misleading_landmarks,
    moved_share,
    onto_mirror_image,
    without_landmarks,
)
from unbend.matching._polish import exact, refined, reranked, with_partners, without_extras
from unbend.matching._result import Match, warn_of_faults
from unbend.matching._score import Candidate, lead_shares, ranked, roundness_bound
from unbend.matching._touching import search_apart

_N_EIGENPAIRS, _LEAST_EIGENPAIRS = 30, 4
# Share of the area that a symmetry leads to another limb, or farther. Of people, animals, fish and
# insects it is 0.31 or more; if back and belly are exchanged, up to 0.26, but seldom above 0.2.
_EXCHANGED = 0.28
# Extremities that may be their own partners, a head and a tail; more are, if less than half of all.
_AXIAL = 2
# Numbers kept for each vertex that is matched, mostly in factors; half as many without `refine`.
# Measured: 400 to 1,000, of parts the most.
WORKING_COLUMNS = 700


@one_blas_thread()
def match(
    source: MeshLike,
    target: MeshLike,
    *,
    partial: Partial = "auto",
    landmarks: npt.ArrayLike | Mapping[str, Any] | None = None,
    n_matches: int = 1,
    n_eigenpairs: int = _N_EIGENPAIRS,
    refine: bool = True,
    allow_mirror: bool = False,
    barycentric: bool = False,
    mirrored: bool = False,
    progress: Progress | None = None,
) -> Match:
    """Match two deformable shapes, without landmarks or training.

    Many hypotheses are registered on coarse copies of the shapes. The map wins whose patches,
    rotated and scaled, explain most of the other shape; it is refined on the shapes themselves.
    Nothing is random: the same meshes give the same map, up to rounding.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts, open or closed, but not with one side only.
        Faces are oriented consistently and outward. Long edges of coarse whole shapes are split in
        the matcher. A surface is reconstructed for a point cloud, and outliers get no partner, -1.
        The vertex counts, units, and positions in space may differ. Of several components the
        largest is matched; the vertices of the others take the partner of the nearest vertex of
        the largest, or none, -1, if that is over 0.22 of the square root of its area away.
    partial : {"auto", "none", "source", "target", "both"}, default="auto"
        Which shape may lack what the other one has. That gets no partner, -1: what lies beyond a
        boundary, where a shape was torn, cut off or seen from one side; and, on closed shapes too,
        parts of 8 to 50 % of the area in all that are unlike everything on the other shape.
        ``"auto"`` is ``"both"``, but regions beyond a boundary of less than 3 % of the area are
        ignored. With ``"none"`` every vertex has a partner.
    landmarks : (l, 2) array_like of int, or mapping of str to such pairs, optional
        Pairs of a source and a target vertex that correspond, perhaps with labels. One to three
        resolve ambiguities. The map takes each to its partner, within about an edge, except for
        those that contradict the best-fitting map, or lie on what it leaves out:
        `missed_landmarks` lists them.
    n_matches : int, default=1
        How many maps to give at most: the best as the result, the others as its
        `alternatives`.
    n_eigenpairs : int, default=30
        Eigenpairs of each shape, the constant included; fewer for meshes of few vertices.
    refine : bool, default=True
        Whether to register the full meshes too. With False, only coarse copies are registered, and
        the map is less accurate.
    allow_mirror : bool, default=False
        Whether a map may turn the surface inside out when that explains more, as from a left hand
        to a right one. Without it, no map does, and a warning says if it would fit far better.
    barycentric : bool, default=False
        Whether to give faces and weights, for accuracy below a vertex, if the target has faces.
    mirrored : bool, default=False
        Whether to give the best orientation-reversing map too.
    progress : callable, optional
        Called with a stage's name and the share of it that is done: 0 when it begins.

    Returns
    -------
    Match

    Raises
    ------
    MeshError
        If a mesh cannot be used or has only one side, or there is not enough memory, or a point
        cloud has no surface: see :func:`unbend.preparation.surface_of_points`.
    InputError
        If an option is out of range.

    Warns
    -----
    UnbendWarning
        Of what was done to a mesh, as when it has several components, its faces are oriented
        inward, or parts of it touch and are cut apart; of missed landmarks; of a map that is in
        disorder, so that part of it is wrong; of shapes that are mirror images of each other; of
        landmarks that lead far from the best map, whose confidence is then at most 0.5; of parts of
        very different areas that are not matched for sure; and of a round shape, which does not
        show how far it is turned, without two landmarks.

    References
    ----------
    Yang, Obaseki & Chen, "Spectral multi-dimensional scaling using biharmonic distance", GRAPP
    2019 (canonical forms); Melzi et al., "ZoomOut", ACM TOG 2019 (growth); Ren et al.,
    "MapTree: recovering multiple solutions in the space of maps", ACM TOG 2020 (hypotheses).

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import match
    >>> ball = make_sphere(3)
    >>> stone = ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2
    >>> found = match((stone, ball.faces), (stone @ np.diag([-2, 2, -2]), ball.faces))
    >>> bool((found.source_to_target == np.arange(len(stone))).all())
    True
    """
    check_partial(partial)
    check_whole(n_matches, "n_matches", 1)
    n_eigenpairs = check_whole(n_eigenpairs, "n_eigenpairs", _LEAST_EIGENPAIRS)
    torn = [partial in ("auto", "both", side) for side in ("source", "target")]
    source, target = as_mesh(source, "source"), as_mesh(target, "target")
    labels, pairs = labelled(landmarks, source, target)
    tell = progress or (lambda stage, share: None)
    tell("spectrum", 0.0)
    inputs = prepare_shapes((source, target), n_eigenpairs, torn, _columns(refine))
    tell("search", 0.0)
    most = _bound_by_roundness(*inputs) if len(pairs) < 2 else 1.0
    (ours, theirs), sides, found = search_apart(inputs, pairs, n_eigenpairs, progress)
    turned = candidates(sides.reflected(), progress) if mirrored or allow_mirror else []
    if allow_mirror:
        found = ranked([*found, *turned])
    tell("refine", 0.0)
    rivals = [*found, *(without_landmarks(sides) if len(pairs) else [])]
    (found, fine), other_hand = run_all(
        [
            functools.partial(reranked, sides, found, polish=refine),
            functools.partial(onto_mirror_image, sides, rivals) if not allow_mirror else list,
        ]
    )
    misleading = misleading_landmarks([*rivals, *other_hand])
    if misleading:
        most = min(most, MISLED)
    if other_hand:
        warn(MIRROR_FITS)
    found = without_extras(sides, found, torn)
    whole = constants.SMALLEST_PART if partial == "auto" else 0.0
    finished = functools.partial(_finished, sides, polish=refine, least=whole)

    results = []
    costs = [one.energy for one in other_hand] + [one.cost for one in found]
    shares = lead_shares(np.array(costs), sides.partial)[len(other_hand) :]
    given = distinct(sides, found, n_matches)
    for n_done, i in enumerate(given, 1):
        chosen = finished(found[i], fine)
        order = [i, *range(i), *range(i + 1, len(found))]
        ranks = [found[j] for j in order]
        apart = differences(sides, ranks)
        result = make_match(ours, theirs, sides, chosen, ranks, shares[order], apart, most)
        result = replace(result, landmark_hints=landmark_hints(ours, sides, ranks, apart))
        if barycentric:
            result = below_vertices(result, ours, theirs, chosen)
        results.append(result)
        tell("refine", n_done / len(given))
    result = replace(results[0], alternatives=tuple(results[1:]), mirror_fits=bool(other_hand))
    if mirrored:
        turned, fine = reranked(sides, turned, polish=refine)
        other = finished(without_extras(sides, turned, torn)[0], fine)
        images = vertex_images(ours, as_taken(theirs, other), other.registered)
        result = replace(result, mirrored=images)
    warn_of_missed(result, labels, pairs)
    warn_of_misleading(misleading, labels, pairs)
    warn_of_faults(result)
    return result


def prepare_spectrum(mesh: MeshLike) -> None:
    """Compute the eigenpairs that :func:`match` needs of a mesh, and keep them on disk for it."""
    prepare_shape(mesh, _N_EIGENPAIRS)


@one_blas_thread()
def symmetry(
    mesh: MeshLike,
    *,
    landmarks: npt.ArrayLike | Mapping[str, Any] | None = None,
    n_eigenpairs: int = _N_EIGENPAIRS,
    refine: bool = True,
    progress: Progress | None = None,
) -> Match:
    """Intrinsic reflective symmetry of a shape: its best map to itself that swaps left and right.

    What has no counterpart gets no partner, -1, as in :func:`match` with ``partial="auto"``. But a
    limb of which nothing is on the other side may be its own partner, as a tail is.

    Parameters
    ----------
    mesh : mesh-like
        See :func:`match`.
    landmarks : (l, 2) array_like of int, or mapping of str to such pairs, optional
        Pairs of vertices, such as the tips of both hands, that are each other's partners.
    n_eigenpairs, refine, progress
        See :func:`match`.

    Returns
    -------
    Match
        From the mesh to itself, reversing orientation. Its `confidence` is that of a match of the
        shape to its mirror image, so it is also high for a roughly symmetric shape, such as a bone,
        and may be for half a body, whose own two sides are then matched.

    Raises
    ------
    MeshError, InputError
        See :func:`match`; also if landmarks give a vertex two partners.

    Warns
    -----
    UnbendWarning
        As :func:`match` does; and of a map that leads most of the surface near to where it is, as
        if back and belly were exchanged or limbs stayed on their sides, whose confidence is then at
        most 0.5.

    Examples
    --------
    >>> import numpy as np
    >>> from unbend.datasets import make_sphere
    >>> from unbend import symmetry
    >>> ball = make_sphere(3)
    >>> x, y, z = ball.vertices.T
    >>> egg = np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    >>> swapped = egg[symmetry((egg, ball.faces)).source_to_target]
    >>> bool(np.abs(swapped * [-1, 1, 1] - egg).max() < 0.1)
    True
    """
    n_eigenpairs = check_whole(n_eigenpairs, "n_eigenpairs", _LEAST_EIGENPAIRS)
    mesh = as_mesh(mesh)
    labels, pairs = labelled(landmarks, mesh, mesh)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    vertices, counts = np.unique(np.unique(both, axis=0)[:, 0], return_counts=True)
    if (counts > 1).any():
        raise InputError(f"landmarks give vertex {vertices[counts > 1][0]} two partners; keep one")
    tell = progress or (lambda stage, share: None)
    tell("spectrum", 0.0)
    one = prepare_shape(mesh, n_eigenpairs, True, _columns(refine))
    tell("search", 0.0)
    (ours, theirs), sides, found = search_apart(
        (one, one), both, n_eigenpairs, progress, reflected=True
    )
    tell("refine", 0.0)
    found, fine = reranked(sides, found, polish=refine)
    found = without_extras(sides, found, (True, True))
    chosen = _finished(sides, found[0], fine, polish=refine, least=constants.SMALLEST_PART)
    tell("refine", 1.0)
    shares = lead_shares(np.array([one.cost for one in found]), sides.partial)
    apart = differences(sides, found)
    # Right maps of slim bodies may seem to, too, which landmarks can confirm.
    stays = not len(pairs) and _stays(sides, found[0])
    most = MISLED if stays else 1.0
    result = make_match(ours, theirs, sides, chosen, found, shares, apart, most)
    missed = sorted({row % len(pairs) for row in result.missed_landmarks})
    result = replace(result, missed_landmarks=tuple(missed))
    warn_of_missed(result, labels, pairs)
    warn_of_faults(result)
    if stays:
        warn(
            f"{ours.surface.mesh.name}: much is led near to where it is, as if back and belly were "
            "exchanged, not left and right, or limbs stayed on their sides; if so, give two "
            "vertices as a landmark that are each other's partners, such as the tips of two limbs; "
            f"the confidence is at most {MISLED}"
        )
    return result


def _stays(sides: Sides, found: Candidate) -> bool:
    """Whether a map of a body to itself leads too much of it near to where it is.

    Fins are along the middle, and where both sides are in one pose no limb can seem to stay.
    """
    if moved_share(sides, found) < _EXCHANGED:
        return True
    kept, among = kept_extremities(sides, found)
    return kept > _AXIAL and 2 * kept >= among and found.energy >= constants.FEATURES


def _columns(refine: bool) -> int:
    return WORKING_COLUMNS if refine else WORKING_COLUMNS // 2


def check_partial(partial: str) -> None:
    """Raise InputError if that is no choice of which shapes may be partial."""
    check_choice(partial, "partial", get_args(Partial))


def _finished(
    sides: Sides,
    candidate: Candidate,
    fine: dict[Candidate, Candidate],
    *,
    polish: bool,
    least: float,
) -> Candidate:
    """Register a candidate on the shapes themselves, if it is not in ``fine``, and finish it."""
    polished = fine.get(candidate) or refined(sides, candidate, polish=polish)
    return with_partners(exact(sides, polished), sides, least)


def _bound_by_roundness(ours: Input, theirs: Input) -> float:
    """Compute the highest confidence without two landmarks; warn if a shape is round."""
    bounds = [roundness_bound(one.shape) for one in (ours, theirs)]
    if (most := min(bounds)) < 1:
        name = (ours, theirs)[bounds.index(most)].surface.mesh.name
        warn(
            f"{name}: the shape is round, which hardly shows how far it is turned about its axis, "
            f"so the confidence is at most {most:.2f}; give two landmarks, at different sides of it"
        )
    return most
