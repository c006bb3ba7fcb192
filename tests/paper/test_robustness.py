"""Perturbed shapes against themselves, and words that follow the figures."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from paper import robustness as module
from paper.collection import Collection
from paper.result import Result
from paper.robustness import KINDS, compare, robustness
from paper.robustness_page import text
from paper.run import Run
from sheets import make_blob
from testshapes.damage import unchanged
from unbend.errors import InputError


@pytest.fixture(scope="module")
def result(run: Run) -> Iterator[Result]:
    few = {"noise": (0.1, 0.5), "remeshing": (1.0,), "shortcut": (1,)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "STRENGTHS", few)
        patch.setattr(module, "_N_VERTICES", {True: 600})
        yield robustness(run)


def test_a_shape_itself_does_not_move():
    blob = make_blob(2)
    forms = {label: module._form(blob, *method) for label, method in KINDS.items()}
    found = compare(blob, forms, unchanged(blob))
    assert max(found[label] for label in KINDS) < 1e-9
    assert found["map error"] == 0


def test_a_mesh_that_the_matcher_refuses_has_no_map(moebius_strip):
    forms = {label: module._form(moebius_strip, *method) for label, method in KINDS.items()}
    found = compare(moebius_strip, forms, unchanged(moebius_strip))
    assert np.isnan(found["map error"])
    assert found["confidence"] == 0
    row = {"perturbation": "noise", "strength": 1, "map error": float("nan")}
    row |= {label: 0.1 for kind in KINDS for label in (kind, f"{kind}, but for scale")}
    summary = module._summary("noise", 1, [row, row | {"map error": 0.01}])
    assert summary["map error"] == 0.01
    assert summary["right maps"] == "1 of 2"


def test_weak_noise_moves_little_and_a_shortcut_much(result):
    rows = {(row["perturbation"], row["strength"]): row for row in result.tables["summary"]}
    weak, strong, shortcut = rows["noise", 0.1], rows["noise", 0.5], rows["shortcut", 1]
    for label in KINDS:
        assert 0 < weak[label] < strong[label] < shortcut[label]
        assert weak[f"{label}, but for scale"] <= weak[label]
    assert weak["right maps"] == "1 of 1"
    for row in rows.values():
        less = row["biharmonic, but for scale"] < row["S-MDS, but for scale"]
        assert row["biharmonic moves less"] == f"{int(less)} of 1"
    assert rows["remeshing", 1.0]["right maps"] == "1 of 1"


def test_the_page_has_all_that_was_done(result):
    assert len(result.figures["robustness"].axes) == 6
    for kind in ("noise", "remeshing", "shortcut"):
        assert f"- **{kind}**: the claim" in result.text
    assert "Decimation was left out: it needs `pip install fast-simplification`" in result.text
    assert [row["shape"] for row in result.tables["all_shapes"]] == ["dog0", "dog0", "dog0", "dog"]


def test_the_verdict_follows_the_figures():
    def row(strength: float, biharmonic: float, geodesic: float) -> dict[str, object]:
        return {
            "perturbation": "noise",
            "strength": strength,
            "biharmonic": 2 * biharmonic,
            "biharmonic, but for scale": biharmonic,
            "S-MDS": geodesic,
            "S-MDS, but for scale": geodesic,
            "biharmonic moves less": "2 of 4",
            "right maps": "3 of 4",
        }

    poses = {"biharmonic": 0.1, "S-MDS": 0.2}

    def said(*rows: dict[str, object]) -> str:
        page = text(list(rows), poses, ["dog0"], ["dog"], decimated=True)
        return page.split("- **noise**: the claim ")[1]

    assert said(row(0.1, 0.01, 0.02), row(0.5, 0.05, 0.1)).startswith(
        "holds. At the strongest (0.5) the biharmonic form moves by 5.0 % (10.0 % with its scale), "
        "and is insensitive at every strength; the S-MDS form moves by 10.0 % (10.0 % with"
    )
    part = said(row(0.1, 0.01, 0.005), row(0.5, 0.15, 0.3))
    assert part.startswith("holds in part.")
    assert "and is insensitive at 0.1; the S-MDS form" in part
    assert "less than the S-MDS form for 2 of 4, 2 of 4 shapes; right maps: 3 of 4, 3 of 4." in part
    assert said(row(0.1, 0.2, 0.005)).startswith("does not hold.")


def test_without_shapes_there_is_nothing_to_perturb(run):
    nothing = Collection("nothing", {}, {}, None)
    with pytest.raises(InputError, match="needs the shapes of TOSCA"):
        robustness(replace(run, shapes=nothing))
