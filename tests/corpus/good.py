"""What is in order: small meshes, files of them, and the commands that read one."""

import functools
import io
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from unbend import Mesh, write_map, write_mesh
from unbend.datasets import make_sphere

Command = str  # what follows `unbend`; STORE stands for a collection of two shapes


@functools.cache
def stone() -> Mesh:
    """Give a closed surface of 42 vertices without symmetry."""
    ball = make_sphere(1)
    x, y, z = ball.vertices.T
    points = np.stack([x * 1.5 + 0.3 * y * z, y * (1 + 0.2 * x), 0.8 * z + 0.25 * x * y], axis=1)
    return Mesh(points, ball.faces)


def square_text() -> str:
    """Give an OFF file of two triangles, for what is damaged line by line."""
    return "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0.0 1 0.5\n3 0 1 2\n3 0 2 3\n"


def npy(array: npt.ArrayLike, *, pickled: bool = False) -> bytes:
    """Give what NumPy would write of an array."""
    file = io.BytesIO()
    np.save(file, array, allow_pickle=pickled)
    return file.getvalue()


def beside(folder: Path) -> None:
    """Write the good files that commands are given beside the bad one."""
    write_mesh(folder / "good.off", stone())
    write_map(folder / "map.txt", np.arange(42))
    write_map(folder / "truth.txt", np.arange(42))
    (folder / "values.csv").write_text("".join(f"{i}\n" for i in range(42)))


@functools.cache
def store() -> str:
    """Make a collection of two shapes, once, in a folder that goes with this process."""
    from unbend.collection import Collection

    folder = tempfile.TemporaryDirectory()
    _KEPT.append(folder)
    for i in range(2):
        write_mesh(
            Path(folder.name) / f"stone{i}.off",
            Mesh(stone().vertices * (1, 1, 1 + i), stone().faces),
        )
    Collection(Path(folder.name) / "store").add(folder.name, workers=0)
    return str(Path(folder.name) / "store")


_KEPT: list[tempfile.TemporaryDirectory[str]] = []


def in_turn(commands: tuple[Command, ...], i: int) -> tuple[Command, ...]:
    """Give all commands to the first file of a kind, and two to each other, different ones.

    What all of them call is the same reader.
    """
    n = len(commands)
    return tuple(commands[k % n] for k in (2 * i, 2 * i + 1)) if i and n > 2 else commands


def reading(name: str) -> tuple[Command, ...]:
    """Give every command that reads a mesh, with this one."""
    return (
        f"check {name}",
        f"canonical {name} -o out.ply --report out.html --no-cache",
        f"distance {name} --from 0 -o out.npy --no-cache",
        f"match {name} good.off -o out.npz --no-cache",
        f"match good.off {name} -o out.npz --figure out.png --no-cache",
        f"similarity good.off {name} --csv out.csv --no-cache",
        f"register good.off {name} --map map.txt -o out.ply",
        f"transfer good.off {name} --map map.txt --values values.csv -o out.csv",
        f"evaluate map.txt {name} truth.txt truth.txt",
        f"collection search STORE {name}",
    )
