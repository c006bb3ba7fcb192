"""A page on which two matched shapes turn, and a place on one shows its partner on the other."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from unbend._types import FloatArray, IntArray, Progress
from unbend.alignment import procrustes
from unbend.canonical import canonical_form
from unbend.choices import Axis
from unbend.correspondence import Evaluation, as_point_map, evaluate, morph, transfer
from unbend.errors import InputError, UnbendWarning
from unbend.io import MeshLike, as_mesh, check_writable, invert_map
from unbend.matching import Match
from unbend.mesh import Mesh, edge_ends, vertex_areas
from unbend.report.pages import _match_words as words
from unbend.report.pages._document import write_page
from unbend.report.pages._packing import pack_places, pack_whole
from unbend.report.pages._shown import Shown, cells_of, faces_within, places_as_colors, show

_SCRIPTS = ("data.js", "shaders.js", "scene.js", "page.js", "match.js")
# The morph between source and target is computed at these shares, and is cubic between them.
_FRAMES = (0.2, 0.4, 0.6, 0.8, 1.0)
# Vertices that the truth does not name take the mean error of neighbours, so far from any it names.
_FILLED_RINGS = 3
# The error that is drawn in the last colour.
_WORST = 0.1


def match_page(
    source: MeshLike,
    target: MeshLike,
    match: Match | npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    up: Axis = "y",
    truth: Sequence[npt.ArrayLike] | None = None,
    command: str = "",
    progress: Progress | None = None,
) -> None:
    """Write a match as a page that opens in any browser, without a network: one HTML file.

    Both shapes turn together, the same place in the same colour; pointing at one marks the partner
    on the other and tells both vertex numbers; a slider morphs the source into the target. Below
    are both canonical forms, before and after they are aligned, and what is known of the match.

    Parameters
    ----------
    source, target : mesh-like
        Anything :func:`unbend.as_mesh` accepts, with faces.
    match : Match or (n_source,) array_like of int
        From source to target; or the target vertex of each source vertex, -1 where there is none:
        such vertices are grey.
    path : path
        The file to write, .html.
    up : {"x", "y", "z"}, default="y"
        The source's axis that points upward.
    truth : sequence of 2 or 3 (r,) array_like of int, optional
        Source vertices, their true target vertices and perhaps the mirrored ones, as for
        :func:`unbend.evaluate`: the page then shows the errors.
    command : str, default=""
        What made the match, shown on the page.
    progress : callable, optional
        Called with a stage's name and the share of it that is done.

    Raises
    ------
    InputError
        If a shape has no faces, the map or the truth does not fit, or there is no such axis.
    FileError
        If the file cannot be written.

    Notes
    -----
    Of a shape with more than 60,000 vertices so many are drawn; all are computed on. The target is
    turned as a whole, and scaled to the source's area, to stand as the source does.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> from unbend import match_page
    >>> from unbend.datasets import make_octopus
    >>> mesh = make_octopus(n_vertices=600).mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "match.html")
    ...     match_page(mesh, mesh, np.arange(600), path)
    ...     path.stat().st_size < 200_000
    True
    """
    check_writable(path, (".html",))
    source, target = as_mesh(source), as_mesh(target)
    for mesh in (source, target):
        if mesh.is_point_cloud:
            raise InputError(f"{mesh.name} has no faces to draw")
    if up not in get_args(Axis):
        raise InputError(f'up must be "x", "y" or "z", not {up!r}')
    step = progress or (lambda stage, share: None)
    step("page, places", 0.0)
    forward = as_point_map(match)
    carried = transfer(source.vertices, match, kind="scalar", source=source, target=target)
    target = _standing_alike(target, source, carried)
    ours, theirs = show(source), show(target)
    backward = match.target_to_source if isinstance(match, Match) else invert_map(forward, target)
    step("page, morph", 0.1)
    frames = _frames(source, target, match, ours, progress=step)
    step("page, canonical forms", 0.6)
    found = None if truth is None else evaluate(match, target, *truth, source=source)
    errors = None
    if found is not None and truth is not None:
        errors = _errors_of_vertices(found, source, forward, truth)
    data: dict[str, Any] = {
        "source": ours.packed(source.vertices)
        | {
            "colors": pack_places(places_as_colors(source, ours)[ours.ids]),
            "partners": pack_whole(forward[ours.ids]),
            "standIns": pack_whole(_seen_as(forward[ours.ids], theirs)),
        },
        "target": theirs.packed(target.vertices)
        | {
            "colors": pack_places(places_as_colors(source, ours, carried)[theirs.ids]),
            "partners": pack_whole(backward[theirs.ids]),
            "standIns": pack_whole(_seen_as(backward[theirs.ids], ours)),
        },
        "frames": [pack_places(frame) for frame in frames],
        "forms": _forms(source, target, forward, ours, theirs),
        "errors": None if errors is None else pack_places(errors[ours.ids][:, None]),
        "error_scale": _WORST,
        "cells": cells_of(source.vertices[ours.ids]),
    }
    known = match if isinstance(match, Match) else None
    blocks = [
        words.pictures(
            (source.name, target.name), up, morphs=bool(frames), errors=found is not None
        ),
        words.forms(),
        '<div class="columns">',
        *([words.errors(found, _WORST)] if found is not None else []),
        *([words.hypotheses(known)] if known is not None and known.hypotheses else []),
        "</div>",
        words.facts((source, target), (ours, theirs), known, command),
    ]
    write_page(
        path,
        title=f"{source.name} to {target.name}",
        heading=f'{escape(source.name)}<span class="arrow">→</span>{escape(target.name)}',
        lead=_lead(match, forward, target),
        body="\n".join(blocks),
        data=data,
        scripts=_SCRIPTS,
    )


def _standing_alike(target: Mesh, source: Mesh, carried: FloatArray) -> Mesh:
    """Turn, scale and shift the target as a whole to where the map has it on the source."""
    there = np.isfinite(carried).all(axis=1)
    areas = [float(vertex_areas(mesh).sum()) for mesh in (source, target)]
    places = target.vertices * math.sqrt(areas[0] / areas[1])
    if there.sum() >= 3:
        turn, shift = procrustes(places[there], carried[there], reflect=False)
        places = places @ turn.T + shift
    return Mesh(places, target.faces, name=target.name, notes=target.notes)


def _frames(
    source: Mesh, target: Mesh, match: Match | npt.ArrayLike, ours: Shown, *, progress: Progress
) -> list[FloatArray]:
    """Places of the shown vertices on their way to the target; none if too few have an image."""
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
    thin, found = Mesh(source.vertices[ours.ids], ours.faces), []
    for i, share in enumerate(_FRAMES):
        found.append(morph(thin, target, along, share).vertices)
        progress("page, morph", 0.1 + 0.5 * (i + 1) / len(_FRAMES))
    return found


def _seen_as(vertices: IntArray, other: Shown) -> IntArray:
    """Shown vertices of the other shape that stand for some of its vertices; -1 for none."""
    return np.where(vertices >= 0, other.stand_ins[vertices], -1)


def _forms(
    source: Mesh, target: Mesh, forward: IntArray, ours: Shown, theirs: Shown
) -> dict[str, Any]:
    """Both canonical forms, and the motion that lays the source's onto the target's."""
    forms = []
    for mesh in (source, target):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnbendWarning)  # the match has said it already
            forms.append(canonical_form(mesh, component="largest").points)
    there = forward >= 0
    images = np.full_like(forms[0], np.nan)
    images[there] = forms[1][forward[there]]
    there = np.asarray(np.isfinite(forms[0] + images).all(axis=1))
    turn, shift = np.eye(3), np.zeros(3)
    if there.sum() >= 3:
        turn, shift = procrustes(forms[0][there], images[there])
    packed: dict[str, Any] = {"rotation": turn.tolist(), "translation": shift.tolist()}
    for name, form, shown in zip(("source", "target"), forms, (ours, theirs), strict=True):
        packed[name] = pack_places(form[shown.ids])
        packed[f"{name}_faces"] = faces_within(form[shown.ids], shown.faces)
    return packed


def _errors_of_vertices(
    found: Evaluation, source: Mesh, forward: IntArray, truth: Sequence[npt.ArrayLike]
) -> FloatArray:
    """Error of each source vertex, of its neighbours where only they have one, else -1."""
    sources, *images = (np.asarray(one) for one in truth)
    counted = (forward[sources] >= 0) & np.all([one >= 0 for one in images], axis=0)
    errors = np.full(len(forward), -1.0)
    errors[sources[counted]] = np.minimum(found.direct, 1.0)
    ends = edge_ends(source.faces, len(forward))
    for _ in range(_FILLED_RINGS):
        known = errors >= 0
        i, j = np.concatenate([ends, ends[:, ::-1]]).T
        i, j = i[known[i]], j[known[i]]
        count = np.bincount(j, minlength=len(errors))
        mean = np.bincount(j, errors[i], len(errors)) / np.maximum(count, 1)
        errors = np.where(known | (count == 0), errors, mean)
    return errors


def _lead(match: Match | npt.ArrayLike, forward: IntArray, target: Mesh) -> str:
    matched = int((forward >= 0).sum())
    part = f"{matched:,}" if matched == len(forward) else f"{matched:,} of {len(forward):,}"
    told = f"{part} vertices matched to a shape of {target.n_vertices:,}"
    if isinstance(match, Match) and not math.isnan(match.confidence):
        told += f"; confidence {match.confidence:.2f}"
    return told + "."
