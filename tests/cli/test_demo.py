import re

from terminal import invoke
from unbend.cli import demo


def test_forms_of_one_species_agree_and_those_of_two_do_not(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "_N_VERTICES", 600)
    monkeypatch.setattr(demo, "_COMPARED", 100)
    poses = {"dog": ("standing", "sitting"), "human": ("standing", "running")}
    monkeypatch.setattr(demo, "_POSES", poses)
    out = tmp_path / "demo.png"
    done = invoke(["demo", "-o", str(out)])
    assert done.exit_code == 0, done.output
    rows = re.findall(r"(\w+) \w+ - (\w+) \w+ +([\d.]+)% +([\d.]+)%", done.stdout)
    pairs = [(one, other, float(before), float(after)) for one, other, before, after in rows]
    assert len(pairs) == 6
    same = [(before, after) for one, other, before, after in pairs if one == other]
    different = [after for one, other, _, after in pairs if one != other]
    assert max(after for _, after in same) < 6
    assert min(different) > 15
    assert all(after < before / 3 for before, after in same)
    assert "one species differs by" in done.stdout
    assert str(out) in done.stdout
    assert out.read_bytes().startswith(b"\x89PNG")
