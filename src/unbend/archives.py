"""Archives (.npz): functional maps and whole matches, never as pickles."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend._files import atomic_write, check_writable, read_bytes
from unbend._formats.npy import read_array
from unbend._types import FloatArray
from unbend.errors import FileError, InputError
from unbend.maps import counted_from_zero, whole_numbers
from unbend.matching import Hypothesis, Match

_REQUIRED = (
    "source_to_target",
    "target_to_source",
    "functional_map",
    "orientation",
    "residual",
    "confidence",
)
_OPTIONAL = ("faces", "weights", "mirrored")


def write_functional_map(path: str | os.PathLike[str], functional_map: npt.ArrayLike) -> None:
    """Write a functional map to a .npz file, under the name ``functional_map``.

    Parameters
    ----------
    path : path
        With the suffix .npz.
    functional_map : (k_source, k_target) array_like of float

    Raises
    ------
    FileError
        If the file cannot be written.
    InputError
        If the map is not a table of finite numbers.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from unbend.archives import read_functional_map, write_functional_map
    >>> path = Path(tempfile.mkdtemp()) / "map.npz"
    >>> write_functional_map(path, np.eye(2))
    >>> read_functional_map(path)
    array([[1., 0.],
           [0., 1.]])
    """
    array = np.asarray(functional_map, dtype=np.float64)
    if array.ndim != 2 or not array.size or not np.isfinite(array).all():
        raise InputError("a functional map must be a table of finite numbers")
    _save(path, {"functional_map": array})


def read_functional_map(path: str | os.PathLike[str]) -> FloatArray:
    """Read a functional map from a .npz file, written on its own or with a match.

    Parameters
    ----------
    path : path
        With the suffix .npz, holding an array named ``functional_map``.

    Returns
    -------
    (k_source, k_target) ndarray of float64

    Raises
    ------
    FileError
        If the file cannot be read or holds no such table.

    See Also
    --------
    write_functional_map, write_match : The reverse.
    """
    array = _load(path, ("functional_map",))["functional_map"]
    if array.ndim != 2 or array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise FileError(f"{Path(path).name}: its functional_map is not a table of finite numbers")
    return np.asarray(array, dtype=np.float64)


def write_match(path: str | os.PathLike[str], match: Match) -> None:
    """Write everything that is known of a match to a .npz file.

    Parameters
    ----------
    path : path
        With the suffix .npz.
    match : Match

    Raises
    ------
    FileError
        If the file cannot be written.

    See Also
    --------
    read_match : The reverse.
    """
    arrays = {name: np.asarray(getattr(match, name)) for name in _REQUIRED}
    arrays["hypotheses"] = np.reshape(
        [(one.energy, one.orientation) for one in match.hypotheses], (-1, 2)
    )
    for name in _OPTIONAL:
        if getattr(match, name) is not None:
            arrays[name] = np.asarray(getattr(match, name))
    _save(path, arrays)


def read_match(path: str | os.PathLike[str]) -> Match:
    """Read a match that :func:`write_match` wrote.

    Parameters
    ----------
    path : path
        With the suffix .npz.

    Returns
    -------
    Match

    Raises
    ------
    FileError
        If the file cannot be read or does not hold a match.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from unbend.datasets import make_sphere
    >>> from unbend.archives import read_match, write_match
    >>> from unbend.matching import match
    >>> path = Path(tempfile.mkdtemp()) / "match.npz"
    >>> write_match(path, match(make_sphere(2), make_sphere(2), method="icp"))
    >>> len(read_match(path).source_to_target)
    162
    """
    arrays = _load(path, _REQUIRED)
    name = Path(path).name
    fields: dict[str, Any] = {"functional_map": read_functional_map(path)}
    for field in ("source_to_target", "target_to_source", "faces", "mirrored"):
        if field in arrays:
            try:
                fields[field] = counted_from_zero(whole_numbers(arrays[field]), 0, None)
            except FileError as error:
                raise FileError(f"{name}: its {field} {error}") from None
    for field in ("orientation", "residual", "confidence"):
        if arrays[field].shape != () or arrays[field].dtype.kind not in "fiu":
            raise FileError(f"{name}: its {field} is not a number")
        fields[field] = float(arrays[field])
    n = len(fields["source_to_target"])
    if "weights" in arrays:
        if arrays["weights"].shape != (n, 3) or arrays["weights"].dtype.kind != "f":
            raise FileError(f"{name}: its weights are not {n} rows of 3 numbers")
        fields["weights"] = np.asarray(arrays["weights"], dtype=np.float64)
    known = np.reshape(arrays.get("hypotheses", np.empty(0)), (-1, 2)).tolist()
    return Match(**fields, hypotheses=tuple(Hypothesis(*row) for row in known))


def _save(path: str | os.PathLike[str], arrays: dict[str, npt.NDArray[Any]]) -> None:
    check_writable(path, (".npz",))
    with atomic_write(path) as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _load(path: str | os.PathLike[str], required: tuple[str, ...]) -> dict[str, npt.NDArray[Any]]:
    path = Path(path)
    data = read_bytes(path, (".npz",))
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            arrays = {name.removesuffix(".npy"): read_array(archive.read(name)) for name in names}
    except FileError as error:
        raise FileError(f"{path.name}: {error}") from error.__cause__
    except Exception as error:  # zipfile raises many kinds on damaged archives
        raise FileError(f"{path.name}: not a .npz file, or a damaged one") from error
    for name in required:
        if name not in arrays:
            raise FileError(f"{path.name}: holds no {name}; it was not written by unbend match")
    return arrays
