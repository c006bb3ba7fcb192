"""Carry the data of one object to another, and read shapes from objects."""

import numpy as np
from mathutils.bvhtree import BVHTree
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import unbend
from unbend._arrays import first_equal_row
from unbend.errors import InputError

LANDMARK = "landmark"  # the vertex groups whose names begin with it are landmarks
_GREY = (0.5, 0.5, 0.5, 1.0)
_SMOOTHINGS = 3
_MOST_UVS = 8  # maps that Blender gives a mesh
_FLAT = 1e-6  # volume of a unit cube that an object's matrix has made flat


def to_mesh(thing) -> unbend.Mesh:
    """Take an object's original mesh, without modifiers and shape keys, in world coordinates."""
    faces = _corners(thing.data)[0]
    matrix = np.array(thing.matrix_world)[:3, :3]
    volume = np.linalg.det(matrix)
    if abs(volume) <= _FLAT * np.linalg.norm(matrix, axis=0).prod():
        raise InputError(f"{thing.name}: its scale is zero along an axis; set another scale")
    if volume < 0:  # mirrored: turned inside out
        faces = faces[:, ::-1]
    return unbend.Mesh(to_world(thing), faces, name=thing.name)


def to_world(thing) -> np.ndarray:
    """Give the original vertices of an object in world coordinates.

    Those at one place, as along the seams of a UV map, stay together to the last bit.
    """
    matrix, points = np.array(thing.matrix_world), _points(thing.data.vertices)
    return (points @ matrix[:3, :3].T + matrix[:3, 3])[first_equal_row(points)]


def to_local(matrix, places: np.ndarray) -> np.ndarray:
    """Turn world coordinates into those of an object that has this matrix."""
    back = np.linalg.inv(np.array(matrix))
    return places @ back[:3, :3].T + back[:3, 3]


def check_changeable(thing) -> None:
    """Refuse an object whose mesh is linked: what it gets is lost on saving."""
    if thing.data.library is not None:
        raise InputError(f"{thing.name}: its mesh is linked from a library; make it local first")


def check_room(source, target, uvs: bool, shape_keys: bool) -> None:
    """Refuse a target that cannot take what the source has."""
    check_changeable(target)
    if source.data == target.data:
        raise InputError(f"{source.name} and {target.name} share one mesh; make it a single user")
    names = {layer.name for one in (source, target) for layer in one.data.uv_layers}
    if uvs and len(names) > _MOST_UVS:
        raise InputError(
            f"{target.name}: with those of {source.name} it would have {len(names)} UV maps; "
            f"Blender takes {_MOST_UVS}: remove some, or do not transfer them"
        )
    if shape_keys and source.data.shape_keys and not target.data.edges:
        raise InputError(f"{target.name}: it has no faces, which shape keys need; leave them out")


def landmarks(thing) -> dict[str, int]:
    """Give the vertex of the largest weight of each vertex group that is a landmark."""
    found: dict[str, tuple[float, int]] = {}
    names = [group.name for group in thing.vertex_groups]
    for vertex in thing.data.vertices:
        for one in vertex.groups:
            # Weights may outlive their groups.
            name = names[one.group] if one.group < len(names) else ""
            if name.startswith(LANDMARK):
                found[name] = max(found.get(name, (0, -1)), (one.weight, vertex.index))
    return {name: index for name, (_, index) in found.items() if index >= 0}


def set_shape_key(thing, name: str, places: np.ndarray):
    """Give an object a shape key, in its coordinates; one of that name is replaced."""
    if thing.data.shape_keys is None:
        thing.shape_key_add(name="Basis", from_mix=False)
    blocks = thing.data.shape_keys.key_blocks
    key = blocks.get(name)
    if key is None or key == thing.data.shape_keys.reference_key:
        key = thing.shape_key_add(name=name, from_mix=False)
    key.relative_key = thing.data.shape_keys.reference_key
    key.data.foreach_set("co", places.ravel())
    thing.data.update()
    return key


def set_colors(
    data, name: str, values: np.ndarray, kind="BYTE_COLOR", domain="POINT", field="color"
):
    """Give a mesh a colour attribute, rows of RGBA; one of that name is replaced."""
    new = data.attributes.get(name)
    if new is not None and (new.data_type, new.domain) != (kind, domain):
        data.attributes.remove(new)
        new = None
    if new is None:
        new = data.color_attributes.new(name, kind, domain)
    new.data.foreach_set(field, values.ravel())
    return new


