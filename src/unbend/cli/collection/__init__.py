"""``unbend collection``: many shapes in one store."""

from __future__ import annotations

from unbend.cli._command import make_group
from unbend.cli.collection.compare import evaluate, groups, matrix, search
from unbend.cli.collection.maps import match, mean, register
from unbend.cli.collection.shapes import add, export, info, list_, remove

app = make_group(
    "Store many shapes; search, group and match them.",
    *(add, list_, info, remove, search, matrix, groups, match, register, mean, evaluate, export),
)
