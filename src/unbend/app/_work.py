"""What a job is given, and how it hands back files, pictures, and the lines that do the same."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from unbend._text import quoted
from unbend._types import Progress
from unbend.choices import Axis
from unbend.correspondence import read_match
from unbend.errors import MeshError
from unbend.io import file_extras, keeps_all, write_mesh
from unbend.matching import Match
from unbend.mesh import Mesh
from unbend.report.figures import drawable, upright
from unbend.report.raster import thumbnail

Result = dict[str, Any]
Landmarks = Sequence[Mapping[str, Any]]  # each a label, "name", and vertices, "at"

_PICTURE = 240  # pixels across


def by_label(landmarks: Landmarks) -> Any:
    """Give landmarks as unbend takes them: by label, or without if two have the same."""
    names = [one["name"] for one in landmarks]
    at = [one["at"] if len(one["at"]) > 1 else one["at"][0] for one in landmarks]
    return dict(zip(names, at, strict=True)) if len(set(names)) == len(names) else at


@dataclass
class Work:
    """Shapes, perhaps their map, the folder for files of the result, and how progress is told.

    Files in the folder are numbered: a name that the user sees is never a path.
    """

    folder: Path
    progress: Progress
    up: Axis
    paths: list[str]
    meshes: list[Mesh]
    map_file: str = ""
    map_name: str = ""
    files: list[dict[str, str]] = field(default_factory=list)
    pictures: list[dict[str, str]] = field(default_factory=list)

    @property
    def names(self) -> list[str]:
        return [mesh.name for mesh in self.meshes]

    @property
    def stems(self) -> list[str]:
        found = [Path(name).stem for name in self.names]
        return found if len(set(found)) == len(set(self.names)) else self.names

    @property
    def report(self) -> list[str]:
        """Options that write the page from the command line."""
        return ["--report", "report.html", *(["--up", self.up] if self.up != "y" else [])]

    @property
    def page(self) -> Path:
        return self.folder / "page.html"

    def read_map(self) -> Match:
        source, target = self.meshes
        return read_match(self.map_file, source=source, target=target)

    def new_file(self, name: str, about: str) -> Path:
        path = self.folder / f"{len(self.files)}{Path(name).suffix}"
        self.files.append({"name": name, "about": about, "path": str(path)})
        return path

    def keep_mesh(self, stem: str, about: str, mesh: Mesh, colors: Any, number: int = 0) -> None:
        """Write a given shape, moved or not, in the formats of MeshLab, Blender and others."""
        given = self.meshes[number]
        whole, moved = mesh.n_faces == given.n_faces, mesh is not given
        for suffix in (".ply",) if mesh.is_point_cloud else (".ply", ".obj", ".glb"):
            name, told, shown = stem + suffix, about, colors
            keeps = whole and (moved or suffix == ".obj")
            like = self.like(name, number) if keeps else None
            if like is not None:
                told = f"{about}, with all else of {self.names[number]}"
                shown = colors if suffix == ".obj" else None  # a GLB file keeps its own
            write_mesh(self.new_file(name, told), mesh, colors=shown, like=like)

    def like(self, name: str, number: int) -> Path | None:
        """Copy the file of a shape, if it holds more that a file of this name keeps.

        The result is not saved in our folder: it names materials as the file of the shape does.
        """
        original = self.paths[number]
        if not (file_extras(original) and keeps_all(name, original)):
            return None
        return Path(shutil.copy(original, self.folder / f"like{Path(name).suffix}"))

    def draw(self, caption: str, mesh: Mesh, colors: Any = None) -> None:
        """Draw a shape, with colours from 0 to 255; points that are too few have no picture."""
        try:
            faces = drawable(mesh).faces
        except MeshError:
            return
        turned = Mesh(mesh.vertices @ upright(self.up).T, faces)
        path = self.folder / f"picture-{len(self.pictures)}.png"
        shares = None if colors is None else np.asarray(colors) / 255
        path.write_bytes(thumbnail(turned, _PICTURE, shares))
        self.pictures.append({"caption": caption, "path": str(path)})

    def python(self, names: str, *lines: str) -> list[str]:
        """Lines of Python that import names of unbend, read both shapes, and perhaps their map."""
        (a, b), found = self.names, [f"from unbend import {names}"]
        found.append(f"source, target = read_mesh({a!r}), read_mesh({b!r})")
        if self.map_name:
            found.append(f"found = read_match({self.map_name!r}, source=source, target=target)")
        return [*found, *lines]

    def result(
        self,
        title: str,
        command: Sequence[str],
        python: Sequence[str],
        facts: Mapping[str, str] | None = None,
    ) -> Result:
        """Put a result together, with the words and lines that do the same, imports first."""
        words = [f"./{one}" if one[:1] == "-" and one in self.names else one for one in command]
        return {
            "title": title,
            "facts": list((facts or {}).items()),
            "files": self.files,
            "pictures": self.pictures,
            "page": self.page.exists(),
            "command": quoted("unbend", *words),
            "python": "\n".join([python[0], "", *python[1:]]),
        }
