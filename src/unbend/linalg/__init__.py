"""Sparse linear algebra: factorisations and eigensolvers. Knows nothing of meshes."""
