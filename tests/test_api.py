"""The public names, as ``unbend/__init__.py`` has them, and what their users get wrong."""

import ast
import copy
import inspect
import pickle
import pydoc
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import unbend
from animals import dog
from unbend.alignment import procrustes
from unbend.canonical import interpolate
from unbend.collection import (
    Collection,
    Registered,
    find_groups,
    mean_shape,
    read_labels,
    retrieval_measures,
    shape_statistics,
    write_mean,
)
from unbend.correspondence import transfer_landmarks
from unbend.datasets import make_sphere, rest_map
from unbend.errors import (
    FileError,
    InputError,
    MeshError,
    MissingExtraError,
    SolverError,
    UnbendWarning,
    heard,
    warn,
)
from unbend.io import (
    invert_map,
    read_markup_pairs,
    value_colors,
    write_markups,
    write_values,
)
from unbend.report import (
    draw_canonical_forms,
    draw_distances,
    draw_form,
    draw_similarities,
    form_page,
    match_page,
    pattern_colors,
    search_page,
    similarity_page,
    view,
)

BALL = make_sphere(2)
N = BALL.n_vertices
SOUP = unbend.Mesh(
    np.tile(BALL.vertices, (9, 1)), np.vstack([BALL.faces + N * i for i in range(9)])
)
EVERY = np.arange(N)
RAGGED = [[1, 2], [3]]
MATCH = unbend.Match(EVERY, EVERY, np.eye(4), 1.0, 1.0)
# The same vertices and more: every vertex that a map onto BALL names is there.
LARGER = unbend.Mesh(np.vstack([BALL.vertices, [[2, 2, 2]]]), BALL.faces, name="larger")
FORM = unbend.canonical_form(BALL)
TABLE = np.ones((3, 3)) - np.eye(3)
FORMS = np.stack([BALL.vertices * scale for scale in (1, 2, 3)])


def similar(areas: object) -> float:
    return unbend.similarity(BALL, BALL, match=EVERY, areas=areas)


def test_help_is_readable() -> None:
    assert "source: 'MeshLike', target: 'MeshLike'" in str(inspect.signature(unbend.match))
    for name in unbend._FOLDERS:
        module = getattr(unbend, name)
        told = pydoc.plain(pydoc.render_doc(module))
        public = getattr(module, "__all__", ())
        assert name == "errors" or public
        assert all(one in told for one in public)


# None in sys.modules: the import fails as where the package is not installed.
CORE_INSTALL = """
import inspect, sys
optional = "sklearn matplotlib pygeodesic pooch lancedb dask distributed"
for package in [*optional.split(), "pyarrow"]:
    sys.modules[package] = None
import unbend
names = dict(inspect.getmembers(unbend))
assert set(unbend.__all__) <= set(names)
starred = {}
exec("from unbend import *", starred)
assert set(unbend.__all__) <= set(starred)
assert unbend.canonical.SpectralMDS.__doc__
try:
    unbend.canonical.SpectralMDS(n_components=2)
except unbend.errors.MissingExtraError as error:
    assert str(error) == "scikit-learn is needed for this: pip install scikit-learn"
else:
    raise AssertionError("nothing was raised")
"""


