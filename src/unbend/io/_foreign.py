"""Meshes of other programs: objects, known by their attributes, and files that they must read."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from unbend._arrays import first_equal_row
from unbend._types import FloatArray, StrPath
from unbend.errors import FileError, InputError, MissingExtraError
from unbend.io.formats import gltf
from unbend.io.formats.contents import NO_FACES, Contents, triangulate
from unbend.mesh import Mesh, label_linked

_GLTF = (".glb", ".gltf")
_TRIMESH = (*_GLTF, ".3mf", ".dae")
_MESHIO = (".msh", ".mesh", ".inp", ".bdf")
_FREESURFER = (".pial", ".white", ".inflated", ".sphere")  # its surfaces
FREESURFER_VALUES = (".thickness", ".curv", ".sulc", ".annot")
_NIBABEL = (".gii", *_FREESURFER, *FREESURFER_VALUES)
_READ_BY_NIBABEL = ("read by nibabel",)
# GIFTI's intents, numbered as in NIfTI.
_LABEL, _POINTSET, _TRIANGLE, _NODE_INDEX = 1002, 1008, 1009, 2002
_NEAREST = 5  # positions, itself among them, that may be one
_ROUNDING = float(np.finfo(np.float32).eps)  # of numbers in single precision, at most
FOREIGN_SUFFIXES = (*_TRIMESH, *_MESHIO, *_NIBABEL)


class _HasVertices(Protocol):  # a mesh of trimesh or Open3D
    @property
    def vertices(self) -> Any: ...


class _HasPoints(Protocol):  # a mesh of PyVista or meshio, or the points of Open3D
    @property
    def points(self) -> Any: ...


class _HasArrays(Protocol):  # a GIFTI image of nibabel
    @property
    def darrays(self) -> Any: ...


MeshLike: TypeAlias = (
    Mesh
    | StrPath
    | Sequence[npt.ArrayLike]
    | npt.NDArray[Any]
    | _HasVertices
    | _HasPoints
    | _HasArrays
)
"""Whatever is taken for a mesh: see :func:`as_mesh`."""


def mesh_of(given: Any) -> Mesh | None:
    """Make a mesh of an object of trimesh, Open3D, meshio, VTK or nibabel; None if it is none."""
    if hasattr(given, "vertices"):
        for faces in ("faces", "triangles"):  # trimesh; Open3D
            if hasattr(given, faces):
                return Mesh(given.vertices, getattr(given, faces))
        if hasattr(given, "colors"):  # trimesh's points
            return Mesh(given.vertices)
    if hasattr(given, "to_legacy"):  # Open3D's tensors
        return mesh_of(given.to_legacy())
    if hasattr(given, "extract_surface") and not hasattr(given, "GetPolys"):  # PyVista
        raise InputError(f"{type(given).__name__} is not a surface: give its extract_surface()")
    if hasattr(given, "points") and hasattr(given, "cells_dict"):  # meshio
        points = np.asarray(given.points)
        cells = [block for block in given.cells if block.type in ("triangle", "quad", "polygon")]
        others = sorted({block.type for block in given.cells} - {one.type for one in cells})
        if others and not cells:
            raise InputError(f"a mesh of {', '.join(others)} has no surface: give its triangles")
        flat = [np.asarray(row) for block in cells for row in block.data]
        if points.shape[1] == 2:
            points = np.column_stack([points, np.zeros(len(points))])
        found = _from_polygons(points, [len(row) for row in flat], np.concatenate([[], *flat]))
        left = (f"cells left out: {', '.join(others)}",) if others else ()
        return Mesh(found.vertices, found.faces, notes=found.notes + left)
    if hasattr(given, "GetPoints") and hasattr(given, "GetPolys"):  # VTK, PyVista
        points, polygons = given.GetPoints(), given.GetPolys()
        if given.GetNumberOfStrips():
            raise InputError("triangle strips are not read: apply vtkTriangleFilter first")
        sizes = np.diff(np.asarray(polygons.GetOffsetsArray()))
        corners = np.asarray(polygons.GetConnectivityArray())
        positions = np.asarray(points.GetData()) if points else np.empty((0, 3))
        return _from_polygons(positions, sizes, corners)
    if hasattr(given, "points") and hasattr(given, "estimate_normals"):  # Open3D's points
        return Mesh(given.points)
    if hasattr(given, "darrays"):  # nibabel's GIFTI
        surface = _of_gifti(given)
        if len(surface.vertices) == 0:
            raise InputError("a GIFTI image without points is not a mesh: give one of a surface")
        return Mesh(surface.vertices, surface.faces)
    return None


def _from_polygons(points: Any, sizes: npt.ArrayLike, corners: npt.NDArray[Any]) -> Mesh:
    faces, notes = triangulate(
        np.asarray(sizes, dtype=np.int64),
        corners.astype(np.int64),
        np.asarray(points, dtype=np.float64),
    )
    return Mesh(points, faces, notes=tuple(notes))


def read_foreign(path: Path, data: bytes) -> Contents:
    """Read a file with another program, and say that in the notes."""
    suffix = path.suffix.lower()
    program = "trimesh" if suffix in _TRIMESH else "meshio" if suffix in _MESHIO else "nibabel"
    needed = (program, "networkx", "lxml") if suffix == ".3mf" else (program,)
    if missing := [one for one in needed if find_spec(one) is None]:
        raise MissingExtraError(*missing)
    try:
        if suffix in _TRIMESH:
            return _by_trimesh(suffix, data)
        if suffix in _NIBABEL:
            return _by_nibabel(path, data)
        _refuse_misread(suffix, data)
        return _by_meshio(path)
    except InputError:
        raise
    except Exception as error:  # their readers raise anything
        told = not isinstance(error, (LookupError, TypeError, AttributeError)) and str(error)
        why = told or f"it is damaged, or no {suffix} file that it knows"
        raise FileError(f"{program} cannot read it: {why}") from error


def _refuse_misread(suffix: str, data: bytes) -> None:
    """Raise FileError for a file that meshio would read wrong, or for ever."""
    if suffix == ".bdf" and not re.search(rb"BEGIN BULK.*\nENDDATA", data, re.DOTALL):
        raise FileError("truncated: it lacks the line BEGIN BULK, or ENDDATA after it")
    systems = {".bdf": rb"CORD[12]", ".inp": rb"\*(?:SYSTEM\b|NODE\b.*SYSTEM *= *[CS])"}
    if suffix in systems and re.search(rb"(?im)^" + systems[suffix], data):
        raise FileError("has coordinate systems of its own, which are not read; save it without")
    if suffix != ".inp":
        return
    text = data.upper()
    if keyword := re.search(rb"(?m)^\*(?:NGEN|NFILL|NCOPY|ELGEN|ELCOPY)\b", text):
        word = keyword[0].decode()
        raise FileError(f"generates nodes or elements by {word}, which is not read; save them all")
    # A line that ends in a comma goes on.
    elsewhere = rb"(?:NODE|ELEMENT)[ \t]*,(?:.*,[ \t\r]*\n)?.*\bINPUT *="
    if re.search(rb"(?m)^\*(?:INCLUDE\b|" + elsewhere + rb")", text):
        raise FileError("includes other files, which are not read; save it as one")
    words = re.findall(rb"(?m)^\*(NODE|INSTANCE)[ \t]*(?:,|\r?$)", text)
    if len({*words}) < len(words):
        raise FileError("has several parts, which are not read; save one alone")


def _by_meshio(path: Path) -> Contents:
    """Read a file in the formats of its suffix; meshio's own ``read`` prints errors, and exits."""
    import meshio

    failures = []
    for kind in meshio.extension_to_filetypes[path.suffix.lower()]:
        try:
            given = getattr(meshio, kind).read(path)
            break
        except meshio.ReadError as error:
            failures.append(str(error))
    else:
        raise meshio.ReadError("; ".join(filter(None, failures)))
    mesh = mesh_of(given)
    assert mesh is not None
    values = {name: np.asarray(array) for name, array in given.point_data.items()}
    return Contents(mesh.vertices, mesh.faces, ("read by meshio", *mesh.notes), lambda: values)


