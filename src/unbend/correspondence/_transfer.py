"""Transfer of values per vertex from one shape to another along a match."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, cast, get_args

import numpy as np
import numpy.typing as npt

from unbend._arrays import check_choice, first_largest, listed, values_of
from unbend._text import plural
from unbend._types import FloatArray, IntArray
from unbend.choices import ValueKind
from unbend.deformation import closest_faces
from unbend.errors import InputError, warn
from unbend.io import MeshLike, as_mesh, checked_map, invert_map
from unbend.matching import Match, warn_of_faults
from unbend.mesh import Mesh, faces_around, find_components, vertex_ids
from unbend.preparation import join_seams

_GREY = 128
_ROUNDING = 1e-6  # by which barycentric coordinates may miss a sum of one
_COLOR_NAME = re.compile(r"colou?r_\d|r(ed)?|g(reen)?|b(lue)?|a(lpha)?")


def transfer(
    values: npt.ArrayLike,
    match: Match | npt.ArrayLike,
    *,
    kind: ValueKind = "auto",
    source: MeshLike | None = None,
    target: MeshLike | None = None,
) -> npt.NDArray[Any]:
    """Carry values from the vertices of the source to those of the target.

    Each target vertex takes the value of the vertex that it corresponds to. If both meshes and a
    match with barycentric coordinates are given, it corresponds to a point in a face instead: its
    corners' numbers are averaged, and their labels vote.

    Parameters
    ----------
    values : (n_source, ...) array_like
        Numbers, labels (whole numbers or text) or truth values per source vertex.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none,
        which is inverted by :func:`unbend.io.invert_map` along the edges of `target`.
    kind : str, default="auto"
        ``"scalar"``: averaged; numbers, or vectors, which are not turned. ``"label"``: never
        averaged. ``"weights"``: averaged; skinning weights, non-negative rows that sum to one, as
        the result's do. ``"color"``: averaged and rounded to whole numbers from 0 to 255. ``"uv"``:
        averaged; texture coordinates, two columns. ``"auto"``: scalar for fractions and columns of
        floats; color for whole numbers from 0 to 255, not all 0 or 1, in three or four columns;
        scalar for other columns of whole numbers; label for everything else, also whole numbers
        that are stored as floats.
    source, target : mesh-like, optional
        Anything :func:`unbend.as_mesh` accepts. Averaging within faces needs both; a map given as
        an array needs `target`.

    Returns
    -------
    (n_target, ...) ndarray
        float64 for scalars and weights, NaN where there is no preimage; for labels the type of
        `values` and ``""`` or NaN there, or int64 and -1, of truth values too; for colours uint8
        and mid-grey.

    Raises
    ------
    InputError
        If the lengths do not agree or the values do not fit the kind.

    Warns
    -----
    UnbendWarning
        Of a match that is wrong in part, or whose parts differ in size, see
        :class:`unbend.Match`.

    Examples
    --------
    >>> from unbend import transfer
    >>> target = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    >>> transfer([10, 20, 30], [1, 2, 0], target=target)
    array([30, 10, 20])
    >>> transfer(["head", "tail"], [0, 1], target=target)
    array(['head', 'tail', 'head'], dtype='<U4')
    """
    source = None if source is None else as_mesh(source, "source")
    target = None if target is None else as_mesh(target, "target")
    if isinstance(match, Match):
        warn_of_faults(match)
    return carry(values, match, kind, source, target)


def carry(
    values: npt.ArrayLike,
    match: Match | npt.ArrayLike,
    kind: ValueKind,
    source: Mesh | None,
    target: Mesh | None,
) -> npt.NDArray[Any]:
    """Transfer values as :func:`transfer` does; for pictures, which warn of nothing."""
    array = values_of(values)
    images = as_point_map(match, source, target)
    if array.ndim == 0 or len(array) != len(images):
        given = "one value" if array.ndim == 0 else plural(len(array), "row")
        need = plural(len(images), "vertex")
        raise InputError(f"{given} to carry, but the source has {need}")
    corners, shares = _preimages(match, images, source, target)
    if corners.max(initial=-1) >= len(array):
        raise InputError(
            f"the map names source vertex {corners.max()}, but there are {len(array)} values"
        )
    chosen = value_kind(array, kind)
    lost = corners[:, 0] < 0
    if chosen == "label":
        return _vote(array, corners, shares, lost)
    carried = _average(checked_numbers(array, chosen), corners, shares)
    carried[lost] = np.nan
    if chosen == "weights":
        carried /= carried.sum(axis=1, keepdims=True)
    if chosen == "color":
        return np.where(np.isfinite(carried), np.rint(carried), _GREY).astype(np.uint8)
    return carried


def transfer_landmarks(
    labels: Sequence[str],
    vertices: npt.ArrayLike,
    match: Match | npt.ArrayLike,
    target: MeshLike,
) -> tuple[list[str], IntArray]:
    """Carry landmarks from the source to the target, as :func:`unbend.io.read_markups` reads them.

    Parameters
    ----------
    labels : sequence of str, length l
        A landmark without one gets its number, from 1 on.
    vertices : (l,) array_like of int
        Of the source.
    match : Match or (n_source,) array_like of int
        From source to target; as an array, -1 where there is no partner.
    target : mesh-like

    Returns
    -------
    labels : list of str
        Of the landmarks that have a partner.
    vertices : (k,) ndarray of int64
        Of the target.

    Raises
    ------
    InputError
        If no landmark has a partner, or the arguments do not fit each other.

    Warns
    -----
    UnbendWarning
        Of landmarks that have no partner, and of those that meet at one vertex.

    Examples
    --------
    >>> from unbend.correspondence import transfer_landmarks
    >>> target = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    >>> transfer_landmarks(["nose", ""], [0, 2], [1, 2, 0], target)
    (['nose', '2'], array([1, 0]))
    """
    target = as_mesh(target, "target")
    images = as_point_map(match, target=target)
    given = vertex_ids(vertices, len(images), "the source")
    labels = listed(labels, "labels")
    if len(labels) != len(given):
        raise InputError(f"{len(given)} landmarks need as many labels, not {len(labels)}")
    missing = ("", None)
    named = np.array(
        [
            f"{i + 1}" if label in missing or label != label else label  # NaN is not itself
            for i, label in enumerate(labels)
        ],
        dtype=str,
    )
    carried, there = images[given], images[given] >= 0
    if not there.any():
        raise InputError(f"no landmark corresponds to a vertex of {target.name}")
    for label in named[~there]:
        warn(f"landmark {label} corresponds to no vertex of {target.name}")
    kept = carried[there]
    met = len(np.unique(given[there])) - len(np.unique(kept))
    if met > 0:
        at_one = f"{plural(met, 'landmark')} at the same vertex of {target.name} as another one"
        warn(f"{at_one}: take a mesh with more vertices")
    return named[there].tolist(), kept


def warn_of_match(match: Match | npt.ArrayLike, source: Mesh) -> None:
    """Warn of a match that a source cannot follow: a faulty one, or a reflection."""
    if isinstance(match, Match):
        warn_of_faults(match)
        if match.orientation < 0:
            warn(
                f"the map is a reflection, so {source.name} is turned inside out: mirror it "
                "(negate x and turn its faces), and match again without allow_mirror"
            )


def positions_on_target(
    match: Match | npt.ArrayLike, target: Mesh, source: Mesh | None = None
) -> FloatArray:
    """Where each source vertex lies on the target, (n_source, 3), NaN where there is no image.

    In a match, only the largest component of the source that has partners has images: the partners
    of smaller ones are those of what is nearest to them, where they would fall together.
    Barycentric coordinates are used where the match has them. Raises InputError if the match does
    not fit the meshes, or its barycentric coordinates do not sum to one.
    """
    images = as_point_map(match, source, target)
    positions = np.where(images[:, None] >= 0, target.vertices[images], np.nan)
    if isinstance(match, Match) and match.faces is not None and match.weights is not None:
        there, number = match.faces >= 0, join_seams(target)[1]
        named = match.faces[there]
        if (
            named.max(initial=-1) >= target.n_faces
            or not (number[target.faces[named]] == number[images[there], None]).any(axis=1).all()
        ):
            raise InputError(
                f"the match names faces that {target.name} does not have, or has in another order: "
                "give source and target as then, choose the same component, or match again"
            )
        weights = match.weights[there]
        wrong = ~(np.abs(weights.sum(axis=1) - 1) <= _ROUNDING)
        if wrong.any():
            row = int(np.flatnonzero(there)[wrong.argmax()])
            raise InputError(
                f"the match's weights in row {row} sum to {match.weights[row].sum():g}: give "
                "barycentric coordinates, which sum to one"
            )
        corners = target.vertices[target.faces[named]]
        positions[there] = np.einsum("ij,ijk->ik", weights, corners)
    if isinstance(match, Match) and source is not None:
        whole, number = join_seams(source)
        of_vertex = find_components(whole.faces, whole.n_vertices).of_vertex[number]
        chosen = of_vertex[(images >= 0) & (of_vertex >= 0)].min(initial=source.n_vertices)
        positions[of_vertex > chosen] = np.nan
    return positions


def inverted(images: IntArray, target: Mesh) -> IntArray:
    """Invert a map as :func:`unbend.io.invert_map` does, and across the target's seams."""
    whole, number = join_seams(target)
    return invert_map(np.where(images < 0, -1, number[images]), whole)[number]


