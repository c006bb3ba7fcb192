"""Mesh files that are damaged, by format, for the commands that read a mesh."""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from unbend import write_mesh

from .case import Answer, Case, Refused, Seen
from .good import beside, in_turn, npy, reading, square_text, stone

_PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
_PLY_ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n3 0 1 2\n3 0 2 3\n"
_SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], dtype="<f4")


def cases() -> Iterator[Case]:
    """Give a case for each damaged file."""
    for files in (_off(), _obj(), _ply(), _stl(), _vtk(), _points()):
        for i, row in enumerate(files):
            yield _bad_file(i, *row)
    yield from _odd_but_whole()


def _bad_file(i: int, name: str, suffix: str, content: str | bytes, sentence: str) -> Case:
    data = content.encode() if isinstance(content, str) else content
    bad = f"bad{suffix}"

    def make(folder: Path) -> None:
        beside(folder)
        (folder / bad).write_bytes(data)

    return Case(name, make, in_turn(reading(bad), i), Refused(sentence, names=bad))


def _odd_but_whole() -> Iterator[Case]:
    """Give files that hold a whole mesh in a way that is easily misread."""
    v, f = stone().vertices, stone().faces

    def written(suffix: str, change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
        def make(folder: Path) -> None:
            write_mesh(folder / f"bad{suffix}", (v, f))
            data = (folder / f"bad{suffix}").read_bytes()
            (folder / f"bad{suffix}").write_bytes(change(data))

        return make

    for name, suffix, change, note in (
        ("OBJ, a comment that ends in a backslash", ".obj", lambda data: b"# C:\\\n" + data, ""),
        ("PLY binary, more than promised", ".ply", lambda data: data + b"more", "4 bytes after"),
        ("PLY, a byte order mark", ".ply", lambda data: b"\xef\xbb\xbf" + data, ""),
    ):
        yield Case(
            name,
            written(suffix, change),
            (f"canonical bad{suffix} -o out.npy --no-cache",),
            Answer(written(suffix, bytes), _same_form(note)),
        )


def _same_form(note: str) -> Callable[[Seen, Seen], str]:
    def compare(seen: Seen, truth: Seen) -> str:
        assert (seen.folder / "out.npy").read_bytes() == (truth.folder / "out.npy").read_bytes()
        assert (note in seen.err) if note else not seen.err, seen.err
        return f"the same, noting {note} the last row" if note else "the same to the last bit"

    return compare


_Row = tuple[str, str, str | bytes, str]


def _changed(old: str, new: str) -> str:
    text = square_text()
    assert text.count(old) == 1, old
    return text.replace(old, new)


def _off() -> Iterator[_Row]:
    text = square_text()
    noise = np.random.default_rng(0).integers(0, 256, 500, dtype=np.uint8).tobytes()
    yield "OFF, empty", ".off", "", "is empty"
    yield "OFF, blanks only", ".off", " \n\n\t\r\n", "is empty"
    yield "OFF, comments only", ".off", "# a\n# b\n", "nothing but comments"
    yield "OFF, wrong magic", ".off", text.replace("OFF", "MESH"), "not an OFF file"
    yield "OFF, only the magic", ".off", "OFF\n", "lacks the line with the numbers"
    yield "OFF, cut off in the faces", ".off", text[:40], "truncated"
    yield "OFF, more vertices promised", ".off", _changed("4 2 0", "40 2 0"), "truncated"
    yield "OFF, fewer vertices promised", ".off", _changed("4 2 0", "3 2 0"), "face 0 holds '0.0'"
    yield "OFF, a negative count", ".off", _changed("4 2 0", "-4 2 0"), "'-4' is not a number"
    yield "OFF, a count in words", ".off", _changed("4 2 0", "four 2 0"), "'four' is not a number"
    yield (
        "OFF, 10^18 vertices in a few bytes",
        ".off",
        "OFF\n1000000000000000000 1 0\n",
        "truncated: it promises 1,000,000,000,000,000,000 vertices",
    )
    yield (
        "OFF, a count of 5,000 digits",
        ".off",
        f"OFF\n{'9' * 5000} 1 0\n",
        "is not a number of vertices",
    )
    yield "OFF, a word for a coordinate", ".off", _changed("1 1 0", "1 one 0"), "vertex 2.*'one'"
    yield "OFF, NaN in use", ".off", _changed("1 1 0", "nan 1 0"), "vertex 2 .*not a finite"
    yield "OFF, infinity in use", ".off", _changed("1 1 0", "1 inf 0"), "vertex 2 .*not a finite"
    yield "OFF, a coordinate of 1e999", ".off", _changed("1 1 0", "1 1e999 0"), "not a finite"
    yield "OFF, two coordinates", ".off", _changed("1 1 0", "1 1"), "vertex 2 has 2 numbers"
    yield "OFF, index out of range", ".off", _changed("3 0 2 3", "3 0 2 4"), "face 1 .*vertex 4"
    yield "OFF, negative index", ".off", _changed("3 0 2 3", "3 0 2 -1"), "face 1 .*vertex -1"
    yield "OFF, a fraction as index", ".off", _changed("3 0 2 3", "3 0 2 2.5"), "face 1 .*'2.5'"
    yield (
        "OFF, an index of 30 digits",
        ".off",
        _changed("3 0 2 3", "3 0 2 " + "9" * 30),
        "face 1 .*'9999",
    )
    yield "OFF, a size that is none", ".off", _changed("3 0 2 3", "x 0 2 3"), "face 1 .*'x'"
    yield (
        "OFF, a size of more corners",
        ".off",
        _changed("3 0 2 3", "7 0 2 3"),
        "face 1 promises 7 vertices but names 3",
    )
    yield "OFF, no vertices", ".off", "OFF\n0 0 0\n", "holds no vertices"
    yield "OFF, binary", ".off", b"OFF BINARY\n" + bytes(64), "binary OFF cannot be read"
    yield "OFF, four-dimensional", ".off", text.replace("OFF", "4OFF"), "not three-dimensional"
    yield "OFF, noise after the magic", ".off", b"OFF\n" + noise, "binary data"
    yield "OFF, UTF-16", ".off", text.encode("utf-16"), "UTF-16"
    yield "OFF, Latin-1 in the data", ".off", _changed("1 1 0", "1 é 0").encode("latin-1"), "vertex"
    yield "OFF, compressed", ".off", b"\x1f\x8b\x08\x00" + noise, "compressed with gzip"
    yield "a suffix that is unknown", ".blend", text, 'unknown suffix ".blend"'


def _obj() -> Iterator[_Row]:
    text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nf 1 2 3\n"
    yield "OBJ, empty", ".obj", "", "is empty"
    yield "OBJ, no vertices", ".obj", "# nothing\nvn 0 0 1\n", "holds no vertices"
    yield "OBJ, index 0", ".obj", text + "f 0 1 2\n", "face 1 names vertex 0"
    yield "OBJ, index out of range", ".obj", text + "f 1 3 5\n", "face 1 names vertex 5"
    yield "OBJ, index too far back", ".obj", text + "f -1 -2 -9\n", "face 1 names vertex -9"
    yield "OBJ, a word as index", ".obj", text + "f 1 2 x/1\n", "face 1 holds '1 2 x/1'"
    yield "OBJ, an index of 5,000 digits", ".obj", text + f"f 1 2 {'9' * 5000}\n", "face 1"
    yield "OBJ, two coordinates", ".obj", text + "v 1 2\nf 1 2 5\n", "vertex 4 has 2 numbers"
    yield "OBJ, NaN in use", ".obj", text + "v nan 0 0\nf 1 2 5\n", "vertex 4 .*not a finite"
    yield "OBJ, binary", ".obj", text.encode() + bytes(9), "binary data"


def _ply() -> Iterator[_Row]:
    square = _PLY + _PLY_ROWS
    head = _PLY.replace("ascii", "binary_little_endian").encode()
    big = head.replace(b"little", b"big")
    faces = struct.pack("<B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3)
    body = _SQUARE.tobytes() + faces
    yield "PLY, empty", ".ply", "", "is empty"
    yield "PLY, wrong magic", ".ply", square.replace("ply", "plx", 1), "not a PLY file"
    yield "PLY, no end of the header", ".ply", square.replace("end_header", ""), "no line end_head"
    yield "PLY, unknown type", ".ply", square.replace("float x", "half x"), "header line .*half x"
    yield "PLY, no format", ".ply", square.replace("format ascii 1.0\n", ""), "no format line"
    yield "PLY, a negative count", ".ply", square.replace("face 2", "face -2"), "'-2' is not a num"
    yield "PLY, a count in words", ".ply", square.replace("face 2", "face two"), "'two' is not a nu"
    yield "PLY, no z", ".ply", square.replace("property float z\n", ""), "without the properties"
    yield "PLY, a property twice", ".ply", square.replace("float y", "float x"), "names a property"
    yield (
        "PLY, vertices twice",
        ".ply",
        square.replace("end_header", "element vertex 0\nend_header"),
        "element vertex twice",
    )
    yield (
        "PLY, vertices twice, first without z",
        ".ply",
        square.replace(
            "element vertex", "element vertex 1\nproperty char q\nelement vertex"
        ).replace("end_header\n", "end_header\n1\n"),
        "element vertex twice",
    )
    yield (
        "PLY, both names for the indices, one no list",
        ".ply",
        head.replace(b"end_header", b"property int vertex_index\nend_header") + body + bytes(8),
        "vertex_index",
    )
    yield "PLY, sizes of lists as fractions", ".ply", square.replace("uchar", "float"), "header lin"
    yield "PLY, indices as fractions", ".ply", square.replace("uchar int", "uchar float"), "whole n"
    yield "PLY, triangle strips", ".ply", square.replace("element face", "element tristrips"), "str"
    yield "PLY text, cut off", ".ply", square[:-8], "truncated"
    yield "PLY text, a word for a coordinate", ".ply", square.replace("1 1 0", "1 one 0"), "'one'"
    yield "PLY text, NaN in use", ".ply", square.replace("1 1 0", "1 nan 0"), "not a finite"
    yield "PLY text, index out of range", ".ply", square.replace("3 0 2 3", "3 0 2 9"), "vertex 9"
    yield "PLY text, negative index", ".ply", square.replace("3 0 2 3", "3 0 2 -3"), "vertex -3"
    yield "PLY text, noise", ".ply", _PLY.encode() + bytes(range(256)), "binary data"
    yield "PLY binary, cut off", ".ply", head + body[:-3], "truncated or damaged"
    yield "PLY binary, index out of range", ".ply", head + body[:-4] + b"\x09\0\0\0", "vertex 9"
    yield "PLY binary, negative index", ".ply", head + body[:-4] + b"\xff" * 4, "vertex -1"
    yield "PLY binary, the other byte order", ".ply", big + body, "truncated|finite|vertex"
    yield (
        "PLY binary, a face of 255 corners",
        ".ply",
        head + _SQUARE.tobytes() + b"\xff" + faces[1:],
        "truncated or damaged",
    )
    wide = head.replace(b"uchar int", b"uint int")
    yield (
        "PLY binary, a list of 4 billion entries",
        ".ply",
        wide + _SQUARE.tobytes() + b"\xff" * 8,
        "truncated or damaged",
    )
    signed = head.replace(b"uchar int", b"int int")
    yield (
        "PLY binary, a list of -1 entries",
        ".ply",
        signed + _SQUARE.tobytes() + b"\xff" * 40,
        "truncated or damaged",
    )
    yield (
        "PLY binary, an index of 2^64 - 1 beside a quad",
        ".ply",
        head.replace(b"uchar int", b"uchar uint64")
        + _SQUARE.tobytes()
        + struct.pack("<B3QB4Q", 3, 0, 1, 2, 4, 0, 1, 2, 2**64 - 1),
        "face 1 .*vertex",
    )
    yield (
        "PLY binary, 10^18 vertices in a few bytes",
        ".ply",
        head.replace(b"vertex 4", b"vertex 1000000000000000000") + body,
        "it promises 1,?000,?000,?000,?000,?000,?000 vertex rows|truncated",
    )
    signalling = body.replace(struct.pack("<f", 0.5), struct.pack("<I", 0x7F800001))
    yield "PLY binary, a signalling NaN", ".ply", head + signalling, "not a finite"


def _stl() -> Iterator[_Row]:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    text = f"solid s\n{facet}endfacet\nendsolid s\n"
    triangle = struct.pack("<12fH", *range(12), 0)
    yield "STL, empty", ".stl", "", "is empty"
    yield "STL, ten bytes", ".stl", b"0123456789", "not an STL file"
    yield "STL, no triangles", ".stl", bytes(80) + struct.pack("<I", 0), "without triangles"
    yield (
        "STL, 4 billion triangles in 84 bytes",
        ".stl",
        b"b" * 80 + b"\xff" * 4,
        "truncated: it promises 4,?294,?967,?295",
    )
    yield "STL, cut off", ".stl", b"b" * 80 + struct.pack("<I", 2) + triangle, "truncated"
    yield "STL text, cut off", ".stl", text[:-12], "truncated"
    yield "STL text, two corners", ".stl", text.replace("vertex 1 0 0\n", ""), "1 facet but 2 corn"
    yield "STL text, a word for a number", ".stl", text.replace("1 0 0", "1 zero 0"), "'zero'"
    yield "STL text, NaN", ".stl", text.replace("1 0 0", "nan 0 0"), "triangle 0 .*finite"
    holes = struct.pack("<12fH", *range(9), float("nan"), 0, 0, 0)
    yield "STL, NaN", ".stl", b"b" * 80 + struct.pack("<I", 1) + holes, "triangle 0 .*finite"
    signalling = triangle[:36] + struct.pack("<I", 0x7F800001) + triangle[40:]
    yield "STL, a signalling NaN", ".stl", b"b" * 80 + struct.pack("<I", 1) + signalling, "finite"


def _vtk() -> Iterator[_Row]:
    head = "# vtk DataFile Version 4.2\nbad\nASCII\nDATASET POLYDATA\n"
    points = "POINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0.5\n"
    text = f"{head}{points}POLYGONS 2 8\n3 0 1 2 3 0 2 3\nPOINT_DATA 4\nSCALARS heat int\n"
    text += "LOOKUP_TABLE default\n1 2 3 4\n"
    yield "VTK, values cut off", ".vtk", text[:-2], "promises 4 numbers of heat, but ends"
    yield "VTK, polygons cut off", ".vtk", text[: text.index("POINT_DATA") - 3], "truncated"
    yield "VTK, another number of polygons", ".vtk", text.replace("S 2 8", "S 3 8"), "not 3 cells"
    yield "VTK, a polygon of vertex 4", ".vtk", text.replace("0 2 3\n", "0 2 4\n"), "vertex 4"
    yield "VTK, a word for a number", ".vtk", text.replace("0.5", "half"), "'half'"
    yield "VTK, NaN", ".vtk", text.replace("0.5", "nan"), "not a finite"
    yield "VTK, an unknown line", ".vtk", text.replace("SCALARS", "SPHERES"), "SPHERES heat"
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], ">f4").tobytes()
    binary = f"{head.replace('ASCII', 'BINARY')}POINTS 4 float\n".encode() + places
    yield "VTK binary, cut off", ".vtk", binary[:-5], "truncated: it promises 12 numbers of POINTS"
    cells = struct.pack(">8i", 3, 0, 1, 2, 3, 0, 2, -9)
    yield "VTK binary, polygon of vertex -9", ".vtk", binary + b"\nPOLYGONS 2 8\n" + cells, "-9"


