"""What a scanner makes of a surface: one side of it, noise, separate pieces, points."""

import numpy as np
from scipy.spatial import cKDTree

from testshapes.damage import Damaged, cut, keep_faces, unchanged
from testshapes.measures import along_edges, face_normals, mean_edge
from unbend._arrays import nearest_rows
from unbend._types import BoolArray, FloatArray
from unbend.datasets.primitives import make_sphere
from unbend.mesh import Mesh, vertex_normals

_GRAZING = 0.1  # cosine of the angle below which a camera sees nothing of a face


def seen_from(mesh: Mesh, direction: FloatArray) -> Damaged:
    """Keep what a camera far away sees: no face turned away, grazing or behind another.

    Parameters
    ----------
    mesh : Mesh
        Faces oriented outward.
    direction : (3,) array_like of float
        From the shape to the camera.

    Returns
    -------
    Damaged
        The largest connected piece of it.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.scanning import seen_from
    >>> bool((seen_from(make_sphere(3), (0, 0, 1)).mesh.vertices[:, 2] > -0.1).all())
    True
    """
    return keep_faces(mesh, _visible(mesh, np.asarray(direction, dtype=np.float64)))


def _visible(mesh: Mesh, direction: FloatArray) -> BoolArray:
    """Faces whose middle nothing hides."""
    direction = direction / np.linalg.norm(direction)
    across = np.linalg.svd(direction[None])[2][1:]  # two directions of the picture
    corners = mesh.vertices[mesh.faces]
    flat, depth = corners @ across.T, corners @ direction
    middle = flat.mean(axis=1)
    normal = face_normals(mesh)
    facing: BoolArray = normal @ direction > _GRAZING * np.linalg.norm(normal, axis=1)
    reach = float(np.linalg.norm(flat - middle[:, None], axis=2).max())
    pairs = cKDTree(middle).query_pairs(reach, output_type="ndarray")
    behind, before = np.concatenate([pairs, pairs[:, ::-1]]).T
    # Barycentric coordinates of the one's middle in the other.
    origin, u, v = flat[before, 0], *(flat[before, i] - flat[before, 0] for i in (1, 2))
    offset = middle[behind] - origin
    twice = _cross(u, v)
    with np.errstate(divide="ignore", invalid="ignore"):  # faces seen edge-on hide nothing
        b, c = _cross(offset, v) / twice, _cross(u, offset) / twice
        a = 1 - b - c
        height = a * depth[before, 0] + b * depth[before, 1] + c * depth[before, 2]
        hides = (a > 0) & (b > 0) & (c > 0) & (height > depth[behind].mean(axis=1))
    facing[behind[hides]] = False
    return facing


def _cross(u: FloatArray, v: FloatArray) -> FloatArray:
    product: FloatArray = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return product


def add_noise(
    mesh: Mesh,
    strength: float,
    *,
    direction: FloatArray | None = None,
    random_state: int | None = None,
) -> Damaged:
    """Move each vertex at random along its normal, or along the view of a depth camera.

    Parameters
    ----------
    mesh : Mesh
    strength : float
        Standard deviation in mean edge lengths.
    direction : (3,) array_like of float, optional
        Of the view. None: along the normals.
    random_state : int or None, default=None

    Returns
    -------
    Damaged

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.scanning import add_noise
    >>> add_noise(make_sphere(2), 0.2, random_state=0).mesh
    Mesh(162 vertices, 320 faces)
    """
    chance = np.random.default_rng(random_state)
    offsets = strength * mean_edge(mesh) * chance.standard_normal(mesh.n_vertices)
    ways = vertex_normals(mesh.vertices, mesh.faces)
    if direction is not None:
        ways = np.asarray(direction) / np.linalg.norm(direction) + np.zeros((mesh.n_vertices, 1))
    return unchanged(Mesh(mesh.vertices + offsets[:, None] * ways, mesh.faces, name=mesh.name))


def sample_points(
    mesh: Mesh, n_points: int, *, noise: float = 0.0, random_state: int | None = None
) -> Damaged:
    """Sample points uniformly by area.

    Parameters
    ----------
    mesh : Mesh
    n_points : int
    noise : float, default=0.0
        Standard deviation of each coordinate, in diagonals of the mesh's bounding box.
    random_state : int or None, default=None

    Returns
    -------
    Damaged
        A point cloud. The origin of a point is the vertex nearest to where it was drawn.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.scanning import sample_points
    >>> sample_points(make_sphere(2), 500, random_state=0).mesh
    Mesh(500 points)
    """
    chance = np.random.default_rng(random_state)
    areas = np.linalg.norm(face_normals(mesh), axis=1)
    corners = mesh.vertices[mesh.faces[chance.choice(len(areas), n_points, p=areas / areas.sum())]]
    weights = chance.dirichlet(np.ones(3), n_points)
    places = np.einsum("ij,ijk->ik", weights, corners)
    diagonal = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    cloud = Mesh(places + noise * diagonal * chance.standard_normal(places.shape), name=mesh.name)
    origin = cKDTree(mesh.vertices).query(places)[1]
    return Damaged(cloud, origin, cKDTree(places).query(mesh.vertices)[1])


def add_components(
    mesh: Mesh, *, eyeballs: int = 2, cloth: float = 0.2, random_state: int | None = None
) -> Damaged:
    """Put balls into the surface and a cloth on it: components of their own, joined to nothing.

    Parameters
    ----------
    mesh : Mesh
        A closed surface, faces oriented outward.
    eyeballs : int, default=2
        Half sunk around random vertices, with a radius of two mean edge lengths.
    cloth : float, default=0.2
        Share of the area of a disc that is laid on the surface, half a mean edge length above it.
    random_state : int or None, default=None

    Returns
    -------
    Damaged
        The vertices of `mesh` come first. The origin of the others is the vertex nearest to them.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from testshapes.scanning import add_components
    >>> add_components(make_sphere(3), eyeballs=1, cloth=0, random_state=0).mesh
    Mesh(684 vertices, 1360 faces)
    """
    chance = np.random.default_rng(random_state)
    length = mean_edge(mesh)
    vertices, faces = [mesh.vertices], [mesh.faces]
    origins = [np.arange(mesh.n_vertices)]
    ball = make_sphere(1)
    for middle in chance.choice(mesh.n_vertices, eyeballs, replace=False):
        faces.append(ball.faces + sum(len(one) for one in vertices))
        vertices.append(mesh.vertices[middle] + 2 * length * ball.vertices)
        origins.append(nearest_rows(vertices[-1], mesh.vertices))
    if cloth > 0:
        middle = int(chance.integers(mesh.n_vertices))
        away = along_edges(mesh, np.array([middle]))[0]
        piece = cut(mesh, -away, 1 - cloth)
        lifted = (
            piece.mesh.vertices
            + 0.5 * length * vertex_normals(mesh.vertices, mesh.faces)[piece.origin]
        )
        faces.append(piece.mesh.faces + sum(len(one) for one in vertices))
        vertices.append(lifted)
        origins.append(piece.origin)
    whole = Mesh(np.concatenate(vertices), np.concatenate(faces), name=mesh.name)
    return Damaged(whole, np.concatenate(origins), np.arange(mesh.n_vertices))
