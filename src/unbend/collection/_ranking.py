"""Reranking of the best hits by the energies of matches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from unbend._types import Progress
from unbend.collection._files import find_file
from unbend.collection._rows import Hit
from unbend.errors import FileError, UnbendError, heard, warn
from unbend.io import read_mesh
from unbend.matching import match
from unbend.mesh import Mesh


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
