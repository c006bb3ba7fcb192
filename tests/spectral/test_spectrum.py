import contextlib
import tracemalloc
import warnings

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.spatial.transform
from hypothesis import given
from hypothesis import strategies as st

from dense import eigenpairs as dense_eigenpairs
from sheets import make_blob
from tests.linalg.problems import square
from unbend import Mesh, laplacian, spectrum
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import InputError, SolverError, UnbendWarning
from unbend.linalg.signs import fix_basis, fix_signs
from unbend.spectral import Laplacian, _spectrum, eigenpairs, make_surface, use_cache
from unbend.spectral._assembly import assemble_stiffness
from unbend.spectral._spectrum import whole_eigenpairs

pytestmark = pytest.mark.usefixtures("no_cache")


def test_sphere_has_l_times_l_plus_one():
    values = spectrum(make_sphere(5), 36).eigenvalues
    expected = np.concatenate([np.full(2 * order + 1, order * (order + 1)) for order in range(6)])
    assert values[0] == 0
    np.testing.assert_allclose(values[1:], expected[1:], rtol=3e-3)


def test_flat_torus_has_its_lattice():
    """Edges of length 1/side on a periodic grid: right triangles, cotangents 1, 1 and 0."""
    side = 64
    i, j = (x.ravel() for x in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))

    def vertex(a, b):
        return (i + a) % side * side + (j + b) % side

    lower = np.stack([vertex(1, 0), vertex(1, 1), vertex(0, 0)], axis=1)
    upper = np.stack([vertex(0, 1), vertex(0, 0), vertex(1, 1)], axis=1)
    faces = np.concatenate([lower, upper])
    half_cotangents = np.tile([0.0, 0.5, 0.5], (len(faces), 1))
    torus = Laplacian(
        assemble_stiffness(faces, half_cotangents, side**2),
        np.full(side**2, side**-2.0),
        "cotangent",
    )
    k = 21
    wave = np.fft.fftfreq(side, 1 / side)
    lattice = np.sort((4 * np.pi**2 * (wave[:, None] ** 2 + wave**2)).ravel())[:k]
    found = whole_eigenpairs(torus, k + 1, 1e-8)[0]  # the last of them is the first of four
    np.testing.assert_allclose(found, lattice, rtol=7e-3, atol=1e-12)


def test_agrees_with_a_dense_solver(blob):
    operator = laplacian(blob)
    values, functions = dense_eigenpairs(operator)
    found = spectrum(blob, 40)
    np.testing.assert_allclose(found.eigenvalues, values[:40], rtol=1e-9, atol=1e-12)
    overlap = functions[:, :40].T @ (operator.areas[:, None] * found.eigenfunctions)
    np.testing.assert_allclose(abs(overlap), np.eye(40), atol=1e-6)


