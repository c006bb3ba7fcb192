"""Small shapes in files, and what a collection keeps of them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import unbend
from once import once
from unbend import write_map, write_mesh
from unbend.collection import Collection, _adding, _pairs, _ranking, _registering, descriptor
from unbend.datasets import make_sphere

BALL = make_sphere(2)
MATCH, SYMMETRY, DESCRIPTOR = map(once, (unbend.match, unbend.symmetry, descriptor))


@pytest.fixture(scope="module", autouse=True)
def computed_once() -> Iterator[None]:
    """The same shapes are described and matched once: when they are is tested here, not how."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_adding, "descriptor", DESCRIPTOR)
        patch.setattr(unbend, "symmetry", SYMMETRY)
        for module in (unbend, _pairs, _ranking, _registering):
            patch.setattr(module, "match", MATCH)
        yield


def write_stones(folder: Path, count: int) -> list[Path]:
    """Write so many stones, each less round than the one before."""
    folder.mkdir(exist_ok=True)
    paths = [folder / f"stone{i:02}.ply" for i in range(count)]
    for i, path in enumerate(paths):
        x, y, z = BALL.vertices.T
        points = np.stack([x * (1 + 0.1 * i), y * (1 + 0.05 * i * z), z + 0.03 * i * x**2], axis=1)
        write_mesh(path, (points * [1, 0.8, 0.6], BALL.faces))
    return paths


def write_pair(folder: Path) -> Collection:
    """Write two stones, a and b, a map and values for them, and a collection of both."""
    for path, name in zip(write_stones(folder, 2), "ab", strict=True):
        path.rename(folder / f"{name}.ply")
    store = Collection(folder / "store")
    store.add(folder, workers=0)
    write_map(folder / "map.txt", np.arange(162))
    (folder / "values.csv").write_text("".join(f"{i / 4}\n" for i in range(162)))
    return store


def rows_of(collection: Collection) -> list[dict[str, Any]]:
    """All that is kept, ordered by path."""
    store = collection._store
    return sorted(store.select(store.schema.names), key=lambda row: row["path"])
