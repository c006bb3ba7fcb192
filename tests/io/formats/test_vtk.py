"""VTK's older files, in text and binary, with the cells of old and new versions."""

import re
from pathlib import Path

import numpy as np
import pytest

from unbend import read_mesh
from unbend.errors import FileError, MeshError
from unbend.io import read_values

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=">f4")
LABELS = np.array([3, 1, 4, 1, 5], dtype=">i4")
HEAT = np.arange(10, dtype=">f8").reshape(5, 2)


def a_file(binary: bool = False, new: bool = False) -> bytes:
    """A pyramid with a square below and all kinds of arrays, as VTK writes it."""

    def numbers(*parts, dtype: str = ">i4") -> bytes:
        flat = np.concatenate([np.ravel(one) for one in parts]).astype(dtype)
        return (flat.tobytes() if binary else " ".join(map(str, flat.tolist())).encode()) + b"\n"

    triangles = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    if new:
        polygons = b"POLYGONS 6 16\nOFFSETS vtktypeint64\n"
        polygons += numbers([0, 4, 7, 10, 13, 16], dtype=">i8")
        polygons += b"CONNECTIVITY vtktypeint64\n" + numbers([0, 3, 2, 1], triangles, dtype=">i8")
    else:
        rows = [[3, *row] for row in triangles]
        polygons = b"POLYGONS 5 21\n" + numbers([4, 0, 3, 2, 1], rows)
    names = b"\xc3hip\x80\x64" + bytes(100) if binary else b"hip\n\n"
    return b"".join(
        [
            b"# vtk DataFile Version %s\na title\n" % (b"5.1" if new else b"4.2"),
            b"BINARY\n" if binary else b"ASCII\n",
            b"DATASET POLYDATA\nFIELD FieldData 2\nscan 1 2 int\n" + numbers([7, 8]),
            b"names 1 2 string\n" + names + b"\n",
            b"POINTS 5 float\n" + numbers(POINTS, dtype=">f4"),
            b"METADATA\nINFORMATION 1\nNAME POINTS LOCATION vtkDataArray\nDATA 1 2\n\n",
            polygons,
            b"CELL_DATA 5\nSCALARS area double\nLOOKUP_TABLE default\n"
            + numbers(range(5), dtype=">f8"),
            b"POINT_DATA 5\nSCALARS region%20of int\nLOOKUP_TABLE table\n" + numbers(LABELS),
            b"LOOKUP_TABLE table 1\n" + (bytes(4) if binary else b"0 0 0 1") + b"\n",
            b"COLOR_SCALARS paint 1\n" + (b"\0\0\0\0\xff" if binary else b"0 0 0 0 1") + b"\n",
            b"NORMALS n float\n" + numbers(POINTS, dtype=">f4"),
            b"TEXTURE_COORDINATES uv 2 double\n" + numbers(HEAT, dtype=">f8"),
            b"FIELD FieldData 1\nheat 2 5 double\n" + numbers(HEAT, dtype=">f8"),
        ]
    )


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("new", [False, True])
def test_a_surface_is_read_with_its_values(tmp_path: Path, binary: bool, new: bool) -> None:
    path = tmp_path / "a.vtk"
    path.write_bytes(a_file(binary, new))
    mesh = read_mesh(path)
    with pytest.raises(FileError, match=r"no area, but .*; values of cells are not read: ParaV"):
        read_values(path, name="area")
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    square = [[0, 3, 2], [0, 2, 1]]
    np.testing.assert_array_equal(mesh.faces, [*square, [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    assert mesh.notes == ("1 polygon split into triangles",)
    np.testing.assert_array_equal(read_values(path, name="region of"), LABELS)
    for name in ("heat", "uv"):
        np.testing.assert_array_equal(read_values(path, name=name), HEAT)
    np.testing.assert_array_equal(read_values(path, name="n"), POINTS)
    assert read_values(path, name="paint").tolist() == [0, 0, 0, 0, 255]
    kind = b"BINARY\nDATASET POLYDATA" if binary else b"ASCII\nDATASET POLYDATA"
    path.write_bytes(a_file(binary, new).replace(kind, kind.lower()))
    np.testing.assert_array_equal(read_mesh(path).faces, mesh.faces)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("new", [False, True])
def test_polygons_of_a_grid_are_read(tmp_path: Path, binary: bool, new: bool) -> None:
    path, data = tmp_path / "a.vtk", a_file(binary, new)
    data = data.replace(b"POLYDATA", b"UNSTRUCTURED_GRID").replace(b"POLYGONS", b"CELLS")

    def grid(*types: int) -> None:
        flat = np.array(types, dtype=">i4")
        numbers = flat.tobytes() if binary else " ".join(map(str, types)).encode()
        kinds = b"CELL_TYPES %d\n" % len(types) + numbers + b"\nCELL_DATA"
        path.write_bytes(data.replace(b"CELL_DATA", kinds))

    grid(9, 5, 5, 7, 5)
    assert read_mesh(path).faces.tolist()[1:3] == [[0, 2, 1], [0, 1, 4]]
    np.testing.assert_array_equal(read_values(path, name="region of"), LABELS)
    grid(10, 5, 3, 7, 5)
    mesh = read_mesh(path)
    assert mesh.faces.tolist() == [[0, 1, 4], [2, 3, 4], [3, 0, 4]]
    assert mesh.notes == ("1 cell left out that is no polygon",)
    for types, problem in (
        ([10] * 5, "5 cells, but no polygons: save its surface as triangles"),
        ([5] * 4 + [6], "triangle strips"),
        ([5] * 4, "has 5 cells, but 4 types"),
    ):
        grid(*types)
        with pytest.raises(FileError, match=problem):
            read_mesh(path)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (b"POINTS 5 float", b"POINTS 500 float", "truncated: it promises 1500 numbers of POINTS"),
        (b"POINTS 5 float", b"POINTS 5 bit", "POINTS holds 'bit', not a type of numbers"),
        (b"POLYDATA", b"STRUCTURED_GRID", "holds STRUCTURED_GRID, which is no surface"),
        (b"DATASET", b"DATA", "not a VTK file"),
        (b"POINTS 5", b"POINTS -5", "'-5' is not a number of rows"),
        (b"POINTS 5", b"POINTS 0", "a line holds '0.0 0.0"),
        (b"1.0 1.0 0.0", b"1.0 x 0.0", "POINTS, block 0 holds 'x', not a number"),
        (b"3 0 1 4", b"3 0 1 9", "face 1 names vertex 9"),
        (b"3 0 1 4", b"9 0 1 4", "the 21 numbers of POLYGONS are not 5 cells"),
        (b"POLYGONS", b"TRIANGLE_STRIPS", "holds triangle strips"),
        (b"NORMALS", b"PEDIGREES", "'PEDIGREES n float', which unbend cannot read"),
        (b"heat 2 5", b"heat 2 6", "truncated: it promises 12 numbers of heat"),
        (b"FIELD FieldData 1\nheat", b"FIELD FieldData 2\nheat", "'' is not a number of rows"),
    ],
)
def test_a_damaged_one_is_refused(tmp_path: Path, old: bytes, new: bytes, problem: str) -> None:
    (tmp_path / "a.vtk").write_bytes(a_file().replace(old, new))
    with pytest.raises((FileError, MeshError), match=re.escape(problem)):
        read_mesh(tmp_path / "a.vtk")


def test_colours_that_can_be_none_are_left_out(tmp_path: Path) -> None:
    data = a_file(False, False).replace(b"\n0 0 0 0 1\n", b"\n0 0 0 0 255\n")
    (tmp_path / "a.vtk").write_bytes(data)
    notes = read_mesh(tmp_path / "a.vtk").notes
    assert notes[-1] == "colours paint left out, which are not from 0 to 1"
    np.testing.assert_array_equal(read_values(tmp_path / "a.vtk", name="heat"), HEAT)


def test_one_cut_off_anywhere_is_never_read_as_another(tmp_path: Path) -> None:
    path = tmp_path / "a.vtk"
    for binary, new in ((False, False), (True, True)):
        data = a_file(binary, new)
        for end in range(data.index(b"POINTS"), len(data) - 1, 3):
            path.write_bytes(data[:end])
            try:
                mesh = read_mesh(path)
            except (FileError, MeshError):
                continue
            np.testing.assert_array_equal(mesh.vertices, POINTS)
            assert len(mesh.faces) in (0, 6)


@pytest.mark.parametrize("ends", ["0 4 7 10 13 17", "1 4 7 10 13 16", "0 8 7 10 13 16"])
def test_offsets_that_do_not_fit_are_refused(tmp_path: Path, ends: str) -> None:
    data = a_file(new=True).replace(b"0 4 7 10 13 16", ends.encode())
    (tmp_path / "a.vtk").write_bytes(data)
    with pytest.raises(FileError, match="the 16 numbers of POLYGONS are not 6 cells"):
        read_mesh(tmp_path / "a.vtk")