def _preimages(
    match: Match | npt.ArrayLike, images: IntArray, source: Mesh | None, target: Mesh | None
) -> tuple[IntArray, FloatArray]:
    """Source vertices (n_target, 1 or 3) of each target vertex, -1 for none, and their shares."""
    if not isinstance(match, Match):
        if target is None:
            raise InputError(
                "a map given as an array maps from source to target: to invert it, give the "
                "target's mesh too, or give a Match"
            )
        vertices = inverted(images, target)
        return vertices[:, None], np.ones((len(vertices), 1))
    vertices = match.target_to_source
    if match.faces is not None and (source is None) != (target is None):
        raise InputError("to average within faces, give both the source and the target, or neither")
    if match.faces is None or source is None or target is None or source.is_point_cloud:
        return vertices[:, None], np.ones((len(vertices), 1))
    places = positions_on_target(match, target)
    there = np.flatnonzero(vertices >= 0)
    whole, number = join_seams(source)
    fans, start = faces_around(whole.faces, whole.n_vertices), number[vertices[there]]
    faces, weights = closest_faces(target.vertices[there], places, whole.faces, fans, start)
    # Partners without faces are used as they are.
    corners, shares = vertices.repeat(3).reshape(-1, 3), np.tile([1.0, 0, 0], (len(vertices), 1))
    on_face = weights.any(axis=1)
    inside = there[on_face]
    corners[inside], shares[inside] = source.faces[faces[on_face]], weights[on_face]
    return corners, shares


