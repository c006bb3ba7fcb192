"""Maps, values, landmarks and labels that are damaged."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .case import Case, Refused
from .good import Command, beside, in_turn, npy

_N = 42  # vertices of good.off

_Row = tuple[str, str, str | bytes, str]


def cases() -> Iterator[Case]:
    """Give a case for each damaged table."""
    for commands, rows in (
        (_using_map, (*_maps(), *_lists_of_vertices())),
        (_using_truth, _truths()),
        (_using_values, _values()),
        (_using_landmarks, _landmarks()),
        (_using_markups, _markups()),
        (_using_points, _points()),
        (_using_labels, _labels()),
    ):
        for i, row in enumerate(rows):
            yield _case(i, commands, row)


def _case(i: int, commands: Callable[[str], tuple[Command, ...]], row: _Row) -> Case:
    name, suffix, content, sentence = row
    data = content.encode() if isinstance(content, str) else content

    def make(folder: Path) -> None:
        beside(folder)
        (folder / f"bad{suffix}").write_bytes(data)

    bad = f"bad{suffix}"
    return Case(name, make, in_turn(commands(bad), i), Refused(sentence, names=bad))


def _using_map(name: str) -> tuple[Command, ...]:
    """Give every command that reads a map, with this one."""
    return (
        f"transfer good.off good.off --map {name} --values values.csv -o out.csv",
        f"register good.off good.off --map {name} -o out.ply",
        f"evaluate {name} good.off truth.txt truth.txt",
    )


def _using_truth(name: str) -> tuple[Command, ...]:
    evaluate = "evaluate map.txt good.off truth.txt"
    return (
        f"{evaluate} {name}",
        f"{evaluate} truth.txt --mirrored-truth {name}",
        "match good.off good.off --no-refine --report out.html --no-cache "
        f"--truth truth.txt {name}",
    )


def _using_values(name: str) -> tuple[Command, ...]:
    transfer = f"transfer good.off good.off --map map.txt --values {name} -o"
    return tuple(f"{transfer} out{suffix}" for suffix in (".npy", ".csv", ".txt"))


def _using_landmarks(name: str) -> tuple[Command, ...]:
    return (f"match good.off good.off --landmarks {name} -o out.npz --no-cache",)


def _using_points(name: str) -> tuple[Command, ...]:
    return (
        f"match good.off good.off --landmarks {name} --landmarks {name} -o out.npz --no-cache",
        f"view good.off --landmarks {name} -o out.html --no-open",
    )


def _using_markups(name: str) -> tuple[Command, ...]:
    return (
        f"match good.off good.off --landmarks {name} --landmarks {name} -o out.npz --no-cache",
        f"transfer good.off good.off --map map.txt --values {name} -o out.mrk.json",
    )


def _using_labels(name: str) -> tuple[Command, ...]:
    return (f"collection evaluate STORE {name}",)


def _lines(*rows: object) -> str:
    return "".join(f"{row}\n" for row in rows)


_MAP = [str(i) for i in range(_N)]


def _maps() -> Iterator[_Row]:
    yield "map, empty", ".txt", "", "is empty"
    yield "map, comments only", ".txt", "# a map\n", "holds no rows"
    yield "map, a header only", ".csv", "target_vertex\n", "holds no rows"
    yield "map, words", ".txt", _lines(*_MAP[:-1], "tail"), "row 41 holds 'tail'"
    yield "map, two columns", ".txt", _lines(*_MAP[:-1], "1 2"), "row 41 holds '1 2'"
    yield "map, a fraction", ".txt", _lines(*_MAP[:-1], "1.5"), "row 41 is 1.5"
    yield "map, NaN", ".txt", _lines(*_MAP[:-1], "nan"), "row 41 is nan"
    yield "map, infinity", ".txt", _lines(*_MAP[:-1], "-inf"), "row 41 is -inf"
    yield "map, beyond the last vertex", ".txt", _lines(*_MAP[:-1], _N), "row 41 is 42"
    yield "map, -2", ".txt", _lines(*_MAP[:-1], -2), "row 41 is -2"
    yield "map, a number of 400 digits", ".txt", _lines(*_MAP[:-1], "9" * 400), "row 41 is inf"
    yield "map, counted from 0 where 1 is meant", ".vts", _lines(*_MAP), "does the file count"
    yield "map, noise", ".txt", bytes(range(256)), "binary data"
    yield "map, Latin-1", ".txt", "é\n".encode("latin-1") * _N, "row 0 holds"
    yield "map, an unknown suffix", ".map", _lines(*_MAP), "unknown suffix"


def _lists_of_vertices() -> Iterator[_Row]:
    yield "map as .npy, two axes", ".npy", npy(np.zeros((_N, 1), int)), "list of vertex numbers"
    yield "map as .npy, no axis", ".npy", npy(np.array(3)), "list of vertex numbers"
    yield "map as .npy, no rows", ".npy", npy(np.zeros(0, int)), "holds no rows"
    yield "map as .npy, words", ".npy", npy(np.array(_MAP)), "list of vertex numbers"
    yield "map as .npy, fractions", ".npy", npy(np.arange(_N) + 0.5), "row 0 is 0.5"
    yield "map as .npy, cut off", ".npy", npy(np.arange(_N))[:-1], "truncated"
    yield "map as .npy, 2^63", ".npy", npy(np.full(_N, 2**63, np.uint64)), "row 0 is 9223372036"
    objects = np.array([{}], dtype=object)
    yield "map as .npy, pickled", ".npy", npy(objects, pickled=True), "not numbers or text"


def _truths() -> Iterator[_Row]:
    yield "truth, empty", ".vts", "", "is empty"
    yield "truth, fewer rows", ".txt", _lines(*_MAP[:-1]), "holds 41 rows, but truth.txt 42"
    yield "truth, beyond the last vertex", ".txt", _lines(*_MAP[:-1], 99), "row 41 is 99"
    yield "truth, words", ".csv", _lines("image", *_MAP[:-1], "x"), "row 41 holds 'x'"


def _values() -> Iterator[_Row]:
    numbers = [str(i / 4) for i in range(_N)]
    yield "values, empty", ".csv", "", "is empty"
    yield "values, comments only", ".txt", "# none\n", "holds no rows"
    yield "values, fewer rows", ".csv", _lines(*numbers[:-1]), "41 rows|42 vertices"
    yield "values, more rows", ".txt", _lines(*numbers, 1, 2), "44 rows"
    yield "values, rows of several lengths", ".csv", _lines(*numbers[:-1], "1,2"), "row 41 has 2 en"
    yield "values, words among numbers", ".csv", _lines(*["1,x"] * _N), "row 0 holds '1 x'"
    yield "values, decimal commas", ".txt", _lines(*["0,5"] * _N), "row 0 holds '0,5'"
    columns = _lines("height", *["0,523"] * _N)
    yield "values, decimal commas in .csv", ".csv", columns, "row 0 holds '0,523'"
    yield "values, a row missing below a name", ".csv", _lines("part", *_MAP[1:]), "41 rows"
    order = _lines("nr,height", *(f"{i},0.5" for i in reversed(range(_N))))
    yield "values, vertex numbers of no name", ".csv", order, "name it vertex"
    yield "values, semicolons", ".csv", _lines(*["0.5;7"] * _N), "row 0 holds '0.5;7'"
    yield "values, whole numbers of 30 digits", ".csv", _lines(*["9" * 30] * _N), "row 0 holds '999"
    yield "values, a word of a million letters", ".txt", _lines(*["a"] * 41, "b" * 10**6), "row 41"
    yield (
        "values, a CSV cell of a million letters",
        ".csv",
        "a" * 10**6 + "\n1\n",
        "not a table in CSV",
    )
    yield "values, noise", ".csv", bytes(range(256)) * 9, "binary data"
    yield "values as .npy, no axis", ".npy", npy(np.array(1.0)), "holds no rows"
    yield "values as .npy, fewer rows", ".npy", npy(np.zeros(7)), "7 rows"
    yield "values as .npy, cut off", ".npy", npy(np.zeros(_N))[:-1], "truncated"
    yield "values as .npy, a structure", ".npy", npy(np.zeros(_N, "i4,i4")), "not numbers"
    objects = np.array([{}] * _N, dtype=object)
    yield "values as .npy, pickled", ".npy", npy(objects, pickled=True), "not numbers or text"

    yield (
        "values, a vertex twice",
        ".csv",
        _lines("vertex,part", "0,a", "0,b"),
        "row 1 holds vertex",
    )
    yield "values, a vertex missing", ".csv", _lines("vertex,part", "1,a"), "no row of vertex 0"
    many = "ply\nformat ascii 1.0\nelement vertex 99999999\nproperty float x\nproperty float y\n"
    few = many.replace("99999999", "1") + "property float z\nend_header\n0 0 0\n"
    yield (
        "values as .ply, of millions",
        ".ply",
        f"{many}property float z\nend_header\n",
        "truncated",
    )
    yield "values as .ply, none", ".ply", few, "holds no values per vertex"


def _landmarks() -> Iterator[_Row]:
    yield "landmarks, empty", ".csv", "", "is empty"
    yield "landmarks, a header only", ".csv", "source,target\n", "holds no landmarks"
    yield "landmarks, one column", ".csv", "1\n2\n", "row 0 holds '1'"
    yield "landmarks, three columns", ".csv", "1,2,3\n", "row 0 holds '1 2 3'"
    yield "landmarks, of one mesh", ".csv", "label,vertex\n1,5\n", "landmarks are pairs"
    yield "landmarks, words", ".csv", "1,2\nnose,tail\n", "row 1 holds 'nose tail'"
    yield "landmarks, a fraction", ".txt", "1.5 2\n", "row 0 holds '1.5 2'"
    yield "landmarks, negative", ".csv", "1,2\n-1,3\n", "row 1 holds '-1 3'"
    yield "landmarks, beyond the last vertex", ".csv", "1,2\n3,42\n", "row 1 names vertex 42"
    yield "landmarks, a number of 30 digits", ".csv", f"1,{'9' * 30}\n", "row 0 holds '1 999"
    yield "landmarks, noise", ".csv", bytes(range(256)), "binary data"
    yield "landmarks, an unknown suffix", ".xls", "1,2\n", "unknown suffix"


def _markups() -> Iterator[_Row]:
    far = '{"markups": [{"controlPoints": [{"label": "nose", "position": [9, 9, 9]}]}]}'
    damaged = "not a landmark file of 3D Slicer"
    yield "points of 3D Slicer, empty", ".json", "", "is empty"
    yield "points of 3D Slicer, none", ".json", '{"markups": []}', "holds no points"
    yield "points of 3D Slicer, far away", ".json", far, "'nose' is 1.* from good.off"
    yield "points of 3D Slicer, words", ".json", far.replace("[9, 9, 9]", '["a", 1, 2]'), damaged
    yield "points of 3D Slicer, two numbers", ".json", far.replace("[9, 9, 9]", "[1, 2]"), damaged
    yield "points of 3D Slicer, deep", ".json", "[" * 10**6, damaged
    yield "points of 3D Slicer, an old file cut off", ".fcsv", "1,0,0,0\n", damaged


def _points() -> Iterator[_Row]:
    commas = "x;y;z\n0,5;1;2\n"
    yield "points in a table, empty", ".csv", "", "is empty"
    yield "points in a table, a header only", ".csv", "x,y,z\n", "holds no points"
    yield "points in a table, decimal commas", ".csv", commas, "with decimal points"
    yield "points in a table, two numbers", ".txt", "1 2\n", "row 0 holds '1 2'"
    yield "points in a table, far away", ".pts", "Version 1.0\n1\nS000 9 9 9\n", "'S000' is 1"
    yield "points in a table, noise", ".csv", bytes(range(256)), "binary data"


def _labels() -> Iterator[_Row]:
    yield "labels, empty", ".csv", "", "is empty"
    yield "labels, another column", ".csv", "path,name\nstone0.off,a\n", "no column label"
    yield "labels, of no shape", ".csv", "path,label\nnowhere.off,a\n", "line 2: nowhere.off is no"
    yield "labels, an empty one", ".csv", "path,label\nstone0.off,\n", "line 2 has no label"
    yield (
        "labels, two for one shape",
        ".csv",
        "path,label\nstone0.off,a\nstone0.off,b\n",
        "line 3 labels",
    )
    yield "labels, Latin-1", ".csv", "path,label\nstone0.off,é\n".encode("latin-1"), "bad.csv"
    yield "labels, noise", ".csv", bytes(range(256)), "bad.csv"
    long = f"path,label\nstone0.off,{'a' * 10**6}\n"
    yield "labels, a cell of a million letters", ".csv", long, "bad.csv"