def _by_nibabel(path: Path, data: bytes) -> Contents:
    """Read a GIFTI file, or a surface or values of FreeSurfer."""
    import nibabel

    suffix = path.suffix.lower()
    if suffix == ".gii":
        return _of_gifti(nibabel.GiftiImage.from_bytes(data))
    if suffix in _FREESURFER:
        vertices, faces = nibabel.freesurfer.read_geometry(path)
        return Contents(vertices, faces, _READ_BY_NIBABEL)
    if suffix == ".annot":
        # Rows of its table, -1 where none: nibabel gives the next row if a colour is in none.
        colors, table, _ = nibabel.freesurfer.read_annot(path, orig_ids=True)
        rows = {color: row for row, color in enumerate(table[:, 4].tolist()) if color}
        values = np.array([rows.get(color, -1) for color in colors.tolist()])
    elif data.startswith(b"\xff\xff\xff"):
        values = nibabel.freesurfer.read_morph_data(path)
        if len(values) < int.from_bytes(data[3:7], "big"):
            raise FileError("truncated: it ends before its last value")
    else:  # which reads it as an old format that has no mark
        raise FileError("not FreeSurfer's format of values per vertex")
    return Contents(
        np.empty((0, 3)), NO_FACES, _READ_BY_NIBABEL, lambda: {suffix[1:]: _plain(values)}
    )


