"""Sampled forms come nearer to the exact one with more samples and eigenpairs."""

from dataclasses import replace

import numpy as np
import pytest

from paper import convergence as module
from paper.collection import Collection
from paper.convergence import convergence
from paper.forms import difference
from paper.loading import load_tosca
from paper.result import Result
from paper.run import Run
from unbend import canonical_form, sampled_canonical_form, write_mesh
from unbend.datasets import make_quadruped
from unbend.errors import InputError

EIGENPAIRS, SAMPLES = (10, 20, 50, 100, 200), (50, 100, 200, 400, 800)  # fewer than usual


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("animals")
    write_mesh(folder / "dog0.off", make_quadruped("walking", n_vertices=850).mesh)
    return Run(load_tosca(folder), None, True, 1, folder / "store", lambda step: None)


@pytest.fixture(scope="module")
def result(run: Run) -> Result:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "EIGENPAIRS", EIGENPAIRS)
        patch.setattr(module, "SAMPLES", SAMPLES)
        return convergence(run)


def test_more_of_both_comes_nearer(result):
    rows = {(row["eigenpairs"], row["samples"]): row for row in result.tables["grid"]}
    assert len(rows) == len(EIGENPAIRS) * len(SAMPLES)
    for way in ("projection", "least-squares"):
        ladder = [float(rows[k, p][way]) for k, p in ((10, 100), (50, 400), (200, 800))]
        assert ladder[0] > 3 * ladder[1] > 3 * ladder[2]
    assert rows[100, 100]["least-squares"] == ""
    assert f"{100 * float(rows[100, 200]['projection']):.1g}"[0] in result.text


def test_the_library_says_the_same(run, result):
    mesh = run.shapes.mesh("dog0")
    sampled = sampled_canonical_form(mesh).points
    row = next(
        row for row in result.tables["grid"] if (row["eigenpairs"], row["samples"]) == (100, 200)
    )
    # Where its samples lie differs: they are spread by 100 eigenpairs, not by 200.
    apart = difference(sampled, canonical_form(mesh).points)[0]
    assert 0.2 < apart / float(row["projection"]) < 5


def test_mu_matters_little_once_it_is_large(result):
    values = [float(row["projection"]) for row in result.tables["mu"]]
    assert values[0] > 10 * values[2]
    assert np.ptp(values[3:]) < 0.1 * values[3]


def test_without_shapes_there_is_nothing_to_compare(run):
    nothing = Collection("nothing", {}, {}, None)
    with pytest.raises(InputError, match="needs the shapes of TOSCA"):
        convergence(replace(run, shapes=nothing))
