"""Mean and components of registered bodies, beside the truth.

    python benchmarks/mean_shape.py [--bodies 30] [--vertices 1500] [--jobs N]

Bodies of random proportions stand meshed each on its own. Found: a template is registered to each,
and statistics are taken. True: the same statistics of the points that truly correspond. Factors
are the logarithms of the proportions that the bodies were made with. ``mean off`` is the distance
between the two means' points, in mean edges; ``component``, the correlation of its scores with the
true ones; ``factor``, the multiple correlation of a proportion with the scores of as many
components as there are proportions, and in brackets that with the true scores.
"""

import argparse
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np

from testshapes.bodies import make_body, random_proportions
from unbend import register
from unbend._types import FloatArray
from unbend.alignment import procrustes
from unbend.collection import shape_statistics
from unbend.correspondence import Registration
from unbend.datasets import Shape, rest_map
from unbend.mesh import edge_ends, vertex_areas
from unbend.spectral import use_cache

POSE, TEMPLATE = "standing", 1000
LEAST_CONFIDENCE, LEAST_COVERAGE = 0.5, 0.5  # as mean_shape's


def body(kind: str, number: int, n_vertices: int) -> Shape:
    return make_body(kind, number, POSE, n_vertices=n_vertices, meshing=number)


@use_cache(gib=0)
def lay(kind: str, n_vertices: int, number: int) -> tuple[Registration, FloatArray, float]:
    """Register the template to a body; and where its vertices truly belong."""
    warnings.simplefilter("ignore")
    start = time.process_time()
    template, one = (body(kind, i, n_vertices) for i in (TEMPLATE, number))
    found = register(template.mesh, one.mesh)
    truth = one.mesh.vertices[rest_map(template, one)]
    return found, truth, time.process_time() - start


def multiple(factor: FloatArray, scores: FloatArray) -> float:
    """Correlation of a factor with the best combination of scores."""
    columns = np.column_stack([np.ones(len(scores)), scores])
    fit = columns @ np.linalg.lstsq(columns, factor, rcond=None)[0]
    return float(np.corrcoef(fit, factor)[0, 1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", default="biped")
    parser.add_argument("--bodies", type=int, default=30)
    parser.add_argument("--vertices", type=int, default=1500)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        work = partial(lay, options.kind, options.vertices)
        rows = list(pool.map(work, range(options.bodies)))
    kept = [
        i
        for i, (one, _, _) in enumerate(rows)
        if one.confidence >= LEAST_CONFIDENCE and one.coverage >= LEAST_COVERAGE
    ]
    print(f"kept {len(kept)} of {options.bodies}; {np.mean([row[2] for row in rows]):.1f} s each")
    template = body(options.kind, TEMPLATE, options.vertices).mesh
    weights = vertex_areas(template)
    found = shape_statistics([rows[i][0].mesh.vertices for i in kept], weights=weights)
    true = shape_statistics([rows[i][1] for i in kept], weights=weights)
    turn, shift = procrustes(found.mean, true.mean, weights=weights, reflect=False)
    ends = true.mean[edge_ends(template.faces, template.n_vertices)]
    edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    off = np.linalg.norm(found.mean @ turn.T + shift - true.mean, axis=1)
    alike = np.corrcoef((found.mean @ turn.T + shift).ravel(), true.mean.ravel())[0, 1]
    print(f"mean off {weights @ off / weights.sum() / edge:.2f} edges, correlation {alike:.5f}")
    print(f"variance of all: found {found.total_variance:.5f}, true {true.total_variance:.5f}")
    for i in range(5):
        one = abs(np.corrcoef(found.scores[:, i], true.scores[:, i])[0, 1])
        share = true.variances[i] / true.total_variance
        print(f"component {i + 1}: {one:.3f}, of {share:.1%} of the variance")
    proportions = [random_proportions(options.kind, i) for i in kept]
    names = list(proportions[0])
    for name in names:
        factor = np.log([one[name] for one in proportions])
        there, at_best = (multiple(factor, one.scores[:, : len(names)]) for one in (found, true))
        print(f"factor {name}: {there:.3f} ({at_best:.3f})")


if __name__ == "__main__":
    main()