def test_is_area_orthonormal_and_starts_with_the_constant(blob):
    found = spectrum(blob, 30)
    gram = found.eigenfunctions.T @ (found.areas[:, None] * found.eigenfunctions)
    np.testing.assert_allclose(gram, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(found.eigenfunctions[:, 0], found.areas.sum() ** -0.5, rtol=1e-12)
    assert (np.diff(found.eigenvalues) > -1e-9).all()


BLOB = make_blob(2)


@pytest.fixture(scope="module")
def before():
    with use_cache(gib=0):
        return spectrum(BLOB, 8)


@given(
    rotation=st.integers(0, 2**32 - 1),
    shift=st.floats(-100, 100),
    scale=st.floats(1e-3, 1e3),
)
def test_rigid_motion_and_scale_change_nothing_but_units(before, rotation, shift, scale):
    turn = scipy.spatial.transform.Rotation.random(rng=rotation).as_matrix()
    moved = Mesh(scale * (BLOB.vertices @ turn.T) + scale * shift, BLOB.faces)
    after = spectrum(moved, 8)
    np.testing.assert_allclose(
        after.eigenvalues * scale**2, before.eigenvalues, rtol=1e-7, atol=1e-9
    )
    np.testing.assert_allclose(after.eigenfunctions * scale, before.eigenfunctions, atol=1e-5)


@given(seed=st.integers(0, 2**32 - 1))
def test_permuting_vertices_permutes_eigenfunctions(before, seed):
    order = np.random.default_rng(seed).permutation(BLOB.n_vertices)
    permuted = Mesh(BLOB.vertices[order], np.argsort(order)[BLOB.faces])
    after = spectrum(permuted, 8)
    np.testing.assert_allclose(after.eigenvalues, before.eigenvalues, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(after.eigenfunctions, before.eigenfunctions[order], atol=1e-6)


def test_every_eigenpair_of_a_tiny_mesh():
    tetrahedron = Mesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
    found = spectrum(tetrahedron, 4)
    np.testing.assert_allclose(
        found.eigenvalues, dense_eigenpairs(laplacian(tetrahedron))[0], atol=1e-12
    )


def test_two_components_have_two_zeros(blob):
    both = Mesh(
        np.vstack([blob.vertices, blob.vertices + 10]),
        np.vstack([blob.faces, blob.faces + blob.n_vertices]),
    )
    found, one = spectrum(both, 8), spectrum(blob, 4)
    np.testing.assert_array_equal(found.eigenvalues[:2], 0)
    np.testing.assert_allclose(found.eigenvalues[2::2], one.eigenvalues[1:4], rtol=1e-8)
    assert np.ptp(found.eigenfunctions[:, 0]) < 1e-12
    assert np.ptp(found.eigenfunctions[: blob.n_vertices, 1]) < 1e-12


def test_unreferenced_vertices_have_no_area_and_no_values(blob):
    extended = Mesh(np.vstack([blob.vertices, [[50, 0, 0]]]), blob.faces)
    with pytest.warns(UnbendWarning, match="1 unreferenced vertex"):
        found = spectrum(extended, 6)
    assert np.isnan(found.eigenfunctions[-1]).all()
    assert found.areas[-1] == 0
    assert "unreferenced" in found.notes[0]


def test_open_square_has_the_spectrum_of_a_drum():
    """Free boundary: pi^2 (a^2 + b^2) on the unit square."""
    modes = np.arange(9) ** 2
    drum = np.sort(np.pi**2 * (modes[:, None] + modes).ravel())[:10]
    np.testing.assert_allclose(spectrum(square(41), 10).eigenvalues, drum, rtol=1e-2, atol=1e-9)


def test_the_number_asked_for_changes_no_eigenfunction():
    """A multiple eigenvalue has any basis of its space for eigenfunctions; one rule names it."""
    ball = make_sphere(3)
    whole = spectrum(ball, 60)
    for k in (2, 3, np.uint8(7), 12, 16, np.int8(40)):
        found = spectrum(ball, k)
        np.testing.assert_allclose(found.eigenvalues, whole.eigenvalues[:k], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(found.eigenfunctions, whole.eigenfunctions[:, :k], atol=1e-8)


def test_turning_a_sphere_turns_nothing_in_its_multiple_eigenspaces():
    ball = make_sphere(3)
    turn = scipy.spatial.transform.Rotation.from_rotvec([0.3, -1.1, 0.6]).as_matrix()
    before = spectrum(ball, 12).eigenfunctions
    after = spectrum((ball.vertices @ turn.T, ball.faces), 12).eigenfunctions
    np.testing.assert_allclose(after, before, atol=1e-8)


def test_more_components_than_eigenpairs():
    n = 12
    ball = make_sphere(1)
    many = Mesh(
        np.vstack([ball.vertices + 3 * i for i in range(n)]),
        np.vstack([ball.faces + ball.n_vertices * i for i in range(n)]),
    )
    few, all_zeros, more = (spectrum(many, k) for k in (5, n, n + 5))
    np.testing.assert_array_equal(all_zeros.eigenvalues, 0)
    np.testing.assert_array_equal(few.eigenvalues, 0)
    np.testing.assert_array_equal(few.eigenfunctions, all_zeros.eigenfunctions[:, :5])
    np.testing.assert_array_equal(more.eigenfunctions[:, :n], all_zeros.eigenfunctions)
    np.testing.assert_allclose(more.eigenvalues[n:], spectrum(ball, 2).eigenvalues[1], rtol=1e-8)


def test_every_component_is_solved_by_itself():
    """The last is a ribbon, which has many low values for its area."""
    balls, i = [make_sphere(2), *[make_sphere(0)] * 8], np.arange(100)
    ribbon = np.column_stack([i / 5, 0.1 * (i % 2), 0 * i])
    points = [*(r * one.vertices for r, one in zip(np.linspace(2, 0.5, 9), balls, strict=True))]
    starts = np.cumsum([0, *map(len, points)])
    faces = [*(one.faces for one in balls), i[:-2, None] + np.arange(3)]
    faces = [own + start for own, start in zip(faces, starts, strict=True)]
    many = Mesh(np.concatenate([*points, ribbon]), np.concatenate(faces))
    found = spectrum(many, 55)
    expected = dense_eigenpairs(laplacian(many))[0][:55]
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(gram(found), np.eye(55), atol=1e-9)
    used = np.logical_or.reduceat(found.eigenfunctions[:, 10:] != 0, starts)
    assert (used.sum(axis=0) == 1).all()  # none leaves a trace on another component
    assert used[-1].sum() > 5


@pytest.mark.parametrize("m", [1, 2, 3, 5])
def test_basis_rule_does_not_depend_on_the_basis_given(m):
    chance = np.random.default_rng(m)
    vectors = np.linalg.qr(chance.standard_normal((40, m + 2)))[0]
    vectors = np.vstack([vectors[:20], vectors[:20]])  # every peak is a tie of two
    vectors = np.linalg.qr(vectors)[0]
    values = np.array([0.5, *np.full(m, 2.0), 3.0])
    turn = np.eye(m + 2)
    turn[1:-1, 1:-1] = np.linalg.qr(chance.standard_normal((m, m)))[0]
    found = fix_basis(vectors, values, 1e-9)
    np.testing.assert_allclose(
        fix_signs(fix_basis(vectors @ turn, values, 1e-9), np.ones(40)),
        fix_signs(found, np.ones(40)),
        atol=1e-12,
    )
    np.testing.assert_array_equal(found[:, [0, -1]], vectors[:, [0, -1]])
    np.testing.assert_allclose(found @ found.T, vectors @ vectors.T, atol=1e-12)


@pytest.mark.parametrize("sizes", [(3, 1), (2, 3), (1, 2, 1, 4), (5,)])
def test_every_multiple_value_has_its_own_basis(sizes):
    """Wherever it stands among the others; what comes in stays as it is."""
    chance = np.random.default_rng(0)
    vectors = np.linalg.qr(chance.standard_normal((30, sum(sizes))))[0]
    values = np.repeat(np.arange(len(sizes)), sizes).astype(float)
    given = vectors.copy()
    found = fix_basis(vectors, values, 1e-9)
    np.testing.assert_array_equal(vectors, given)
    for value in range(len(sizes)):
        own = values == value
        alone = fix_basis(vectors[:, own], values[own], 1e-9)
        np.testing.assert_allclose(found[:, own], alone, atol=1e-13)
        projection = vectors[:, own] @ vectors[:, own].T
        np.testing.assert_allclose(alone @ alone.T, projection, atol=1e-13)
        if own.sum() > 1:  # the first is that projection's column at its highest entry
            highest = projection[:, np.diag(projection).argmax()]
            np.testing.assert_allclose(alone[:, 0], highest / np.linalg.norm(highest), atol=1e-12)


def test_rounding_does_not_add_up_in_a_large_eigenspace():
    vectors = np.linalg.qr(np.random.default_rng(0).standard_normal((600, 400)))[0]
    found = fix_basis(vectors, np.ones(400), 1e-9)
    np.testing.assert_allclose(found.T @ found, np.eye(400), rtol=0, atol=1e-14)


def test_sign_rule_does_not_depend_on_the_sign_given():
    chance = np.random.default_rng(3)
    vectors, weights = chance.standard_normal((50, 4)), chance.random(50)
    odd = np.linspace(-1, 1, 50)[:, None]  # its third moment vanishes
    np.testing.assert_array_equal(fix_signs(vectors, weights), fix_signs(-vectors, weights))
    np.testing.assert_array_equal(fix_signs(odd, np.ones(50)), fix_signs(-odd, np.ones(50)))


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_first_peak_decides_where_the_third_moment_vanishes_in_any_unit(unit):
    for seed in range(10):
        chance = np.random.default_rng(seed)
        half = chance.standard_normal(300)
        half[0] = 9.0
        odd = np.concatenate([half, -chance.permutation(half)])[:, None] * unit
        for signed in (odd, -odd):  # what rounding leaves of the moment says nothing
            assert fix_signs(signed, np.ones(600))[0] == 9 * unit


@pytest.mark.parametrize("k", [0, 643, 2.5, True])
def test_impossible_numbers_of_eigenpairs_are_refused(blob, k):
    with pytest.raises(InputError, match="from 1 to 642"):
        spectrum(blob, k)
    assert spectrum(blob, 1).eigenvalues.tolist() == [0]


@pytest.mark.parametrize("tol", [1e-4, 1e-8, 1e-9])
def test_residuals_are_as_small_as_asked(tol):
    dog = make_quadruped("sitting", n_vertices=1500).mesh
    operator = laplacian(dog)
    found = spectrum(dog, 30, tolerance=tol)
    areas = operator.areas[:, None]
    residual = operator.stiffness @ found.eigenfunctions
    residual -= areas * found.eigenfunctions * found.eigenvalues
    size = np.sqrt((residual**2 / areas).sum(axis=0))
    assert (size[1:] <= tol * found.eigenvalues[1:] + 1e-13 * found.eigenvalues[-1]).all()


@pytest.mark.parametrize("tol", [-1e-8, 1, np.nan])
def test_a_tolerance_is_a_share(blob, tol):
    with pytest.raises(InputError, match="tolerance must be at least 0 and below 1, not"):
        spectrum(blob, 3, tolerance=tol)


def test_no_tolerance_at_all_may_be_asked_for():
    egg = Mesh(make_sphere(1).vertices * [1, 0.7, 0.5], make_sphere(1).faces)
    with contextlib.suppress(SolverError):  # rounding may leave more
        found = spectrum(egg, 5, tolerance=0)
        values = dense_eigenpairs(laplacian(egg))[0]
        np.testing.assert_allclose(found.eigenvalues, values[:5], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("areas", ["voronoi", "barycentric"])
def test_areas_are_of_the_kind_asked_for(blob, areas):
    operator = laplacian(blob, area_kind=areas)
    found = spectrum(blob, 5, area_kind=areas)
    np.testing.assert_allclose(found.areas, operator.areas)
    np.testing.assert_allclose(
        found.eigenvalues, dense_eigenpairs(operator)[0][:5], rtol=1e-9, atol=1e-12
    )


def test_few_functions_of_many_components_take_little_memory():
    """Of 3,000 triangles, as a torn scan has them; a function for each would take 200 MB."""
    rng = np.random.default_rng(0)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]) * rng.uniform(0.5, 2, (3000, 1, 1))
    places = np.arange(3000)[:, None, None] * [0, 0, 1.0]
    torn = Mesh((corners + places).reshape(-1, 3), np.arange(9000).reshape(-1, 3))
    tracemalloc.start()
    found = spectrum(torn, 6)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40e6
    functions, areas = found.eigenfunctions, found.areas
    np.testing.assert_array_equal(found.eigenvalues, 0)
    np.testing.assert_allclose(functions[:, 0], areas.sum() ** -0.5, rtol=1e-12)
    np.testing.assert_allclose(functions.T @ (areas[:, None] * functions), np.eye(6), atol=1e-12)
    np.testing.assert_allclose(functions[0::3], functions[1::3], rtol=1e-12)
    np.testing.assert_array_equal(functions, spectrum(torn, 6).eigenfunctions)


def test_what_a_solver_mixes_with_the_null_space_is_taken_out(blob_and_ball, monkeypatch):
    """Of two components, as the smallest values that are not 0 may be after many digits lost."""
    surface = make_surface(blob_and_ball, connected=False)
    right = _spectrum.smallest_eigenpairs
    expected = eigenpairs(surface, 8)

    def mixed(*args, **options):
        values, functions = right(*args, **options)
        functions[:, 1] = 0.8 * functions[:, 1] + 0.6 * functions[:, 0]
        functions[:, 3] = 0.6 * functions[:, 3] - 0.8 * functions[:, 0]
        return values, functions

    monkeypatch.setattr(_spectrum, "smallest_eigenpairs", mixed)
    found = eigenpairs(surface, 8)
    np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=1e-9)
    np.testing.assert_allclose(found.eigenfunctions, expected.eigenfunctions, atol=1e-8)


@pytest.mark.parametrize(("apart", "is_equal"), [(0.05, True), (0.15, False)])
def test_values_that_differ_by_less_than_a_tenth_of_the_tolerance_are_equal(
    blob, monkeypatch, apart, is_equal
):
    """A basis of two such functions is then replaced, whatever it was, and else kept."""
    surface, right, tol = make_surface(blob), _spectrum.smallest_eigenpairs, 1e-4
    monkeypatch.setattr(_spectrum, "_lacking", lambda *args: "")  # they are no eigenpairs
    found = []
    for turn in (np.eye(2), np.array([[0.6, -0.8], [0.8, 0.6]])):

        def near(*args, turn=turn, **options):
            values, functions = right(*args, **options)
            functions[:, 25:27] = functions[:, 25:27] @ turn
            values[25:27] = values[25] * (1 + np.array([0, apart * tol]))
            return values, functions

        monkeypatch.setattr(_spectrum, "smallest_eigenpairs", near)
        found.append(eigenpairs(surface, 30, tolerance=tol).eigenfunctions)
    assert (abs(found[0] - found[1]).max() < 1e-8) == is_equal


def gram(found):
    return found.eigenfunctions.T @ (found.areas[:, None] * found.eigenfunctions)


def needled(count, share):
    """An egg of 162 vertices, some of whose edges have shrunk to this share."""
    ball = make_sphere(2)
    points = ball.vertices * [1, 0.5, 0.3] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2
    rows = np.random.default_rng(0).permutation(ball.n_faces)[:count]
    here, there = ball.faces[rows, 0], ball.faces[rows, 1]
    points[there] = points[here] + share * (points[there] - points[here])
    return Mesh(points, ball.faces)


@pytest.mark.parametrize("share", [1e-3, 1e-6, 3e-8])
def test_needles_do_not_spoil_the_eigenpairs_of_small_meshes(share):
    """Against ARPACK, on the factorised pencil: dense solvers drown in the largest entries."""
    mesh = needled(40, share)
    operator = laplacian(mesh)
    mass = sp.diags_array(operator.areas / operator.areas.sum()).tocsc()
    expected = sp.linalg.eigsh(sp.csc_matrix(operator.stiffness), 9, M=mass, sigma=1.0)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnbendWarning)  # of faces without area
        found = spectrum(mesh, 9)
    values = found.eigenvalues * operator.areas.sum()
    np.testing.assert_allclose(values[1:], expected[1:], rtol=1e-7)
    np.testing.assert_allclose(gram(found), np.eye(9), atol=1e-8)


@pytest.mark.parametrize("longer", [1e4, 1e6])
def test_values_near_zero_do_not_spoil_the_orthonormality(blob, longer):
    found = spectrum((blob.vertices * [1, longer, 1], blob.faces), 10)
    np.testing.assert_allclose(gram(found), np.eye(10), atol=1e-8)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda values, functions: (values * (1 + 1e-4), functions), "residual is about"),
        (lambda values, functions: (values, functions * (1 + 1e-5)), "orthonormal but for"),
        (lambda values, functions: (values, functions[:, [0, 1, 1, *range(3, 11)]]), "orthonormal"),
        (lambda values, functions: (values, functions + 1e-4 * functions[::-1]), "orthonormal"),
        (lambda values, functions: (values, functions * np.nan), "orthonormal"),
    ],
)
def test_wrong_eigenpairs_are_an_error_with_the_figure(blob, monkeypatch, spoil, message):
    right = _spectrum.smallest_eigenpairs
    monkeypatch.setattr(
        _spectrum, "smallest_eigenpairs", lambda *args, **options: spoil(*right(*args, **options))
    )
    with pytest.raises(SolverError, match=message):
        spectrum(blob, 9)
