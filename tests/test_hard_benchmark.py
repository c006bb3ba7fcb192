"""What the benchmark of hard matches measures and reads; what it finds is its own affair."""

import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from unbend import write_mesh
from unbend.datasets import cut_discs, make_biped, make_sphere, rest_map
from unbend.datasets.damage import unchanged

FOLDER = Path(__file__).parents[1] / "benchmarks"
pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the benchmarks are not part of a release"
)


@pytest.fixture
def scripts(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    return {name: import_module(name) for name in ("hard", "hard_sets", "becos", "confidence")}


@pytest.fixture
def case(scripts):
    source = make_biped("standing", n_vertices=600)
    target = make_biped("walking", n_vertices=700, meshing=1)
    there, back = rest_map(source, target), rest_map(target, source)
    pair = scripts["hard_sets"].Pair(
        "two", source.mesh, target.mesh, there, back, target.mirror[there]
    )
    torn = cut_discs(target.mesh, 0.2, random_state=2)
    return scripts["hard_sets"].Case(pair, unchanged(source.mesh), torn)


def test_the_truth_is_without_fault(scripts, case):
    damaged_truth = scripts["hard"].damaged_truth
    there = damaged_truth(case.pair.truth, case.source, case.target)
    back = damaged_truth(case.pair.back, case.target, case.source)
    found = scripts["hard"].measure(case, there, back)
    assert found["error"] == 0
    assert found["iou"] == 1


def test_a_map_that_matches_everything_pays_for_it_in_overlap_only(scripts, case):
    truth = case.target.image[case.pair.truth]
    everywhere = np.where(truth >= 0, truth, 0)
    back = case.pair.back[case.target.origin]
    found = scripts["hard"].measure(case, everywhere, back)
    assert found["error"] == 0
    assert found["iou"] == pytest.approx(0.8, abs=0.03)


def test_the_mirror_image_of_the_truth_is_told_from_it(scripts, case):
    mirrored = case.target.image[case.pair.mirrored]
    back = case.pair.back[case.target.origin]
    found = scripts["hard"].measure(case, mirrored, back)
    assert found["error"] > 0.1
    assert found["mirrored_error"] == 0


def test_a_map_of_nothing_is_wrong(scripts, case):
    nothing = np.full(case.source.mesh.n_vertices, -1)
    found = scripts["hard"].measure(case, nothing, np.full(case.target.mesh.n_vertices, -1))
    assert found["error"] == np.inf
    assert found["iou"] == 0


def test_calibration_of_a_known_sample(scripts):
    """Ten maps at .95 of which nine are right, ten at .25 of which five are."""
    rows = [{"confidence": 0.95, "error": 0.01 if i else 1.0} for i in range(10)]
    rows += [{"confidence": 0.25, "error": 0.01 if i % 2 else 1.0} for i in range(10)]
    found = scripts["hard"].calibration(rows)
    assert found["calibration_error"] == pytest.approx((0.05 + 0.25) / 2)
    expected = (9 * 0.05**2 + 0.95**2 + 5 * 0.75**2 + 5 * 0.25**2) / 20
    assert found["brier"] == pytest.approx(expected)
    assert (found["sure"], found["sure_and_wrong"]) == (10, 1)


def test_every_line_of_own_shapes_can_be_drawn(scripts, case, monkeypatch):
    sets = scripts["hard_sets"]
    options = sets.Options(seed=3, n_vertices=500, tosca=None, becos=None)
    random_pair = sets.own_pair(np.random.default_rng(0), options, "quadruped", same_body=False)
    assert random_pair.source.n_vertices == random_pair.target.n_vertices == 500
    limbs = tuple(np.where(one.vertices[:, 1] < 0.5, 1, -1) for one in case.pair[1:3])
    pair = case.pair._replace(limbs=limbs)
    monkeypatch.setattr(sets, "own_pair", lambda *_, **__: pair)
    for name in ("cuts", "holes", "scans", "welds", "noise"):
        for line in sets.list_cases(name, options):
            one = sets.draw(name, *line, 0, options)
            assert (one.target.mesh.faces.shape != one.pair.target.faces.shape) or (
                one.target.mesh.vertices != one.pair.target.vertices
            ).any()
    again = sets.draw(name, *line, 0, options)
    np.testing.assert_array_equal(again.target.mesh.vertices, one.target.mesh.vertices)
    assert [kind for kind, _ in sets.list_cases("proportions", options)] == list(sets.KINDS)


def test_constants_of_the_confidence_are_found_again(scripts, capsys, tmp_path):
    """Maps that are right as often as three given constants say."""
    confidence, rng = scripts["confidence"], np.random.default_rng(0)
    rows = []
    for number in range(1500):
        energies = np.sort(rng.uniform(0.1, 0.6, 4)).tolist()
        rows.append({"number": number, "set": "cuts", "kind": "biped", "done": "", "iou": 1.0})
        rows[-1] |= {"energies": energies, "overlap": float(rng.uniform(0.3, 1))}
    given = np.array([0.35, 0.04, 0.1])
    trust = confidence.confidences(rows, given)
    right = (rng.random(len(rows)) < trust).astype(float)
    np.testing.assert_allclose(confidence.fitted(rows, right), given, rtol=0.25)
    file = tmp_path / "rows.jsonl"
    lines = [json.dumps(row | {"error": 1.0 - one}) for row, one in zip(rows, right, strict=True)]
    file.write_text("\n".join([*lines, '{"number": 9']))  # the last one was cut short
    assert [row["number"] for row in confidence.read(file)] == list(range(1500))
    confidence.fit([file])
    said = capsys.readouterr().out
    assert "fitted to 750" in said
    assert "cuts, biped" in said


def test_pairs_for_the_confidence_are_drawn_alike_each_time(scripts, case, monkeypatch):
    confidence, sets = scripts["confidence"], scripts["hard_sets"]
    for module in (confidence, sets):
        monkeypatch.setattr(module, "own_pair", lambda *_, **__: case.pair)
    monkeypatch.setitem(sets.BOTH, "limb", lambda _, pair: case)
    options = sets.Options(seed=5, n_vertices=500, tosca=None, becos=None)
    drawn = [confidence.draw_case(number, options) for number in range(60)]
    assert {one[0] for one in drawn} == set(confidence.OFTEN)
    again = confidence.draw_case(7, options)
    assert again[:3] == drawn[7][:3]
    np.testing.assert_array_equal(again[3].target.mesh.vertices, drawn[7][3].target.mesh.vertices)


def test_truth_files_are_read_and_put_together(scripts, tmp_path):
    """Three copies of a ball: ant to bee directly, bee to cow through a shape of which only the
    faces are there."""
    becos = scripts["becos"]
    ball = make_sphere(1)
    meshes, truths = tmp_path / "data" / "tosca-off", tmp_path / "precomputed_corr_templates"
    faces = tmp_path / "corres_comp" / "default_faces"
    for folder in (meshes, truths, faces):
        folder.mkdir(parents=True)
    for name in ("ant0", "ant3", "bee0", "cow0"):
        write_mesh(meshes / f"{name}.off", ball)
    np.save(faces / "yak_7.npy", ball.faces)
    turn = np.random.default_rng(0).permutation(42)

    def write(name, images):
        rows = np.zeros((42, 4))
        for i, image in enumerate(images):
            face = int(np.flatnonzero((ball.faces == image).any(axis=1))[0]) if image >= 0 else -1
            rows[i, 0] = face
            if face >= 0:
                rows[i, 1 + int(np.flatnonzero(ball.faces[face] == image)[0])] = 1
        np.savetxt(truths / f"{name}_corres.txt", rows)

    some = np.where(np.arange(42) < 30, turn, -1)
    write("tosca_ant0_tosca_bee0", some)
    write("tosca_bee0_zoo_yak_7", turn)
    write("zoo_yak_7_tosca_cow0", turn)
    assert becos.poses(tmp_path)["ant"] == ["ant0", "ant3"]
    assert becos.class_pairs(tmp_path) == (("ant", "bee"), ("bee", "cow"))
    np.testing.assert_array_equal(becos.truth(tmp_path, "ant", "bee"), some)
    np.testing.assert_array_equal(becos.truth(tmp_path, "bee", "cow"), turn[turn])
