"""What is wrong with a mesh, and the part of it that computations run on."""

from unbend.preparation._diagnosis import Diagnosis, diagnose
from unbend.preparation._prepare import (
    Prepared,
    check_area,
    check_size,
    describe_positions,
    describe_seams,
    join_seams,
    only_component,
    prepare,
    restrict,
)
from unbend.preparation._surface import PointSurface, surface_of_points, triangulate_points

__all__ = [
    "Diagnosis",
    "PointSurface",
    "Prepared",
    "check_area",
    "check_size",
    "describe_positions",
    "describe_seams",
    "diagnose",
    "join_seams",
    "only_component",
    "prepare",
    "restrict",
    "surface_of_points",
    "triangulate_points",
]
