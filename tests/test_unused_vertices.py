"""Results are as without vertices that no face uses, wherever they are, and as without seams."""

import dataclasses
import functools
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import unbend
from forms import form_of
from sheets import cut_along_seam
from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.mesh import used_vertices, vertex_areas, vertex_normals
from unbend.mesh.decimation import decimate
from unbend.report.figures import draw_canonical_forms, save_figure
from unbend.report.match_figures import draw_match
from unbend.report.raster import thumbnail
from unbend.report.shape_figures import draw_form

pytestmark = pytest.mark.filterwarnings("ignore::unbend.errors.UnbendWarning")

FAR = {
    "not finite": [(np.nan,) * 3, (np.inf, -np.inf, 0.0)],
    "1e200": [(1e200, -1e200, 1e200)],
}


class Case:
    """Three blobs of other proportions.

    There may be unused vertices before the others, and copies of those on a seam behind them.
    """

    def __init__(self, blob: Mesh, far: Any = (), *, cut: bool = False) -> None:
        self.first, self.seam = len(far), np.arange(0)
        if cut:
            blob, self.seam = cut_along_seam(blob)
        front = np.reshape(far, (-1, 3))
        self.mesh, *self.others = (
            Mesh(np.concatenate([front, blob.vertices * [1, y, z]]), blob.faces + self.first)
            for y, z in ((1, 1), (1.1, 0.9), (0.9, 1.2))
        )
        self.other = self.others[0]
        self.rolled = self.map(np.roll(np.arange(200), 3))
        self.same = self.map(np.arange(200))

    def map(self, images: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(self.first, -1), images + self.first, images[self.seam]])

    def rows(self, values: Any) -> np.ndarray:
        """Rows of the vertices in use, which copies have, too."""
        rows = np.asarray(values)[self.first :]
        np.testing.assert_array_equal(rows[200:], rows[self.seam])
        return rows[:200]


def diagnosis(case: Case) -> Iterator[Any]:
    told = dataclasses.asdict(unbend.diagnose(case.mesh))
    for one in ("n_vertices", "unreferenced_vertices", "duplicate_vertices", "seam_vertices"):
        del told[one]
    yield repr(told)


def form(case: Case, **options: Any) -> Iterator[Any]:
    found = form_of(case.mesh, **options)
    yield from (case.rows(found.points), found.eigenvalues, found.stress, found.area)


def pose(case: Case) -> Iterator[Any]:
    yield case.rows(unbend.lay_into_pose(case.mesh, unbend.canonical_form(case.mesh)))


def laplacians(case: Case) -> Iterator[Any]:
    for kind in ("cotangent", "robust"):
        found = unbend.laplacian(case.mesh, laplacian=kind)
        yield from (found.stiffness.toarray()[-200:, -200:], found.areas[-200:])


def spectrum(case: Case) -> Iterator[Any]:
    found = unbend.spectrum(case.mesh, 12)
    yield from (found.eigenvalues, case.rows(found.eigenfunctions))
    values = unbend.canonical.interpolate(np.arange(5.0), np.arange(5) * 12 + case.first, found)
    yield case.rows(values)


def distances(case: Case) -> Iterator[Any]:
    for kind in ("biharmonic", "geodesic"):
        found = unbend.distance(case.mesh, [3 + case.first, 40 + case.first], distance=kind)
        yield case.rows(found.T)
        samples = unbend.farthest_point_sampling(case.mesh, 9, distance=kind)
        yield samples - case.first


def matched(case: Case) -> Iterator[Any]:
    found = unbend.match(case.mesh, case.other)
    yield from (case.rows(found.source_to_target) - case.first, found.confidence)


def errors(case: Case) -> Iterator[Any]:
    rows = np.arange(0, 200, 5) + case.first
    found = unbend.evaluate(case.rolled, case.mesh, rows, rows)
    yield from (found.direct, found.coverage)


def carried(case: Case) -> Iterator[Any]:
    values = case.map(np.arange(200)).astype(float)
    found = unbend.transfer(values, case.rolled, source=case.mesh, target=case.other)
    yield case.rows(found) - case.first
    yield case.rows(unbend.morph(case.mesh, case.other, case.same, 0.5).vertices)
    yield unbend.similarity(case.mesh, case.other, match=case.same)
    colors = unbend.report.match_colors(case.mesh, case.other, case.rolled)
    yield from (case.rows(one) for one in colors)


def registration(case: Case) -> Iterator[Any]:
    found = unbend.register(case.mesh, case.other, case.same)
    yield from (case.rows(found.mesh.vertices), case.rows(found.distances), found.coverage)


def mean(case: Case) -> Iterator[Any]:
    shapes = [unbend.register(case.mesh, one, case.same) for one in case.others]
    found = unbend.collection.mean_shape(shapes, case.mesh)
    yield from (case.rows(found.mean.vertices), found.statistics.variances, found.confidences)
    yield case.rows(found.statistics.variability)