def _of_gifti(image: Any) -> Contents:
    """Take the surface of a GIFTI image and its values, of which it may lack either."""
    places, corners, columns = np.empty((0, 3)), NO_FACES, []
    intents = [one.intent for one in image.darrays]
    if max(intents.count(_POINTSET), intents.count(_TRIANGLE)) > 1:
        raise FileError("holds several surfaces: save each in a file of its own")
    for one in image.darrays:
        if one.intent == _POINTSET:
            places = one.data
        elif one.intent == _TRIANGLE:
            corners = one.data
        elif one.intent == _NODE_INDEX:
            raise FileError("numbers its rows (NODE_INDEX): save a row for each vertex, in order")
        else:
            columns.append(one)
    names = [one.meta.get("Name") or "value" for one in columns]
    if len({len(one.data) for one in columns}) > 1:
        raise FileError("its arrays of values differ in length: save each in a file of its own")
    first = int(_LABEL in intents)  # columns are joined if numbered from 0, and then averaged
    if len({*names}) < len(names) or (first and any(name.endswith("_0") for name in names)):
        names = [f"value_{i}" for i in range(first, first + len(names))]
    values = {name: _plain(one.data) for name, one in zip(names, columns, strict=True)}
    return Contents(places, corners, _READ_BY_NIBABEL, lambda: values)


