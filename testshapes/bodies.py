"""Bodies with proportions drawn at random, and which of their points are the same."""

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.datasets._skeleton import Bone, Pose, cones_of
from unbend.datasets.biped import make_biped
from unbend.datasets.octopus import make_octopus
from unbend.datasets.quadruped import make_quadruped
from unbend.datasets.shape import Shape
from unbend.errors import InputError
from unbend.mesh import face_normals

_MAKERS: dict[str, Callable[..., Shape]] = {
    "quadruped": make_quadruped,
    "biped": make_biped,
    "octopus": make_octopus,
}
KINDS = tuple(_MAKERS)
_LENGTHS = {
    "quadruped": ("legs", "neck", "tail", "ears", "muzzle", "body", "paws", "head"),
    "biped": ("legs", "arms", "torso", "head", "hands"),
    "octopus": ("arms", "mantle", "eyes"),
}
_LENGTH, _GIRTH = (0.6, 1.6), (0.6, 2.0)  # factors on the plain body
_ON_SKIN = 1e-3  # in units of the body's length
_TURNED_OVER = 0.002  # share of the area
_N_VERTICES = 1000  # enough to see whether parts touch


def make_body(
    kind: str,
    body: int,
    pose: str | Pose | None = None,
    *,
    n_vertices: int = 2000,
    meshing: int = 0,
    random_state: int | None = None,
) -> Shape:
    """Make a body with proportions of its own.

    Parameters
    ----------
    kind : {"quadruped", "biped", "octopus"}
    body : int
        Seed of the proportions: another number, another body. See :func:`random_proportions`.
    pose : str, mapping, or None, default=None
        As for :func:`make_quadruped` and the like; None: a random pose.
    n_vertices : int, default=2000
        Number of vertices, met exactly; 500 to 200000.
    meshing : int, default=0
        Another number: other vertices and triangles on the same surface.
    random_state : int or None, default=None
        Seed of a random pose.

    Returns
    -------
    Shape
        :func:`rest_map` relates it truly to all other bodies of its kind.

    Raises
    ------
    InputError
        If there is no such kind or pose, or a number is out of range.

    Examples
    --------
    >>> from unbend.datasets import rest_map
    >>> from testshapes.bodies import make_body
    >>> source = make_body("biped", 1, random_state=1, n_vertices=600)
    >>> target = make_body("biped", 2, "sitting", meshing=2, n_vertices=700)
    >>> rest_map(source, target).shape  # for each source vertex, the target vertex
    (600,)
    """
    own = random_proportions(kind, body)
    return _MAKERS[kind](
        pose, n_vertices=n_vertices, meshing=meshing, random_state=random_state, **own
    )


def random_proportions(kind: str, body: int) -> dict[str, float]:
    """Draw the proportions of a body.

    Lengths of limbs, trunk and head are drawn from 0.6 to 1.6 of those of the plain body, girth
    and the thickness of limbs from 0.6 to 2, each on its own and evenly in their logarithms. Draws
    whose parts would touch or come off are thrown away.

    Parameters
    ----------
    kind : {"quadruped", "biped", "octopus"}
    body : int
        Seed.

    Returns
    -------
    dict of str to float
        For the maker of this kind.

    Raises
    ------
    InputError
        If there is no such kind.

    Examples
    --------
    >>> from unbend.datasets import make_octopus
    >>> from testshapes.bodies import random_proportions
    >>> sizes = random_proportions("octopus", 7)
    >>> list(sizes)
    ['arms', 'mantle', 'eyes', 'girth', 'limbs']
    >>> make_octopus("swimming", n_vertices=600, **sizes).mesh
    Mesh(600 vertices, 1196 faces)
    """
    if kind not in _MAKERS:
        raise InputError(f"there is no kind of body {kind!r}; the kinds are {', '.join(KINDS)}")
    return dict(_proportions(kind, body))


@lru_cache(maxsize=4096)
def _proportions(kind: str, body: int) -> tuple[tuple[str, float], ...]:
    chance = np.random.default_rng([KINDS.index(kind), body])
    ranges = dict.fromkeys(_LENGTHS[kind], _LENGTH) | {"girth": _GIRTH, "limbs": _GIRTH}
    while True:
        drawn = {
            name: float(np.exp(chance.uniform(*np.log(limits)))) for name, limits in ranges.items()
        }
        try:
            plain = _MAKERS[kind]({}, n_vertices=_N_VERTICES, **drawn)
        except InputError:  # parts touch or come off
            continue
        if is_carried_well(plain.rest, plain.reference, plain.mesh.faces, plain.plain_bones):
            return tuple(drawn.items())


def is_carried_well(
    points: FloatArray, carried: FloatArray, faces: IntArray, bones: Sequence[Bone]
) -> bool:
    """Whether carried vertices lie on the skin of ``bones`` and hardly a face is turned over.

    They do not where parts have grown together: the web between two legs has no place on a body
    whose legs are apart.
    """
    values, gradients = cones_of(bones).local_field(carried)[0](carried)
    outward = np.einsum("fi,fi->f", face_normals(carried, faces), gradients[faces].mean(axis=1)) > 0
    areas = np.linalg.norm(face_normals(points, faces), axis=1)
    return bool(
        np.abs(values).max() < _ON_SKIN and areas[~outward].sum() < _TURNED_OVER * areas.sum()
    )
