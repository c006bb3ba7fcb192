from collections.abc import Iterator

import pytest

from unbend.matching import _inputs


@pytest.fixture(scope="module")
def as_meshed() -> Iterator[None]:
    """Split no edges, so that vertices of a shape are those of its mesh, however coarse it is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_inputs, "_LONGEST", float("inf"))
        yield
