"""The surface in its form's pose: itself, but for its pose, whatever that was."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend import Mesh, canonical_form, lay_into_pose
from unbend.alignment import procrustes
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError
from unbend.mesh import edge_ends


def apart(points, others, reflect=False):
    """Distance that is left after the best motion, as a share of the size."""
    rotation, translation = procrustes(points, others, reflect=reflect)
    left = points @ rotation.T + translation - others
    return np.linalg.norm(left) / np.linalg.norm(others - others.mean(axis=0))


def laid(mesh, **options):
    return lay_into_pose(mesh, canonical_form(mesh, **options))


@pytest.fixture(scope="module")
def dogs():
    """A dog in three poses."""
    return [
        make_quadruped(pose, n_vertices=1500).mesh for pose in ("standing", "galloping", "sitting")
    ]


@pytest.fixture(scope="module")
def unbent(dogs):
    return [laid(dog) for dog in dogs]


def test_a_sphere_is_its_own_form_and_stays_as_it_is():
    ball = make_sphere(3)
    assert apart(laid(ball), ball.vertices) < 5e-3


def test_poses_of_one_shape_become_nearly_one(dogs, unbent):
    for i, j in ((0, 1), (0, 2), (1, 2)):
        before = apart(dogs[i].vertices, dogs[j].vertices)
        assert apart(unbent[i], unbent[j]) < min(0.7 * before, 0.2)


def test_the_surface_is_kept(dogs, unbent):
    for dog, points in zip(dogs, unbent, strict=True):
        i, j = edge_ends(dog.faces, 1500).T
        before = np.linalg.norm(dog.vertices[i] - dog.vertices[j], axis=1)
        stretch = np.linalg.norm(points[i] - points[j], axis=1) / before
        assert abs(np.median(stretch) - 1) < 0.03
        assert np.percentile(stretch, 5) > 0.8
        assert np.percentile(stretch, 95) < 1.2
        # The right side stays out, and limbs keep their girth: the volume is about the same.
        assert volume(points, dog.faces) == pytest.approx(volume(dog.vertices, dog.faces), rel=0.25)


def volume(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_motions_and_units_change_nothing_and_mirrors_mirror(blob):
    plain = laid(blob)
    turn = Rotation.from_rotvec([0.3, 1.0, -2.0]).as_matrix()
    moved = Mesh(40 * blob.vertices @ turn.T + 7, blob.faces)
    assert apart(laid(moved), 40 * plain) < 1e-6
    np.testing.assert_allclose(laid(moved, keep_scale=True), laid(moved), atol=1e-6)
    mirrored = laid(Mesh(blob.vertices * [1, 1, -1], blob.faces))
    assert apart(mirrored * [1, 1, -1], plain) < 1e-6
    assert apart(mirrored, plain) > 0.01


def test_where_the_form_lies_and_its_unit_change_nothing(blob):
    form = canonical_form(blob)
    elsewhere = replace(form, points=3 * form.points + [5, -7, 9])
    assert apart(lay_into_pose(blob, elsewhere), lay_into_pose(blob, form)) < 1e-6


def test_of_more_dimensions_the_first_three_are_the_pose(blob):
    assert apart(laid(blob, n_components=5), laid(blob)) < 1e-4


def test_the_share_that_is_done_grows_to_all_of_it():
    ball, told = make_sphere(2), []
    lay_into_pose(
        ball, canonical_form(ball), progress=lambda stage, share: told.append((stage, share))
    )
    assert {stage for stage, _ in told} == {"detail"}
    np.testing.assert_allclose(
        [share for _, share in told], np.arange(1, len(told) + 1) / len(told)
    )


def test_what_is_no_part_of_the_surface_is_nan(blob):
    loose = Mesh(np.vstack([blob.vertices, [[9, 9, 9]]]), blob.faces)
    with pytest.warns(match="unreferenced"):
        found = laid(loose)
    assert np.isnan(found[-1]).all()
    np.testing.assert_allclose(found[:-1], laid(blob), atol=1e-9)


def test_only_the_component_of_the_form_is_laid(blob, blob_and_ball):
    with pytest.warns(match="component 0 of 2"):
        form = canonical_form(blob_and_ball, component="largest")
    found = lay_into_pose(blob_and_ball, form)
    assert np.isnan(found[blob.n_vertices :]).all()
    np.testing.assert_allclose(found[: blob.n_vertices], laid(blob), atol=1e-6)


def test_what_does_not_go_together_is_refused(blob):
    form = canonical_form(blob)
    for mesh, given, message in (
        (blob, canonical_form(blob, n_components=2), "needs a form of 3 dimensions, not 2"),
        (blob.vertices, form, "has no faces"),
        (blob, form.points, "this needs a CanonicalForm, not ndarray"),
        (make_sphere(1), form, "the form has 642 points, but sphere has 42 vertices"),
    ):
        with pytest.raises(InputError, match=message):
            lay_into_pose(mesh, given)
