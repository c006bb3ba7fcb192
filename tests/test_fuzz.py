"""The targets of the fuzzer on some of the inputs that it begins with.

``tests/test_corpus.py`` reads all of them.
"""

import pytest

from fuzz import mutations, readers


@pytest.mark.parametrize("family", ["meshes", "maps", "values", "archives"])
def test_seeds_raise_nothing(family: str) -> None:
    seeds = sorted(set(readers.seeds(family)))
    assert len(seeds) > 10
    for seed in seeds[::24]:
        getattr(readers, family)(seed)


def test_broken_meshes_raise_nothing() -> None:
    for seed in list(mutations.seeds("shapes"))[::13]:  # each is matched
        mutations.shapes(seed)
