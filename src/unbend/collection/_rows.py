"""What a collection returns: small frozen rows."""

from __future__ import annotations

from dataclasses import dataclass

from unbend._display import Brief, is_doubtful
from unbend.errors import UnbendError


@dataclass(frozen=True)
class Entry:
    """One shape of a collection.

    Attributes
    ----------
    id : str
        Hash of its file's bytes, 32 hexadecimal digits.
    path : str
        Where the file was when it was added; of several files, the first by name.
    n_vertices, n_faces : int
    area : float
        In the file's squared units of length; 0 for a point cloud.
    notes : str
        What was done to the mesh to describe it.
    also : tuple of str
        The paths of other files with the same content.
    """

    id: str
    path: str
    n_vertices: int
    n_faces: int
    area: float
    notes: str
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class Hit:
    """One shape that a search found.

    Attributes
    ----------
    id, path, also
        See :class:`Entry`.
    distance : float
        Of the descriptors; 0 for the same shape.
    energy : float or None
        Of its match with the query, where that ranks; infinite where it could not be matched.
    """

    id: str
    path: str
    distance: float
    energy: float | None = None
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class Failure:
    """A shape, or a pair of shapes, that failed, and why.

    Attributes
    ----------
    path : str
        The shape's file; of a pair of shapes both, with an arrow between them.
    reason : str
        One sentence.
    """

    path: str
    reason: str

    @classmethod
    def of(cls, path: str, error: Exception) -> Failure:
        """Give an error's sentence as the reason, and its kind where it is none of ours."""
        kind = "" if isinstance(error, UnbendError) else f"{type(error).__name__}: "
        return cls(path, f"{kind}{error}".split("\n", 1)[0])


@dataclass(frozen=True, repr=False)
class Added(Brief):
    """Result of adding shapes.

    Attributes
    ----------
    added, skipped : int
        Shapes that are new, and files whose content was there, from the same call or before.
    new_paths : int
        Skipped files whose path was not there before: copies, and files that were moved.
    failures : tuple of Failure
    seconds : float
    """

    added: int
    skipped: int
    new_paths: int
    failures: tuple[Failure, ...]
    seconds: float


@dataclass(frozen=True, repr=False)
class Matched(Brief):
    """Result of matching pairs of shapes.

    Attributes
    ----------
    matched, skipped : int
        Pairs that are new, and pairs whose match was there before.
    failures : tuple of Failure
    seconds : float
    doubtful : int
        Pairs, of all these, whose match may well be wrong: their confidence is below 0.6.
    """

    matched: int
    skipped: int
    failures: tuple[Failure, ...]
    seconds: float
    doubtful: int


@dataclass(frozen=True)
class RegisteredShape:
    """A shape that a template is registered to.

    Attributes
    ----------
    name, path, file : str
        A unique name, the shape's file, and the name of the mesh that was written.
    confidence, coverage, scan_coverage : float
        See :class:`unbend.correspondence.Registration`.
    mean_distance, distance_95 : float
        Mean and 95 % quantile of the vertices' distances from the shape, in its unit.
    warnings : tuple of str
        Of matching and registering.
    also : tuple of str
        See :class:`Entry`.
    """

    name: str
    path: str
    file: str
    confidence: float
    coverage: float
    scan_coverage: float
    mean_distance: float
    distance_95: float
    warnings: tuple[str, ...]
    also: tuple[str, ...]

    @property
    def doubtful(self) -> bool:
        """Whether the match may well be wrong: its confidence is below 0.6."""
        return is_doubtful(self.confidence)


@dataclass(frozen=True, repr=False)
class Registered(Brief):
    """Result of registering a template to shapes.

    Attributes
    ----------
    registered, skipped : int
        Shapes that are new, and those that were there before.
    shapes : tuple of RegisteredShape
    failures : tuple of Failure
    seconds : float
    """

    registered: int
    skipped: int
    shapes: tuple[RegisteredShape, ...]
    failures: tuple[Failure, ...]
    seconds: float


@dataclass(frozen=True)
class Info:
    """Size of a collection, and how its shapes are described.

    Attributes
    ----------
    n_shapes, n_files : int
    n_bytes : int or None
        On disk; None in an object store.
    version : str
        Of the descriptors.
    descriptor_length : int
    indexed : bool
        Whether there is an index for approximate search.
    """

    n_shapes: int
    n_files: int
    n_bytes: int | None
    version: str
    descriptor_length: int
    indexed: bool
