"""Files: meshes, maps between them and values on them. Whatever is a mesh becomes a `Mesh` here."""

from unbend.io._colors import both_signs, scale_limits, value_colors
from unbend.io._files import (
    atomic_write,
    check_writable,
    prefixed,
    read_bytes,
    read_table,
    write_table,
)
from unbend.io._foreign import FREESURFER_VALUES, MeshLike
from unbend.io._maps import (
    MAP_SUFFIXES,
    checked_map,
    counted_from_zero,
    invert_map,
    read_landmarks,
    read_map,
    refuse_other_base,
    roughness,
    straight_error,
    warn_of_truth,
    whole_numbers,
    write_map,
)
from unbend.io._markups import MARKUP_SUFFIXES, read_markup_pairs, read_markups, write_markups
from unbend.io._meshes import READ_SUFFIXES, as_mesh, file_extras, read_mesh
from unbend.io._values import (
    VALUE_SUFFIXES,
    check_storable,
    read_named_values,
    read_values,
    write_values,
)
from unbend.io._writing import (
    COLOR_SUFFIXES,
    SCALAR_SUFFIXES,
    WRITE_SUFFIXES,
    keeps_all,
    moved_obj,
    write_mesh,
)

__all__ = [
    "COLOR_SUFFIXES",
    "FREESURFER_VALUES",
    "MAP_SUFFIXES",
    "MARKUP_SUFFIXES",
    "READ_SUFFIXES",
    "SCALAR_SUFFIXES",
    "VALUE_SUFFIXES",
    "WRITE_SUFFIXES",
    "MeshLike",
    "as_mesh",
    "atomic_write",
    "both_signs",
    "check_storable",
    "check_writable",
    "checked_map",
    "counted_from_zero",
    "file_extras",
    "invert_map",
    "keeps_all",
    "moved_obj",
    "prefixed",
    "read_bytes",
    "read_landmarks",
    "read_map",
    "read_markup_pairs",
    "read_markups",
    "read_mesh",
    "read_named_values",
    "read_table",
    "read_values",
    "refuse_other_base",
    "roughness",
    "scale_limits",
    "straight_error",
    "value_colors",
    "warn_of_truth",
    "whole_numbers",
    "write_map",
    "write_markups",
    "write_mesh",
    "write_table",
    "write_values",
]