def as_point_map(
    match: Match | npt.ArrayLike, source: Mesh | None = None, target: Mesh | None = None
) -> IntArray:
    """Target vertex of each source vertex, -1 for none.

    Raises InputError unless it is a map between these meshes, where they are given.
    """
    given = match.source_to_target if isinstance(match, Match) else match
    images = checked_map(given, what="a map that is no Match")
    sizes = [("source", len(images), source)]
    if isinstance(match, Match):
        sizes.append(("target", len(match.target_to_source), target))
    for side, n, mesh in sizes:
        if mesh is not None and mesh.n_vertices != n:
            raise InputError(
                f"the map has {n} {side} vertices, but {mesh.name} has {mesh.n_vertices}"
            )
    return images if target is None else checked_map(images, target.n_vertices, "the map")


def value_kind(array: npt.NDArray[Any], kind: str = "auto", names: Sequence[str] = ()) -> ValueKind:
    """Decide how values are carried, see :func:`transfer`: never ``"auto"``.

    ``names`` are those of columns that :func:`unbend.io.read_named_values` gives. Columns with
    other names than those of colours are not taken for colours.
    """
    check_choice(kind, "kind", get_args(ValueKind))
    if kind != "auto":
        return cast(ValueKind, kind)
    if list(names) == ["uv_0", "uv_1"]:
        return "uv"
    if array.dtype.kind == "f":
        known = array[~np.isnan(array)]
        whole = len(known) > 0 and (np.isfinite(known) & (known == np.rint(known))).all()
        return "label" if whole and array[:1].size == 1 else "scalar"
    if array.dtype.kind in "iu" and array.ndim == 2 and array.shape[1] > 1:
        named = all(_COLOR_NAME.fullmatch(name.lower()) for name in names)
        is_bytes = array.min() >= 0 and 1 < array.max() <= 255
        return "color" if named and is_bytes and array.shape[1] in (3, 4) else "scalar"
    return "label"


