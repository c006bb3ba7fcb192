"""Landmarks of 3D Slicer and in tables: in, out, paired, and refused where they do not fit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import read_markup_pairs, read_markups, write_markups

CUBE = Mesh(
    [[x, y, z] for x in (1, 3) for y in (1, 3) for z in (1, 3)] + [[1.2, 1, 1]],
    [[0, 1, 2], [3, 4, 5], [6, 7, 0]],  # the last vertex is in no face
)


def mrk(*points, axes="LPS") -> str:
    keys = ("label", "position", "description", "positionStatus")
    controls = [dict(zip(keys, point, strict=False)) for point in points]
    return json.dumps({"markups": [{"coordinateSystem": axes, "controlPoints": controls}]})


@settings(deadline=None)
@given(st.lists(st.tuples(st.text(), st.integers(0, 8)), min_size=1))
def test_what_is_written_is_read_back(tmp_path_factory, points) -> None:
    path = tmp_path_factory.mktemp("m") / "a.mrk.json"
    labels, vertices = zip(*points, strict=True)
    write_markups(path, CUBE, vertices, labels)
    back_labels, back = read_markups(path, CUBE)
    assert (back_labels, back.tolist()) == (list(labels), list(vertices))


def test_a_point_moves_to_the_nearest_vertex_in_a_face(tmp_path: Path) -> None:
    path = tmp_path / "a.mrk.json"
    path.write_text(mrk(("nose", [3, 3.05, 1]), ("tail", [1.04, 1, 1])))
    assert read_markups(path, CUBE)[1].tolist() == [6, 0]


def test_a_described_vertex_counts_until_the_point_is_moved(tmp_path: Path) -> None:
    path = tmp_path / "a.mrk.json"
    path.write_text(mrk(("loose", [1.2, 1, 1], "vertex 8"), ("nose", [3, 1, 1], "vertex 4")))
    assert read_markups(path, CUBE)[1].tolist() == [8, 4]
    path.write_text(mrk(("tail", [1, 1, 1], "vertex 0"), ("nose", [3, 2.98, 1], "vertex 4")))
    with pytest.warns(UnbendWarning, match=r"a.mrk.json: 1 point not at .* where they lie"):
        assert read_markups(path, CUBE)[1].tolist() == [0, 6]


def test_ras_is_turned_to_lps(tmp_path: Path) -> None:
    path = tmp_path / "a.mrk.json"
    path.write_text(mrk(("nose", [-3, -1, 1]), axes="RAS"))
    assert read_markups(path, CUBE)[1].tolist() == [4]


def test_a_mesh_that_is_in_ras_itself_is_told(tmp_path: Path) -> None:
    """A body that is nearly its own image, so that every point is near it either way."""
    body = Mesh(make_sphere(3).vertices * [1, 1, 2] + [0.02, 0.01, 0])
    path = tmp_path / "a.mrk.json"
    points = [(f"{i}", body.vertices[i].tolist()) for i in (10, 200, 300)]
    path.write_text(mrk(*points, axes="RAS"))
    with pytest.raises(FileError, match=r"from mesh, 0 with x and y negated: .* in LPS"):
        read_markups(path, body)


def test_points_of_another_unit_that_fall_on_one_vertex_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mrk.json"
    flat = Mesh([[0, 0, 0], [100, 0, 0], [0, 100, 0]], [[0, 1, 2]])
    path.write_text(mrk(("nose", [0.1, 0, 0]), ("tail", [0, 0.1, 0])))
    with pytest.warns(UnbendWarning, match=r"1 point \(tail\) at the same vertex of mesh as"):
        assert read_markups(path, flat)[1].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("axes", "sign"), [("LPS", 1), ("RAS", -1), ("0", -1), ("1", 1), (None, -1)]
)
def test_fcsv(tmp_path: Path, axes: str | None, sign: int) -> None:
    path = tmp_path / "a.fcsv"
    path.write_text(
        "# Markups fiducial file version = 4.11\n"
        + ("" if axes is None else f"# CoordinateSystem = {axes}\n")
        + "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
        + f'1,{3 * sign},{1 * sign},1,0,0,0,1,1,1,0,"nose, left",,\n'
        + f"2,{3 * sign},{1 * sign},3,0,0,0,1,1,1,0,tail,vertex 5,\n"
    )
    labels, vertices = read_markups(path, CUBE)
    assert labels == ["nose, left", "tail"]
    assert vertices.tolist() == [4, 5]
    path.write_text(path.read_text().replace("vertex 5,", "vertex 5,,2,0"))  # as newer ones end
    assert read_markups(path, CUBE)[1].tolist() == [4, 5]
    for status in "013":
        path.write_text(re.sub(r"5,,\d", f"5,,{status}", path.read_text()))
        with pytest.warns(UnbendWarning, match="point 'tail' has no position: left out"):
            assert read_markups(path, CUBE)[1].tolist() == [4]


@pytest.mark.parametrize(
    ("name", "text", "labels"),
    [
        ("a.csv", "3,1,1\n1,3,3\n", ["", ""]),
        ("a.csv", "x,y,z\n3,1,1\n1,3,3\n", ["", ""]),
        ("a.csv", "x,y,z,quality\n3,1,1,0.9\n1,3,3,0.8\n", ["", ""]),
        ("a.csv", "name;z;y;x\nnose;1;1;3\ntail;3;3;1\n", ["nose", "tail"]),
        ("a.csv", "id,Label,X,Y,Z\n7,nose,3,1,1\n8,tail,1,3,3\n", ["nose", "tail"]),
        ("a.csv", '"","x","y","z"\n"nose",3,1,1\n"NA",1,3,3\n', ["nose", "NA"]),  # R; nasion
        ("a.csv", ",Landmark,X,Y,Z\n1,nose,3,1,1\n2,tail,1,3,3\n", ["nose", "tail"]),
        ("a.csv", "label,l,p,s,defined\nnose,3,1,1,1\ntail,1,3,3,1\n", ["nose", "tail"]),  # Slicer
        ("a.csv", "label,r,a,s\nnose,-3,-1,1\ntail,-1,-3,3\n", ["nose", "tail"]),
        ("a.txt", "3 1 1\n 1\t3   3\n", ["", ""]),
        ("a.txt", "nose, 3, 1, 1\ntail, 1, 3, 3\n", ["nose", "tail"]),
        ("a.csv", "label,vertex\nnose,4\ntail,3\n", ["nose", "tail"]),  # of unbend view
        ("a.csv", "Name,vertex\nnose,4\ntail,3\n", ["nose", "tail"]),
        ("a.csv", '"","label","vertex"\n"1","nose",4\n"2","tail",3\n', ["nose", "tail"]),
        ("a.pts", "Version 1.0\n2\nS000 3 1 1\nS001 1 3 3\n", ["S000", "S001"]),
    ],
)
def test_tables_of_points(tmp_path: Path, name: str, text: str, labels: list[str]) -> None:
    (tmp_path / name).write_text(text)
    found, vertices = read_markups(tmp_path / name, CUBE)
    assert (found, vertices.tolist()) == (labels, [4, 3])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("x,y,z\n", "holds no points"),
        ("3,1\n", "row 0 holds '3,1'; a point is x, y and z"),
        ("3,1,1\nnose,1,3,3\n", "row 1 holds"),
        ("3,1,1,1,3,3\n", "row 0 holds"),  # two points, or decimal commas
        ("x;y;z\n3,0;1;1\n", "row 0 holds '3,0;1;1'; .* with decimal points"),
        ("a,b,c\n3,1,1\n", "row 0 holds 'a,b,c'"),
        ("x,y,z\n3 1 1\n", "row 0 holds '3 1 1'"),
        ("label,vertex\nnose,9\n", "point 'nose' is vertex 9, but mesh has 9 vertices"),
        ("label,vertex\nnose,4.5\n", "row 0 holds 'nose,4.5'; a landmark is a label and the"),
        ("3,1,1\n3,3.2,1\n", "point '2' is 0.2 from mesh, more than 3 %"),
        ("3,1,nan\n", "point '1' has no position"),
        ("x,y,z\n3,1,1\nNA,NA,NA\n", "point '2' has no position"),
        ('3,1,"1\n', "not a table"),
    ],
)
def test_what_tables_of_points_cannot_mean(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(FileError, match=problem):
        read_markups(tmp_path / "a.csv", CUBE)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (mrk(("nose", [3, 3.2, 1])), "'nose' is 0.2 from mesh, more than 3 %"),
        (mrk(("", [3, 3, float("nan")])), "'1' has no position: place it, or delete it"),
        (mrk(("nose", [9, 9, 9], "vertex 5")), "'nose' is 10.4 from mesh"),
        (mrk(("nose", [1e300, 9, 9], "vertex 5")), "'nose' is inf from mesh"),
        (mrk(("nose", [0, 0, 0], "vertex 9")), "'nose' is vertex 9, but mesh has 9"),
        (mrk(("nose", [0])), "not a landmark file"),
        (mrk(("nose", [0, 0])), "not a landmark file"),
        (mrk(("nose", [0, 0, 0]), axes="IJK"), "not a landmark file"),
        (mrk(), "holds no points"),
        ("[" * 100_000, "not a landmark file"),
        ('{"markups": 7}', "not a landmark file"),
        ("{", "not a landmark file"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "a.mrk.json"
    path.write_text(text)
    with pytest.raises(FileError, match=problem):
        read_markups(path, CUBE)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.mrk.json", mrk(("ear", [3, 3, float("nan")]), ("nose", [3, 1, 1]))),
        ("a.mrk.json", mrk(("ear", [3, 3, 3], "", "undefined"), ("nose", [3, 1, 1]))),
        ("a.mrk.json", mrk(("ear", [3, 3, 3], "", "missing"), ("nose", [3, 1, 1]))),
        ("a.csv", "label,l,p,s,defined\near,3,3,3,0\nnose,3,1,1,1\n"),
        ("a.csv", '"","x","y","z"\n"ear",NA,NA,NA\n"nose",3,1,1\n'),  # R
    ],
)
def test_a_named_point_without_a_position_is_left_out(tmp_path: Path, name: str, text: str) -> None:
    paths = [tmp_path / name] * 2
    paths[0].write_text(text)
    with pytest.warns(UnbendWarning, match="point 'ear' has no position: left out"):
        labels, vertices = read_markups(paths[0], CUBE)
    assert (labels, vertices.tolist()) == (["nose"], [4])
    with pytest.raises(FileError, match="point 'ear' has no position: place it, or delete it"):
        read_markup_pairs(paths, CUBE, CUBE)  # which might pair by order


def picked(*points: str) -> str:
    return f"<!DOCTYPE PickedPoints>\n<PickedPoints>\n{''.join(points)}</PickedPoints>\n"


def test_points_picked_in_meshlab(tmp_path: Path) -> None:
    (tmp_path / "a.pp").write_text(
        picked(
            '<point name="nose &quot;L>&quot;" active="1" x="3" y="1" z="1"/>\n',
            '<point z="9" y="9" x="9" active="0" name="ear"/>\n',  # not placed
            '<point z="3" y="3" x="1" active="1" name="tail"/>\n',
        )
    )
    labels, vertices = read_markups(tmp_path / "a.pp", CUBE)
    assert (labels, vertices.tolist()) == (['nose "L>"', "tail"], [4, 3])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (picked(), "holds no points"),
        (picked('<point name="nose" x="3" y="1"/>'), "not a landmark file of MeshLab"),
        (picked('<point name="nose" x="3" y="1" z="1"/>')[:-9], "not a landmark file of MeshLab"),
        (picked('<point name="nose" x="9" y="9" z="9"/>'), "'nose' is 10.4 from mesh"),
        ("3,1,1\n", "not a landmark file of MeshLab"),
    ],
)
def test_damaged_points_of_meshlab_are_refused(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "a.pp").write_text(text)
    with pytest.raises(FileError, match=problem):
        read_markups(tmp_path / "a.pp", CUBE)


def test_a_mesh_without_vertices_has_no_place_for_landmarks(tmp_path: Path) -> None:
    (tmp_path / "a.mrk.json").write_text(mrk(("nose", [3, 3, 3])))
    with pytest.raises(InputError, match="nothing has no vertices"):
        read_markups(tmp_path / "a.mrk.json", Mesh(np.empty((0, 3)), name="nothing"))


@pytest.mark.parametrize("text", ["1,2\n", "1,a,b,c,0,0,0,1,1,1,0,nose,\n", "#\n", "\0"])
def test_a_damaged_fcsv_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.fcsv").write_text(text)
    with pytest.raises(FileError, match=r"a\.fcsv"):
        read_markups(tmp_path / "a.fcsv", CUBE)


def pair(folder: Path, first: list[str], second: list[str]) -> list[list[int]]:
    paths = [folder / "a.mrk.json", folder / "b.mrk.json"]
    for path, labels in zip(paths, (first, second), strict=True):
        write_markups(path, CUBE, range(len(labels)), labels)
    labels, pairs = read_markup_pairs(paths, CUBE, CUBE)
    assert labels == [first[i] for i in pairs[:, 0]]
    return pairs.tolist()


def test_points_pair_by_label_or_else_by_order(tmp_path: Path) -> None:
    assert pair(tmp_path, ["nose", "tail"], ["tail", "nose"]) == [[0, 1], [1, 0]]
    assert pair(tmp_path, ["F-1", "F-2"], ["P-1", "P-2"]) == [[0, 0], [1, 1]]
    assert pair(tmp_path, ["F-1", "F-2", "F-3"], ["3", "1", "2"]) == [[0, 1], [1, 2], [2, 0]]
    assert pair(tmp_path, ["F-1", "F-2"], ["F-3", "F-4"]) == [[0, 0], [1, 1]]
    assert pair(tmp_path, ["", ""], ["", ""]) == [[0, 0], [1, 1]]
    with pytest.raises(InputError, match=r"2 points, .* 3: they must be pairs"):
        pair(tmp_path, ["a", "b"], ["c", "d", "e"])


def test_files_that_fit_the_meshes_the_other_way_round_are_refused(tmp_path: Path) -> None:
    ball = make_sphere(3)
    inner, outer = Mesh(ball.vertices, name="inner"), Mesh(1.05 * ball.vertices, name="outer")
    paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for path, mesh in zip(paths, (inner, outer), strict=True):
        np.savetxt(path, mesh.vertices[[5, 100, 300]], delimiter=",")
    assert read_markup_pairs(paths, inner, outer)[1].tolist() == [[5, 5], [100, 100], [300, 300]]
    told = r"a\.csv fits inner and .*b\.csv fits outer: give the files .* the other way round"
    with pytest.raises(FileError, match=told):
        read_markup_pairs(paths, outer, inner)


def test_points_that_only_one_file_has_are_left_out_and_named(tmp_path: Path) -> None:
    with pytest.warns(UnbendWarning) as told:
        assert pair(tmp_path, ["nose", "tail"], ["ear", "nose"]) == [[0, 1]]
    assert [str(one.message).split(" has ")[1] for one in told] == [
        "a point 'tail': left out",
        "a point 'ear': left out",
    ]


def test_labels_pair_in_any_case(tmp_path: Path) -> None:
    assert pair(tmp_path, ["nose", "tail "], ["Tail", "Nose"]) == [[0, 1], [1, 0]]
    with pytest.raises(InputError, match="one point 'Nose'"):
        pair(tmp_path, ["Nose", "nose", "tail"], ["nose", "tail", "ear"])


def test_labels_of_several_points_pair_by_order_only_if_both_files_have_them_alike(
    tmp_path: Path,
) -> None:
    assert pair(tmp_path, ["tail", "tail"], ["tail", "tail"]) == [[0, 0], [1, 1]]
    with pytest.raises(InputError, match="do not both have one point 'tail'"):
        pair(tmp_path, ["tail", "tail", "nose"], ["nose", "tail", "ear"])
    with pytest.raises(InputError, match=r"2 points, .* 3: they must be pairs"):
        pair(tmp_path, ["", ""], ["", "", ""])


def test_labels_that_have_nothing_in_common_are_told(tmp_path: Path) -> None:
    with pytest.warns(UnbendWarning, match=r"no label in common.* paired by order"):
        assert pair(tmp_path, ["nose", "tail"], ["Nase", "Schwanz"]) == [[0, 0], [1, 1]]
    for first, second in (
        (["nose-1", "tail-2"], ["eye-9", "ear-7"]),
        (["1", "2"], ["F-9", "F-7"]),
        (["nose", "tail"], ["F-1", "F-2"]),
        (["", ""], ["nose", "tail"]),
    ):
        with pytest.warns(UnbendWarning, match="paired by order"):
            assert pair(tmp_path, first, second) == [[0, 0], [1, 1]]


def test_points_numbered_from_0_and_from_1_are_not_paired_one_off(tmp_path: Path) -> None:
    for first, second in (["1", "2", "3"], ["0", "1", "2"]), (["2", "0", "1"], ["3", "2", "1"]):
        with pytest.raises(
            InputError, match=r"a\.mrk\.json numbers its points from [01], .* alike"
        ):
            pair(tmp_path, first, second)
    assert pair(tmp_path, ["1", "2", "3", "4"], ["2", "1", "4", "3"])[0] == [0, 1]
    with pytest.warns(UnbendWarning, match="left out"):  # each lacks one of the same numbers
        assert pair(tmp_path, ["F-1", "F-2", "F-3"], ["F-2", "F-3", "F-4"]) == [[1, 0], [2, 1]]
    with pytest.warns(UnbendWarning, match="has a point '0': left out"):
        assert pair(tmp_path, ["0", "1", "2"], ["1", "2"]) == [[1, 0], [2, 1]]


def test_landmarks_that_cannot_be_written_are_named(tmp_path: Path) -> None:
    out = tmp_path / "a.mrk.json"
    for vertices, labels, problem in (
        ([-1], ["a"], "there is no vertex -1"),
        ([999], ["a"], "there is no vertex 999"),
        ([0.5], ["a"], "whole numbers"),
        ([0, 1], ["a"], "2 landmarks need as many labels, not 1"),
    ):
        with pytest.raises(InputError, match=problem):
            write_markups(out, CUBE, vertices, labels)
    assert not out.exists()


def test_labels_may_have_a_hash_and_rows_a_comment(tmp_path: Path) -> None:
    text = '# of a scan\nlabel,x,y,z\n#1,0,0,1\n"tip #2",0,1,0 # the left one\n# and\na#3,1,0,0\n'
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    places = np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, 0]])
    tetrahedron = Mesh(places, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    labels, vertices = read_markups(tmp_path / "a.csv", tetrahedron)
    assert labels == ["#1", "tip #2", "a#3"]
    assert vertices.tolist() == [0, 1, 2]