def carry_vertex_groups(source, target, carry) -> None:
    """Give the target the source's groups, weights averaged; a group of that name is replaced."""
    n = len(source.data.vertices)
    weights = np.zeros((n, len(source.vertex_groups)))
    for vertex in source.data.vertices:
        for one in vertex.groups:
            if one.group < weights.shape[1]:
                weights[vertex.index, one.group] = one.weight
    carried = np.nan_to_num(carry(weights))
    for group, column in zip(source.vertex_groups, carried.T, strict=True):
        if group.name.startswith(LANDMARK):
            continue
        new = target.vertex_groups.get(group.name) or target.vertex_groups.new(name=group.name)
        new.remove(range(len(target.data.vertices)))
        for vertex in np.flatnonzero(column > 1e-4).tolist():
            new.add([vertex], float(column[vertex]), "REPLACE")


def carry_uvs(source, target, places: np.ndarray) -> None:
    """Give the target the source's UV maps, each face those of one island.

    `places` has, for each of the target's vertices, where it is on the source.
    """
    corners, loops = _corners(source.data)
    if not len(corners):
        return
    vertices = to_world(source)
    shown = None if target.data.uv_layers else source.data.uv_layers.active.name
    ends, polygons = _loops(target.data)
    middles = _middles(places, ends, polygons)
    known = np.isfinite(middles).all(axis=1)[polygons]
    first, _ = _nearest(vertices, corners, middles)
    for layer in source.data.uv_layers:
        uvs = np.empty(2 * len(source.data.loops))
        layer.uv.foreach_get("vector", uvs)
        uvs = uvs.reshape(-1, 2)
        islands = _islands(corners, loops, uvs)
        # A face's corners are looked for on the island that its middle is on.
        wanted = np.where(known, islands[first][polygons], -1)
        found = np.zeros((len(ends), 2))
        for island in np.unique(wanted[known]):
            triangles, rows = np.flatnonzero(islands == island), np.flatnonzero(wanted == island)
            nearest, spots = _nearest(vertices, corners[triangles], places[ends[rows]])
            nearest = triangles[nearest]
            shares = _shares(spots, vertices[corners[nearest]])
            found[rows] = np.einsum("nc,ncd->nd", shares, uvs[loops[nearest]])
        new = target.data.uv_layers.get(layer.name)
        if new is None:
            other = target.data.attributes.get(layer.name)
            if other is not None:
                target.data.attributes.remove(other)
            new = target.data.uv_layers.new(name=layer.name)
        new.uv.foreach_set("vector", found.ravel())
    if shown is not None:
        target.data.uv_layers.active = target.data.uv_layers[shown]


def carry_colors(source, target, places: np.ndarray, carry) -> None:
    """Give the target the source's colour attributes, on vertices or on face corners.

    A corner's colour is taken a little inside its face, so that sharp borders stay sharp.
    """
    corners, loops = _corners(source.data)
    for layer in list(source.data.color_attributes):
        values = np.empty(4 * len(layer.data))
        layer.data.foreach_get("color", values)
        values = values.reshape(-1, 4)
        if layer.domain == "POINT":
            found = carry(values)
        elif not len(corners):
            continue
        else:
            ends, polygons = _loops(target.data)
            inside = 0.9 * places[ends] + 0.1 * _middles(places, ends, polygons)[polygons]
            vertices = to_world(source)
            nearest, spots = _nearest(vertices, corners, inside)
            shares = _shares(spots, vertices[corners[nearest]])
            found = np.einsum("nc,ncd->nd", shares, values[loops[nearest]])
            found[~np.isfinite(inside).all(axis=1)] = np.nan
        found = np.where(np.isfinite(found), found, _GREY)
        set_colors(target.data, layer.name, found, layer.data_type, layer.domain)


