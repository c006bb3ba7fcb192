"""VTK's files in XML are read however VTK writes them, and hold what they promise."""

import lzma
import xml.etree.ElementTree as ET
import zlib
from base64 import b64decode, b64encode
from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, as_mesh, read_mesh, write_mesh
from unbend.errors import FileError, MeshError
from unbend.io import read_values

TYPES = {"Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}


def arrays(path: Path) -> dict[str, np.ndarray]:
    found = {}
    for one in ET.parse(path).iter("DataArray"):
        data = b64decode(one.text)
        assert int.from_bytes(data[:8], "little") == len(data) - 8
        width = int(one.get("NumberOfComponents"))
        found[one.get("Name")] = np.frombuffer(data[8:], TYPES[one.get("type")]).reshape(-1, width)
    return found


@pytest.mark.parametrize("points", [True, False])
def test_arrays_come_back(blob: Mesh, tmp_path: Path, points: bool) -> None:
    rng = np.random.default_rng(0)
    mesh = Mesh(blob.vertices) if points else blob
    scalars = {"heat": rng.random(642), "cold": np.full(642, np.nan)}
    colors, uvs = rng.integers(0, 256, (642, 3)), rng.random((642, 2))
    write_mesh(tmp_path / "a.vtp", mesh, scalars=scalars, colors=colors, uvs=uvs)
    found = arrays(tmp_path / "a.vtp")
    ends = np.arange(1, 643) if points else np.arange(3, mesh.faces.size + 1, 3)
    expected = {
        "Points": mesh.vertices,
        "connectivity": np.arange(642)[:, None] if points else mesh.faces.reshape(-1, 1),
        "offsets": ends[:, None],
        "heat": scalars["heat"][:, None],
        "cold": scalars["cold"][:, None],
        "color": colors,
        "uv": uvs,
    }
    assert found.keys() == expected.keys()
    for name, array in expected.items():
        np.testing.assert_array_equal(found[name], array)
    back = read_mesh(tmp_path / "a.vtp")
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    for name in ("heat", "cold", "color"):
        np.testing.assert_array_equal(
            read_values(tmp_path / "a.vtp", name=name), found[name].squeeze()
        )


def test_vtk_reads_it(blob: Mesh, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    heat = np.linspace(0, 1, 642)
    write_mesh(tmp_path / "a.vtp", blob, scalars={"heat": heat})
    found = pyvista.read(tmp_path / "a.vtp")
    back = as_mesh(found)
    np.testing.assert_array_equal(back.vertices, blob.vertices)
    np.testing.assert_array_equal(back.faces, blob.faces)
    np.testing.assert_array_equal(found.point_data["heat"], heat)


PLACES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]])
CODES = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}


def a_file(
    how: str, packer: str = "", order: str = "<", word: str = "u4", grid: bool = False
) -> bytes:
    """Two pieces of a square and a triangle each, with values and a line, as VTK writes them."""
    pack = {"": bytes, "vtkZLib": zlib.compress, "vtkLZMA": lzma.compress}[packer]
    appended = b""

    def words(*numbers: int) -> bytes:
        return np.array(numbers, order + word).tobytes()

    def array(name: str, rows: np.ndarray) -> str:
        nonlocal appended
        code, width = rows.dtype.str[1:], rows[0].size
        head = f'<DataArray Name="{name}" type="{CODES[code]}" NumberOfComponents="{width}"'
        if how in ("ascii", ""):
            text = " ".join(map(str, rows.ravel().tolist()))
            told = ' format="ascii"' if how else ""
            return f"{head}{told}>{text}</DataArray>"
        data = rows.astype(order + code).tobytes()
        parts = [words(len(data)) + data]
        if packer:
            blocks = [pack(data[i : i + 64]) for i in range(0, len(data), 64)]
            sizes = len(blocks), 64, len(data) % 64, *map(len, blocks)
            parts = [words(*sizes), b"".join(blocks)]
        coded = b"".join(parts if how == "raw" else map(b64encode, parts))
        if how == "binary":
            return f'{head} format="binary">\n  {coded.decode()}\n</DataArray>'
        at, appended = len(appended), appended + coded
        return f'{head} format="appended" offset="{at}"/>'

    pieces = ""
    for at in (0, 10):
        polygons = [array("connectivity", np.array([0, 1, 2, 3, 2, 1, 0]))]
        polygons += [array("offsets", np.array([4, 7]))]
        polygons += [array("types", np.array([9, 5], np.uint8))] if grid else []
        cells = "Cells" if grid else "Polys"
        pieces += (
            f'<Piece NumberOfPoints="4"><PointData>{array("heat", at + np.arange(4.0))}'
            f'{array("rgb", np.full((4, 3), at, np.uint8))}<Array Name="labels" type="String"/>'
            f"</PointData><CellData/><Points>{array('Points', (PLACES + at).astype(np.float32))}"
            f"</Points><Verts/><{cells}>{''.join(polygons)}</{cells}></Piece>"
        )
    kind, header = "UnstructuredGrid" if grid else "PolyData", f"UInt{8 * int(word[1])}"
    ends = "BigEndian" if order == ">" else "LittleEndian"
    packed = f' compressor="{packer}DataCompressor"' if packer else ""
    tail = b"</VTKFile>\n"
    if appended:
        coding = b"raw" if how == "raw" else b"base64"
        tail = b'<AppendedData encoding="%s">\n _%s\n</AppendedData>' % (coding, appended) + tail
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" byte_order="{ends}" '
        f'header_type="{header}"{packed}><{kind}>{pieces}</{kind}>'
    ).encode() + tail


