"""Arrays come back whole; what a header promises is not believed."""

import io

import numpy as np
import pytest

from unbend.errors import FileError
from unbend.io.formats.npy import read_array


def written(shape: tuple[int, ...], descr: str, data: bytes = b"") -> bytes:
    file = io.BytesIO()
    header = {"descr": descr, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + data


@pytest.mark.parametrize(
    "array", [np.array([True]), np.array(7, "u1"), np.zeros((0, 3)), np.ones((1,) * 32, ">f4"),
              np.array(["ab", "c"]), np.asfortranarray(np.arange(6).reshape(2, 3))]
)  # fmt: skip
def test_what_was_saved_comes_back_whatever_follows(array: np.ndarray) -> None:
    file = io.BytesIO()
    np.save(file, array)
    for more in (b"", b"12345678"):
        back = read_array(file.getvalue() + more)
        assert back.dtype == array.dtype
        np.testing.assert_array_equal(back, array, strict=True)


@pytest.mark.parametrize(
    ("shape", "descr", "sentence"),
    [
        ((-1, -1, 3), "<f8", "promises an array of shape"),
        ((-1, 3), "<f8", "promises an array of shape"),
        ((1,) * 33, "<f8", "promises an array of shape"),
        ((2**59,), "<f8", "promises an array of shape"),
        ((0, 2**59), "<f8", "promises an array of shape"),
        ((1,), "<U0", "promises an array of shape"),
        ((2**59 - 1,), "<f8", "truncated: it promises 576,460,752,303,423,487 rows"),
        ((), "<f8", "truncated: it promises 1 row, 8 bytes"),
        ((1,), "<c8", "not numbers or text"),
    ],
)
def test_empty_promises(shape: tuple[int, ...], descr: str, sentence: str) -> None:
    with pytest.raises(FileError, match=sentence):
        read_array(written(shape, descr, b"1234"))
