"""What a match says of itself."""

from dataclasses import replace

import numpy as np
import pytest

from unbend.matching import Match

WHOLE = Match(np.array([1, 0, 1]), np.array([1, 0]), np.eye(2), 0.7, 0.9)


@pytest.mark.parametrize(
    ("shares", "told"),
    [
        ((1.0, 1.0), "Match(3 to 2 vertices, confidence 0.90)"),
        ((0.5, 1.0), "Match(3 to 2 vertices, overlap 50%, confidence 0.90)"),
        ((0.5, 0.25), "Match(3 to 2 vertices, overlap 25%, confidence 0.90)"),
    ],
)
def test_it_tells_its_size_and_of_what_part_it_is(shares: tuple[float, float], told: str) -> None:
    found = replace(WHOLE, overlap_source=shares[0], overlap_target=shares[1])
    assert repr(found) == told


def test_it_says_so_where_nobody_knows_its_confidence() -> None:
    found = replace(WHOLE, confidence=np.nan)
    assert repr(found) == "Match(3 to 2 vertices, confidence not estimated)"
    assert '<th scope="row">confidence</th><td>not estimated</td>' in found._repr_html_()