def checked_numbers(array: npt.NDArray[Any], kind: str) -> FloatArray:
    """Return values as numbers that can be averaged as a kind, or raise InputError."""
    if array.dtype.kind == "U":
        raise InputError(f'text cannot be averaged as {kind}; use kind="label"')
    numbers = array.astype(np.float64)
    if kind == "weights":
        if numbers.ndim != 2:
            raise InputError(f"weights must be rows, one for each vertex, not {numbers.shape}")
        wrong = ~((numbers >= 0).all(axis=1) & (np.abs(numbers.sum(axis=1) - 1) < 1e-3))
        if wrong.any():
            row = wrong.argmax()
            total, least = numbers[row].sum(), numbers[row].min()
            advice = "divide by the sums"
            if not numbers[row].any():
                advice = "give each vertex at least one"
            elif np.isnan(total):
                advice = "write 0 where one is missing"
            elif least < 0 or np.isinf(total):
                advice = "write finite numbers of 0 or more"
            raise InputError(
                f"weights must be non-negative and sum to one in each row: {advice}; "
                f"row {row} sums to {total:g}, its least is {least:g}"
            )
    if kind == "uv" and (numbers.ndim != 2 or numbers.shape[1] != 2):
        raise InputError(f"texture coordinates must have two columns, not {numbers.shape}")
    if kind == "color":
        if numbers.ndim != 2 or not ((numbers >= 0) & (numbers <= 255)).all():
            raise InputError("colours must be rows of numbers from 0 to 255")
        if numbers.max(initial=0) <= 1 and (numbers % 1).any():
            raise InputError(
                "colours must be from 0 to 255, and these are from 0 to 1; multiply by 255"
            )
    return numbers


def _average(numbers: FloatArray, corners: IntArray, shares: FloatArray) -> FloatArray:
    carried = np.zeros((len(corners), *numbers.shape[1:]))
    least, most = np.full_like(carried, np.inf), np.full_like(carried, -np.inf)
    for corner, share in zip(corners.T, shares.T, strict=True):
        weight, given = share.reshape(-1, *[1] * (numbers.ndim - 1)), numbers[corner]
        # The NaN of a corner without a share must not enter the mean.
        with np.errstate(invalid="ignore"):  # the mean of both infinities is NaN
            carried += np.where(weight > 0, weight * given, 0)
        least = np.where(weight > 0, np.minimum(least, given), least)
        most = np.where(weight > 0, np.maximum(most, given), most)
    return np.clip(carried, least, most)  # the mean of equal numbers is theirs


def _vote(
    array: npt.NDArray[Any], corners: IntArray, shares: FloatArray, lost: npt.NDArray[np.bool_]
) -> npt.NDArray[Any]:
    """Give each target vertex the label with the largest share: a row of `array`, whole."""
    # Without an axis, all NaN are one label.
    _, labels = np.unique(array, axis=0 if array.ndim > 1 else None, return_inverse=True)
    labels = labels.reshape(-1)[corners]
    votes = np.stack([(shares * (labels == one[:, None])).sum(axis=1) for one in labels.T], axis=1)
    winners = np.take_along_axis(corners, first_largest(votes.T)[:, None], axis=1)[:, 0]
    if array.dtype.kind in "biu":
        if array.max(initial=0) > np.iinfo(np.int64).max:
            raise InputError(f"labels must be below 2^63, and one is {array.max()}")
        array = array.astype(np.int64)
    carried = array[winners]
    if lost.any():
        carried[lost] = {"U": "", "f": np.nan}.get(array.dtype.kind, -1)
    return carried
