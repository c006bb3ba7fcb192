"""What is kept of a shape."""

from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, write_mesh
from unbend.collection import _adding
from unbend.collection._adding import make_row
from unbend.collection._files import hash_file
from unbend.datasets import make_sphere
from unbend.errors import MeshError, warn
from unbend.mesh import vertex_areas

BALL = make_sphere(3)


def test_a_row_tells_what_a_file_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(tmp_path / "shape.ply")

    def described() -> dict:
        return make_row(hash_file(path))

    for faces, area in ((BALL.faces, vertex_areas(BALL).sum()), (BALL.faces[:0], 0)):
        write_mesh(path, Mesh(BALL.vertices, faces))
        row = described()
        assert (row["n_vertices"], row["n_faces"]) == (642, len(faces))
        assert row["area"] == pytest.approx(area)

    for numbers in ([1.0, 2.0], [1.0, np.nan]):

        def described_so(mesh: Mesh, numbers: list = numbers) -> np.ndarray:
            warn("it is odd")
            return np.array(numbers)

        monkeypatch.setattr(_adding, "descriptor", described_so)
        if np.isfinite(numbers).all():
            assert "it is odd" in described()["notes"]
        else:
            with pytest.raises(MeshError, match=r"^its descriptor is not finite; try unbend check"):
                described()
