"""A collection registered to a template: one connectivity, resumed, with bad shapes listed."""

import csv
import hashlib
import itertools
import os
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sheets import make_blob
from unbend import Mesh, match, read_mesh, write_mesh
from unbend.collection import (
    Collection,
    _registering,
    mean_shape,
    read_registrations,
    register_files,
)
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import read_values

TEMPLATE = make_blob(2)
N = TEMPLATE.n_vertices
TURN = Rotation.from_rotvec([0.4, 1.0, -0.3]).as_matrix()
ORDER = np.random.default_rng(0).permutation(N)
OF_OTHERS = pytest.mark.filterwarnings("ignore:.* that shapes.csv does not list")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A registered collection of the template, a permuted copy, another pose and sparse points."""
    folder = tmp_path_factory.mktemp("registering")
    scans = folder / "scans"
    scans.mkdir()
    write_mesh(folder / "template.obj", TEMPLATE)
    shutil.copy(folder / "template.obj", scans / "itself.obj")
    permuted = Mesh((TEMPLATE.vertices @ TURN.T + 3)[ORDER], np.argsort(ORDER)[TEMPLATE.faces])
    write_mesh(scans / "permuted.ply", permuted)
    write_mesh(scans / "walking.off", make_blob(2, bend=0.3))
    way = np.random.default_rng(0).normal(size=(500, 3))
    sparse = [3, 1, 0.1] * way / np.linalg.norm(way, axis=1, keepdims=True)
    write_mesh(scans / "points.ply", sparse)
    collection = Collection(folder / "store")
    collection.add(scans, workers=0)
    done = collection.register(folder / "template.obj", folder / "out", workers=0)
    assert (done.registered, done.skipped) == (3, 0)
    return folder


@pytest.fixture
def own(made: Path, tmp_path: Path) -> tuple[Collection, Path]:
    """The collection, and a copy of what is registered, to change."""
    shutil.copytree(made / "out", tmp_path / "out")
    return Collection(made / "store"), tmp_path / "out"


def rows(folder: Path) -> list[dict[str, str]]:
    with open(folder / "shapes.csv", newline="") as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    files = [one for one in folder.rglob("*") if one.is_file()]
    return {
        str(one.relative_to(folder)): (one.read_bytes(), one.stat().st_mtime_ns) for one in files
    }


def test_all_shapes_have_the_templates_vertices_and_faces(made: Path) -> None:
    out = made / "out"
    table = rows(out)
    assert [Path(row["path"]).name for row in table] == [
        "itself.obj", "permuted.ply", "walking.off", "points.ply"
    ]  # fmt: skip
    vertices = np.load(out / "vertices.npy")
    assert (vertices.shape, vertices.dtype) == ((3, N, 3), np.float64)
    for row, points in zip(table, vertices, strict=False):
        mesh = read_mesh(out / row["file"])
        assert mesh.notes == ()
        np.testing.assert_array_equal(mesh.faces, TEMPLATE.faces)
        np.testing.assert_array_equal(mesh.vertices, points)
    size = np.ptp(TEMPLATE.vertices)
    np.testing.assert_allclose(vertices[0], TEMPLATE.vertices, atol=1e-6 * size)
    np.testing.assert_allclose(vertices[1], TEMPLATE.vertices @ TURN.T + 3, atol=1e-4 * size)


def test_tables_agree_with_the_array(made: Path) -> None:
    out = made / "out"
    with open(out / "vertices.csv", newline="") as file:
        long = list(csv.DictReader(file))
    vertices = np.load(out / "vertices.npy")
    places = [[float(row[axis]) for axis in "xyz"] for row in long]
    np.testing.assert_array_equal(np.reshape(places, vertices.shape), vertices)
    assert [row["shape"] for row in long[::N]] == [row["shape"] for row in rows(out)[:3]]
    assert [int(row["vertex"]) for row in long] == 3 * list(range(N))
    template, found, failures = read_registrations(out)
    np.testing.assert_array_equal(template.vertices, TEMPLATE.vertices)
    for row, one in zip(rows(out), found, strict=False):
        assert float(row["confidence"]) == one.confidence
        assert float(row["coverage"]) == one.coverage
        assert float(row["scan_coverage"]) == one.scan_coverage
        assert float(row["mean_distance"]) == pytest.approx(np.nanmean(one.distances))
        assert row["status"] == ("doubtful" if round(one.confidence, 2) < 0.6 else "registered")
    (failure,) = failures
    assert Path(failure.path).name == "points.ply"
    assert "too sparse or too noisy" in failure.reason
    assert rows(out)[3]["status"] == f"failed: {failure.reason}"
    assert mean_shape(found, template, min_confidence=0, n_components=1).names == tuple(
        row["path"] for row in rows(out)[:3]
    )


def test_what_lies_where_the_scan_ends_is_told_in_the_long_table(tmp_path: Path) -> None:
    write_mesh(tmp_path / "template.ply", TEMPLATE)
    half = TEMPLATE.faces[(TEMPLATE.vertices[TEMPLATE.faces] @ [1, 0, 0] > 0).all(axis=1)]
    used, faces = np.unique(half, return_inverse=True)
    write_mesh(tmp_path / "half.ply", (TEMPLATE.vertices[used], faces.reshape(-1, 3)))
    out = tmp_path / "out"
    register_files([str(tmp_path / "half.ply")], str(tmp_path / "template.ply"), str(out))
    with open(out / "vertices.csv", newline="") as file:
        covered = [bool(int(row["covered"])) for row in csv.DictReader(file)]
    _, (found,), _ = read_registrations(out)
    np.testing.assert_array_equal(covered, found.covered)
    assert 0.3 < np.mean(covered) < 0.7


def test_what_is_there_is_not_touched_again_and_what_is_missing_is_made_again(
    own: tuple[Collection, Path],
) -> None:
    collection, out = own
    whole = contents(out)
    walking = next(out.glob("walking-*.obj"))
    result = out / "registrations" / f"{walking.stem}.npz"
    for lost in (result, walking):  # as a run that was killed leaves them
        lost.unlink()
        (out / "vertices.npy").unlink(missing_ok=True)
        done = collection.register(out / "template.obj", out, workers=0)
        assert (done.registered, done.skipped) == (1, 2)
        again = contents(out)
        assert {name: data for name, (data, _) in again.items()} == {
            name: data for name, (data, _) in whole.items()
        }
        made_again = {name for name in whole if again[name][1] != whole[name][1]}
        tables = {"shapes.csv", "vertices.npy", "vertices.csv"}
        assert made_again - tables == {walking.name, f"registrations/{result.name}"}
    result.write_bytes(b"damaged")
    with pytest.raises(FileError, match=r"walking.*npz: remove it, and run unbend collection"):
        read_registrations(out)
    assert collection.register(out / "template.obj", out, workers=0).registered == 1
    done = collection.register(out / "template.obj", out, workers=0)
    assert (done.registered, done.skipped, len(done.failures)) == (0, 3, 1)


def test_what_another_run_is_just_writing_stays(
    own: tuple[Collection, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, out = own
    other = out / ".vertices.csv.01234567.part"

    def attempt_all(*given: Any, of: Any = _registering.attempt_all) -> list[Any]:
        other.touch()
        os.utime(other, (time.time(), time.time()))
        return of(*given)

    monkeypatch.setattr(_registering, "attempt_all", attempt_all)
    collection.register(out / "template.obj", out, workers=0)
    assert other.exists()


def test_tables_that_a_run_did_not_finish_are_not_read(
    own: tuple[Collection, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, out = own
    whole = contents(out)
    (out / ".vertices.npy.01234567.part").write_bytes(b"of a run that was killed")
    for last in ("vertices.npy", "vertices.csv", "shapes.csv"):

        def replace(old: str, new: str, last: str = last, of: Any = os.replace) -> None:
            if Path(new).name == last:
                raise KeyboardInterrupt
            of(old, new)

        with monkeypatch.context() as patch:
            patch.setattr("unbend.io._files.os.replace", replace)
            with pytest.raises(KeyboardInterrupt):
                collection.register(out / "template.obj", out, workers=0)
        with pytest.raises(FileError, match="holds no registered shapes, or not all yet"):
            read_registrations(out)
    collection.register(out / "template.obj", out, workers=0)
    again = contents(out)
    assert {name: data for name, (data, _) in again.items()} == {
        name: data for name, (data, _) in whole.items()
    }


def test_what_is_partly_registered_again_is_not_read(
    own: tuple[Collection, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, out = own

    def attempt_all(*given: Any) -> list[Any]:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(_registering, "attempt_all", attempt_all)
        with pytest.raises(KeyboardInterrupt):
            collection.register(out / "template.obj", out, partial="none", workers=0)
    with pytest.raises(FileError, match="holds no registered shapes, or not all yet"):
        read_registrations(out)
    collection.register(out / "template.obj", out, workers=0)


@pytest.mark.parametrize("killed_after", [0, 1])
def test_a_mesh_is_as_its_row_says_whenever_a_run_is_killed(
    own: tuple[Collection, Path], monkeypatch: pytest.MonkeyPatch, killed_after: int
) -> None:
    collection, out = own
    _, (first, *_), _ = read_registrations(out)
    moved = replace(first, mesh=Mesh(first.mesh.vertices + 1, first.mesh.faces))
    write = _registering.write_registration

    def killed(*given: Any, **options: Any) -> None:
        for _ in range(killed_after):
            write(*given, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(_registering, "match", lambda *given, **options: None)
    monkeypatch.setattr(_registering, "register", lambda *given: moved)
    landmarks = {first.mesh.name: [(0, 0)]}
    with monkeypatch.context() as patch:
        patch.setattr(_registering, "write_registration", killed)
        with pytest.raises(KeyboardInterrupt):
            collection.register(out / "template.obj", out, landmarks=landmarks, workers=0)
    collection.register(out / "template.obj", out, workers=0)
    for row, places in zip(rows(out), np.load(out / "vertices.npy"), strict=False):
        np.testing.assert_allclose(read_mesh(out / row["file"]).vertices, places, atol=1e-6)


def test_new_landmarks_register_a_shape_again_and_only_that_and_stay_until_others_are_given(
    own: tuple[Collection, Path],
) -> None:
    collection, out = own
    (permuted,) = (row["path"] for row in rows(out) if row["shape"].startswith("permuted"))
    inverse = np.argsort(ORDER)
    hints = {permuted: [(i, inverse[i]) for i in (0, 50, 100)]}
    options = {"landmarks": hints, "workers": 0}
    assert collection.register(out / "template.obj", out, **options).registered == 1
    assert collection.register(out / "template.obj", out, **options).registered == 0
    next(out.glob("permuted-*.obj")).unlink()
    assert collection.register(out / "template.obj", out, workers=0).registered == 1
    (result,) = (out / "registrations").glob("permuted-*.npz")
    assert len(np.load(result)["landmarks"]) == 3
    without = {permuted: []}
    assert collection.register(out / "template.obj", out, landmarks=without, workers=0).skipped == 2
    assert len(np.load(result)["landmarks"]) == 0
    expected = TEMPLATE.vertices @ TURN.T + 3
    np.testing.assert_allclose(np.load(out / "vertices.npy")[1], expected, atol=4e-4)
    hints[permuted] = [(0, N)]
    done = collection.register(out / "template.obj", out, **options)
    assert [Path(one.path).name for one in done.failures] == ["permuted.ply", "points.ply"]
    assert len(np.load(out / "vertices.npy")) == len(done.shapes) == 2
    with pytest.raises(InputError, match=r"nobody.ply is not in the collection"):
        collection.register(out / "template.obj", out, landmarks={"nobody.ply": []}, workers=0)
    name = Path(permuted).name
    for given, problem in (
        ({permuted: [[1, 2, 3, 4], [1, 2, 3, 4]]}, rf"{name} must be rows of two .* \(2, 4\)"),
        ({permuted: [(1.7, 1.2)]}, rf"{name} must be rows of two .* float64"),
        ({permuted: [(0, 1)], collection.find([permuted])[0].id: [(2, 3)]}, "is named twice"),
    ):
        with pytest.raises(InputError, match=problem):
            collection.register(out / "template.obj", out, landmarks=given, workers=0)


@OF_OTHERS
def test_what_may_be_partial_is_passed_on_and_shapes_are_registered_again_if_it_changes(
    own: tuple[Collection, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    collection, out = own
    (walking,) = (one.path for one in collection if one.path.endswith("walking.off"))
    asked = []

    def matched(*shapes: Mesh, **options: Any) -> Any:
        asked.append(options["partial"])
        return match(*shapes, **options)

    monkeypatch.setattr(_registering, "match", matched)
    for partial, registered in (("auto", 0), ("none", 1), ("none", 0), ("auto", 1)):
        done = register_files([walking], str(out / "template.obj"), str(out), partial)
        assert (done.registered, done.skipped) == (registered, 1 - registered)
    assert asked == ["none", "auto"]
    with pytest.raises(InputError, match=r"partial must be one of auto, none, .* not 'all'"):
        collection.register(out / "template.obj", out, partial="all", workers=0)


@OF_OTHERS
def test_a_registered_shape_whose_file_changed_or_is_gone_fails(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made / "out", tmp_path / "out")
    shutil.copytree(made / "scans", tmp_path / "scans")
    collection = Collection(tmp_path / "store")
    collection.add([tmp_path / "scans" / name for name in ("itself.obj", "walking.off")], workers=0)
    (tmp_path / "scans" / "walking.off").write_text("something else")
    (tmp_path / "scans" / "itself.obj").unlink()
    for out in ("out", "new"):  # registered before, or not
        done = collection.register(made / "template.obj", tmp_path / out, workers=0)
        assert (done.registered, done.skipped, done.shapes) == (0, 0, ())
        reasons = {Path(one.path).name: one.reason for one in done.failures}
        assert "there is no such file" in reasons["itself.obj"]
        assert "it has changed since it was added" in reasons["walking.off"]


@OF_OTHERS
def test_identical_files_are_one_shape_with_the_first_path(own: tuple[Collection, Path]) -> None:
    collection, out = own
    shapes = out.parent / "shapes"
    (walking,) = (one.path for one in collection if one.path.endswith("walking.off"))
    shapes.mkdir()
    paths = [str(shapes / name) for name in ("walking.off", "a.off", "b.off")]
    for path in paths:
        shutil.copy(walking, path)
    done = register_files([*paths, paths[0]], str(out / "template.obj"), str(out))
    (shape,) = done.shapes
    assert (done.skipped, shape.path, shape.also) == (1, paths[0], tuple(paths[1:]))
    assert rows(out)[0]["also"] == "; ".join(paths[1:])


@OF_OTHERS
def test_a_renamed_shape_is_not_registered_again_and_nothing_is_lost(
    made: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(made / "out", out)
    write_mesh(out / "mine-0123456789ab.obj", TEMPLATE)
    for name, new in (("itself.obj", "itself.obj"), ("walking.off", "strolling.off")):
        shutil.copy(made / "scans" / name, tmp_path / new)
    collection = Collection(tmp_path / "store")
    collection.add([tmp_path / "itself.obj", tmp_path / "strolling.off"], workers=0)
    before = contents(out)
    done = collection.register(out / "template.obj", out, workers=0)
    assert (done.registered, done.skipped, done.failures) == (0, 2, ())
    after, listed = contents(out), [one.file for one in done.shapes]
    assert [name.split("-")[0] for name in listed] == ["itself", "strolling"]
    meshes = {name for name in after if name.endswith(".obj")}
    moved = {name.replace("walking", "strolling") for name in before if name.endswith(".obj")}
    assert meshes == moved
    assert after[listed[1]][0] == before[listed[1].replace("strolling", "walking")][0]
    assert len(list((out / "registrations").iterdir())) == len(moved) - 2  # the template, mine
    stale = out / listed[1].replace("strolling", "walking")  # of a backup
    for path in (stale, out / "registrations" / f"{stale.stem}.npz"):
        path.write_text("stale", "utf-8")
    collection.register(out / "template.obj", out, workers=0)
    now = contents(out)
    assert {name: now[name][0] for name in now} == {name: after[name][0] for name in after}


def test_shapes_of_one_name_whose_ids_begin_alike_are_told_apart(
    made: Path, tmp_path: Path
) -> None:
    """In one of four collections of 50,000 shapes, two share the first 8 digits of their ids."""
    paths = [tmp_path / name / "mesh.obj" for name in ("one", "other")]
    for path, pose in zip(paths, ("itself.obj", "walking.off"), strict=True):
        path.parent.mkdir()
        write_mesh(path, read_mesh(made / "scans" / pose))
    begun = [hashlib.blake2b(path.read_bytes(), digest_size=16) for path in paths]
    seen: dict[str, str] = {}
    for line in (f"# {i}\n" for i in itertools.count()):
        hashes = [one.copy() for one in begun]
        for one in hashes:
            one.update(line.encode())
        starts = [one.hexdigest()[:8] for one in hashes]
        seen[starts[0]] = line
        if starts[1] in seen:
            break
    for path, end in zip(paths, (seen[starts[1]], line), strict=True):
        with open(path, "a") as file:
            file.write(end)
    given = [str(path) for path in paths], str(made / "template.obj"), str(tmp_path / "out")
    done = register_files(*given)
    assert len({one.name for one in done.shapes}) == 2
    assert len({one.mesh.vertices.tobytes() for one in read_registrations(given[2])[1]}) == 2
    assert register_files(*given).skipped == 2


def test_registering_some_files_keeps_the_others(own: tuple[Collection, Path]) -> None:
    collection, out = own
    for one in collection:
        if not one.path.endswith("points.ply"):
            with pytest.warns(UnbendWarning, match="also holds 2 registered shapes that"):
                done = register_files([one.path], str(out / "template.obj"), str(out))
            assert done.skipped == 1


@OF_OTHERS
def test_shapes_may_be_in_the_folder_that_is_written_to(own: tuple[Collection, Path]) -> None:
    collection, out = own
    (walking,) = (one.path for one in collection if one.path.endswith("walking.off"))
    shutil.copy(walking, out)
    (out / "other.glb").touch()
    with pytest.warns(UnbendWarning, match="left out 1 .glb file"):
        done = register_files([str(out)], str(out / "template.obj"), str(out))
    (out / "other.glb").unlink()
    assert [one.path for one in done.shapes] == [str(out / "walking.off")]
    assert (done.skipped, done.failures) == (1, ())
    (out / "walking.off").unlink()
    with pytest.raises(FileError, match="out holds only what was registered before"):
        register_files([str(out)], str(out / "template.obj"), str(out))


@pytest.mark.parametrize("suffix", [".vtp", ".glb"])
def test_the_template_in_the_folder_that_is_written_to_is_never_a_shape(
    tmp_path: Path, suffix: str
) -> None:
    uvs = TEMPLATE.vertices[:, :2]
    write_mesh(tmp_path / f"template{suffix}", TEMPLATE, uvs=uvs)
    write_mesh(tmp_path / "scan.ply", TEMPLATE)
    given = [str(tmp_path / "*.*")], str(tmp_path / f"template{suffix}"), str(tmp_path)
    done = register_files(*given)
    (shape,) = done.shapes
    assert shape.file.endswith(suffix)
    if suffix == ".vtp":
        distance = read_values(tmp_path / shape.file, name="distance").mean()
        assert distance == pytest.approx(shape.mean_distance)
    else:
        np.testing.assert_allclose(read_values(tmp_path / shape.file, name="uv"), uvs, atol=1e-6)
    assert [(one.path, one.also) for one in done.shapes] == [(str(tmp_path / "scan.ply"), ())]
    assert register_files(*given).shapes == done.shapes


def test_warnings_of_a_shape_are_told_and_stay_in_the_table(tmp_path: Path) -> None:
    write_mesh(tmp_path / "template.ply", TEMPLATE)
    pieces = np.vstack([TEMPLATE.vertices, TEMPLATE.vertices[:3] + 9])
    faces = np.vstack([TEMPLATE.faces, N + np.arange(3)])
    write_mesh(tmp_path / "pieces.ply", (pieces, faces))
    given = [str(tmp_path / "pieces.ply")], str(tmp_path / "template.ply"), str(tmp_path / "out")
    with pytest.warns(UnbendWarning, match=r"pieces.ply: .*largest .* is matched") as told:
        done = register_files(*given)
    assert len(told) == 1
    assert str(told[0].message) == f"{given[0][0]}: {done.shapes[0].warnings[0]}"
    again = register_files(*given)
    assert (again.skipped, again.shapes) == (1, done.shapes)
    assert rows(tmp_path / "out")[0]["warnings"] == done.shapes[0].warnings[0]


def test_a_textured_template_keeps_its_lines(made: Path, tmp_path: Path) -> None:
    lines = (made / "template.obj").read_text().splitlines()
    lines = ["mtllib coat.mtl", *lines, "g all", "usemtl fur"]
    lines = [f"vt 0.{i} 0.5" for i in range(3)] + [
        " ".join(["f", *(f"{word}/{i + 1}" for i, word in enumerate(line.split()[1:]))])
        if line.startswith("f ")
        else line
        for line in lines
    ]
    (tmp_path / "textured.obj").write_text("\n".join(lines))
    collection = Collection(tmp_path / "store")
    collection.add(made / "scans" / "permuted.ply", workers=0)
    done = collection.register(tmp_path / "textured.obj", tmp_path / "out", workers=0)
    written = (tmp_path / "out" / done.shapes[0].file).read_text().splitlines()
    for line, wanted in zip(written, lines, strict=True):
        if wanted.startswith("mtllib"):  # it is still found from the other folder
            assert line == "mtllib ../coat.mtl"
        elif not wanted.startswith("v "):
            assert line == wanted
    copy = (tmp_path / "out" / "template.obj").read_text()
    assert copy == "\n".join(lines).replace("coat.mtl", "../coat.mtl")
    (tmp_path / "deeper").mkdir()
    shutil.move(tmp_path / "out", tmp_path / "deeper" / "out")
    done = collection.register(tmp_path / "textured.obj", tmp_path / "deeper" / "out", workers=0)
    assert (done.registered, done.skipped) == (0, 1)


def test_the_template_may_be_a_shape_of_the_collection(made: Path, tmp_path: Path) -> None:
    collection = Collection(made / "store")
    (entry,) = (one for one in collection if one.path.endswith("itself.obj"))
    shutil.copytree(made / "out", tmp_path / "out")
    done = collection.register(entry.id, tmp_path / "out", workers=0)  # it has the same bytes
    assert (done.registered, done.skipped) == (0, 3)


def test_mistakes_leave_nothing(made: Path, tmp_path: Path) -> None:
    collection, out = Collection(made / "store"), tmp_path / "out"
    for template, message in (
        (made / "scans" / "points.ply", "a template needs faces, and this is a point cloud"),
        ("nobody.ply", "nobody.ply is not in the collection"),
    ):
        with pytest.raises((FileError, InputError), match=message):
            collection.register(template, out, workers=0)
        assert not out.exists()
    with pytest.raises(FileError, match=r"registered to another template, template.obj there"):
        collection.register(made / "scans" / "walking.off", made / "out", workers=0)
    with pytest.raises(FileError, match="cannot write"):
        collection.register(made / "template.obj", made / "store" / "out", workers=0)
    with pytest.raises(FileError, match="holds no registered shapes, or not all yet"):
        read_registrations(tmp_path)
