"""Many shapes: one store, what describes each, search, groups, pairs, and statistics over them."""

from unbend.collection._collection import Collection
from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._files import (
    find_file,
    find_files,
    make_folder,
    matches,
    read_found,
    short_names,
    warn_of_others,
)
from unbend.collection._groups import find_groups
from unbend.collection._mean import MeanShape, mean_shape, write_mean
from unbend.collection._registering import read_registrations, register_files
from unbend.collection._retrieval import Retrieval, read_labels, retrieval_measures
from unbend.collection._rows import (
    Added,
    Entry,
    Failure,
    Hit,
    Info,
    Matched,
    Registered,
    RegisteredShape,
)
from unbend.collection._statistics import Statistics, shape_statistics
from unbend.collection._store import check_outside

__all__ = [
    "DESCRIPTOR_VERSION",
    "Added",
    "Collection",
    "Entry",
    "Failure",
    "Hit",
    "Info",
    "Matched",
    "MeanShape",
    "Registered",
    "RegisteredShape",
    "Retrieval",
    "Statistics",
    "check_outside",
    "descriptor",
    "find_file",
    "find_files",
    "find_groups",
    "make_folder",
    "matches",
    "mean_shape",
    "read_found",
    "read_labels",
    "read_registrations",
    "register_files",
    "retrieval_measures",
    "shape_statistics",
    "short_names",
    "warn_of_others",
    "write_mean",
]
