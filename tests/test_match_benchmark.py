"""What the benchmark of matches draws, measures and prints; what it finds is its own affair."""

import functools
import json
import struct
import sys
from collections import namedtuple
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import unbend.matching
from testshapes.damage import cut_discs, damaged_truth, unchanged
from unbend import write_mesh
from unbend.datasets import make_biped, make_quadruped, make_sphere, rest_map
from unbend.io import write_markups

FOLDER = Path(__file__).parents[1] / "benchmarks"
pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the benchmarks are not part of a release"
)


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    return import_module


@functools.cache
def bodies():
    source = make_biped("standing", n_vertices=600)
    target = make_biped("walking", n_vertices=600, meshing=1)
    there, back = rest_map(source, target), rest_map(target, source)
    return "two", source.mesh, target.mesh, there, back, target.mirror[there]


@pytest.fixture
def pair(script):
    return script("match_cases").Pair(*bodies())


@pytest.fixture
def torn(pair):
    return cut_discs(pair.target, 0.2, random_state=2)


@pytest.fixture
def measured(script, pair, torn):
    """Measure maps of the pair whose target is torn."""
    case = script("match_cases").of_pair(pair, None, torn)
    back = damaged_truth(pair.back, torn, unchanged(pair.source))
    return lambda there, back=back: script("match").measure(case, there, back)


def test_the_truth_is_without_fault(pair, torn, measured):
    found = measured(damaged_truth(pair.truth, unchanged(pair.source), torn))
    assert found["error"] == 0
    assert found["iou"] == 1
    assert not found["mirrored"]


def test_a_map_that_matches_everything_pays_for_it_in_overlap_only(pair, torn, measured):
    truth = torn.image[pair.truth]
    found = measured(np.where(truth >= 0, truth, 0))
    assert found["error"] == 0
    assert found["iou"] == pytest.approx(0.8, abs=0.03)


def test_the_mirror_image_of_the_truth_is_told_from_it(pair, torn, measured):
    found = measured(torn.image[pair.mirrored])
    assert found["error"] > 0.1
    assert found["mirrored"]


def test_a_map_of_nothing_is_wrong(pair, torn, measured):
    found = measured(np.full(pair.source.n_vertices, -1), np.full(torn.mesh.n_vertices, -1))
    assert found["error"] == np.inf
    assert found["iou"] == 0


def test_landmarks_are_true_known_on_both_shapes_and_apart(script, pair, torn):
    case = script("match_cases").of_pair(pair, None, torn)
    for hints in ((int(case.rows[7]), 0), ()):
        pairs = script("match").true_landmarks(case, hints)
        truth = damaged_truth(pair.truth, unchanged(pair.source), torn)
        np.testing.assert_array_equal(truth[pairs[:, 0]], pairs[:, 1])
        assert not hints or pairs[0, 0] == hints[0]
        assert np.linalg.norm(np.diff(case.source.vertices[pairs[:, 0]], axis=0)) > 0.5


def test_calibration_of_a_known_sample(script):
    """Ten maps at .95 of which nine are right, ten at .25 of which five are."""
    confidence = np.repeat([0.95, 0.25], 10)
    right = np.array([1] * 9 + [0] + [0, 1] * 5)
    found = script("match").calibration_error(confidence, right)
    assert found == pytest.approx((0.05 + 0.25) / 2)


def test_rows_are_grouped_by_damage_or_by_shape(script):
    names = ["20%: biped 12", "noise 0.2: cat0 cat1", "cat10 cat2", "3 17", "cow a3 a4"]
    groups = [script("match").group({"set": "some", "pair": name}) for name in names]
    assert groups == ["some 20%", "some noise 0.2", "some cat", "some ", "some cow"]


def test_fewer_pairs_of_a_set_are_the_first_of_more(script):
    chosen = script("match_cases").chosen
    some, many, every = (chosen(range(40), 5, count) for count in (7, 39, None))
    assert len(some) == 7
    assert some == many[:7]
    assert many == every[:39]
    assert sorted(every) == list(range(40))