def test_every_public_name_can_be_had_from_a_core_install():
    subprocess.run([sys.executable, "-W", "error", "-c", CORE_INSTALL], check=True)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda out: interpolate([1.0], [0], BALL), "needs a Spectrum, not Mesh"),
        (
            lambda out: unbend.write_mesh(out, BALL, scalars=np.eye(2)),
            "scalars must be a dictionary",
        ),
        (lambda out: similarity_page([BALL] * 2, "12"), "values: needs real numbers"),
        (lambda out: search_page(BALL, [BALL], ["1"]), "values: needs real numbers"),
        (lambda out: unbend.spectrum(BALL, "5"), "number of eigenpairs must be"),
        (lambda out: unbend.spectrum(BALL, 5, tolerance="x"), "tolerance must be at least 0"),
        (lambda out: unbend.spectrum(BALL, 5, tolerance=None), "not None"),
        (lambda out: unbend.distance(BALL, 0, distance="diffusion", time="x"), "time must be pos"),
        (lambda out: unbend.farthest_point_sampling(BALL, "3"), "number of samples must be"),
        (lambda out: interpolate([1], [0], unbend.spectrum(BALL, 3), mu="1"), "mu must be"),
        (lambda out: unbend.match(BALL, BALL, n_eigenpairs="9"), "n_eigenpairs must be a whole"),
        (lambda out: unbend.match(BALL, BALL, landmarks=RAGGED), "landmarks: rows have different"),
        (lambda out: unbend.symmetry(BALL, n_eigenpairs="9"), "n_eigenpairs must be a whole"),
        (lambda out: unbend.similarity(BALL, BALL, n_components=None), "n_components must be"),
        (lambda out: unbend.align(RAGGED, FORMS[0]), "source points: rows have different lengths"),
        (lambda out: unbend.align("ab", FORMS[0]), "source points: needs real numbers, not <U2"),
        (lambda out: unbend.align(FORMS[0], FORMS[0] * 1j), "target points: needs real numbers"),
        (
            lambda out: unbend.align(FORMS[0], FORMS[0], tolerance="x"),
            "tolerance must be at least 0",
        ),
        (
            lambda out: unbend.align(*FORMS[:2]).apply(FORMS[0][:, :2]),
            "points must have shape (m, 3)",
        ),
        (lambda out: unbend.align(*FORMS[:2]).apply("x"), "points: needs real numbers"),
        (lambda out: unbend.spectral.use_cache(gib="x").__enter__(), "gib must be a number"),
        (lambda out: procrustes(FORMS[0], np.ma.masked_less(FORMS[0], 0)), "are masked"),
        (lambda out: procrustes(FORMS[0], FORMS[0], weights="x"), "weights: needs real"),
        (lambda out: unbend.morph(BALL, BALL, EVERY, "x"), "t must be a finite number, not 'x'"),
        (lambda out: unbend.morph(BALL, BALL, EVERY, np.array([0.5])), "t must be a finite numb"),
        (lambda out: unbend.morph(BALL, LARGER, MATCH, 0.5), "162 target vertices, but larger has"),
        (lambda out: unbend.register(BALL, LARGER, MATCH), "162 target vertices, but larger has"),
        (lambda out: unbend.evaluate(MATCH, LARGER, [0], [0]), "target vertices, but larger has"),
        (lambda out: unbend.transfer(5, MATCH), "one value to carry"),
        (lambda out: unbend.transfer(RAGGED, MATCH), "values: rows have different lengths"),
        (lambda out: invert_map(RAGGED, BALL), "a map: rows have different lengths"),
        (lambda out: shape_statistics([FORMS[0], FORMS[0][:5]]), "shapes: rows have diff"),
        (lambda out: shape_statistics([BALL, BALL]), "shapes: needs real numbers"),
        (lambda out: shape_statistics(FORMS).at(0, "x"), "deviations must be a number"),
        (lambda out: retrieval_measures(["a", "b"], TABLE), "distances: needs real numbers"),
        (lambda out: retrieval_measures(TABLE, None), "labels must be lists, with one"),
        (lambda out: retrieval_measures(TABLE, TABLE), "labels must be lists, with one"),
        (lambda out: find_groups(TABLE, 2.5), "from 1 to 3, the number of shapes, not 2.5"),
        (lambda out: find_groups(RAGGED), "distances: rows have different lengths"),
        (lambda out: unbend.write_mesh(out, BALL, scalars={3: EVERY}), "3 cannot name values"),
        (lambda out: unbend.write_mesh(out, BALL, scalars={"a": ["x"] * N}), "scalars 'a': needs"),
        (lambda out: unbend.write_mesh(out, BALL, uvs="x"), "uvs: needs real numbers"),
        (lambda out: unbend.write_mesh(out, BALL, colors=RAGGED), "colors: rows have different"),
        (lambda out: write_values(out, EVERY, BALL, kind="auto"), "kind must be one of scalar"),
        (lambda out: write_values(out, RAGGED, BALL), "values: rows have different"),
        (lambda out: write_values(out.with_suffix(".csv"), [None] * N, BALL), "of type object"),
        (lambda out: write_values(out.with_suffix(".csv"), EVERY * 1j, BALL), "type complex128"),
        (lambda out: write_values(out, np.ma.masked_less(EVERY, 9), BALL), "some are masked"),
        (lambda out: value_colors(np.ma.masked_less(EVERY, 9)), "values: some are masked"),
        (lambda out: pattern_colors(np.ma.masked_less(FORMS[0], 0)), "vertices: some are masked"),
        (
            lambda out: draw_canonical_forms([("a", BALL, np.ma.masked_less(FORMS[0], 0))], out),
            "the canonical form of 'a': some are masked",
        ),
        (lambda out: write_values(out, EVERY, BALL, kind="color"), "colors must be whole numbers"),
        (lambda out: write_values(out.with_suffix(".obj"), ["a"] * N, BALL), "values: needs real"),
        (lambda out: write_values(out, EVERY + 2**53, BALL), "must be below 2^53"),
        (lambda out: unbend.write_map(out.with_suffix(".txt"), RAGGED), "a map: rows have"),
        (lambda out: unbend.write_map(out.with_suffix(".txt"), [1], base=1.0), "base must be 0 or"),
        (lambda out: unbend.write_match(out.with_suffix(".npz"), EVERY), "a ndarray is no Match"),
        (lambda out: unbend.match(np.empty((0, 3)), BALL), "source: there are no vertices"),
        (lambda out: view(np.empty((0, 3))), "mesh: there are no vertices"),
        (lambda out: view(dog(n_vertices=500)), "a Shape is not a mesh, but has one: give its .m"),
        (
            lambda out: unbend.canonical_form(BALL, random_state=None),
            "random_state must be a whole",
        ),
        (lambda out: unbend.align(EVERY.astype("M8[D]"), FORMS[0]), "needs real numbers, not dat"),
        (lambda out: similar(np.ones((3, N))), "areas must be those of the model, then those of"),
        (lambda out: similar(["x"] * 2), "areas: needs real numbers"),
        (lambda out: rest_map(BALL, BALL), "rest_map needs two Shapes, not Mesh"),
        (lambda out: mean_shape([BALL, BALL], BALL), "needs Registrations, not Mesh"),
        (lambda out: form_page(BALL, FORM, posed=FORMS[0][:, :2]), "posed must be places of shape"),
        (
            lambda out: draw_form(BALL, FORM, out.with_suffix(".png"), posed=0),
            "posed must be places",
        ),
        (lambda out: match_page(BALL, BALL, EVERY, truth=[EVERY]), "truth must be 2 or 3 lists"),
        (lambda out: draw_distances("ab", TABLE[:2, :2] + np.inf, out.with_suffix(".png")), "fini"),
        (lambda out: draw_distances("abc", np.triu(TABLE), out.with_suffix(".png")), "symmetric"),
        (lambda out: draw_similarities("ab", [["x"] * 2] * 2, out), "needs real numbers"),
        (lambda out: read_markup_pairs(["a.fcsv"], BALL, BALL), "two meshes need two files, not 1"),
        (
            lambda out: write_markups(out.with_suffix(".json"), BALL, [0, 1], "ab"),
            "labels must be a",
        ),
        (lambda out: write_markups(out.with_suffix(".json"), BALL, [0], {"a"}), "must be a list"),
        (lambda out: transfer_landmarks({"a", "b"}, [0, 1], EVERY, BALL), "labels must be a list"),
        (lambda out: transfer_landmarks("ab", [0, 1], EVERY, BALL), "must be a list, not 'ab'"),
        (lambda out: read_markup_pairs("ab", BALL, BALL), "two meshes must be a list, not 'ab'"),
        (
            lambda out: unbend.Mesh(BALL.vertices, BALL.faces, notes="scaled"),
            "notes must be a list, not 'scaled'",
        ),
        (lambda out: unbend.read_mesh(b"ball.ply"), "a path is needed, not bytes"),
        (lambda out: unbend.read_mesh(BALL), "a path is needed, not Mesh"),
        (lambda out: unbend.write_mesh(BALL, out), "a path is needed, not Mesh"),
        (lambda out: unbend.write_map(EVERY, out), "a path is needed, not ndarray"),
        (lambda out: write_values(EVERY, out, BALL), "a path is needed, not ndarray"),
        (lambda out: read_labels(None, []), "a path is needed, not NoneType"),
        (lambda out: Collection(BALL), "a path is needed, not Mesh"),
        (lambda out: Collection(out).add(None), "shapes are given by their paths, not None"),
        (lambda out: Collection(out).add([BALL]), "a path is needed, not Mesh"),
        (lambda out: Collection(out).remove(5), "shapes are given by their paths, not 5"),
        (lambda out: unbend.read_map(out, n_source="162"), "n_source must be a whole number"),
        (lambda out: unbend.read_map(out, n_target=np.nan), "n_target must be a whole number"),
        (lambda out: unbend.io.read_values(out, n_vertices="162"), "n_vertices must be a whole"),
        (lambda out: mean_shape(None, BALL), "registrations must be a list, not None"),
        (lambda out: write_mean(out, None), "needs a MeanShape, not a NoneType"),
        (lambda out: view(BALL, BALL, [[1, 2], [3]]), "landmarks: rows have different lengths"),
        (lambda out: similarity_page(None, TABLE), "shapes must be a list, not None"),
        (
            lambda out: unbend.farthest_point_sampling(BALL, 5, start=[[1, 2], [3]]),
            "start: rows have different lengths",
        ),
        (lambda out: write_markups(out.with_suffix(".json"), BALL, [0], [None]), "a list of text"),
    ],
)
def test_a_wrong_argument_gets_a_sentence(
    call: Callable[[Path], object], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as caught:
        call(tmp_path / "out.ply")
    assert sentence in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_completion_offers_public_names_only() -> None:
    public = [name for name in dir(unbend) if not name.startswith("_")]
    assert public == sorted({*unbend.__all__, *unbend._FOLDERS})


def test_type_checkers_see_no_module_that_takes_any_name() -> None:
    """They accept every attribute of a module with a ``__getattr__``, misspelled ones too."""
    for path in Path(unbend.__file__).parent.rglob("*.py"):
        body = ast.parse(path.read_bytes()).body
        assert "__getattr__" not in [getattr(one, "name", None) for one in body], path


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "u8", ">i4", "i8"])
def test_maps_may_be_whole_numbers_of_any_type(dtype: str, tmp_path: Path) -> None:
    point_map = EVERY.astype(dtype)
    np.testing.assert_array_equal(invert_map(point_map, BALL), EVERY)
    np.testing.assert_array_equal(unbend.transfer(EVERY, point_map, target=BALL), EVERY)
    assert unbend.evaluate(point_map, BALL, EVERY[:2], EVERY[:2]).mean() == 0
    assert unbend.similarity(BALL, BALL, match=point_map) == pytest.approx(1)
    unbend.write_map(tmp_path / "map.vts", point_map)
    np.testing.assert_array_equal(unbend.read_map(tmp_path / "map.vts"), EVERY)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_mesh_stays_read_only_however_it_is_copied(again: Callable) -> None:
    mesh = again(BALL)
    np.testing.assert_array_equal(mesh.vertices, BALL.vertices)
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_a_result_is_told_in_a_few_lines() -> None:
    for result in (
        unbend.laplacian(BALL),
        unbend.spectrum(BALL, 5),
        unbend.canonical_form(BALL),
        unbend.align(BALL.vertices, BALL.vertices),
        unbend.evaluate(EVERY, BALL, EVERY, EVERY),
        retrieval_measures(np.arange(16.0).reshape(4, 4), [0, 0, 1, 1]),
        dog(n_vertices=500),
        Registered(9, 0, ("shape",) * 9, ("failure",) * 9, 1.0),
    ):
        told = repr(result)
        assert told.startswith(f"{type(result).__name__}(")
        assert len(told) < 400
        assert "array" not in told


