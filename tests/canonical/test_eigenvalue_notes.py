"""Every route finds one eigenvalue more than it gives, to tell whether a multiple one is split."""

from dataclasses import replace

import numpy as np
import pytest

import dense
from forms import form_of
from sheets import make_torus
from unbend import Mesh, canonical_form, laplacian
from unbend.datasets import make_octopus, make_quadruped, make_sphere
from unbend.errors import UnbendWarning

# With the number of an eigenvalue of the torus that equals the next.
ROUTES = [
    ({}, 3),
    ({"distance": "commute-time"}, 5),
    ({"distance": "diffusion"}, 3),
    ({"weighting": "area"}, 3),
    ({"weighting": "area", "keep_scale": True}, 3),
    ({"method": "sampled"}, 3),
]


@pytest.mark.parametrize(("options", "d"), ROUTES)
def test_a_double_eigenvalue_that_the_form_splits_is_warned_of(options, d):
    ring = make_torus(40, 16)
    with pytest.warns(
        UnbendWarning, match=f"torus: eigenvalues {d} and {d + 1} are nearly"
    ) as told:
        form = form_of(ring, n_components=d, **options)
    assert str(told[0].message).endswith(f"eigenspace; use n_components={d - 1} or {d + 1}")
    assert form.notes[-1] in str(told[0].message)
    assert f"({form.eigenvalues[-1]:.6g} and " in form.notes[-1]
    for other in (d - 1, d + 1):
        assert form_of(ring, n_components=other, **options).notes == ()


@pytest.mark.filterwarnings("ignore:.*are nearly equal")
def test_a_split_form_depends_on_the_order_of_the_vertices():
    """What the warning is for; dense scaling shows the double eigenvalue."""
    ring = make_torus(40, 16)
    operator = laplacian(ring)
    scaled = replace(operator, areas=operator.areas / operator.areas.sum())
    gram = dense.kernel(scaled, lambda values: values**-2)
    values = dense.classical_scaling(dense.distances(gram) ** 2, 4)[1]
    assert values[2] == pytest.approx(values[3], rel=1e-9)
    moved: dict[int, list[float]] = {3: [], 4: []}
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(ring.n_vertices)
        other = Mesh(ring.vertices[order], np.argsort(order)[ring.faces])
        for d, apart in moved.items():
            one, two = (canonical_form(mesh, n_components=d).points for mesh in (ring, other))
            difference = one[order] @ one[order].T - two @ two.T
            apart.append(np.abs(difference).max() / np.abs(two @ two.T).max())
    assert max(moved[3]) > 0.01
    assert max(moved[4]) < 1e-8


@pytest.mark.parametrize(("d", "choices"), [(1, "2"), (2, "3"), (4, "3 or 5"), (7, "3 or 8")])
def test_the_warning_says_how_many_components_to_take(d, choices):
    """A sphere's eigenvalues are three, then five equal ones."""
    with pytest.warns(UnbendWarning, match=f"use n_components={choices}$"):
        canonical_form(make_sphere(2), n_components=d)


@pytest.mark.parametrize("make", [make_quadruped, make_octopus])
def test_bodies_split_no_eigenvalue(make):
    body = make(n_vertices=500).mesh
    for options in ({}, {"method": "sampled", "distance": "geodesic"}):
        for d in range(1, 6):
            assert form_of(body, n_components=d, **options).notes == ()
