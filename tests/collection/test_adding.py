"""What is kept of a shape."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from unbend import Mesh, canonical_form, spectrum, write_mesh
from unbend.collection import _adding
from unbend.collection._adding import make_row
from unbend.collection._descriptor import FORM_POINTS, Basis, sample_form
from unbend.collection._files import hash_file
from unbend.datasets import make_sphere
from unbend.errors import MeshError, warn
from unbend.mesh import vertex_areas

BALL = make_sphere(3)


def stone() -> Mesh:
    x, y, z = BALL.vertices.T
    points = np.stack([2 * x, 1.2 * y + 0.3 * x**2, z + 0.2 * x * y], axis=1)
    return Mesh(points / np.sqrt(vertex_areas(Mesh(points, BALL.faces)).sum()), BALL.faces)


def test_the_form_is_the_exact_canonical_form_at_farthest_points() -> None:
    exact = canonical_form(stone(), weighting="area").points
    pairs = spectrum(stone(), 8)
    found = sample_form(Basis(pairs.eigenvalues, pairs.eigenfunctions, pairs.areas))
    assert found.shape == (FORM_POINTS, 3)
    # Rows of the exact form, but for the axes' signs; none is far from all that were taken.
    gaps, rows = cKDTree(np.abs(exact)).query(np.abs(found))
    assert gaps.max() < 1e-6
    assert len(set(rows)) > FORM_POINTS / 2
    left = cKDTree(np.abs(found)).query(np.abs(exact))[0].max()
    apart = cKDTree(found).query(found, 2)[0][:, 1]
    assert left <= apart.min() + 1e-6


def test_of_few_points_some_repeat() -> None:
    few = Basis(np.array([0.0, 1.0]), np.array([[1.0, 1], [1, -1], [1, 2], [1, 0]]), np.ones(4) / 4)
    found = sample_form(few)
    assert found.shape == (FORM_POINTS, 3)
    np.testing.assert_array_equal(np.unique(found[:, 0]), [-1, 0, 1, 2])
    assert not found[:, 1:].any()


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

        def describe(basis: Basis, numbers: list = numbers) -> np.ndarray:
            warn("it is odd")
            return np.array(numbers)

        monkeypatch.setattr(_adding, "describe", describe)
        if np.isfinite(numbers).all():
            assert "it is odd" in described()["notes"]
        else:
            with pytest.raises(MeshError, match=r"^its descriptor is not finite; try unbend check"):
                described()
