"""The targets of the fuzzer on the inputs that it begins with."""

from __future__ import annotations

import pytest

from fuzz import mutations, readers


@pytest.mark.parametrize("family", ["meshes", "maps", "values", "archives"])
def test_seeds_raise_nothing(family: str) -> None:
    seeds = set(readers.seeds(family))
    assert len(seeds) > 10
    for seed in seeds:
        getattr(readers, family)(seed)


def test_broken_meshes_raise_nothing() -> None:
    for seed in mutations.seeds("shapes"):
        mutations.shapes(seed)
