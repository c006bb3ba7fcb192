"""Load the collections of shapes on which matching is measured, in the layouts they come in."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from types import MappingProxyType

from paper.collection import Collection
from paper.shape_files import SHAPE_SUFFIXES
from unbend.errors import FileError, InputError

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
    "training/registrations",
    "MPI-{}/training/registrations",
)
# Beside folders of these names, not in them, are the folders with what is known of the meshes.
_MESHES_ALONE = ("meshes", "off", "shapes")


def load_tosca(
    folder: str | os.PathLike[str], *, classes: str | Iterable[str] | None = None
) -> Collection:
    r"""Find the TOSCA shapes in a folder, in any layout they circulate in.

    - The original archives: ``cat0.mat`` or ``cat0.vert`` with ``cat0.tri``. Vertex ``i`` is the
      same point on every shape of a class.
    - The same as ``cat0.off`` in one folder.
    - The Princeton benchmark: ``Meshes/cat0.off``, numbered alike too, with feature points and
      their symmetry in ``Corrs/cat.pid`` and ``Corrs/cat.sym.info`` (or all in one folder).
    - The remeshed set of Ren et al.: ``cat0.off`` with ``corres/cat0.vts`` and
      ``corres/cat0.sym.vts``; also the whole repository, ``Dataset/TOSCA_Isometric/vtx_5k/``.

    Parameters
    ----------
    folder : path
        The folder of the meshes, or one above it as laid out there.
    classes : str or iterable of str, optional
        Only these, for instance ``["cat", "dog"]``. All by default.

    Returns
    -------
    Collection
        A shape's class is its name without the number; files without a number are passed over.
        No mesh is read yet.

    Raises
    ------
    FileError
        If the folder or shapes in it are missing.
    InputError
        If there are no shapes of a class in `classes`.

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
    kinds = [classes] if isinstance(classes, str) else classes
    hint = "cat0.off, cat0.mat, or cat0.vert with cat0.tri, and so on"
    return _load("TOSCA", folder, r"(.*\D)\d+", hint, lambda name: name.rstrip("0123456789"), kinds)


def load_scape(folder: str | os.PathLike[str]) -> Collection:
    """Find the SCAPE shapes, one person in 71 poses, in a folder.

    ``mesh000.off`` (or .ply, .obj) and so on, numbered alike, in one folder or as in the
    Princeton benchmark (``Meshes/``, and ``Corrs/1.pid`` with ``Corrs/1.sym.info``); or remeshed,
    with ``corres/mesh000.vts``, in one folder or with the meshes in ``off/`` or ``vtx_5k/``.

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


def load_faust(folder: str | os.PathLike[str]) -> Collection:
    """Find the FAUST registrations, ten people in ten poses each, in a folder.

    ``tr_reg_000.ply`` and so on, numbered alike, in one folder or as in the original archive
    (``MPI-FAUST/training/registrations/``); or remeshed, ``tr_reg_000.off`` with
    ``corres/tr_reg_000.vts`` and ``.sym.vts``, in one folder, with the meshes in ``off/``, or in
    the repository of Ren et al. (``Dataset/FAUST/vtx_5k/``).

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
    For research only, under the licence that comes with the archive; cite [1]_.

    References
    ----------
    .. [1] F. Bogo, J. Romero, M. Loper, M. J. Black. FAUST: dataset and evaluation for 3D mesh
       registration. CVPR, 2014.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend import write_mesh
    >>> from paper.loading import load_faust
    >>> from unbend.datasets import make_sphere
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name in ("tr_reg_000", "tr_reg_001"):
    ...     write_mesh(folder / f"{name}.ply", make_sphere(1))
    >>> len(load_faust(folder).truth("tr_reg_000", "tr_reg_001").source_points)
    42
    """
    return _load("FAUST", folder, r"tr_reg_\d+", "tr_reg_000.ply and so on", lambda name: "person")


def _load(
    title: str,
    folder: str | os.PathLike[str],
    pattern: str,
    hint: str,
    class_of: Callable[[str], str],
    only: Iterable[str] | None = None,
) -> Collection:
    root = Path(folder)
    if not root.is_dir():
        raise FileError(f"there is no folder {root}; put the shapes of {title} there: {hint}")
    meshes, files = _find(root, title, pattern)
    if not files:
        raise FileError(f"{root} holds no shapes of {title}; put {hint} there")
    kinds = {name: class_of(name).rstrip("_- ") for name in sorted(files, key=_natural)}
    if only is not None:
        wanted = set(only)
        if missing := sorted(wanted - set(kinds.values())):
            known = ", ".join(dict.fromkeys(kinds.values()))
            raise InputError(f"{meshes} holds no {missing[0]!r} of {title}; it holds {known}")
        kinds = {name: kind for name, kind in kinds.items() if kind in wanted}
    around = [meshes, *([meshes.parent] if meshes.name.lower() in _MESHES_ALONE else [])]
    corres = next((place / "corres" for place in around if (place / "corres").is_dir()), None)
    features = {} if corres else _feature_files(around, set(kinds.values()))
    return Collection(
        title,
        MappingProxyType(kinds),
        MappingProxyType({name: files[name] for name in kinds}),
        corres,
        MappingProxyType(features),
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


def _feature_files(around: list[Path], kinds: set[str]) -> dict[str, Path]:
    """Find the feature points of each class; those of SCAPE, one class, are named 1."""
    places = [place for folder in around for place in (folder, folder / "Corrs")]
    return {
        kind: path
        for kind in kinds
        for place in reversed(places)
        if (path := place / f"{'1' if kind == 'person' else kind}.pid").is_file()
    }


def _natural(name: str) -> tuple[str, int]:
    """Sort key that puts cat2 before cat10."""
    stem = name.rstrip("0123456789")
    return stem, int(name[len(stem) :])
