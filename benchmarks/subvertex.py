"""What barycentric coordinates add to a map between vertices, beside the exact truth.

    python benchmarks/subvertex.py [--vertices N ...] [--pairs N] [--seed S]

Own bodies, two poses of each, each pose meshed on its own. Where a vertex of the source truly lies
on the target is known to the last digit: in the same pose, the source's own meshing has it there.
Errors are straight distances to that place over the square root of the area: of the target vertex
that it is mapped to, of the point on a face, and of the nearest vertex, which is the least that a
map between vertices can err.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.spatial import cKDTree

from unbend import match
from unbend.datasets import make_body
from unbend.mesh import vertex_areas

KINDS = ("biped", "quadruped")
WRONG = 0.08  # as in benchmarks/matching.py: another limb, of which neither says anything


def errors(kind: str, seed: int, n_vertices: int) -> tuple[float, float, float]:
    """Mean errors by vertices, by points on faces, and of the vertices nearest to the truth."""
    source = make_body(kind, seed, n_vertices=n_vertices, random_state=2 * seed)
    target, truth = (
        make_body(kind, seed, n_vertices=n_vertices, meshing=meshing, random_state=2 * seed + 1)
        for meshing in (1, 0)
    )
    places, mesh = truth.mesh.vertices, target.mesh
    found = match(source.mesh, mesh, barycentric=True, cache=False)
    assert found.faces is not None
    assert found.weights is not None
    fine = np.einsum("ij,ijk->ik", found.weights, mesh.vertices[mesh.faces[found.faces]])
    unit = np.sqrt(vertex_areas(mesh).sum())
    coarse = np.linalg.norm(mesh.vertices[found.source_to_target] - places, axis=1)
    least = cKDTree(mesh.vertices).query(places)[0]
    exact = np.linalg.norm(fine - places, axis=1)
    return tuple(float(one.mean() / unit) for one in (coarse, exact, least))  # type: ignore[return-value]


def main() -> None:
    """Print a line for each number of vertices."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--vertices", type=int, nargs="+", default=[1000, 5000, 20000])
    parser.add_argument("--pairs", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print("vertices  pairs  right  by vertices  on faces  nearest vertex", flush=True)
    for n in options.vertices:
        rows = [errors(KINDS[i % len(KINDS)], options.seed + i, n) for i in range(options.pairs)]
        right = np.array([row for row in rows if row[0] < WRONG])
        means = right.mean(axis=0) if len(right) else np.full(3, np.nan)
        print(
            f"{n:8}{len(rows):7}{len(right):7}{means[0]:13.5f}{means[1]:10.5f}{means[2]:16.5f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
