import json

import pytest

from terminal import invoke
from unbend import spectrum


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path))
    return tmp_path


def test_info_says_where_and_how_much(blob, folder):
    spectrum(blob, 4)
    found = json.loads(invoke(["cache", "info", "--json"]).stdout)
    assert found["folder"] == str(folder)
    assert found["n_files"] == 1
    assert found["n_bytes"] > 642 * 4 * 8
    assert str(folder) in invoke(["cache", "info"]).stdout


def test_clear_empties_it(blob, folder):
    spectrum(blob, 4)
    assert "removed 1 spectra" in invoke(["cache", "clear"]).stdout
    assert not list(folder.glob("*.npz"))
