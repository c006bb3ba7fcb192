"""Parts of a mesh that touch, and have grown together there."""

import numpy as np
import pytest

from tests.sheets import make_torus
from testshapes.bodies import make_body
from testshapes.damage import Damaged, damaged_truth
from testshapes.welding import fuse
from unbend import match, symmetry
from unbend.datasets import Shape
from unbend.errors import UnbendWarning
from unbend.matching._inputs import prepare_shapes
from unbend.matching._plan import Levels, make_sides
from unbend.matching._touching import cut_apart


@pytest.fixture(scope="module")
def free() -> Shape:
    return make_body("biped", 0, random_state=0, n_vertices=1500, meshing=1)


@pytest.fixture(scope="module")
def closed() -> Shape:
    """The same body in a pose in which two of its parts touch."""
    return make_body("biped", 0, random_state=50, n_vertices=1500)


@pytest.fixture(scope="module")
def grown(closed: Shape) -> Damaged:
    return fuse(closed.mesh, random_state=0)


def test_parts_that_have_grown_together_are_matched_as_if_apart(
    free: Shape, closed: Shape, grown: Damaged
) -> None:
    apart = match(free.mesh, closed.mesh, refine=False)
    with pytest.warns(UnbendWarning, match="some parts of human touch"):
        found = match(free.mesh, grown.mesh, refine=False, barycentric=True)
    there, here = closed.reference[grown.origin], free.reference

    def error(ours: np.ndarray, theirs: np.ndarray, partners: np.ndarray) -> float:
        used = partners >= 0
        return float(np.linalg.norm(ours[used] - theirs[partners[used]], axis=1).mean())

    least = error(here, closed.reference, apart.source_to_target)
    assert error(here, there, found.source_to_target) < 1.15 * least
    assert found.confidence > 0.95
    assert (found.source_to_target >= 0).mean() > 0.98
    # Points on faces are those of the mesh as it is, around the vertices.
    used = found.faces >= 0
    corners = grown.mesh.faces[found.faces[used]]
    assert (corners == found.source_to_target[used, None]).any(axis=1).all()
    places = np.einsum("ij,ijk->ik", found.weights[used], there[corners])
    assert error(here[used], places, np.arange(used.sum())) < 1.15 * least


def test_a_body_is_not_cut_where_its_vertices_alone_join_other_parts(
    free: Shape, grown: Damaged
) -> None:
    inputs = prepare_shapes((free.mesh, grown.mesh), 30, (True, True))
    sides = make_sides(*(one.shape for one in inputs))
    levels = [sides.source, sides.target]
    same, cut = cut_apart(inputs, levels, 30, 9999)
    assert same is inputs[0]
    assert cut.uncut is inputs[1]
    both = cut_apart([inputs[1]] * 2, [levels[1]] * 2, 30, 9999)
    assert [one.uncut for one in both] == [inputs[1]] * 2
    assert not cut_apart([same, cut], levels, 30, 9999)
    assert cut.local(np.arange(grown.mesh.n_vertices)).min() >= 0

    class Far(Levels):
        def apart(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
            return np.where(np.arange(len(one)) == 7, 0.5, 0.0)

    assert not cut_apart(inputs, [levels[0], Far(*levels[1])], 30, 9999)
    few = make_torus(20, 10)
    other = prepare_shapes((free.mesh, few), 8, (True, True))
    sides = make_sides(*(one.shape for one in other))
    levels = [sides.source, sides.target]
    assert not cut_apart(other, levels, 8, 9999)  # too few points for a surface


def test_left_and_right_are_found_where_parts_have_grown_together() -> None:
    body = make_body("biped", 0, random_state=53, n_vertices=1500)
    grown = fuse(body.mesh, random_state=0)
    with pytest.warns(UnbendWarning, match="some parts of human touch"):
        found = symmetry(grown.mesh, refine=False)
    partners = damaged_truth(body.mirror, grown, grown)
    known = (partners >= 0) & (found.source_to_target >= 0)
    ends = body.reference[grown.origin]
    apart = ends[found.source_to_target[known]] - ends[partners[known]]
    assert known.mean() > 0.95
    assert np.linalg.norm(apart, axis=1).mean() < 0.03
