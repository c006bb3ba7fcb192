"""The jobs of the app, run in this process: what they find, and the files that they write."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sheets import make_egg
from unbend import Mesh, read_match, read_mesh, write_match, write_mesh
from unbend.app._jobs import run
from unbend.app._work import Work
from unbend.collection import Collection
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError, UnbendWarning
from unbend.io import read_map, read_markups, read_values, value_colors, write_markups


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> list[list[str]]:
    """A dog standing and the same one galloping: vertex i is the same point of both."""
    folder, found = tmp_path_factory.mktemp("shapes"), []
    for pose in ("standing", "galloping"):
        mesh = make_quadruped(pose, n_vertices=600).mesh
        path = folder / f"{pose}.ply"
        colors = value_colors(mesh.vertices[:, 0]) if pose == "standing" else None
        write_mesh(path, mesh, colors=colors)
        found.append([str(path), f"my {pose}.ply"])
    return found


def done(folder: Path, do: str, shapes: list[list[str]], **given):
    """Run a job as the worker does; what it returns can be written as JSON."""
    stages = []
    folder.mkdir(exist_ok=True)
    job = {"do": do, "folder": str(folder / do), "shapes": shapes, "up": "y", **given}
    found = run(job, lambda stage, share: stages.append(stage))
    return json.loads(json.dumps(found)) | {"folder": folder / do}


def placed(name: str, *at: int):
    return {"name": name, "at": list(at)}


def page_of(result) -> str:
    assert result["page"]
    return (result["folder"] / "page.html").read_text("utf-8")


def file_of(result, suffix: str) -> str:
    return next(one["path"] for one in result["files"] if one["name"].endswith(suffix))


@pytest.fixture(scope="module")
def matched(shapes, tmp_path_factory: pytest.TempPathFactory):
    return done(tmp_path_factory.mktemp("match"), "match", shapes, landmarks=[placed("nose", 5, 5)])


def uses(matched) -> dict[str, str]:
    return {"map_file": matched["map_file"], "map_name": matched["files"][0]["name"]}


def test_a_match_has_a_map_files_a_page_and_the_lines_that_do_the_same(shapes, matched) -> None:
    meshes = [read_mesh(path) for path, _ in shapes]
    found = read_match(matched["map_file"], source=meshes[0], target=meshes[1])
    assert (found.source_to_target == np.arange(600)).mean() > 0.5
    np.testing.assert_array_equal(read_map(file_of(matched, ".csv")), found.source_to_target)
    assert "very likely right" in matched["confidence"]
    assert not matched["doubtful"]
    assert len(page_of(matched)) > 10_000
    names = [one["name"] for one in matched["files"]]
    assert names[0] == "my standing-my galloping.npz"
    assert {"landmarks.csv", "my galloping-coloured.glb"} <= set(names)
    assert "--landmarks landmarks.csv" in matched["command"]
    assert matched["command"].startswith("unbend match 'my standing.ply' 'my galloping.ply'")
    compile(matched["python"], "lines", "exec")
    assert "landmarks={'nose': [5, 5]}" in matched["python"]
    assert '"landmarks": [{"label": "nose"' in page_of(matched)
    assert matched["landmarks"] == [placed("nose", 5, 5)]


def test_another_map_can_be_taken(shapes, matched, tmp_path) -> None:
    other = matched["alternatives"][0]
    given = {"map_file": other["path"], "map_name": other["name"], "landmarks": []}
    given |= {"command": other["command"], "python": other["python"]}
    taken = done(tmp_path, "choose", shapes, **given)
    assert taken["files"][0]["name"].endswith("-2.npz")
    meshes = [read_mesh(path) for path, _ in shapes]
    first, second = (
        read_match(one["map_file"], source=meshes[0], target=meshes[1]).source_to_target
        for one in (matched, taken)
    )
    assert (first != second).any()
    compile(taken["python"], "lines", "exec")
    assert f"write_match({other['name']!r}, found" in taken["python"]


def test_colours_of_the_first_file_are_carried(shapes, matched, tmp_path) -> None:
    found = done(tmp_path, "transfer", shapes, **uses(matched))
    carried = read_values(file_of(found, ".npy")).astype(int)
    own = read_values(shapes[0][0]).astype(int)
    assert np.abs(carried - own).mean() < 15
    assert len(found["pictures"]) == 2
    compile(found["python"], "lines", "exec")


def test_a_table_and_landmarks_are_carried(shapes, matched, tmp_path) -> None:
    parts = tmp_path / "parts.csv"
    parts.write_text("\n".join(["head"] * 300 + ["tail"] * 300), encoding="utf-8")
    found = done(tmp_path, "transfer", shapes, **uses(matched), values=[str(parts), "parts.csv"])
    assert set(read_values(file_of(found, ".csv"), n_vertices=600)) == {"head", "tail"}
    points = tmp_path / "points.mrk.json"
    given = uses(matched) | {"values": [str(points), "points.mrk.json"]}
    partners = read_match(matched["map_file"]).source_to_target
    for names in (["nose", "nose"], ["", ""]):  # 3D Slicer does not ask for different ones
        write_markups(points, shapes[0][0], [3, 400], names)
        carried = done(tmp_path / f"more{names[0]}", "transfer", shapes, **given)
        labels, vertices = read_markups(file_of(carried, ".mrk.json"), shapes[1][0])
        assert labels == (names if names[0] else ["1", "2"])
        assert vertices.tolist() == partners[[3, 400]].tolist()
        assert carried["facts"][0][1] == "2 of 2 landmarks"


def test_texture_coordinates_are_carried_as_such(shapes, matched, tmp_path) -> None:
    source, path = read_mesh(shapes[0][0]), tmp_path / "uv.ply"
    write_mesh(path, source, uvs=source.vertices[:, :2])
    given = uses(matched) | {"values": [str(path), "uv.ply"], "column": "uv"}
    found = done(tmp_path, "transfer", shapes, **given)
    want = read_values(file_of(found, ".npy"))
    np.testing.assert_allclose(read_values(file_of(found, ".glb"), name="uv"), want, atol=1e-6)
    assert "as uv" in found["facts"][0][1]
    assert "transfer(values, found, kind='uv'" in found["python"]


def test_a_label_has_one_colour_on_both_shapes(shapes, matched, tmp_path, monkeypatch) -> None:
    table, drawn = tmp_path / "own.csv", []
    table.write_text("\n".join(f"v{i}" for i in range(600)), encoding="utf-8")
    monkeypatch.setattr(Work, "draw", lambda self, caption, mesh, colors: drawn.append(colors))
    full = read_match(matched["map_file"])
    write_match(
        tmp_path / "map.npz", replace(full, target_to_source=np.maximum(full.target_to_source, 9))
    )
    given = uses(matched) | {"map_file": str(tmp_path / "map.npz")}
    found = done(tmp_path, "transfer", shapes, **given, values=[str(table), "own.csv"])
    carried = read_values(file_of(found, ".csv"), n_vertices=600)
    assert "v0" not in carried
    rows = [int(one[1:]) for one in carried]
    np.testing.assert_array_equal(drawn[1], drawn[0][rows])


def test_the_first_shape_is_fitted_and_morphed(shapes, matched, tmp_path) -> None:
    fitted = done(tmp_path, "register", shapes, **uses(matched))
    target = read_mesh(shapes[1][0]).vertices
    assert "On my galloping.ply: " in page_of(fitted)
    assert "by distance from my galloping.ply, up to " in page_of(fitted)
    size = np.ptp(target, axis=0).max()
    off = np.linalg.norm(read_mesh(file_of(fitted, ".ply")).vertices - target, axis=1)
    assert np.median(off) < 0.03 * size
    between = done(tmp_path, "morph", shapes, **uses(matched), steps=3)
    assert [one["name"] for one in between["files"]][::3] == [
        f"my standing-to-my galloping-{i}.ply" for i in (1, 2, 3)
    ]
    assert len(between["pictures"]) == 5
    for one in (fitted, between):
        compile(one["python"], "lines", "exec")


def test_an_obj_file_keeps_its_texture_coordinates(shapes, matched, tmp_path) -> None:
    dog = read_mesh(shapes[0][0])
    write_mesh(tmp_path / "dog.obj", dog, uvs=np.linspace(0, 1, 1200).reshape(600, 2))
    text = (tmp_path / "dog.obj").read_text("utf-8")
    (tmp_path / "dog.obj").write_text(f"mtllib dog skin.mtl\n{text}", "utf-8")
    given = [[str(tmp_path / "dog.obj"), "dog.obj"], shapes[1]]
    fitted = done(tmp_path, "register", given, **uses(matched))
    half = done(tmp_path, "morph", given, **uses(matched), steps=1)
    form = done(tmp_path, "form", given[:1])
    again = done(tmp_path, "choose", given, **uses(matched), command=["match"], python=["", ""])
    before, *others = (
        [x for x in Path(path).read_text("utf-8").splitlines() if x[:2] in ("mt", "vt", "f ")]
        for path in (
            tmp_path / "dog.obj",
            *(file_of(x, ".obj") for x in (fitted, half, form, again)),
        )
    )
    assert len(before) == 1 + 600 + dog.n_faces
    assert others == 4 * [before]
    kept = [one["about"] for one in half["files"] if "with all else of dog.obj" in one["about"]]
    assert len(kept) == 1


def test_distances_from_clicked_places_are_those_of_a_sphere(tmp_path) -> None:
    ball = make_sphere(3)
    write_mesh(tmp_path / "ball.ply", ball)
    shapes, landmarks = [[str(tmp_path / "ball.ply"), "ball.ply"]], [placed("pole", 7)]
    more = [*landmarks, placed("other", 70)]
    found = done(tmp_path / "more", "distance", shapes, landmarks=more)
    painted = file_of(found, ".ply")
    both = [read_values(painted, name=f"distance_{vertex}") for vertex in (7, 70)]
    np.testing.assert_allclose(np.stack(both, axis=1), read_values(file_of(found, ".csv")))
    found = done(tmp_path, "distance", shapes, landmarks=landmarks)
    exact = np.arccos(np.clip(ball.vertices @ ball.vertices[7], -1, 1))
    np.testing.assert_allclose(read_values(file_of(found, ".csv")), exact, atol=0.1)
    assert "--from 7" in found["command"]
    assert '"landmarks": [{"name": "pole", "at": [7]}]' in page_of(found)


def test_forms_symmetries_and_pages_for_landmarks_are_made(shapes, tmp_path) -> None:
    form = done(tmp_path, "form", shapes[:1])
    assert read_mesh(file_of(form, ".ply")).n_vertices == 600
    egg = make_egg(2)
    write_mesh(tmp_path / "more.ply", (np.vstack([egg.vertices, [[9, 9, 9]]]), egg.faces))
    with (
        pytest.warns(UnbendWarning, match="unreferenced"),
        pytest.warns(UnbendWarning, match=r"glb: .* without position: 0, 0, 0"),
    ):
        form = done(tmp_path / "more", "form", [[str(tmp_path / "more.ply"), "-more.ply"]])
    for suffix in (".ply", ".obj"):
        places = read_mesh(file_of(form, suffix)).vertices
        assert np.isnan(places[162:]).all()
        assert np.isfinite(places[:162]).all()
    assert form["command"].startswith("unbend canonical ./-more.ply ")
    write_mesh(tmp_path / "egg.ply", egg)
    symmetric = done(tmp_path, "symmetry", [[str(tmp_path / "egg.ply"), "egg.ply"]])
    partners = egg.vertices[read_map(file_of(symmetric, ".csv"))]
    np.testing.assert_allclose(partners * [-1, 1, 1], egg.vertices, atol=1e-6)
    assert symmetric["facts"] == [["with a mirror partner", "162 of 162 vertices"]]
    for count in (1, 2):
        given = [placed(name, *[5] * count) for name in ("nose", "tail", "nose")]
        for i, names in ((2, ["nose", "tail"]), (3, ["1", "2", "3"])):  # two of one name
            folder = tmp_path / f"{count}-{i}"
            page = done(folder, "landmarks", shapes[:count], landmarks=given[:i])
            shown = json.dumps([placed(name, *[5] * count) for name in names])
            assert f'"landmarks": {shown}' in page_of(page)


def test_a_collection_is_searched_and_what_is_gone_is_not_offered(shapes, tmp_path) -> None:
    ball = tmp_path / "ball.ply"
    write_mesh(ball, make_sphere(3))
    store = Collection(tmp_path / "store")
    store.add([shapes[1][0], str(ball)], workers=0)
    ball.unlink()
    found = done(tmp_path, "search", shapes[:1], store=store.path)
    assert found["found"] == [{"path": shapes[1][0], "name": "galloping.ply"}]
    page = page_of(found)
    assert page.index("galloping.ply") < page.index("ball.ply")
    assert "not drawn: cannot read" in page


def test_a_collection_is_put_into_groups(store, tmp_path) -> None:
    found = done(tmp_path, "groups", [], store=store.path)
    rows = Path(file_of(found, "groups.csv")).read_text("utf-8").splitlines()
    group = {Path(path).name: number for path, number in (row.rsplit(",", 1) for row in rows)}
    assert group["dog-galloping.ply"] == group["dog-standing.ply"] != group["ring.ply"]
    assert "3 shapes in 2 groups" in page_of(found)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda v, f: (v, f[1:]), "open, with 1 hole"),
        (lambda v, f: (v, None), "points without faces"),
        (lambda v, f: (np.vstack([v, v + 3]), np.vstack([f, f[4:] + 162])), "2 separate pieces"),
        (lambda v, f: (v, np.vstack([f[:1, ::-1], f[1:]])), "point inward"),
        (lambda v, f: (np.vstack([v, v[:1]]), f), "1 vertex in no face"),
        (lambda v, f: (v, np.vstack([f, [[0, 1, 2]]])), "are damaged"),
        (lambda v, f: (v[:3], [[0, 1, 2]]), "cannot work with this shape"),
    ],
)
def test_what_is_wrong_with_a_shape_is_told_in_plain_words(change, told, tmp_path) -> None:
    ball = make_sphere(2)
    write_mesh(tmp_path / "a.ply", Mesh(*change(ball.vertices, ball.faces)))
    found = done(tmp_path, "look", [[str(tmp_path / "a.ply"), "a.ply"]])
    assert told in " ".join(found["told"])
    assert found["usable"] == ("cannot" not in told)


def test_points_alone_are_drawn_as_far_as_a_surface_can_be_laid(tmp_path) -> None:
    for n, count in ((3, 1), (1, 0)):
        write_mesh(tmp_path / "a.xyz", Mesh(make_sphere(n).vertices))
        found = done(tmp_path / str(n), "look", [[str(tmp_path / "a.xyz"), "a.xyz"]])
        assert len(found["pictures"]) == count


def test_a_sample_pair_is_ours(tmp_path) -> None:
    found = done(tmp_path, "sample", [])
    assert [read_mesh(one["path"]).n_vertices for one in found["samples"]] == [2600, 2200]


def test_landmarks_that_do_not_fit_are_refused(shapes, tmp_path) -> None:
    with pytest.raises(InputError, match="600"):
        done(tmp_path, "match", shapes, landmarks=[placed("nose", 600, 0)])
