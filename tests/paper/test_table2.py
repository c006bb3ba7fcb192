"""Cosines of one person's forms: the known correspondence bounds the others."""

from dataclasses import replace

import numpy as np
import pytest

from paper import forms
from paper.loading import load_scape
from paper.result import Result
from paper.run import Run
from paper.table2 import cosine, table2
from paper.table2_text import WAYS, Compared, table2_text
from tests.paper.folders import write_people
from unbend import sampled_canonical_form
from unbend.correspondence import similarity
from unbend.errors import InputError


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("people")
    people = load_scape(write_people(folder))
    return Run(people, people, True, 1, folder / "store", lambda step: None)


@pytest.fixture(scope="module")
def result(run: Run) -> Result:
    return table2(run)


def test_a_known_correspondence_bounds_icp(result):
    rows = result.tables["all_pairs"]
    assert [(row["model"], row["probe"]) for row in rows] == [
        ("mesh000", "mesh001"), ("mesh000", "mesh002"), ("mesh001", "mesh002"),
    ]  # fmt: skip
    for row in rows:
        for kind in ("geodesic", "biharmonic"):
            assert 0.9 < row[f"{kind}, known"] <= 1
            assert row[f"{kind}, icp, known points"] <= row[f"{kind}, known"] + 1e-9
            assert 0.9 < row[f"{kind}, icp, closest points"] <= 1


def test_the_library_says_the_same(run, result):
    made = [
        sampled_canonical_form(run.scape.mesh(name), n_eigenpairs=50)
        for name in ("mesh000", "mesh001")
    ]
    value = result.tables["all_pairs"][0]["biharmonic, known"]
    assert similarity(*made) == pytest.approx(value, abs=1e-9)


def test_the_page_gives_the_figures_of_the_table(result):
    rows = result.tables["all_pairs"]
    geodesic, biharmonic = (
        np.array([row[f"{kind}, known"] for row in rows]) for kind in ("geodesic", "biharmonic")
    )
    probes, everything = result.tables["summary"][:2]
    assert (probes["correspondence"], probes["over"], probes["pairs"]) == ("known", "probes", 2)
    assert (everything["over"], everything["pairs"]) == ("all pairs", 3)
    assert everything["geodesic"] == pytest.approx(geodesic.mean())
    assert everything["by"] == pytest.approx((biharmonic - geodesic).mean())
    above = int((biharmonic > geodesic).sum())
    assert everything["biharmonic above in"] == above
    said = f"{above} of 3 ({biharmonic.mean():.4f} against {geodesic.mean():.4f} on average"
    assert said in result.text
    assert set(result.figures) == {"probes", "similarities"}


def test_the_verdict_follows_the_figures():
    def text(above: int) -> str:
        geodesic = np.full(10, 0.9)
        biharmonic = np.where(np.arange(10) < above, 0.95, 0.2)
        both = [
            Compared(way, over, geodesic, biharmonic)
            for way in WAYS
            for over in ("probes", "all pairs")
        ]
        return table2_text(both, tuple("abcdefghijk"), 10)

    assert "- *known*: confirmed." in text(9)
    assert "- *known*: neither confirmed nor refuted" in text(5)
    assert "- *known*: refuted." in text(0)
    assert "in 0 pairs by the geodesic and 5 by the biharmonic distance" in text(5)
    assert "the paper's lie among the lowest of ours" in text(9)


def test_a_second_run_computes_nothing(run, result, monkeypatch):
    monkeypatch.setattr(forms, "make_form", None)
    assert table2(run).tables == result.tables


def test_too_few_poses_are_refused(run):
    with pytest.raises(InputError, match="three poses or more"):
        table2(replace(run, scape=None))


def test_a_cosine_forgets_place_and_size_but_not_direction():
    points = np.random.default_rng(0).normal(size=(40, 3))
    assert cosine(points, 3 * points + 5) == pytest.approx(1)
    assert cosine(points, -points) == pytest.approx(-1)
