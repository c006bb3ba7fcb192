"""The mesh itself: vertices and faces, their topology, and coarser ones."""

from unbend.mesh._mesh import (
    Mesh,
    face_normals,
    measure_corners,
    used_vertices,
    vertex_areas,
    vertex_ids,
    vertex_normals,
)
from unbend.mesh._topology import (
    FACES_AT_ONCE,
    Components,
    count_non_manifold_vertices,
    edge_ends,
    faces_around,
    find_components,
    find_edges,
    has_earlier_twin,
    has_repeated_index,
    label_linked,
    measure_faces,
    minimum_cut,
    other_sides,
    proper_faces,
)
from unbend.mesh._winding import orient_consistently, outwardness

__all__ = [
    "FACES_AT_ONCE",
    "Components",
    "Mesh",
    "count_non_manifold_vertices",
    "edge_ends",
    "face_normals",
    "faces_around",
    "find_components",
    "find_edges",
    "has_earlier_twin",
    "has_repeated_index",
    "label_linked",
    "measure_corners",
    "measure_faces",
    "minimum_cut",
    "orient_consistently",
    "other_sides",
    "outwardness",
    "proper_faces",
    "used_vertices",
    "vertex_areas",
    "vertex_ids",
    "vertex_normals",
]
