"""Our own shapes in the layout of the collections, for runs without any data."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from paper.collection import Collection
from unbend import write_map, write_mesh
from unbend.datasets import Shape, make_biped, make_octopus, make_quadruped, rest_map

_SPECIES: dict[str, tuple[Callable[..., Shape], dict[str, Any], tuple[str, ...]]] = {
    "dog": (make_quadruped, {"species": "dog"}, ("standing", "galloping", "sitting", "grazing")),
    "cat": (make_quadruped, {"species": "cat"}, ("standing", "walking", "stretching", "howling")),
    "horse": (make_quadruped, {"species": "horse"}, ("standing", "galloping", "rearing", "lying")),
    "octopus": (make_octopus, {}, ("floating", "crawling", "swimming", "reaching")),
    "human": (make_biped, {"species": "human"}, ("standing", "running", "sitting", "dancing")),
    "child": (make_biped, {"species": "child"}, ("standing", "kicking", "waving", "bowing")),
}
_QUICK_POSES = 3
_PEOPLE = (
    "standing", "walking", "running", "sitting", "squatting", "waving", "kicking", "lunging",
    "bowing", "dancing", "spread",
)  # fmt: skip
_N_VERTICES = {True: 2000, False: 8000}  # quick, full


def make_species(folder: Path, quick: bool, progress: Callable[[str], None]) -> Collection:
    """Animals and people, each pose meshed on its own, with true and mirrored correspondences."""
    n_vertices = _N_VERTICES[quick]
    place = folder / f"synthetic-{n_vertices}"
    corres = place / "corres"
    corres.mkdir(parents=True, exist_ok=True)
    class_of: dict[str, str] = {}
    files: dict[str, Path] = {}
    for kind, (make, options, poses) in _SPECIES.items():
        names = [f"{kind}{i}" for i in range(len(poses[: _QUICK_POSES if quick else None]))]
        class_of |= dict.fromkeys(names, kind)
        files |= {name: place / f"{name}.off" for name in names}
        if all((corres / f"{name}.sym.vts").exists() for name in names):
            continue
        first: Shape | None = None
        for i, (name, pose) in enumerate(zip(names, poses, strict=False)):
            progress(f"making {kind}, {pose}")
            shape = make(pose, n_vertices=n_vertices, meshing=i, **options)
            first = shape if first is None else first
            truth = rest_map(first, shape)
            write_mesh(files[name], shape.mesh)
            write_map(corres / f"{name}.vts", truth)
            write_map(corres / f"{name}.sym.vts", shape.mirror[truth])
    return Collection("shapes of our own", class_of, files, corres)


def make_people(folder: Path, quick: bool, progress: Callable[[str], None]) -> Collection:
    """One person in many poses, numbered alike, as in SCAPE."""
    n_vertices = _N_VERTICES[quick]
    place = folder / f"synthetic-people-{n_vertices}"
    place.mkdir(parents=True, exist_ok=True)
    names = [f"mesh{i:03d}" for i in range(len(_PEOPLE))]
    files = {name: place / f"{name}.off" for name in names}
    for name, pose in zip(names, _PEOPLE, strict=True):
        if not files[name].exists():
            progress(f"making a person, {pose}")
            write_mesh(files[name], make_biped(pose, n_vertices=n_vertices).mesh)
    return Collection("one person of our own", dict.fromkeys(names, "person"), files, None)
