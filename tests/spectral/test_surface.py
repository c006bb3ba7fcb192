"""A surface at unit area: which part of a mesh, which areas, whether it hangs together."""

import numpy as np
import pytest

from unbend import Mesh, laplacian, spectrum
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, UnbendWarning
from unbend.spectral import local_ids, make_surface

SPHERE = make_sphere(2)
TWO = Mesh(
    np.vstack([make_sphere(3).vertices, SPHERE.vertices + 50]),
    np.vstack([make_sphere(3).faces, SPHERE.faces + 642]),
    name="two",
)


@pytest.mark.parametrize("kind", ["cotangent", "robust"])
def test_one_component_unless_all_are_wanted(kind):
    with pytest.raises(MeshError, match="2 separate components"):
        make_surface(TWO, laplacian=kind)
    assert make_surface(TWO, laplacian=kind, connected=False).n_vertices == 804
    with pytest.warns(UnbendWarning, match=r"^two: component 1 of 2 was kept"):
        part = make_surface(TWO, laplacian=kind, component=1)
    np.testing.assert_array_equal(part.mesh.vertices, SPHERE.vertices + 50)


def test_points_too_far_apart_are_refused_where_they_must_hang_together():
    cloud = Mesh(TWO.vertices, name="points")
    with pytest.raises(MeshError, match="points: its Laplacian falls into 2 pieces"):
        make_surface(cloud)
    assert make_surface(cloud, connected=False).n_vertices == 804
    assert make_surface(cloud.vertices[:642]).n_vertices == 642


@pytest.mark.parametrize("kind", ["cotangent", "robust"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_the_laplacian_is_the_one_asked_for_in_any_unit(blob, kind, size):
    surface = make_surface(Mesh(blob.vertices * size, blob.faces), laplacian=kind)
    whole = laplacian(blob, laplacian=kind)
    assert surface.operator.kind == kind
    assert abs(surface.operator.stiffness - whole.stiffness).max() < 1e-9
    np.testing.assert_allclose(surface.area, whole.areas.sum() * size**2)


@pytest.mark.parametrize("areas", ["voronoi", "barycentric"])
def test_areas_are_of_the_kind_asked_for_and_sum_to_one(blob, areas):
    whole = laplacian(blob, area_kind=areas).areas
    surface = make_surface(blob, area_kind=areas)
    assert surface.area == pytest.approx(whole.sum())
    np.testing.assert_allclose(surface.operator.areas, whole / whole.sum())
    np.testing.assert_allclose(spectrum(blob, 3, area_kind=areas).areas, whole)


def test_vertices_of_the_whole_mesh_among_those_in_use():
    mesh = Mesh(np.vstack([[[9, 9, 9]], SPHERE.vertices, [[9, 9, 9]]]), SPHERE.faces + 1)
    with pytest.warns(UnbendWarning, match="2 unreferenced vertices"):
        surface = make_surface(mesh)
    found = local_ids(surface, [1, 162])
    assert found.tolist() == [0, 161]
    assert found.dtype == np.int64
    for unused in (0, 163):
        with pytest.raises(InputError, match=f"vertex {unused} is not part of the surface"):
            local_ids(surface, [1, unused])
    with pytest.raises(InputError, match="there is no vertex 164"):
        local_ids(surface, [164])
    with pytest.raises(InputError, match="name at least one vertex"):
        local_ids(surface, np.empty(0, int))
