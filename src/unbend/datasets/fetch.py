"""Download a collection of shapes with ground truth, each file checked."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from urllib.parse import urlsplit

from unbend._text import plural
from unbend.errors import FileError, InputError, MissingExtraError
from unbend.spectral import cache_folder

TOSCA_REMESHED_URL = (
    "https://raw.githubusercontent.com/llorz/SGA18_orientation_BCICP_dataset/"
    "ca33927be7147ba7070ac5457fd3084967931b48/Dataset/TOSCA_Isometric/vtx_5k/"
)

_TOSCA_TERMS = """\
The TOSCA shapes may be used for academic purposes. In what you publish, please cite
  A. M. Bronstein, M. M. Bronstein, R. Kimmel. Numerical geometry of non-rigid shapes.
    Springer, 2008. (the shapes)
  J. Ren, A. Poulenard, P. Wonka, M. Ovsjanikov. Continuous and orientation-preserving
    correspondences via functional maps. ACM TOG 37(6), 2018. (remeshed, with ground truth)
  D.-M. Yan, G. Bao, X. Zhang, P. Wonka. Low-resolution remeshing using the localized
    restricted Voronoi diagram. IEEE TVCG, 2014. (how they were remeshed)"""


def fetch_tosca_remeshed(
    folder: str | os.PathLike[str] | None = None, *, base_url: str = TOSCA_REMESHED_URL
) -> Path:
    """Download 23 remeshed TOSCA shapes with their ground truth, about 11 MB.

    Cats, centaurs, David, dogs and Michael, each shape meshed on its own with about 5,000
    vertices. Complete files are not downloaded again, so an interrupted download resumes. Before
    the first download the terms of use and what to cite are printed on standard error.

    Parameters
    ----------
    folder : path, optional
        Where to put the files; made if missing. By default a folder in the cache of unbend.
    base_url : str, optional
        Where the files are, for instance on a mirror; by default one fixed version of the
        authors' public repository.

    Returns
    -------
    Path
        The folder, with meshes ``NAME.off``. Row `i` of every ``corres/NAME.vts`` of a class is
        the same point; ``corres/NAME.sym.vts`` holds its left-right mirror image.

    Raises
    ------
    MissingExtraError
        If pooch is not installed: ``pip install pooch``.
    InputError
        If `base_url` does not begin with https://, and is not on this machine.
    FileError
        If a file cannot be downloaded, is not the file it should be (by its SHA-256), or cannot
        be written. What arrived before it is kept.

    References
    ----------
    J. Ren, A. Poulenard, P. Wonka, M. Ovsjanikov. Continuous and orientation-preserving
    correspondences via functional maps. ACM Transactions on Graphics 37(6), 2018.

    Examples
    --------
    >>> from unbend import evaluate, match, read_map, read_mesh
    >>> from unbend.datasets import fetch_tosca_remeshed
    >>> folder = fetch_tosca_remeshed()  # doctest: +SKIP
    >>> source, target = (read_mesh(folder / f"cat{i}.off") for i in (0, 1))  # doctest: +SKIP
    >>> truth = [read_map(folder / "corres" / f"cat{i}.vts") for i in (0, 1)]  # doctest: +SKIP
    >>> evaluate(match(source, target), target, *truth).mean()  # doctest: +SKIP
    """
    lines = (files("unbend.datasets") / "tosca_remeshed.sha256").read_text("utf-8").splitlines()
    registry = {name: digest for digest, name in (line.split() for line in lines)}
    target = cache_folder() / "tosca_remeshed" if folder is None else Path(folder)
    return fetch_files(registry, target, base_url, _TOSCA_TERMS)


def fetch_files(registry: Mapping[str, str], folder: Path, base_url: str, terms: str) -> Path:
    """Download files that are missing from a folder, or whose SHA-256 is not that of the registry.

    See :func:`fetch_tosca_remeshed` for errors.
    """
    try:
        import pooch
    except ImportError:
        raise MissingExtraError("pooch") from None

    address = urlsplit(base_url)
    here = address.scheme == "http" and address.hostname in ("127.0.0.1", "::1", "localhost")
    if address.scheme != "https" and not here:
        raise InputError(f"base_url must begin with https://, not {base_url!r}")
    source = base_url.rstrip("/") + "/"
    name = ""
    try:
        missing = [name for name in registry if not (folder / name).is_file()]
        if missing:
            print(
                f"{terms}\nDownloading {plural(len(missing), 'file')} to {folder}", file=sys.stderr
            )
        client = pooch.create(folder, source, registry=dict(registry))
        for name in registry:
            client.fetch(name)  # if it is missing or has another SHA-256
    except OSError as error:  # no network, no such page, no room, no permission
        raise FileError(
            f"cannot download {source}{name} to {folder}: {error}; what has arrived is kept, so "
            "correct that and try again"
        ) from error
    except ValueError as error:  # what pooch raises when the SHA-256 differs
        raise FileError(
            f"{source}{name} is not the file it should be (its SHA-256 differs); try again, or "
            "give another base_url"
        ) from error
    return folder