def test_a_result_tells_how_large_its_arrays_are() -> None:
    n = BALL.n_vertices
    assert repr(unbend.spectrum(BALL, 5)) == (
        f"Spectrum(eigenvalues=<5>, eigenfunctions=<{n} x 5>, areas=<{n}>, "
        "laplacian='cotangent', notes=())"
    )
    assert "component_vertices=<9>, component_faces=<9>" in repr(unbend.diagnose(SOUP))


@pytest.mark.parametrize(
    "error",
    [MissingExtraError("dask", "distributed"), FileError("a"), MeshError("a"), SolverError("a")],
)
def test_errors_travel_between_processes(error: Exception) -> None:
    assert repr(pickle.loads(pickle.dumps(error))) == repr(error)


def test_a_warning_points_to_the_line_that_called_unbend() -> None:
    ball = make_sphere(2)
    two = np.vstack([ball.vertices, ball.vertices + 9])
    faces = np.vstack([ball.faces[:50], ball.faces + ball.n_vertices])
    with pytest.warns(UnbendWarning) as told:
        unbend.match((two, faces), ball, refine=False)
    with pytest.warns(UnbendWarning) as also_told:
        unbend.canonical_form((two, faces), component="largest")
    assert {one.filename for one in [*told, *also_told]} == {__file__}


def test_warnings_are_heard_in_their_own_thread() -> None:
    """Also if the thread that began to listen first is the first to end."""
    began, go_on = threading.Event(), threading.Event()

    def listen() -> list[str]:
        with heard() as said:
            began.set()
            go_on.wait()
            warn("theirs")
        return said

    with ThreadPoolExecutor(1) as thread:
        with heard() as said:
            listening = thread.submit(listen)
            began.wait()
            warn("ours")
        go_on.set()
        assert listening.result() == ["theirs"]
    assert said == ["ours"]
    with pytest.warns(UnbendWarning, match="nobody's"):
        warn("nobody's")
