"""Registration benchmark: templates laid onto scans, beside the truth.

    python benchmarks/registration.py [FOLDER]

Own bodies are laid onto other poses, bodies and torn scans of them along the true map, so that
nothing but the registration errs. With FOLDER, of remeshed TOSCA as `UNBEND_DATA` has it, the first
shape of each class is laid onto the others, along a match that is found.

Errors are straight distances to where vertices belong, over the square root of the scan's area;
at covered vertices of our own bodies and at all points that are known of others; ``match`` those of
where the map leads. ``off`` is the distance to the scan of covered vertices, in mean edges of the
fitted template, on average and at worst; ``folds`` counts edges at which it folds back by more than
120 degrees, and the template does.
"""

import re
import sys
import time
from pathlib import Path

import numpy as np

from testshapes.bodies import make_body
from testshapes.damage import cut_discs, damaged_truth
from testshapes.scanning import seen_from
from unbend import Mesh, match, read_mesh, register
from unbend.correspondence import Registration
from unbend.datasets import rest_map
from unbend.mesh import find_edges, vertex_areas

_KINDS = ("quadruped", "biped", "octopus")
_BODIES, _VERTICES = 3, 1500


def folds(mesh: Mesh) -> int:
    """Count edges at which the surface turns by more than 120 degrees."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edges = find_edges(mesh.faces, mesh.n_vertices)
    sums = np.stack([np.bincount(edges.of_side, np.repeat(one, 3)) for one in normal.T], axis=1)
    # Two unit vectors more than 120 degrees apart have a sum shorter than one.
    return int(((np.linalg.norm(sums, axis=1) < 1) & (edges.n_faces == 2)).sum())


def side(mesh: Mesh) -> float:
    """Square root of the area."""
    return float(np.sqrt(vertex_areas(mesh).sum()))


def show(name: str, rows: list[list[float]]) -> None:
    """Print the means of rows, which are in the order of the head."""
    means = np.mean(rows, axis=0)
    print(
        f"{name:34}{len(rows):4}{means[0]:9.1%}{means[1]:10.5f}{means[2]:9.3f}{means[3]:10.4f}"
        f"{means[4]:9.4f}{means[5]:7.1f} ({means[6]:.1f}){means[7]:8.2f}",
        flush=True,
    )


def row(
    found: Registration, template: Mesh, error: float, rough: float, seconds: float
) -> list[float]:
    """Collect the numbers of one registration."""
    off = found.distances[found.covered] / (10 * found.tolerance)
    tangles = folds(found.mesh), folds(template)
    return [found.coverage, off.mean(), off.max(), error, rough, *tangles, seconds]


def own(number: int, kind: str, other: int, damage: str) -> list[float]:
    """Lay one of our bodies onto another scan, where the vertices' places there are known."""
    body = make_body(kind, number, random_state=number, n_vertices=_VERTICES)
    posed = make_body(kind, other, random_state=number + 50, n_vertices=_VERTICES)
    scan = make_body(kind, other, random_state=number + 50, n_vertices=_VERTICES, meshing=1)
    truth = rest_map(body, scan)
    torn = None
    if damage == "holes":
        torn = cut_discs(scan.mesh, 0.15, 3, random_state=number)
    if damage == "camera":
        torn = seen_from(scan.mesh, np.array([1, 0.3, 0.2]))
    whole = side(scan.mesh)
    places = posed.mesh.vertices if other == number else scan.mesh.vertices[truth]
    mesh = scan.mesh if torn is None else torn.mesh
    start = time.process_time()
    found = register(body.mesh, mesh, damaged_truth(truth, target=torn))
    seconds = time.process_time() - start
    on = found.covered
    errors = np.linalg.norm(found.mesh.vertices - places, axis=1)[on].mean() / whole
    rounded = np.linalg.norm(scan.mesh.vertices[truth] - places, axis=1)[on].mean() / whole
    return row(found, body.mesh, errors, rounded if other == number else np.nan, seconds)


def real(folder: Path, source: str, target: str) -> list[float]:
    """Lay one shape onto another along a match, and measure at the points that are known."""
    template, scan = (read_mesh(folder / f"{name}.off") for name in (source, target))
    ours, theirs = (
        np.loadtxt(folder / "corres" / f"{name}.vts", dtype=np.int64) - 1
        for name in (source, target)
    )
    given = match(template, scan, barycentric=True)
    start = time.process_time()
    found = register(template, scan, given)
    seconds = time.process_time() - start
    corners = scan.vertices[scan.faces[given.faces[ours]]]
    rough = np.einsum("ij,ijk->ik", given.weights[ours], corners)
    errors = [
        np.linalg.norm(places - scan.vertices[theirs], axis=1).mean() / side(scan)
        for places in (found.mesh.vertices[ours], rough)
    ]
    return row(found, template, *errors, seconds)


def main() -> None:
    """Print the table."""
    print(
        f"{'':34}{'n':>4}{'covered':>9}{'off':>10}{'worst':>9}{'error':>10}{'match':>9}"
        f"{'folds':>13}{'CPU s':>8}"
    )
    for title, shift, damage in (
        ("another pose", 0, ""),
        ("15 % in holes", 0, "holes"),
        ("one side, as a camera sees it", 0, "camera"),
        ("another body", 1, ""),
    ):
        show(
            title,
            [own(i, kind, i + shift, damage) for kind in _KINDS for i in range(_BODIES)],
        )
    if len(sys.argv) < 2:
        return
    folder = Path(sys.argv[1])
    classes: dict[str, list[str]] = {}
    for path in sorted(folder.glob("*.off")):
        classes.setdefault(re.sub(r"\d+$", "", path.stem), []).append(path.stem)
    for name, shapes in classes.items():
        show(name, [real(folder, shapes[0], other) for other in shapes[1:]])


if __name__ == "__main__":
    main()
