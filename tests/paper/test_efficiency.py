"""Costs of the forms: measured in processes of their own, and summed up."""

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

from counting import process
from paper import efficiency as module
from paper.collection import Collection
from paper.efficiency import METHODS, efficiency, peak_of
from paper.run import Run
from unbend.datasets import make_sphere


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("store")


@pytest.fixture
def small(store: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setattr(module, "_SIZES", {True: (500, 600)})
    monkeypatch.setattr(module, "_SAMPLES", {True: (50, 200)})
    monkeypatch.setattr(module, "_AT", {True: 500})
    monkeypatch.setattr(module, "_alone", lambda function, *arguments: function(*arguments))
    monkeypatch.setattr(module, "_warm_up", lambda name: None)
    monkeypatch.setattr(module, "_REPEATS", 1)
    ticks = itertools.count()  # a clock of our own: no test asserts a time
    monkeypatch.setattr(module, "perf_counter", lambda: float(next(ticks)) ** 2)
    nothing = Collection("nothing", {}, {}, None)
    return Run(nothing, None, True, 2, store, lambda step: None)


def test_every_setting_has_its_costs(small):
    result = efficiency(small)
    rows = result.tables["costs"]
    assert [(row["vertices"], row["samples"]) for row in rows] == [
        (500, 200), (600, 200), (500, 50),
    ]  # fmt: skip
    for row in rows:
        assert all(row[f"{name}, s"] > 0 for name in METHODS)
    for fit in result.tables["exponents"]:
        first, second = (rows[i][f"{fit['method']}, s"] for i in (0, 1))
        assert fit["power"] == pytest.approx(np.log(second / first) / np.log(600 / 500))
        assert f"{fit['power']:.2f} ({fit['method']})" in result.text


def test_where_no_peak_is_told_none_is_given(small, monkeypatch):
    monkeypatch.setattr(module, "_STATUS", Path("nowhere"))
    result = efficiency(small)
    assert "Memory was not measured" in result.text
    assert not any("MiB" in key for row in result.tables["costs"] for key in row)
    assert len(result.figures["efficiency"].axes) == 2


def test_what_is_measured_runs_in_a_process_of_its_own():
    number, threads = module._alone(process)
    assert number != os.getpid()
    assert threads == "1"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no peak is told here")
def test_a_peak_is_never_below_what_was_held_before():
    mesh = make_sphere(3)
    assert peak_of("biharmonic, exact", mesh.vertices, mesh.faces, 50) >= 0
