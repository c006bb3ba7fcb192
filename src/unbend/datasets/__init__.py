"""Shapes to try things on: closed forms, and animals in many poses."""

from __future__ import annotations

from unbend.datasets.primitives import make_sphere

__all__ = ["make_sphere"]
