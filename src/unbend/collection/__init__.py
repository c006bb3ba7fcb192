"""Many shapes: one store, what describes each, search, groups, pairs, and statistics over them."""

from unbend.collection._collection import Collection
from unbend.collection._descriptor import DESCRIPTOR_VERSION, descriptor
from unbend.collection._groups import find_groups
from unbend.collection._retrieval import Retrieval, retrieval_measures
from unbend.collection._rows import Added, Entry, Failure, Hit, Info, Matched

__all__ = [
    "DESCRIPTOR_VERSION",
    "Added",
    "Collection",
    "Entry",
    "Failure",
    "Hit",
    "Info",
    "Matched",
    "Retrieval",
    "descriptor",
    "find_groups",
    "retrieval_measures",
]