def carry_shape_keys(source, target, places: np.ndarray, carry) -> None:
    """Give the target the source's shape keys, turned and scaled as the surface is there."""
    turns = _turns(places, target)
    back = np.linalg.inv(np.array(target.matrix_world)[:3, :3])
    out = np.array(source.matrix_world)[:3, :3]
    blocks = source.data.shape_keys.key_blocks
    if target.data.shape_keys is None:
        target.shape_key_add(name=blocks[0].name)
    basis = _points(target.data.shape_keys.key_blocks[0].data)
    for block in blocks[1:]:
        moved = (_points(block.data) - _points(block.relative_key.data)) @ out.T
        carried = np.einsum("vij,vj->vi", turns, np.nan_to_num(carry(moved)))
        new = set_shape_key(target, block.name, basis + carried @ back.T)
        new.slider_min = -10  # the least, so that any greatest one is above it
        new.slider_max, new.slider_min = block.slider_max, block.slider_min
        new.value, new.mute = block.value, block.mute
        if block.vertex_group in target.vertex_groups:
            new.vertex_group = block.vertex_group


def _points(items) -> np.ndarray:
    found = np.empty(3 * len(items))
    items.foreach_get("co", found)
    return found.reshape(-1, 3)


def _corners(mesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and loops of the corners of all triangles."""
    mesh.calc_loop_triangles()
    found = np.empty((2, 3 * len(mesh.loop_triangles)), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", found[0])
    mesh.loop_triangles.foreach_get("loops", found[1])
    return found[0].reshape(-1, 3), found[1].reshape(-1, 3)


def _loops(mesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertex and polygon of each loop."""
    vertices = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertices)
    sizes = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_total", sizes)
    return vertices, np.repeat(np.arange(len(sizes)), sizes)


def _middles(places: np.ndarray, ends: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Mean of the corners of each polygon."""
    sums = np.stack([np.bincount(polygons, column[ends]) for column in places.T], axis=1)
    return sums / np.bincount(polygons)[:, None]


def _islands(corners: np.ndarray, loops: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Find the UV island of each triangle: those that share a vertex and its place are in one."""
    keys = np.column_stack([corners.ravel(), np.rint(1e5 * uvs[loops.ravel()])])
    _, key = np.unique(keys, axis=0, return_inverse=True)
    n, triangles = len(corners), np.repeat(np.arange(len(corners)), 3)
    size = n + key.max() + 1
    links = coo_matrix((np.ones(len(triangles)), (triangles, n + key.ravel())), (size, size))
    return connected_components(links, directed=False)[1][:n]


def _nearest(vertices: np.ndarray, faces: np.ndarray, places: np.ndarray):
    """Closest face of each place and the closest spot on it; face 0 for what is no place."""
    tree = BVHTree.FromPolygons(vertices.tolist(), faces.tolist())
    indices, spots = np.zeros(len(places), dtype=np.int64), np.zeros((len(places), 3))
    for i in np.flatnonzero(np.isfinite(places).all(axis=1)).tolist():
        spots[i], _, indices[i], _ = tree.find_nearest(places[i])
    return indices, spots


def _shares(spots: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of spots on triangles, (n, 3, 3)."""
    across = np.cross(
        np.roll(triangles, -1, axis=1) - spots[:, None],
        np.roll(triangles, -2, axis=1) - spots[:, None],
    )
    areas = np.linalg.norm(across, axis=2)
    return areas / np.maximum(areas.sum(axis=1, keepdims=True), 1e-300)


def _turns(places: np.ndarray, target) -> np.ndarray:
    """For each vertex of the target, how its neighbourhood on the source is turned and scaled."""
    edges = np.empty(2 * len(target.data.edges), dtype=np.int32)
    target.data.edges.foreach_get("vertices", edges)
    number, stands = first_equal_row(_points(target.data.vertices)), to_world(target)
    edges = number[edges.reshape(-1, 2)]
    i, j = np.concatenate([edges, edges[:, ::-1]]).T
    here, there = places[j] - places[i], stands[j] - stands[i]
    known = np.isfinite(here).all(axis=1)
    i, j, here, there = i[known], j[known], here[known], there[known]
    sums = np.zeros((len(stands), 3, 3))
    np.add.at(sums, i, there[:, :, None] * here[:, None, :])
    for _ in range(_SMOOTHINGS):  # few edges say little, and slip on a coarse mesh
        sums = sums + np.stack(
            [np.bincount(i, sums[j, a, b], len(sums)) for a in range(3) for b in range(3)], axis=1
        ).reshape(-1, 3, 3)
    left, _, right = np.linalg.svd(sums)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return ((left @ right) * np.sqrt((there**2).sum() / (here**2).sum()))[number]
