"""Many shapes: kept in one store, searched by shape, grouped, matched in pairs."""

from unbend.collection._collection import Collection
from unbend.collection._groups import find_groups
from unbend.collection._rows import Added, Entry, Failure, Hit, Info, Matched

__all__ = ["Added", "Collection", "Entry", "Failure", "Hit", "Info", "Matched", "find_groups"]
