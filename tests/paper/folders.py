"""Folders as a user would have them, with small shapes of our own in place of the real ones."""

from functools import cache
from pathlib import Path

import numpy as np

from unbend import Mesh, write_mesh
from unbend.datasets import make_biped, make_quadruped


@cache
def dog(pose: str) -> Mesh:
    return make_quadruped(pose, n_vertices=600).mesh


@cache
def person(pose: str) -> Mesh:
    return make_biped(pose, n_vertices=600).mesh


def write_animals(folder: Path) -> Path:
    """Three poses of a dog, numbered alike."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, pose in enumerate(("standing", "walking", "lying")):
        write_mesh(folder / f"dog{i}.off", dog(pose))
    return folder


def write_people(folder: Path) -> Path:
    """Three poses of a person, numbered alike."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, pose in enumerate(("standing", "walking", "sitting")):
        write_mesh(folder / f"mesh{i:03d}.off", person(pose))
    return folder


def write_edited(path: Path) -> None:
    """A dog with one more vertex, which no face uses."""
    mesh = dog("standing")
    write_mesh(path, Mesh(np.vstack([mesh.vertices, [9.0, 9.0, 9.0]]), mesh.faces))
