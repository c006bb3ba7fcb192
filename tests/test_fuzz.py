"""The targets of the fuzzer on the inputs that it begins with, and on some steps at random."""

from __future__ import annotations

import numpy as np
import pytest

from fuzz import mutations, readers


@pytest.mark.parametrize("family", ["meshes", "maps", "values", "archives"])
def test_seeds_raise_nothing(family: str) -> None:
    seeds = set(readers.seeds(family))
    assert len(seeds) > 10
    for seed in seeds:
        getattr(readers, family)(seed)


@pytest.mark.parametrize("seed", range(20))
def test_broken_meshes_raise_nothing(seed: int) -> None:
    mutations.shapes(np.random.default_rng(seed).bytes(4 + 4 * (seed % 8)))
