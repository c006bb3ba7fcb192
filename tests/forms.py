"""Canonical forms of both kinds, for tests that hold for each."""

from typing import Any

from unbend import canonical_form, sampled_canonical_form
from unbend.canonical import CanonicalForm


def form_of(mesh: Any, *, method: str = "exact", **options: Any) -> CanonicalForm:
    return (canonical_form if method == "exact" else sampled_canonical_form)(mesh, **options)
