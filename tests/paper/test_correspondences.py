"""Each method's errors: nought where shapes agree, and the same by either route."""

from types import SimpleNamespace

import numpy as np
import pytest

from paper import correspondences, forms
from paper.collection import Collection
from paper.correspondences import (
    ALTERNATIVES,
    EXACT,
    FORMS,
    METHODS,
    PAPERS,
    PROGRESSIVE,
    judge_all,
    label_of,
)
from paper.forms import form, some_points
from paper.loading import load_tosca
from paper.run import Arrays, Run
from tests.paper.folders import write_animals
from unbend import Mesh, read_mesh, write_mesh
from unbend.correspondence import aligned_cosine


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Collection:
    """Three dogs, and the first one again, turned and larger."""
    folder = write_animals(tmp_path_factory.mktemp("dogs"))
    first = read_mesh(folder / "dog0.off")
    write_mesh(folder / "dog9.off", (first.vertices[:, [1, 2, 0]] * 3 + 1, first.faces))
    return load_tosca(folder)


@pytest.fixture(scope="module")
def found(shapes: Collection, tmp_path_factory: pytest.TempPathFactory) -> list[Arrays]:
    """Both pairs judged, with few samples, and the truth for the matcher, which is slow."""
    run = Run(shapes, None, True, 1, tmp_path_factory.mktemp("store"), lambda step: None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(correspondences, "N_EIGENPAIRS", 30)
        patch.setattr(forms.make_form, "__defaults__", (60,))  # samples
        patch.setattr(correspondences, "match", _true_match)
        return judge_all(run, [("dog0", "dog1"), ("dog0", "dog9")], 50)


def _true_match(source: Mesh, target: Mesh) -> SimpleNamespace:
    return SimpleNamespace(source_to_target=np.arange(source.n_vertices), confidence=0.75)


def test_every_method_and_way_is_judged(found):
    labels = {*METHODS, *(label_of(name, way) for name in FORMS for way in ALTERNATIVES)}
    for one in found:
        assert labels | {"confidence"} <= set(one)
        assert all(one[label].shape == (50,) for label in labels)
        assert all(np.isfinite(one[label]).all() for label in labels)


def test_the_truth_is_without_error_and_a_form_in_another_pose_is_not(found):
    assert found[0][PROGRESSIVE].max() == 0
    assert found[0]["confidence"] == 0.75
    assert 0.02 < found[0][label_of(EXACT, "known")].mean() < 0.3


def test_a_turned_copy_has_the_same_form(found):
    assert found[1][label_of(EXACT, "known")].max() == 0
    assert all(found[1][label_of(name, "known")].mean() < 0.01 for name in FORMS)


def test_the_sampled_form_is_the_exact_one_with_enough_samples(shapes):
    exact = form(shapes, "dog0", *FORMS[EXACT], 100)["points"]
    sampled = form(shapes, "dog0", *FORMS[PAPERS], 100)["points"]
    assert aligned_cosine(exact, sampled, np.ones(600)) > 0.9999


def test_a_point_without_image_is_infinitely_wrong(shapes):
    truth = shapes.truth("dog0", "dog1")
    images = truth.target_points.copy()
    images[3] = -1
    found = correspondences._errors(shapes, "dog1", truth, images, "some")["some"]
    assert np.flatnonzero(np.isinf(found)).tolist() == [3]
    assert np.delete(found, 3).max() == 0


def test_points_for_icp_are_finite_and_differ_by_seed():
    points = np.arange(30.0).reshape(10, 3)
    points[4] = np.nan
    assert some_points(points, 99, 0).tolist() == np.delete(points, 4, axis=0).tolist()
    few = [some_points(points, 5, seed).tolist() for seed in (0, 0, 1)]
    assert few[0] == few[1] != few[2]