def _points() -> Iterator[_Row]:
    yield "XYZ, empty", ".xyz", "", "is empty"
    yield "XYZ, comments only", ".xyz", "# x y z\n", "holds no points"
    yield "XYZ, two columns", ".xyz", "0 0\n1 1\n2 2\n3 3\n", "point 0 has 2 numbers"
    yield "XYZ, words", ".xyz", "x y z\n1 2 3\n", "point 0 holds 'x'"
    yield "XYZ, decimal commas", ".xyz", "0,5 1 2\n" * 4, "point 0 .*write decimal points"
    yield "XYZ, infinity", ".xyz", "0 0 0\n1 0 0\n0 inf 0\n0 0 1\n", "vertex 2 .*not a finite"
    good = npy(np.eye(3))
    yield "NumPy, empty", ".npy", "", "is empty"
    yield "NumPy, wrong magic", ".npy", b"\x93NUMPX" + good[6:], "not a NumPy array file"
    yield "NumPy, ten bytes", ".npy", b"\x93NUMPY\x02\x00\xff\xff", "not a NumPy array file"
    yield "NumPy, a header of 4 GB", ".npy", b"\x93NUMPY\x02\x00" + b"\xff" * 9, "not a NumPy arr"
    yield "NumPy, cut off", ".npy", good[:-8], "truncated: it promises 3 rows"
    yield "NumPy, 10^12 rows", ".npy", _header("<f8", "(1000000000000, 3)"), "truncated"
    yield "NumPy, a pickle", ".npy", _header("|O", "(3, 3)") + _PICKLE, "not numbers or text"
    yield "NumPy, code in the header", ".npy", _header("'+print('x')+'", "(3, 3)"), "not a NumPy"
    yield "NumPy, negative shape", ".npy", _header("<f8", "(-1, 3)"), "shape"
    yield "NumPy, items of no bytes", ".npy", _header("<U0", "(4000000000, 3)") + b"abc", "bad.npy"
    yield "NumPy, rows without end", ".npy", _header("<f8", f"(0, {2**70})") + b"abc", "bad.npy"
    yield "NumPy, a hundred axes", ".npy", _header("<f8", f"({'1,' * 100})") + bytes(8), "bad.npy"
    yield "NumPy, complex numbers", ".npy", npy(np.ones((4, 3), dtype=complex)), "not numbers"
    yield "NumPy, a structure", ".npy", npy(np.zeros(4, dtype="f8,f8,f8")), "not numbers"
    yield "NumPy, two columns", ".npy", npy(np.ones((4, 2))), r"not \(n, 3\) numbers"
    yield "NumPy, NaN", ".npy", npy(np.eye(3) * np.nan), "that vertex, and 2 more"
    yield "NumPy, numbers beyond double", ".npy", npy(np.full((4, 3), "1e4000", "g")), "finite"


# What a pickle of os.system("touch hacked") begins with; it is never looked at.
_PICKLE = b"cposix\nsystem\n(S'touch hacked'\ntR."


def _header(dtype: str, shape: str) -> bytes:
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()
