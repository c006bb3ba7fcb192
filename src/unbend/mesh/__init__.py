"""The mesh itself: vertices and faces, their topology, and coarser ones."""

from unbend.mesh._mesh import Mesh as Mesh
from unbend.mesh._mesh import face_normals as face_normals
from unbend.mesh._mesh import measure_corners as measure_corners
from unbend.mesh._mesh import used_vertices as used_vertices
from unbend.mesh._mesh import vertex_areas as vertex_areas
from unbend.mesh._mesh import vertex_ids as vertex_ids
from unbend.mesh._mesh import vertex_normals as vertex_normals
from unbend.mesh._topology import FACES_AT_ONCE as FACES_AT_ONCE
from unbend.mesh._topology import Components as Components
from unbend.mesh._topology import count_non_manifold_vertices as count_non_manifold_vertices
from unbend.mesh._topology import edge_ends as edge_ends
from unbend.mesh._topology import faces_around as faces_around
from unbend.mesh._topology import find_components as find_components
from unbend.mesh._topology import find_edges as find_edges
from unbend.mesh._topology import has_earlier_twin as has_earlier_twin
from unbend.mesh._topology import has_repeated_index as has_repeated_index
from unbend.mesh._topology import label_linked as label_linked
from unbend.mesh._topology import measure_faces as measure_faces
from unbend.mesh._topology import minimum_cut as minimum_cut
from unbend.mesh._topology import other_sides as other_sides
from unbend.mesh._topology import proper_faces as proper_faces
from unbend.mesh._winding import orient_consistently as orient_consistently
from unbend.mesh._winding import outwardness as outwardness