def _plain(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Numbers in this machine's byte order."""
    return values.astype(np.float64 if values.dtype.kind == "f" else np.int64)


def _by_trimesh(suffix: str, data: bytes) -> Contents:
    """Read all parts of a scene, each where it stands; only from these bytes, never other files."""
    import trimesh

    given, left_out = gltf.readable(suffix, data) if suffix in _GLTF else (data, [])
    scene = trimesh.load_scene(io.BytesIO(given), file_type=suffix[1:], process=False)
    placed = [*_placed(scene)]
    vertices, faces, at = [np.empty((0, 3))], [NO_FACES], 0
    for part, placement in placed:
        if gltf.DRACO.encode() in data and not part.vertices.any():  # trimesh goes on without them
            raise FileError(
                "its Draco data could not be decoded (trimesh 5.1 can, if they are whole); save it "
                "without compression"
            )
        x, y, z = part.vertices.T[:, :, None]
        a, b, c, shift = placement[:3].T
        vertices.append(x * a + y * b + z * c + shift)  # @ may round equal rows differently
        corners = np.asarray(getattr(part, "faces", NO_FACES)) + at
        faces.append(corners[:, ::-1] if np.linalg.det(placement[:3, :3]) < 0 else corners)
        at += len(part.vertices)
    if not placed:
        raise FileError("holds no vertices")
    places, corners = np.concatenate(vertices), np.concatenate(faces)
    if len(placed) > 1 and suffix in _GLTF and np.isfinite(places).all():
        places = _joined(places, placed)
    values = [_values(part, linear=suffix in _GLTF) for part, _ in placed]
    names = dict.fromkeys(name for one in values for name in one)  # in one order
    shared = {
        name: np.concatenate([one[name] for one in values])
        for name in names
        if all(name in one for one in values)
    }
    notes = ["read by trimesh", *left_out]
    if some := [name for name in ("color", "uv") if name in names and name not in shared]:
        notes.append(f"{' and '.join(some)} left out, since some parts have none")
    if suffix == ".dae":
        notes.append("its vertices are numbered as trimesh reads them, not in the file's order")
    return Contents(places, corners, tuple(notes), lambda: shared)


def _joined(places: FloatArray, placed: list[tuple[Any, FloatArray]]) -> FloatArray:
    """Positions (n, 3), one where those of different parts differ by rounding alone.

    If two positions of one part would become one, they stay as they are.
    """
    part = np.repeat(np.arange(len(placed)), [len(one.vertices) for one, _ in placed])
    shifts = np.array([placement[:3, 3] for _, placement in placed])
    off = np.abs(shifts - np.median(shifts, axis=0)).max(axis=1)
    reach = [
        np.abs(placement[:3, :3]).max() * np.abs(one.vertices).max(axis=1)
        for one, placement in placed
    ]
    rounding = _ROUNDING * (np.concatenate(reach) + off[part])
    first, number = np.unique(first_equal_row(places), return_inverse=True)
    points, own = places[first], np.append(rounding[first], 0.0)
    away, near = cKDTree(points).query(points, k=_NEAREST, distance_upper_bound=2 * own.max())
    one, k = np.nonzero(away <= own[:-1, None] + own[near])
    other = near[one, k]
    apart = part[first[one]] != part[first[other]]
    label = label_linked((one[apart], other[apart]), len(points))
    joined = np.unique(label, return_index=True)[1][label]
    # Groups of several positions, and whose they are.
    groups = np.column_stack([label[number], part, number])[(np.bincount(label) > 1)[label][number]]
    groups = np.unique(groups, axis=0)
    twice = groups[1:][(groups[1:, :2] == groups[:-1, :2]).all(axis=1), 0]
    alone = np.flatnonzero(np.isin(label, twice))
    joined[alone] = alone
    return points[joined[number]]


def _placed(scene: Any) -> Iterator[tuple[Any, FloatArray]]:
    """Parts of a scene but for lines, in the order of the file, and the matrix of each."""
    numbers = {name: number for number, name in enumerate(scene.geometry)}
    placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
    for placement, name in sorted(placed, key=lambda one: numbers[one[1]]):
        if not hasattr(scene.geometry[name], "entities"):  # lines
            yield scene.geometry[name], placement


def moved_glb(data: bytes, vertices: FloatArray, mesh: Mesh) -> bytes:
    """Give the bytes of a .glb file, whose vertices were read, with the positions of a mesh."""
    import trimesh

    if not gltf.is_movable(data):
        raise FileError(
            "nothing but its shape can be kept, because of bones, morph targets, compression, "
            "lines, copies of parts, parts that share vertices, or parts that are not shown"
        )
    given = io.BytesIO(gltf.readable(".glb", data)[0])
    places, at = [], 0
    for part, placement in _placed(trimesh.load_scene(given, file_type="glb", process=False)):
        places.append((slice(at, at + len(part.vertices)), placement))
        at += len(part.vertices)
    return gltf.move(data, places, vertices, mesh.vertices, mesh.faces)


def _values(part: Any, linear: bool) -> dict[str, npt.NDArray[Any]]:
    """Colours of a part, which may be amounts of light, and texture coordinates."""
    found = {}
    visual = part.visual
    light = getattr(visual, "vertex_attributes", {}).get("color")
    if light is None and visual.kind == "vertex":
        light = visual.vertex_colors
    if light is not None and light.size:  # points without colours have none, not None
        if light.dtype == np.uint32:  # as DracoPy gives 16 bits
            light = light.astype(np.uint16)
        scale = np.iinfo(light.dtype).max if light.dtype.kind == "u" else 1
        shares = np.clip(light[:, :3] / scale, 0, 1)
        if light.shape[1] > 3:
            found["alpha"] = light[:, 3]
        if linear:  # as screens take them: IEC 61966-2-1
            dark = shares <= 0.0031308
            shares = np.where(dark, shares * 12.92, 1.055 * shares ** (1 / 2.4) - 0.055)
        found["color"] = np.rint(shares * 255).astype(np.uint8)
    if getattr(visual, "uv", None) is not None:
        found["uv"] = np.asarray(visual.uv, dtype=np.float64)
    return found
