"""Load the collections of shapes on which matching is measured, in the layouts they come in."""

import os
import re
from collections.abc import Callable
from pathlib import Path
from types import MappingProxyType

from paper.collection import Collection
from paper.shape_files import SHAPE_SUFFIXES
from unbend.errors import FileError

# Where the meshes are, below the folder that is given: at hand; in the Princeton benchmark; in
# the remeshed sets of Ren et al. (2018) and those made after them.
_MESH_FOLDERS = (
    "",
    "Meshes",
    "{}/Meshes",
    "Data/{}/Meshes",
    "vtx_5k",
    "{}/vtx_5k",
    "Dataset/{}/vtx_5k",
    "{}_Isometric/vtx_5k",
    "Dataset/{}_Isometric/vtx_5k",
    "off",
    "shapes",
)
# Beside folders of these names, not in them, are the folders with what is known of the meshes.
_MESHES_ALONE = ("meshes", "off", "shapes")


def load_tosca(folder: str | os.PathLike[str]) -> Collection:
    r"""Find the TOSCA shapes in a folder, in any layout they circulate in.

    - The original archives: ``cat0.mat`` or ``cat0.vert`` with ``cat0.tri``. Vertex ``i`` is the
      same point on every shape of a class.
    - The same as ``cat0.off`` in one folder.
    - The Princeton benchmark: ``Meshes/cat0.off``, numbered alike too.
    - The remeshed set of Ren et al.: ``cat0.off`` with ``corres/cat0.vts`` and
      ``corres/cat0.sym.vts``; also the whole repository, ``Dataset/TOSCA_Isometric/vtx_5k/``.

    Parameters
    ----------
    folder : path
        The folder of the meshes, or one above it as laid out there.

    Returns
    -------
    Collection
        A shape's class is its name without the number; files without a number are passed over.
        No mesh is read yet.

    Raises
    ------
    FileError
        If the folder or shapes in it are missing.

    Notes
    -----
    The shapes may be used for academic purposes; cite [1]_, and [2]_ for the remeshed ones.

    References
    ----------
    .. [1] A. M. Bronstein, M. M. Bronstein, R. Kimmel. Numerical geometry of non-rigid shapes.
       Springer, 2008.
    .. [2] J. Ren, A. Poulenard, P. Wonka, M. Ovsjanikov. Continuous and orientation-preserving
       correspondences via functional maps. ACM Transactions on Graphics 37(6), 2018.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from paper.loading import load_tosca
    >>> from unbend.datasets import make_sphere
    >>> folder = Path(tempfile.mkdtemp())
    >>> (folder / "corres").mkdir()
    >>> for name in ("cat0", "cat1"):
    ...     write_mesh(folder / f"{name}.off", make_sphere(1))
    >>> _ = (folder / "corres" / "cat0.vts").write_text("1\n2\n")
    >>> _ = (folder / "corres" / "cat1.vts").write_text("5\n7\n")
    >>> load_tosca(folder).truth("cat0", "cat1")
    Truth(source_points=array([0, 1]), target_points=array([4, 6]), mirrored_target_points=None)
    """
    hint = "cat0.off, cat0.mat, or cat0.vert with cat0.tri, and so on"
    return _load("TOSCA", folder, r"(.*\D)\d+", hint, lambda name: name.rstrip("0123456789"))


def load_scape(folder: str | os.PathLike[str]) -> Collection:
    """Find the SCAPE shapes, one person in 71 poses, in a folder.

    ``mesh000.off`` (or .ply, .obj) and so on, numbered alike, in one folder or, as in the
    Princeton benchmark, in ``Meshes/``; or remeshed, with ``corres/mesh000.vts``, in one folder or
    with the meshes in ``off/`` or ``vtx_5k/``.

    Parameters
    ----------
    folder : path
        The folder of the meshes, or one above it as laid out there.

    Returns
    -------
    Collection
        All shapes are of the class ``"person"``. No mesh is read yet.

    Raises
    ------
    FileError
        If the folder or shapes in it are missing.

    Notes
    -----
    Not for commercial use, and not to be passed on; acknowledge the source [1]_. Some copies
    hold further shapes with fewer vertices: they have no ground truth.

    References
    ----------
    .. [1] D. Anguelov, P. Srinivasan, D. Koller, S. Thrun, J. Rodgers, J. Davis. SCAPE: shape
       completion and animation of people. ACM Transactions on Graphics 24(3), 2005.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from paper.loading import load_scape
    >>> from unbend.datasets import make_sphere
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name in ("mesh000", "mesh001"):
    ...     write_mesh(folder / f"{name}.off", make_sphere(1))
    >>> load_scape(folder)
    Collection(SCAPE: 2 shapes)
    """
    return _load("SCAPE", folder, r"mesh_?\d+", "mesh000.off and so on", lambda name: "person")


def _load(
    title: str,
    folder: str | os.PathLike[str],
    pattern: str,
    hint: str,
    class_of: Callable[[str], str],
) -> Collection:
    root = Path(folder)
    if not root.is_dir():
        raise FileError(f"there is no folder {root}; put the shapes of {title} there: {hint}")
    meshes, files = _find(root, title, pattern)
    if not files:
        raise FileError(f"{root} holds no shapes of {title}; put {hint} there")
    kinds = {name: class_of(name).rstrip("_- ") for name in sorted(files, key=_natural)}
    around = [meshes, *([meshes.parent] if meshes.name.lower() in _MESHES_ALONE else [])]
    corres = next((place / "corres" for place in around if (place / "corres").is_dir()), None)
    return Collection(
        title,
        MappingProxyType(kinds),
        MappingProxyType({name: files[name] for name in kinds}),
        corres,
    )


def _find(root: Path, title: str, pattern: str) -> tuple[Path, dict[str, Path]]:
    """Return the first folder of a known layout that holds shapes, and their files by name."""
    for layout in _MESH_FOLDERS:
        place = root / layout.format(title)
        try:
            paths = [path for path in place.iterdir() if path.is_file()] if place.is_dir() else []
        except OSError as error:
            raise FileError(f"cannot read the folder {place}: {error.strerror}") from None
        # Later ones replace earlier ones, so the preferred format comes last.
        files = {
            path.stem: path
            for suffix in reversed(SHAPE_SUFFIXES)
            for path in paths
            if path.suffix.lower() == suffix and re.fullmatch(pattern, path.stem)
        }
        if files:
            return place, files
    return root, {}


def _natural(name: str) -> tuple[str, int]:
    """Sort key that puts cat2 before cat10."""
    stem = name.rstrip("0123456789")
    return stem, int(name[len(stem) :])
