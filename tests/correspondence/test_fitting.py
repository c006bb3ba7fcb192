"""What registration keeps of a surface: sizes of its parts, partners of its vertices."""

import numpy as np
import scipy.sparse as sp

from unbend import Mesh
from unbend.correspondence._fitting import Fit, _nearest_partners
from unbend.correspondence._projection import make_target
from unbend.datasets import make_sphere
from unbend.deformation import ElasticSurface
from unbend.mesh import vertex_areas

ROD = make_sphere(3)
ROD = Mesh(ROD.vertices * [3, 1, 1], ROD.faces)
AREAS = vertex_areas(ROD)
START = ROD.vertices / np.sqrt(AREAS.sum())
LEFT, RIGHT = START[:, 0] < -0.2, START[:, 0] > 0.2


def _fitted(goal: np.ndarray, seen: np.ndarray) -> Fit:
    """Fit a rod to what is seen of another."""
    n = len(START)
    surface = ElasticSurface(START, ROD.faces, AREAS / AREAS.sum())
    target = make_target(goal, ROD.faces[seen[ROD.faces].all(axis=1)])
    fit = Fit(surface, target, np.arange(n), goal, np.isin(np.arange(n), target.faces))
    fit.run(None)
    return fit


def test_sizes_of_patches_vary_as_proportions_do() -> None:
    fit = _fitted(START * np.where(START[:, :1] > 0, 2, 1), START[:, 0] < 9)
    assert 2 > fit.sizes[RIGHT].mean() > 1.4 * fit.sizes[LEFT].mean() > 1.4


def test_what_is_not_seen_is_as_large_as_the_rest() -> None:
    fit = _fitted(2 * START, START[:, 0] < 0.3)
    np.testing.assert_allclose(fit.sizes, 2, rtol=0.01)
    np.testing.assert_allclose(fit.places, 2 * START, atol=0.01)


def test_the_nearest_partner_spreads_along_the_edges() -> None:
    places = np.array([[0.0, 0, 0], [1, 0, 0], [3, 0, 0], [4, 0, 0], [9, 9, 9]])
    path = sp.diags([1.0, 1, 1, 0], 1, shape=(5, 5))
    matched = np.array([True, False, False, True, False])
    links = sp.csr_matrix(path + path.T)
    found = _nearest_partners(np.array([7, -1, -1, 8, -1]), matched, places, links)
    assert found.tolist() == [7, 7, 8, 8, 7]  # the last is joined to none, and takes any
