import json

from typer.testing import CliRunner

from unbend.cli import app, demo


def test_forms_of_one_species_agree_and_those_of_two_do_not(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "_N_VERTICES", 1000)
    monkeypatch.setattr(demo, "_COMPARED", 300)
    out = tmp_path / "demo.png"
    done = CliRunner().invoke(app, ["demo", "-o", str(out), "--json"])
    assert done.exit_code == 0, done.output
    pairs = json.loads(done.stdout)["pairs"]
    assert len(pairs) == 15
    same = [pair for pair in pairs if pair["same_species"]]
    different = [pair for pair in pairs if not pair["same_species"]]
    assert max(pair["after"] for pair in same) < 0.06
    assert min(pair["after"] for pair in different) > 0.15
    assert all(pair["after"] < pair["before"] / 3 for pair in same)
    assert out.read_bytes().startswith(b"\x89PNG")


def test_the_table_says_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "_N_VERTICES", 600)
    monkeypatch.setattr(demo, "_COMPARED", 100)
    out = tmp_path / "demo.png"
    done = CliRunner().invoke(app, ["demo", "-o", str(out)])
    assert "dog standing - dog galloping" in done.stdout
    assert "one species differs by" in done.stdout
    assert str(out) in done.stdout
