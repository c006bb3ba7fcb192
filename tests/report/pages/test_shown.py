"""What is packed can be unpacked, here by another route than the pages' own script."""

import base64
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from unbend.datasets import make_sphere
from unbend.report.pages._shown import pack_places, pack_whole


def unpack(packed):
    data = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"])), np.uint8)
    folded = data.reshape(4, packed["columns"], -1).astype(np.int64)
    folded = (folded * 256 ** np.arange(4)[:, None, None]).sum(axis=0)
    steps = np.where(folded % 2, -(folded + 1) // 2, folded // 2)
    return np.cumsum(steps, axis=1).T


@given(st.lists(st.tuples(*[st.integers(-(2**29), 2**29)] * 2), max_size=20))
def test_whole_numbers_come_back(rows):
    table = np.array(rows, dtype=np.int64).reshape(-1, 2)
    if len(table):
        np.testing.assert_array_equal(unpack(pack_whole(table)), table)


def test_numbers_that_differ_little_take_little_room():
    assert len(pack_whole(np.arange(10_000))["data"]) < 200


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_places_come_back_to_half_a_step(unit):
    places = unit * (make_sphere(3).vertices * [1, 2, 0.1] + 7)
    packed = pack_places(places)
    found = np.array(packed["low"]) + packed["step"] * unpack(packed)
    assert packed["step"] <= 4.1 * unit / 2**14
    assert np.abs(found - places).max() <= 0.51 * packed["step"]


def test_what_is_nowhere_is_packed_as_the_lowest_place():
    packed = pack_places(np.array([[np.nan, 1.0], [3.0, 5.0], [4.0, 4.0]]))
    assert packed["low"] == [3.0, 4.0]
    assert unpack(packed)[0].tolist() == [0, 0]
    assert pack_places(np.full((2, 3), np.nan))["low"] == [0, 0, 0]
