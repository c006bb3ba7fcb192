"""The names that options take. Imports nothing, so that the command line can list them fast."""

from __future__ import annotations

from typing import Literal

LaplacianKind = Literal["auto", "cotangent", "robust"]
AreaKind = Literal["voronoi", "barycentric"]
DistanceKind = Literal["biharmonic", "commute-time", "diffusion", "geodesic", "geodesic-exact"]
Detail = Literal["preserved"]
Weighting = Literal["uniform", "area"]
Interpolation = Literal["projection", "least-squares"]
Partial = Literal["auto", "none", "source", "target", "both"]
GeodesicKind = Literal["geodesic", "geodesic-exact"]
ValueKind = Literal["auto", "scalar", "label", "weights", "color", "uv"]
Axis = Literal["x", "y", "z"]
Measure = Literal["similarity", "distance"]

# Diffusion time, in units of a surface's area, unless another is asked for.
DIFFUSION_TIME = 0.1
