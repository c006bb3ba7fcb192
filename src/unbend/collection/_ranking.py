"""Comparison of shapes: all pairs by descriptor, and the best hits again by their matches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from unbend._memory import available_memory
from unbend._text import gib
from unbend._types import FloatArray, Progress
from unbend.collection._files import find_file
from unbend.collection._rows import Entry, Hit
from unbend.collection._store import Store
from unbend.errors import FileError, InputError, UnbendError, heard, warn
from unbend.io import read_mesh
from unbend.matching import match
from unbend.mesh import Mesh


def compare_all(store: Store) -> tuple[list[Entry], FloatArray]:
    """Distances (n, n) of the descriptors of all shapes, sorted by path."""
    from scipy.spatial.distance import cdist

    n = store.n_shapes()
    free, needed = available_memory(), 3 * 8 * n**2
    if free is not None and needed > free:
        raise InputError(
            f"all pairs of {n:,} shapes need {gib(needed)} of memory and {gib(free)} are "
            "free; search the collection instead, or export it"
        )
    rows = {row["id"]: row["descriptor"] for row in store.select(["id", "descriptor"])}
    entries = sorted((one for one in store.entries() if one.id in rows), key=lambda one: one.path)
    descriptors = np.array([rows[one.id] for one in entries])
    return entries, cdist(descriptors, descriptors)


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
    ranked = [replace(hit, energy=value) for hit, value in zip(hits, energies, strict=True)]
    return sorted(ranked, key=lambda hit: (hit.energy, hit.distance))
