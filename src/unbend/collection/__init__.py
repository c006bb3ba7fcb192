"""Many shapes: one store, what describes each, search, groups, pairs, and statistics over them."""

from unbend.collection._collection import Collection
from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._groups import find_groups
from unbend.collection._retrieval import Retrieval, retrieval_measures
from unbend.collection._rows import Added, Entry, Failure, Hit, Info, Matched
from unbend.collection._statistics import (
    LeftOut,
    MeanShape,
    Statistics,
    mean_shape,
    shape_statistics,
)

__all__ = [
    "DESCRIPTOR_VERSION",
    "Added",
    "Collection",
    "Entry",
    "Failure",
    "Hit",
    "Info",
    "LeftOut",
    "Matched",
    "MeanShape",
    "Retrieval",
    "Statistics",
    "descriptor",
    "find_groups",
    "mean_shape",
    "retrieval_measures",
    "shape_statistics",
]
