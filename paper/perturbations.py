"""What is done to a shape to see whether its canonical form withstands it."""

from testshapes.damage import Damaged, cut_discs
from testshapes.scanning import add_noise
from testshapes.welding import weld
from unbend._arrays import nearest_rows
from unbend.errors import InputError, MissingExtraError
from unbend.mesh import Mesh
from unbend.preparation import prepare

_N_HOLES = 8


def perturb(mesh: Mesh, kind: str, strength: float) -> Damaged:
    """Do something to a shape; the same each time.

    Parameters
    ----------
    mesh : Mesh
        A single connected surface.
    kind : str
        ``"noise"``: normal noise along the normals, `strength` its standard deviation in mean
        edge lengths. ``"holes"`` and ``"part missing"``: eight discs, or one, around random
        vertices cut out, together this share of the area; of what falls apart the largest
        piece stays. ``"shortcut"``: two parts that touch, or nearly, joined by this many tubes.
        ``"decimation"``: reduced to this share of the faces by quadric collapses.
    strength : float

    Returns
    -------
    Damaged

    Raises
    ------
    InputError
        If there is no such kind, or no room for so many tubes.
    MissingExtraError
        If decimation is asked for and fast-simplification is not installed.

    References
    ----------
    Garland and Heckbert, "Surface simplification using quadric error metrics", 1997.

    Examples
    --------
    >>> from unbend.datasets import make_sphere
    >>> from paper.perturbations import perturb
    >>> perturb(make_sphere(3), "part missing", 0.25).mesh
    Mesh(501 vertices, 960 faces)
    """
    if kind == "noise":
        return add_noise(mesh, strength, random_state=0)
    if kind in ("holes", "part missing"):
        return cut_discs(mesh, strength, _N_HOLES if kind == "holes" else 1, random_state=0)
    if kind == "shortcut":
        return weld(mesh, int(strength), random_state=0)
    if kind == "decimation":
        return _decimate(mesh, strength)
    raise InputError(f"there is no perturbation {kind!r}")


def _decimate(mesh: Mesh, share: float) -> Damaged:
    try:
        from fast_simplification import simplify
    except ImportError:
        raise MissingExtraError("fast-simplification") from None
    # It wants arrays that it might write to.
    vertices, faces = simplify(mesh.vertices.copy(), mesh.faces.copy(), target_reduction=1 - share)
    left = prepare(Mesh(vertices, faces, name=mesh.name), component="largest")
    origin = nearest_rows(left.mesh.vertices, mesh.vertices)
    image = nearest_rows(mesh.vertices, left.mesh.vertices)
    return Damaged(left.mesh, origin, image)
