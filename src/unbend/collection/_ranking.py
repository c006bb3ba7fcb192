"""Re-ranking of the best hits by canonical forms or matches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from unbend._types import FloatArray, Progress
from unbend.alignment import align
from unbend.collection._files import find_file
from unbend.collection._rows import Hit
from unbend.collection._store import Store, among
from unbend.errors import FileError, UnbendError, heard, warn
from unbend.io import read_mesh
from unbend.matching import match
from unbend.mesh import Mesh


def rank_by_form(own: FloatArray, hits: Sequence[Hit], store: Store) -> list[Hit]:
    """Rank by the root mean square distance of aligned canonical forms."""
    rows = store.select(["id", "form"], among("id", [hit.id for hit in hits]))
    forms = {row["id"]: np.reshape(row["form"], own.shape) for row in rows}
    there = [hit for hit in hits if hit.id in forms]  # another process may have removed others
    with heard():  # that an alignment still improved by millionths ranks nothing anew
        return _ranked(there, [align(own, forms[hit.id]).residual for hit in there])


def rank_by_match(
    query: Mesh, hits: Sequence[Hit], store: str, progress: Progress | None
) -> list[Hit]:
    """Rank by the energy of each match; shapes that cannot be matched or read come last."""
    energies: list[float] = []
    reason = None
    for i, hit in enumerate(hits):
        if progress is not None:
            progress(f"matching {i + 1} of {len(hits)}", i / len(hits))
        energies.append(math.inf)
        try:
            path = find_file(hit, store)
        except FileError as error:
            warn(f"{error}; until then it comes last")
            continue
        try:
            with heard():
                energies[-1] = match(query, read_mesh(path)).hypotheses[0].energy
        except UnbendError as error:
            reason = error
    if reason is not None and min(energies) == math.inf:
        warn(f"none could be matched, so they stay in the order of their descriptors: {reason}")
    return _ranked(hits, energies)


def _ranked(hits: Sequence[Hit], values: Sequence[float]) -> list[Hit]:
    ranked = [replace(hit, reranked=value) for hit, value in zip(hits, values, strict=True)]
    return sorted(ranked, key=lambda hit: (hit.reranked, hit.distance))
