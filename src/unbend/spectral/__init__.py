"""A mesh's Laplacian and its eigenpairs, computed once and kept on disk."""

from unbend.spectral._cache import cache_folder, cache_info, clear_cache, use_cache
from unbend.spectral._laplacian import Laplacian, laplacian
from unbend.spectral._point_cloud import delaunay_triangles
from unbend.spectral._spectrum import Spectrum, eigenpairs, spectrum
from unbend.spectral._surface import Surface, local_ids, make_surface, named

__all__ = [
    "Laplacian",
    "Spectrum",
    "Surface",
    "cache_folder",
    "cache_info",
    "clear_cache",
    "delaunay_triangles",
    "eigenpairs",
    "laplacian",
    "local_ids",
    "make_surface",
    "named",
    "spectrum",
    "use_cache",
]
