"""Closed bodies of our own of which one or both have a part that the other lacks."""

import functools
from pathlib import Path

import numpy as np
from match_cases import Case, Draw, Pair, of_pair
from scipy.spatial import cKDTree

from testshapes.changed import CHANGES, is_usual, make_changed
from unbend._types import BoolArray, FloatArray, IntArray
from unbend.errors import InputError

_NEAR = 0.03  # farther apart on the plain body, in units of its length, are different points


def extras(data: Path, seed: int, count: int | None) -> list[Draw]:
    """List pairs of animals and of people, each of its own proportions."""
    return [functools.partial(extra_case, seed, i) for i in range(24 if count is None else count)]


def extra_case(seed: int, number: int) -> Case:
    """Draw two bodies. One has a part more or less than usual, or both in every third case."""
    chance = np.random.default_rng([seed, number, *b"extra"])
    kind = list(CHANGES)[number % 2]
    while True:
        one, other = chance.permutation(list(CHANGES[kind]))[:2]
        names = [str(one), str(other) if number % 3 == 0 else ""][:: chance.choice([1, -1])]
        try:
            source, target = (make_changed(chance, kind, name) for name in names)
        except InputError:  # parts touch
            continue
        known = [(shape.reference, is_usual(shape)) for shape in (source, target)]
        name = ": ".join(one or kind for one in names)
        there, back = truth(*known), truth(*known[::-1])
        return of_pair(Pair(f"{name} {number}", source.mesh, target.mesh, there, back))


def truth(source: tuple[FloatArray, BoolArray], target: tuple[FloatArray, BoolArray]) -> IntArray:
    """Target vertex of each source vertex, -1 for none, by their places on the plain body."""
    usual = np.flatnonzero(target[1])
    away, nearest = cKDTree(target[0][usual]).query(source[0])
    return np.where(source[1] & (away < _NEAR), usual[nearest], -1)
