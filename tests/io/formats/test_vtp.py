"""VTP files hold what they promise; VTK itself reads them where it is installed."""

import xml.etree.ElementTree as ET
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, as_mesh, write_mesh

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
        "colors": colors,
        "uv": uvs,
    }
    assert found.keys() == expected.keys()
    for name, array in expected.items():
        np.testing.assert_array_equal(found[name], array)


def test_vtk_reads_it(blob: Mesh, tmp_path: Path) -> None:
    pyvista = pytest.importorskip("pyvista")
    heat = np.linspace(0, 1, 642)
    write_mesh(tmp_path / "a.vtp", blob, scalars={"heat": heat})
    found = pyvista.read(tmp_path / "a.vtp")
    back = as_mesh(found)
    np.testing.assert_array_equal(back.vertices, blob.vertices)
    np.testing.assert_array_equal(back.faces, blob.faces)
    np.testing.assert_array_equal(found.point_data["heat"], heat)
