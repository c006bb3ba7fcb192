"""``unbend collection``: from files to a store, from a store to answers."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stones import write_stones
from terminal import invoke
from unbend import read_match
from unbend.cli.collection import compare
from unbend.collection import Collection
from unbend.datasets import make_sphere
from unbend.errors import InputError


def run(*arguments: object) -> Any:
    return invoke(["collection", *map(str, arguments)])


def json_of(*arguments: object) -> dict:
    done = run(*arguments, "--json")
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cli")
    write_stones(folder / "stones", 4)
    Collection(folder / "shapes").add(folder / "stones", workers=0)
    return folder


@pytest.fixture
def folder(shapes: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shapes)
    return shapes


def test_add_lists_what_failed_and_says_so(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "torn.ply").write_bytes(b"ply\nnothing more")
    arguments = ("add", tmp_path / "store", "stones/stone00.ply", tmp_path / "torn.ply")
    done = run(*arguments, "--workers", 0)
    assert done.exit_code == 1
    told = [line for line in done.stderr.splitlines() if not line.startswith("progress: ")]
    assert told[0].startswith(f"failed: {tmp_path}/torn.ply: truncated")
    assert done.stdout.startswith("added 1, already there 0, failed 1; ")
    again = run(*arguments, "--workers", 0, "--json")
    assert again.exit_code == 1
    told = json.loads(again.stdout)
    assert (told["n_added"], told["n_skipped"], told["n_shapes"]) == (0, 1, 1)
    assert [Path(one["path"]).name for one in told["failed"]] == ["torn.ply"]


def test_list_and_info(folder: Path) -> None:
    told = json_of("list", "shapes")["shapes"]
    assert {Path(one["path"]).stem for one in told} == {f"stone{i:02}" for i in range(4)}
    rows = run("list", "shapes", "-n", 2).stdout.splitlines()
    assert len(rows) == 4
    assert rows[-1] == "... of 4"
    assert "162         320  stones/stone0" in rows[1]
    assert json_of("info", "shapes")["n_shapes"] == 4
    assert run("info", "shapes").stdout.splitlines()[0].split() == ["shapes", "4"]
    one = run("info", "shapes", "stones/stone01.ply", "--thumbnail", "stone.png")
    assert "vertices  162" in one.stdout
    assert Path("stone.png").read_bytes().startswith(b"\x89PNG")
    assert json_of("info", "shapes", "stones/stone01.ply")["n_faces"] == 320


def test_search(folder: Path) -> None:
    told = json_of("search", "shapes", "stones/stone02.ply", "-n", 2)
    assert [hit["rank"] for hit in told["hits"]] == [1, 2]
    assert told["hits"][0]["path"] == str(folder / "stones" / "stone02.ply")
    rows = run("search", "shapes", "stones/stone02.ply").stdout.splitlines()
    assert rows[0].split() == ["rank", "distance", "id", "path"]
    assert rows[1].split()[::3] == ["1", "stones/stone02.ply"]
    assert len(rows) == 5


def test_identical_files_show_as_one_shape(folder: Path, tmp_path: Path) -> None:
    paths = [str(one) for one in write_stones(tmp_path / "stones", 2)]
    for name in ("copy.ply", "more.ply"):
        (tmp_path / name).write_bytes(Path(paths[0]).read_bytes())
    copies = [str(tmp_path / "copy.ply"), str(tmp_path / "more.ply")]
    store = tmp_path / "store"
    done = run("add", store, tmp_path / "stones", *copies, "--workers", 0)
    assert done.stdout.startswith("added 2, already there 2 (2 copied or moved), failed 0; ")
    assert f"{store} has 2 shapes" in done.stdout
    first = f"{copies[0]} (also {copies[1]} and 1 more)"
    for arguments in (("list",), ("search", paths[0]), ("groups", "-n", 1), ("matrix",)):
        assert first in run(arguments[0], store, *arguments[1:]).stdout
    assert f"also      {copies[1]}, {paths[0]}\n" in run("info", store, paths[0]).stdout
    every = {*copies, *paths}
    told = json_of("list", store)["shapes"]
    assert {path for one in told for path in (one["path"], *one["also"])} == every
    assert json_of("info", store, paths[0])["also"] == [copies[1], paths[0]]
    assert json_of("search", store, paths[0])["hits"][0]["also"] == [copies[1], paths[0]]
    assert json_of("matrix", store)["also"] == [[copies[1], paths[0]], []]
    (group,) = json_of("groups", store, "-n", 1, "--csv", tmp_path / "out.csv")["groups"]
    assert sorted(group) == sorted(every)
    run("groups", store, "-n", 1, "--report", tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f"also {copies[1]}; also {paths[0]}" in page
    with open(tmp_path / "out.csv", newline="") as file:
        assert [row["path"] for row in csv.DictReader(file)] == sorted(every)
    assert "next:" not in run("groups", store).stdout  # of two shapes no number stands out
    rows = run("info", store).stdout.splitlines()
    assert [row.split() for row in rows[:2]] == [["shapes", "2"], ["files", "4"]]
    assert json_of("export", store, "-o", tmp_path / "out.csv")["n_rows"] == 4
    done = run("remove", store, copies[0])
    assert done.stdout.startswith(f"removed {copies[0]}; the shape stays as {copies[1]}\n")
    assert run("remove", store, copies[1], paths[0]).stdout == (
        f"removed {copies[1]}\nremoved {paths[0]}\n{store} has 1 shape\n"
    )


def test_what_misses_a_file_says_which_and_how_to_mend_it(tmp_path: Path) -> None:
    stones = write_stones(tmp_path / "stones", 2)
    store = tmp_path / "store"
    Collection(store).add(stones, workers=0)
    query = stones[0].rename(tmp_path / "query.ply")
    (tmp_path / "stones").rename(tmp_path / "away")
    mend = f"(there is no such file): run unbend collection add {store} NEWFOLDER"
    for arguments in (
        ("search", store, query, "--by-match"),
        ("search", store, query, "--report", tmp_path / "out.html"),
        ("groups", store, "-n", 1, "--report", tmp_path / "out.html"),
        ("match", store, "--all", "-o", tmp_path / "out", "--workers", 0),
        ("register", store, "--template", query, "-o", tmp_path / "reg", "--workers", 0),
    ):
        done = run(*arguments)
        for stone in stones:
            assert f"{stone} {mend}" in done.stderr, done.output
    done = run("add", store, tmp_path / "away", query, "--workers", 0)
    assert done.stdout.startswith("added 0, already there 2 (2 copied or moved), failed 0")
    done = run("search", store, query, "--by-match", "--report", tmp_path / "out.html")
    assert done.exit_code == 0
    assert all(line.startswith("progress: ") for line in done.stderr.splitlines())


def test_pages_show_what_is_there(folder: Path, tmp_path: Path) -> None:
    write_stones(tmp_path / "stones", 3)
    Collection(tmp_path / "store").add(tmp_path / "stones", workers=0)
    (tmp_path / "stones" / "stone01.ply").unlink()
    page = tmp_path / "page.html"
    query = tmp_path / "stones" / "stone02.ply"
    for arguments, title in (
        (("search", tmp_path / "store", query), "Most like stone02.ply"),
        (("matrix", tmp_path / "store"), "How alike 3 shapes are"),
        (("groups", tmp_path / "store", "-n", 2), "3 shapes in 2 groups"),
    ):
        done = run(*arguments, "--report", page)
        assert done.exit_code == 0, done.output
        assert done.stdout.endswith(f"next: open {page} in a browser\n")
        assert "failed: " in done.stderr
        text = page.read_text(encoding="utf-8")
        assert f"<title>{title}</title>" in text
        assert "not drawn: " in text
        assert json_of(*arguments, "--report", page)["written"] == [str(page)]


def test_a_figure_tells_shapes_of_one_name_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names: list[str] = []
    monkeypatch.setattr("unbend.report.draw_distances", lambda shown, *_: names.extend(shown))
    for here in ("a/scan", "b/scan"):
        (tmp_path / here).mkdir(parents=True)
        write_stones(tmp_path / here, 1)[0].rename(tmp_path / here / "mesh.ply")
    write_stones(tmp_path / "b" / "scan", 2)
    with open(tmp_path / "b" / "scan" / "mesh.ply", "ab") as file:
        file.write(b"\n")
    store = tmp_path / "store"
    done = Collection(store).add([tmp_path / "a", tmp_path / "b"], workers=0)
    assert done.failures == ()
    assert run("matrix", store, "--figure", tmp_path / "all.png").exit_code == 0
    assert names == ["a/scan/mesh.ply", "b/scan/mesh.ply", "stone01"]


def test_matrix_and_groups(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = json_of("matrix", "shapes", "--csv", "table.csv", "--figure", "table.png")
    table = np.array(told["distances"])
    assert table.shape == (4, 4)
    np.testing.assert_array_equal(table, table.T)
    assert Path("table.png").read_bytes().startswith(b"\x89PNG")
    with open("table.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["path", *told["paths"]] == ["path", *(row[0] for row in rows)]
    np.testing.assert_allclose(np.array([row[1:] for row in rows], dtype=float), table)
    assert len(run("matrix", "shapes").stdout.splitlines()) == 5
    monkeypatch.setattr(compare, "_MOST_PRINTED", 3)
    many = "compared 4 shapes, too many to print"
    assert run("matrix", "shapes").stdout.startswith(f"{many}: add --csv OUT or --figure PNG\n")
    assert run("matrix", "shapes", "--csv", "table.csv").stdout.startswith(f"{many}\n")
    groups = json_of("groups", "shapes", "-n", 2, "--csv", "groups.csv")["groups"]
    assert sorted(path for group in groups for path in group) == sorted(told["paths"])
    with open("groups.csv", newline="") as file:
        assert {row["group"] for row in csv.DictReader(file)} == {"0", "1"}
    assert run("groups", "shapes", "-n", 1).stdout.startswith("group 0: 4\n  stones/")
    assert run("groups", "shapes").stdout.endswith(" stand out most\n")


def test_match(folder: Path) -> None:
    Path("pairs.csv").write_text("source, target\nstones/stone02.ply, stones/stone03.ply\n")
    line = ("match", "shapes", "--pairs", "pairs.csv", "-o", "matches", "--workers", 0)
    told = json_of(*line)
    assert (told["n_matched"], told["n_skipped"], told["failed"]) == (1, 0, [])
    (path,) = Path("matches").glob("stone02-stone03-*.npz")
    assert len(read_match(path).source_to_target) == 162
    assert run(*line).stdout.startswith("matched 0, there before 1, failed 0")
    run(*line, "--partial", "none")
    assert len(list(Path("matches").glob("stone02-stone03-*-none.npz"))) == 1


def test_export_and_remove(folder: Path, tmp_path: Path) -> None:
    Collection(tmp_path / "store").add("stones/stone00.ply", workers=0)
    assert json_of("export", tmp_path / "store", "-o", tmp_path / "all.csv")["n_rows"] == 1
    done = run("export", "shapes", "-o", "all.parquet")
    assert done.stdout.startswith("wrote 4 rows to all.parquet, one for each file\n")
    told = json_of("remove", tmp_path / "store", "stones/stone00.ply")
    assert (len(told["removed"]), told["n_shapes"]) == (1, 0)
    stones = write_stones(tmp_path / "stones", 3)
    Collection(tmp_path / "store").add(stones, workers=0)
    stones[1].unlink()
    assert run("remove", tmp_path / "store", "--missing").stdout.splitlines() == [
        f"removed {stones[1]}",
        f"{tmp_path / 'store'} has 2 shapes",
    ]
    assert "name the shapes to remove, or give --missing" in run("remove", "shapes").stderr


def test_a_page_or_figure_that_is_refused_leaves_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Collection("one").add(write_stones(tmp_path / "stones", 1), workers=0)
    before = sorted(tmp_path.iterdir())
    for line in (
        "matrix one --csv out.csv --figure out.png",
        "matrix one --csv out.csv --report out.html",
        "groups one --csv out.csv --report out.html",
    ):
        done = run(*line.split())
        assert done.exit_code == 2
        assert done.stderr == "error: a table of shapes needs two or more, not 1\n"
        assert sorted(tmp_path.iterdir()) == before


def test_a_page_of_too_many_shapes_is_refused_before_they_are_compared(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []

    def refuse(count: int) -> None:
        counts.append(count)
        raise InputError("too many")

    monkeypatch.setattr("unbend.report.check_count", refuse)
    monkeypatch.setattr(Collection, "search", None)
    done = run("search", "shapes", "stones/stone00.ply", "-n", 900, "--report", "out.html")
    assert (done.stderr, counts) == ("error: too many\n", [5])
    monkeypatch.setattr(Collection, "distances", None)
    for name in ("matrix", "groups"):
        done = run(name, "shapes", "--report", "out.html")
        assert (done.stderr, counts.pop()) == ("error: too many\n", 4)
    line = ["similarity", *["none.ply"] * 3, "--report", "out.html"]
    done = invoke(line)
    assert (done.stderr, counts) == ("error: too many\n", [5, 3])


def test_a_point_cloud_has_no_thumbnail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savetxt("cloud.xyz", make_sphere(2).vertices)
    Collection("clouds").add("cloud.xyz", workers=0)
    done = run("info", "clouds", "cloud.xyz", "--thumbnail", "cloud.png")
    assert done.exit_code == 2
    assert done.stderr == "error: cloud.xyz is a point cloud, of which no picture is kept\n"
    assert not Path("cloud.png").exists()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("search nowhere stones/stone00.ply", "there is no collection at nowhere: unbend coll"),
        ("search shapes nobody.ply", "cannot read nobody.ply: there is no such file"),
        ("remove shapes nobody.ply", "nobody.ply is not in the collection shapes: give a path"),
        ("add stones stones", "the folder stones holds other things"),
        ("info shapes --thumbnail a.png", "--thumbnail is the picture of one shape"),
        ("match shapes -o out", "give either --pairs PAIRS.csv or --all"),
        (
            "match shapes --pairs stones/stone00.ply -o out",
            'unknown suffix ".ply"; use .csv or .txt',
        ),
        ("match shapes --pairs bad.csv -o out", "bad.csv: there is no column source; the first"),
        ("matrix shapes --csv out.txt", 'unknown suffix ".txt"; use .csv'),
        ("matrix shapes --csv shapes/a.csv", "cannot write shapes/a.csv: the folder shapes is the"),
        ("groups shapes --report shapes/a.html", "shapes is the collection's alone; write else"),
        ("search shapes stones/stone00.ply --report shapes/a.html", "cannot write shapes/a.html"),
        ("info shapes stones/stone00.ply --thumbnail shapes/a.png", "cannot write shapes/a.png"),
        ("export shapes -o shapes/shapes.lance/a.csv", "cannot write shapes/shapes.lance/a.csv"),
        ("match shapes --all -o shapes/out", "cannot write shapes/out: the folder shapes is the"),
        (
            "register shapes --template absent.ply -o out",
            "there is no file absent.ply, and absent.ply is not in the collection shapes: give",
        ),
        ("register shapes --template stones/stone00.ply -o shapes", "cannot write shapes: the"),
        ("mean stones -o out", "stones holds no registered shapes, or not all yet: unbend coll"),
    ],
)
def test_mistakes_get_one_sentence(folder: Path, arguments: str, sentence: str) -> None:
    Path("bad.csv").write_text("one,other\n1,2\n")
    done = run(*arguments.split())
    assert done.exit_code == 2
    assert done.stderr.startswith("error: ")
    assert sentence in done.stderr
    assert not Path("out").exists()