def test_every_strength_of_own_sets_can_be_drawn_and_is_the_same_again(script, pair, monkeypatch):
    sets = script("own_sets")
    limbs = tuple(np.where(one.vertices[:, 1] < 0.5, 1, -1) for one in (pair.source, pair.target))
    monkeypatch.setattr(sets, "own_pair", lambda *_, **__: pair._replace(limbs=limbs))
    for done, harm in sets.HARM.items():
        names = set()
        for draw in sets.bodies("own", done)(Path(), 3, 14):
            case = draw()
            names.add(case.name.partition(":")[0])
            assert any(
                one.faces.shape != whole.faces.shape or (one.vertices != whole.vertices).any()
                for one, whole in ((case.source, pair.source), (case.target, pair.target))
            )
        assert names == {*harm, *(sets.BOTH if done == "cuts" else ())}
        np.testing.assert_array_equal(draw().target.vertices, case.target.vertices)


def test_parts_have_something_in_common_and_are_the_same_again(script, pair, monkeypatch):
    sets = script("part_sets")
    for name in ("_people", "_animals", "_poses", "_armadillos", "_two_classes"):
        monkeypatch.setattr(sets, name, lambda *_, **__: pair)
    for two_kinds in (False, True):
        for draw in sets.parts(sets.KNOWN, two_kinds)(Path(), 3, 6):
            case, again = draw(), draw()
            shares = [float(one.mean()) for one in case.overlap]
            assert sets.OVERLAP[0] <= min(shares) <= sets.OVERLAP[1]
            np.testing.assert_array_equal(case.source.vertices, again.source.vertices)
            np.testing.assert_array_equal(case.target.faces, again.target.faces)
            # The images of what has a partner are on what is left of the target.
            assert np.isin(case.images, case.origin).mean() > 0.9


def test_exact_places_are_nearest_to_the_true_partners(script):
    sets = script("own_sets")
    pair = sets.own_pair(np.random.default_rng(0), "biped", True, n_vertices=800, places=True)
    off = np.linalg.norm(pair.places - pair.target.vertices[pair.truth], axis=1)
    edges = pair.target.vertices[pair.target.faces]
    assert off.max() < 2 * np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).max()
    assert off.mean() < 0.5 * np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).mean()


@pytest.fixture
def poses(script, monkeypatch, tmp_path):
    """Return a folder of two poses of 1,500 vertices, which are simplified."""
    monkeypatch.setattr(script("public_sets"), "_MOST", 1000)
    monkeypatch.setattr(script("public_sets"), "_LEFT", (700, 900))
    (tmp_path / "beast").mkdir()
    for pose in ("standing", "walking"):
        mesh = make_quadruped(pose, n_vertices=1500).mesh
        write_mesh(tmp_path / "beast" / f"{pose}.obj", mesh)
    (tmp_path / "beast" / "notes.txt").write_text("not a pose")
    return tmp_path / "beast"


def test_a_pose_is_simplified_and_knows_where_its_vertices_were(script, poses):
    coarse = script("public_sets").draw_pose(poses / "standing.obj", np.random.default_rng(0))
    assert 650 < coarse.mesh.n_vertices < 950
    assert len(coarse.origin) == coarse.mesh.n_vertices
    assert len(coarse.image) == 1500
    # A vertex is what is nearest to its origin, but for a few that two of them share.
    every = np.arange(coarse.mesh.n_vertices)
    assert (coarse.image[coarse.origin] == every).mean() > 0.9


def test_the_truth_between_two_simplified_poses_keeps_parts_together(script, poses):
    case = script("public_sets").sequence_case(poses, 0, 0)
    assert set(case.name.split()) == {"beast", "standing", "walking"}
    np.testing.assert_array_equal(case.rows, np.arange(case.source.n_vertices))
    ends = case.rows[case.source.faces[:, :2]]
    there = case.target.vertices[case.images[ends]]
    edges = np.linalg.norm(case.target.vertices[case.target.faces[:, 0]]
                           - case.target.vertices[case.target.faces[:, 1]], axis=1)  # fmt: skip
    assert np.linalg.norm(there[:, 0] - there[:, 1], axis=1).mean() < 2 * edges.mean()