@pytest.mark.parametrize(
    "made",
    [
        {"how": "ascii"},
        {"how": ""},
        {"how": "binary", "order": ">"},
        {"how": "binary", "packer": "vtkZLib", "grid": True},
        {"how": "base64", "packer": "vtkLZMA", "word": "u8"},
        {"how": "base64", "grid": True},
        {"how": "raw", "packer": "vtkZLib", "word": "u8", "order": ">"},
        {"how": "raw"},
    ],
    ids=str,
)
def test_it_is_read_however_it_is_written(tmp_path: Path, made) -> None:
    path = tmp_path / ("a.vtu" if made.get("grid") else "a.vtp")
    path.write_bytes(a_file(**made))
    mesh = read_mesh(path)
    np.testing.assert_array_equal(mesh.vertices, np.concatenate([PLACES, PLACES + 10]))
    faces = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0]])
    np.testing.assert_array_equal(mesh.faces, np.concatenate([faces, faces + 4]))
    assert mesh.notes == ("2 polygons split into triangles",)
    heat = np.concatenate([np.arange(4.0), 10 + np.arange(4.0)])
    np.testing.assert_array_equal(read_values(path, name="heat"), heat)
    np.testing.assert_array_equal(
        read_values(path, name="rgb"), np.repeat([0, 10], 12).reshape(-1, 3)
    )
    for cells in (b"<CellData/>", b'<CellData Scalars="m"><DataArray/></CellData>'):
        path.write_bytes(path.read_bytes().replace(b"<CellData/>", cells))
        with pytest.raises(FileError, match="holds no m, but ") as refused:
            read_values(path, name="m")
        assert ("values of cells are not read" in str(refused.value)) == (b"Array" in cells)


@pytest.mark.parametrize("how", ["ascii", "binary", "base64", "raw"])
@pytest.mark.parametrize("packer", ["", "vtkZLib", "vtkLZMA"])
def test_a_cut_file_is_refused(tmp_path: Path, how: str, packer: str) -> None:
    whole = a_file(how, packer)
    last = whole.index(b"AppendedData") if b"AppendedData" in whole else 0
    for cut in np.linspace(last, len(whole) - 30, 20, dtype=int):
        (tmp_path / "a.vtp").write_bytes(whole[: cut + 1])
        with pytest.raises((FileError, MeshError), match=r"^a\.vtp: (truncated|damaged|holds no)"):
            read_mesh(tmp_path / "a.vtp")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('type="PolyData"', 'type="ImageData"', "holds ImageData, which is no surface"),
        ("<VTKFile", '<VTKFile compressor="vtkLZ4DataCompressor"', "is packed by vtkLZ4Data"),
        ("NumberOfPoints", 'NumberOfStrips="2" NumberOfPoints', "holds triangle strips"),
        ('"Float32"', '"Bit"', "Points holds 'Bit', not a type of numbers"),
        (
            'NumberOfComponents="3"',
            'NumberOfComponents="5"',
            "damaged: Points has 12 numbers in rows",
        ),
        ("4 7<", "4 9<", "damaged: its 7 corners are not those of 2 cells"),
        ("0 1 2 3 2 1 0<", "0 1 2 9 2 1 0<", "damaged: a cell of a piece of 4 points has another"),
        ("0.0 1.0 2.0 3.0", "0.0 1.0 two 3.0", "heat 2 holds 'two', not a number"),
        (
            'type="Int64"',
            'type="Float64"',
            "damaged: a piece has not 4 points of three numbers, or",
        ),
        ("0.0 1.0 2.0 3.0", "0.0 1.0 2.0", "damaged: heat does not have a row for each point"),
        ('Points="4"', 'Points="5"', "damaged: a piece has not 5 points of three numbers"),
        ("</VTKFile>", "", "truncated, or not a VTK file in XML"),
        ("Piece", "Part", "holds no pieces"),
        ("ascii", "binary", "truncated or damaged: .*base64"),
    ],
)
def test_what_cannot_be_read_is_said(tmp_path: Path, old: str, new: str, why: str) -> None:
    (tmp_path / "a.vtp").write_bytes(a_file("ascii").replace(old.encode(), new.encode()))
    with pytest.raises((FileError, MeshError), match=f"^a.vtp: {why}"):
        read_mesh(tmp_path / "a.vtp")