def measures(case: Case) -> Iterator[Any]:
    yield unbend.collection.descriptor(case.mesh)
    yield case.rows(vertex_areas(case.mesh))
    yield case.rows(vertex_normals(case.mesh.vertices, case.mesh.faces))
    yield case.rows(used_vertices(case.mesh))
    yield thumbnail(case.mesh, 96)


def files(case: Case) -> Iterator[Any]:
    for suffix in ("off", "obj", "ply", "stl", "glb"):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"shape.{suffix}")
            unbend.write_mesh(path, case.mesh)
            if suffix != "glb":  # which is not read
                read = unbend.read_mesh(path)
                yield read.vertices[read.faces]


def pages(case: Case) -> Iterator[Any]:
    two, table = [case.mesh, case.other], np.array([[0, 1.0], [1, 0]])
    for page in (
        unbend.report.form_page(case.mesh, unbend.canonical_form(case.mesh)),
        unbend.report.match_page(*two, case.rolled),
        unbend.report.similarity_page(two, table),
        unbend.report.search_page(case.mesh, two, [0.0, 1.0]),
    ):
        (data,) = re.findall(r'id="data">(.*?)</script>', page.html)
        yield str(list(places_in(json.loads(data))))


def places_in(data: Any) -> Iterator[Any]:
    for key, one in data.items() if isinstance(data, dict) else enumerate(data):
        if key in ("places", "faces"):
            yield one
        elif isinstance(one, dict | list):
            yield from places_in(one)


def pictures(case: Case) -> Iterator[Any]:
    image = pytest.importorskip("matplotlib.image")
    found = unbend.canonical_form(case.mesh)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "picture.png")
        draw_form(case.mesh, found, path)
        yield image.imread(path)
        draw_match(case.mesh, case.other, case.rolled, path)
        yield image.imread(path)
        draw_canonical_forms([("a", case.mesh, found.points)], path)
        yield image.imread(path)
        save_figure(unbend.plot(case.mesh), path)
        yield image.imread(path)


CASES: dict[str, Callable[[Case], Iterator[Any]]] = {
    "diagnose": diagnosis,
    "canonical_form": form,
    "canonical_form, area": partial(form, weighting="area"),
    "sampled_canonical_form": partial(form, method="sampled", distance="geodesic"),
    "lay_into_pose": pose,
    "laplacian": laplacians,
    "spectrum, interpolate": spectrum,
    "distance, farthest_point_sampling": distances,
    "match": matched,
    "evaluate": errors,
    "transfer, morph, similarity, match_colors": carried,
    "register": registration,
    "mean_shape": mean,
    "descriptor and measures": measures,
    "write_mesh": files,
    "pages": pages,
    "figures": pictures,
}


# These keep a mesh cut open along its seams, or fit what they draw by all vertices.
LITERAL = (
    "laplacian",
    "spectrum, interpolate",
    "descriptor and measures",
    "write_mesh",
    "pages",
    "figures",
)


@pytest.fixture(scope="module")
def blob(blob: Mesh) -> Mesh:
    kept, faces, _ = decimate(blob.vertices, blob.faces, 200)
    return Mesh(blob.vertices[kept], faces)


@pytest.fixture(scope="module")
def without(blob: Mesh) -> Callable[[str], list[Any]]:
    """Results without unused vertices."""
    return functools.cache(lambda name: list(CASES[name](Case(blob))))


@pytest.mark.parametrize("far", [*FAR, "a seam"])
@pytest.mark.parametrize("name", CASES)
def test_results_are_as_without_them(
    blob: Mesh, without: Callable[[str], list[Any]], name: str, far: str
) -> None:
    if far == "a seam" and name in LITERAL:
        pytest.skip("is of the mesh as it is")
    case = Case(blob, FAR.get(far, ()), cut=far == "a seam")
    expected, found = without(name), list(CASES[name](case))
    assert len(found) == len(expected) > 0
    for one, other in zip(found, expected, strict=True):
        if isinstance(other, str | bytes):
            assert one == other
        else:
            largest = np.abs(np.nan_to_num(np.asarray(other, dtype=float))).max()
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-8 * largest)


@pytest.mark.parametrize("far", FAR)
def test_a_moebius_strip_stays_one_sided(moebius_strip: Mesh, far: str) -> None:
    vertices = np.concatenate([moebius_strip.vertices, FAR[far]])
    assert unbend.diagnose(Mesh(vertices, moebius_strip.faces)).one_sided


def test_rows_that_are_not_finite_are_nan() -> None:
    ball = make_sphere(1)
    mesh = Mesh(np.concatenate([ball.vertices, [[0, np.inf, 1]]]), ball.faces)
    assert np.isnan(mesh.vertices[-1]).all()