def test_specimens_are_paired_by_the_labels_of_their_landmarks(script, tmp_path):
    ball = make_sphere(1)
    for name, vertices, labels in (("a", [3, 7], ["x", "y"]), ("b", [9, 5], ["y", "x"])):
        write_mesh(tmp_path / f"{name}_bone.ply", ball)
        write_markups(tmp_path / f"{name}.mrk.json", ball, vertices, labels)
    (draw,) = script("public_sets").specimens("*_bone.ply", "*.mrk.json")(tmp_path, 0, None)
    case = draw()
    assert case.name == "a b"
    np.testing.assert_array_equal(case.rows, [3, 7])
    np.testing.assert_array_equal(case.images, [5, 9])


def test_truth_files_are_read_and_put_together(script, tmp_path):
    """Three copies of a ball: ant to bee directly, bee to cow through a shape of which only the
    faces are there."""
    becos = script("becos")
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


def rows_of(errors, cpu=1.0, name="own"):
    """Rows of maps with given errors."""
    return [{"set": name, "pair": f"{i}", "error": one, "cpu": cpu} for i, one in enumerate(errors)]


def test_constants_of_the_confidence_are_found_again(script, capsys, tmp_path, monkeypatch):
    """From maps that are right as often as four given constants say."""
    confidence, rng = script("confidence"), np.random.default_rng(0)
    rows = rows_of(np.zeros(200))
    for i, row in enumerate(rows):
        row["energies"] = np.sort(rng.uniform(0.1, 0.6, 4)).tolist()
        row |= {"differences": [0.0, 0.5, 0.5, 0.5], "confidence_bound": 1.0}
        row |= {"disorder": float(rng.uniform(0, 0.2)), "set": ("own", "parts")[i % 2]}
        row["lines"] = ["relaxed"] if i % 2 else []
    given = np.array([0.35, 0.04, 0.6, 0.1])
    trust = confidence.confidences(rows, given)
    np.testing.assert_allclose(confidence.fitted(rows, trust), given, rtol=0.02)
    right = (rng.random(len(rows)) < trust).astype(float)
    for row, said, one in zip(rows, trust, right, strict=True):
        row |= {"confidence": said, "error": 1.0 - one}
    file = tmp_path / "rows.jsonl"
    refused = {"refused": "why", "error": np.inf, "confidence": 0.0}
    lines = [json.dumps(row) for row in [*rows, refused]]
    file.write_text("\n".join([*lines, '{"number": 9']))  # the last one was cut short
    monkeypatch.setattr(confidence, "fitted", lambda *_: given)
    monkeypatch.setattr(sys, "argv", ["confidence.py", str(file)])
    confidence.main()
    said = capsys.readouterr().out
    assert "200 maps as they were matched" in said
    assert "fitted to all: even 0.350, spread 0.0400, disorder 0.60, lead 0.1000;" in said
    for some, why in (
        ([row | {"error": 0.0} for row in rows[:20]], "of the 20 in the files, of 2, 20 are right"),
        ([row | {"set": "own"} for row in rows], "of the 200 in the files, of 1,"),
    ):
        file.write_text("\n".join(json.dumps(row) for row in some))
        with pytest.raises(SystemExit):
            confidence.main()
        assert why in capsys.readouterr().err


def test_a_bound_of_the_map_bounds_the_confidence(script):
    row = {"energies": [0.05, 0.5], "confidence_bound": 0.2, "disorder": 0.2}
    row |= {"lines": [], "differences": [0.0, 0.5]}
    given = np.array([0.3, 0.03, 0.5, 0.04])
    assert script("confidence").confidences([row], given) == [0.2]


def test_maps_that_hardly_differ_do_not_share_the_probability(script):
    row = {"energies": [0.1, 0.1], "confidence_bound": 1.0, "disorder": 0.0}
    rows = [row | {"lines": [], "differences": [0.0, apart]} for apart in (0.5, 0.05)]
    apart, alike = script("confidence").confidences(rows, np.array([0.3, 0.03, 0.5, 0.04]))
    assert alike > 0.99
    assert apart == pytest.approx(alike / 2)


@pytest.fixture
def plan(monkeypatch):
    """Stand in for the matcher's plan: three stages on four lines."""

    def from_spectra(sides, found):
        """Propose."""

    def from_points(sides, found):
        """Propose."""

    def refine(sides, found):
        """Mend."""

    step = namedtuple("step", "stage")
    steps = [from_spectra, from_points, refine, refine]
    stand_in = SimpleNamespace(PLAN=[step(one) for one in steps])
    monkeypatch.setattr(unbend.matching, "_plan", stand_in, raising=False)
    return stand_in


