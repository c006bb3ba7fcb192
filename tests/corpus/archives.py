"""Matches (.npz) that are damaged, forged, or far larger than they look."""

import io
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from unbend import Match, write_match

from .case import Answer, Case, Refused, Seen
from .good import Command, beside, in_turn, npy

_N = 42  # vertices of good.off
Arrays = dict[str, Any]


def cases() -> Iterator[Case]:
    """Give a case for each archive."""
    for i, (name, change, sentence) in enumerate(_arrays()):
        yield _case(i, name, lambda change=change: _packed(change(_match())), sentence)
    for i, (name, make, sentence) in enumerate(_files()):
        yield _case(i, name, make, sentence)
    yield Case(
        "match, a member that would lie above the folder",
        _writer(lambda: _packed({**_match(), "../../escaped": np.zeros(1)})),
        _commands()[:2],
        Answer(_writer(lambda: _packed(_match())), _same_output, "the answer without it"),
    )


def _case(i: int, name: str, data: Callable[[], bytes], sentence: str) -> Case:
    commands = in_turn(_commands(), i)
    return Case(name, _writer(data), commands, Refused(sentence, names="bad.npz"))


def _writer(data: Callable[[], bytes]) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        beside(folder)
        (folder / "bad.npz").write_bytes(data())

    return make


def _commands() -> tuple[Command, ...]:
    return (
        "transfer good.off good.off --map bad.npz --values values.csv -o out.csv",
        "register good.off good.off --map bad.npz -o out.ply",
        "evaluate bad.npz good.off truth.txt truth.txt",
    )


def _same_output(seen: Seen, truth: Seen) -> str:
    assert not (seen.folder.parent.parent / "escaped.npy").exists()
    name = next(one.name for one in truth.folder.iterdir() if one.name.startswith("out"))
    assert (seen.folder / name).read_bytes() == (truth.folder / name).read_bytes()
    return "the same to the last bit"


def _match() -> Arrays:
    """Give what the file of a match holds."""
    rows = np.arange(_N)
    found = Match(
        source_to_target=rows,
        target_to_source=rows,
        functional_map=np.eye(5),
        orientation=1.0,
        confidence=0.9,
    )
    return _arrays_of(found)


def _arrays_of(found: Match) -> Arrays:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        write_match(Path(folder) / "m.npz", found)
        with np.load(Path(folder) / "m.npz", allow_pickle=False) as arrays:
            return dict(arrays)


def _packed(arrays: Arrays, how: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", how) as archive:
        for name, array in arrays.items():
            data = array if isinstance(array, bytes) else npy(array, pickled=True)
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def _with(**changes: Any) -> Callable[[Arrays], Arrays]:
    return lambda arrays: arrays | changes


def _arrays() -> Iterator[tuple[str, Callable[[Arrays], Arrays], str]]:
    rows = np.arange(_N)
    half = np.full((_N, 3), 1 / 2)
    yield "match, lacking the map", lambda all_: {"confidence": np.array(1.0)}, "holds no source_to"
    yield "match, a member pickled", _with(source_to_target=np.array([{}] * _N)), "not numbers or"
    yield "match, code in a header", _with(confidence=_code()), "its confidence: not a NumPy"
    yield "match, a member that is no array", _with(confidence=b"0.9"), "its confidence: not a"
    yield (
        "match, a vertex that is not there",
        _with(source_to_target=rows + 1),
        "target: row 41 is 42",
    )
    yield "match, a vertex -2", _with(target_to_source=rows - 2), "target_to_source: row 0 is -2"
    yield "match, fractions as vertices", _with(source_to_target=rows + 0.5), "row 0 is 0.5"
    yield "match, a map of no axis", _with(source_to_target=np.array(3)), "its source_to_target"
    yield "match, no rows", _with(source_to_target=rows[:0]), "source_to_target: holds no"
    yield "match, NaN in the functional map", _with(functional_map=np.eye(5) * np.nan), "not finite"
    yield "match, a functional map too large", _with(functional_map=np.eye(50)), "more than 42 and"
    yield "match, an orientation of 7", _with(orientation=np.array(7.0)), "not from -1 to 1"
    yield "match, a confidence of -1", _with(confidence=np.array(-1.0)), "not from 0 to 1"
    yield "match, a confidence in words", _with(confidence=np.array("high")), "its confidence is <U"
    yield "match, a disorder of infinity", _with(disorder=np.array(np.inf)), "not finite"
    yield "match, weights without faces", _with(weights=half), "mean nothing without faces"
    yield "match, weights of sum 1.5", _with(weights=half, faces=rows), "its weights in row 0"
    yield "match, hypotheses of two columns", _with(hypotheses=half[:, :2]), "its hypotheses"
    yield (
        "match, of other shapes",
        _with(source_to_target=rows % 7, target_to_source=rows[:7]),
        "a mesh of 7 vertices",
    )


def _code() -> bytes:
    text = "__import__('os').system('touch hacked')".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def _files() -> Iterator[tuple[str, Callable[[], bytes], str]]:
    yield "match, empty", lambda: b"", "is empty"
    yield "match, noise", lambda: bytes(range(256)) * 9, "not a .npz file, or a damaged one"
    yield "match, cut off", lambda: _packed(_match())[:-40], "not a .npz file, or a damaged one"
    yield "match, an empty archive", lambda: _packed({}), "holds no source_to_target"
    yield "match, bits changed", _flipped, "damaged"
    yield "match, encrypted", _encrypted, "not a .npz file, or a damaged one"
    yield "match, a member twice", _twice, "two arrays of one name"
    yield "zip bomb, 80 MB of zeros", lambda: _packed(_bomb(80)), "would grow from"
    yield "zip bomb, bzip2 behind a small size", _hidden_bomb, "packed in a way"
    yield "zip bomb, LZMA", lambda: _packed(_bomb(1), zipfile.ZIP_LZMA), "packed in a way"
    yield "zip bomb, 8 TB claimed by a header", _claimed, "is 138 bytes, but with shape"


def _flipped() -> bytes:
    data = bytearray(_packed(_match()))
    for i in range(60, 120):
        data[i] ^= 0xFF
    return bytes(data)


def _encrypted() -> bytes:
    data = bytearray(_packed(_match()))
    central = data.index(b"PK\x01\x02")
    data[6] |= 1  # the flag, in the member's header and in the directory
    data[central + 8] |= 1
    return bytes(data)


def _twice() -> bytes:
    import warnings

    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for arrays in (_match(), _match()):
            for name, array in arrays.items():
                archive.writestr(f"{name}.npy", npy(array))
    return file.getvalue()


def _bomb(megabytes: int) -> Arrays:
    """Give a match with a functional map of so many zeros, which pack a thousandfold."""
    header = io.BytesIO()
    shape = (megabytes * 2**17, 1)
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    return _match() | {"functional_map": header.getvalue() + bytes(megabytes * 2**20)}


def _hidden_bomb() -> bytes:
    """Pack 60 MB with bzip2, and say in the directory and the header that it is 208 bytes."""
    arrays = _bomb(60)
    size = struct.pack("<I", len(arrays["functional_map"]))
    return _packed(arrays, zipfile.ZIP_BZIP2).replace(size, struct.pack("<I", 208))


def _claimed() -> bytes:
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (2**40, 1)}
    )
    return _packed(_match() | {"functional_map": header.getvalue() + bytes(10)})