def test_lines_of_the_plan_are_left_out_by_name(script, plan):
    harness = script("match")
    the_list = plan.PLAN
    assert harness.lines_of_plan() == ["from_spectra", "from_points", "refine"]
    harness.leave_out(["refine"])
    assert harness.lines_of_plan() == ["from_spectra", "from_points"]
    assert plan.PLAN is the_list


def test_the_lines_that_run_are_noted(script, plan):
    with script("match").lines_that_run() as lines:
        for step in plan.PLAN[::2]:
            step.stage(None, [])
    assert lines == ["from_spectra", "refine"]
    assert script("match").lines_of_plan() == ["from_spectra", "from_points", "refine"]


def test_a_line_that_the_plan_lacks_is_refused_by_name(script, plan, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["match.py", "poses", "--without", "magic"])
    with pytest.raises(SystemExit):
        script("match").main()
    said = capsys.readouterr().err
    assert "magic" in said
    assert "from_spectra, from_points, refine" in said


def test_a_comparison_tells_lost_pairs_from_won_ones(script):
    before, after = rows_of([0.01, 0.03, 0.5, 0.02], cpu=2.0), rows_of([0.02, 0.05, 0.04, np.inf])
    found = script("ablation").compare(before, after)
    assert (found.right, found.lost, found.won) == (3, 1, 1)
    assert found.mean == pytest.approx(0.035)
    assert found.mean_before == pytest.approx(0.02)
    assert (found.cpu_before, found.cpu) == (2.0, 1.0)


def test_the_ablation_prints_what_each_line_earns(script, plan, monkeypatch, capsys, tmp_path):
    errors = {"": [0.01, 0.02], "without from_points": [0.01, 0.9], "without refine": [0.02, 0.04]}
    ablation = script("ablation")

    def measured(given, out, changed="", set_up=None):
        assert set(given.sets) == {"poses", "cuts"}
        rows = rows_of(errors[changed], name="poses") + rows_of([0.03], name="cuts")
        return [row | {"lines": ["from_spectra", "refine"]} for row in rows]

    monkeypatch.setattr(ablation, "measured", measured)
    monkeypatch.setattr(sys, "argv", ["ablation.py", "poses", "cuts", "--groups",
                                      "--out", str(tmp_path / "rows")])  # fmt: skip
    ablation.main()
    same = script("match").read(tmp_path / "rows/from_points.jsonl")
    assert [row["error"] for row in same] == [0.01, 0.02, 0.03]  # as with it: it was not run
    assert not script("match").read(tmp_path / "rows/refine.jsonl")
    table = [line.split() for line in capsys.readouterr().out.splitlines()[1:]]
    assert table[0] == ["nothing", "3", "3", "0.0200", "0.0200", "0", "0", "1.00"]
    assert table[3] == ["from_points", "3", "2", "0.0200", "0.0200", "1", "0", "1.00"]
    assert table[4] == ["poses", "2", "1", "0.0100", "0.0100", "1", "0", "1.00"]
    assert table[6] == ["refine", "3", "3", "0.0300", "0.0200", "0", "0", "1.00"]


def test_constants_are_halved_and_doubled(script, monkeypatch, capsys, tmp_path):
    stand_in = SimpleNamespace(LADDER=(3.0, 10.0), BEAM=16, PATCH=0.08, NAME="x", FLAG=True)
    monkeypatch.setattr(unbend.matching, "_constants", stand_in, raising=False)
    # The plan, once loaded again, would keep the stand-in after this test.
    monkeypatch.setattr("importlib.reload", lambda module: module)
    constants, changes = script("constants"), []

    def measured(given, out, changed="", set_up=None):
        changes.append(changed)
        if set_up:
            set_up()
        return rows_of([0.01, stand_in.PATCH / 2])

    monkeypatch.setattr(constants, "measured", measured)
    command = ["constants.py", "poses", "--only", "LADDER", "BEAM", "PATCH", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    constants.main()
    assert changes == ["", "LADDER = (1.5, 5.0)", "LADDER = (6.0, 20.0)", "BEAM = 8", "BEAM = 32",
                       "PATCH = 0.04", "PATCH = 0.16"]  # fmt: skip
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "all as they are: 2 of 2 right, mean error 0.0250, 1.00 s"
    assert said[-1] == "| `PATCH` | 0.08 | 2, 0.0150 (0.60), 1.00 | 1, 0.0100 (1.00), 1.00 |"
    monkeypatch.setattr(sys, "argv", ["constants.py", "poses", "--only", "NAME", "--out", "x"])
    with pytest.raises(SystemExit):
        constants.main()
    assert "LADDER, BEAM, PATCH" in capsys.readouterr().err


@pytest.fixture
def matched(script, monkeypatch, tmp_path):
    """Match a set of forty pairs with nothing; return its rows and which were matched now."""
    harness, out = script("match"), tmp_path / "rows.jsonl"
    now = []

    def run_all(tasks, n_jobs, keep, set_up):
        now[:] = [task[3] for task in tasks]
        for _, name, _, number, seed, changed, _ in tasks:
            keep({"set": name, "number": number, "seed": seed, "changed": changed})

    def run(pairs, changed="", seed=0):
        given = SimpleNamespace(sets=["forty"], data=tmp_path, seed=seed, pairs=pairs, jobs=1)
        return harness.measured(given, out, changed), list(now)

    draws = script("match_cases").chosen
    monkeypatch.setitem(harness.SETS, "forty", lambda _, seed, n: draws(range(40), seed, n))
    monkeypatch.setattr(harness, "run_all", run_all)
    run.out = out
    return run


def test_an_interrupted_run_goes_on_where_it_stopped(matched):
    assert matched(5)[1] == [0, 1, 2, 3, 4]
    lines = matched.out.read_text().splitlines()
    matched.out.write_text("\n".join([*lines[:3], lines[3][:20]]))  # cut short
    rows, now = matched(6)
    assert now == [3, 4, 5]
    assert [row["number"] for row in rows] == [0, 1, 2, 3, 4, 5]
    assert matched(6) == (rows, [])


def test_rows_of_other_seeds_and_other_matchers_do_not_count(matched, script, monkeypatch):
    whole, _ = matched(3)
    assert matched(3, "without refine")[1] == [0, 1, 2]
    assert matched(3, seed=1)[1] == [0, 1, 2]
    assert matched(3) == (whole, [])
    assert len(matched(2)[0]) == 2
    monkeypatch.setattr(script("match"), "_matcher", lambda: "another version")
    assert matched(3)[1] == [0, 1, 2]


def test_faces_are_read_drawn_and_know_their_partners(script, tmp_path, monkeypatch):
    sets, ball = script("face_sets"), make_sphere(3)
    monkeypatch.setattr(sets, "_VERTICES", (600, 900))
    bump = np.zeros((642, 3))
    bump[0] = 2

    def matrix(values) -> bytes:  # a column
        return struct.pack("<ii", values.size, 1) + values.astype("<f4").tobytes()

    (tmp_path / "sfm_shape_3448.bin").write_bytes(
        struct.pack("<I", 1)
        + matrix(ball.vertices)
        + matrix(bump)
        + matrix(np.array([4.0]))
        + struct.pack("<Q", ball.n_faces)
        + ball.faces.astype("<i4").tobytes()
    )
    smile = struct.pack("<Q", 5) + b"smile" + matrix(0 * bump)
    (tmp_path / "expression_blendshapes_3448.bin").write_bytes(struct.pack("<Q", 6) + 6 * smile)
    model = sets.read_model(tmp_path)
    np.testing.assert_allclose(model.mean, ball.vertices, atol=1e-6)
    np.testing.assert_array_equal(model.faces, ball.faces)
    np.testing.assert_array_equal(model.components[..., 0], 2 * bump)
    assert model.expressions.shape == (6, 642, 3)
    case, again = (sets.face_case(tmp_path, False, 1, 2) for _ in range(2))
    np.testing.assert_array_equal(case.target.vertices, again.target.vertices)
    # But for the bump, both are the same ball: partners are as far apart as their partners are.
    one, other = case.source.vertices[case.rows], case.whole.vertices[case.images]
    apart = [np.linalg.norm(points[:, None] - points, axis=2) for points in (one, other)]
    assert np.median(abs(apart[0] - apart[1])) < 0.1
    parts = sets.face_case(tmp_path, True, 1, 2)
    assert min(one.mean() for one in parts.overlap) < 0.95
