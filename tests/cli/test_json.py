"""The JSON of every command: one table says which keys there are, and what they hold."""

import json
import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from every_command import every_command
from sheets import make_egg
from stones import write_pair
from terminal import invoke
from unbend.cli import demo
from unbend.collection import Collection
from unbend.io import read_mesh, write_mesh

# A type, several of them, a list whose entries are all alike, or an object with exactly these keys.
NUMBER = (int, float)
MAYBE = (int, float, type(None))  # null where it is not known, or not finite
ENTRY = {
    "id": str, "path": str, "also": [str], "n_vertices": int, "n_faces": int, "area": NUMBER,
    "notes": str,
}  # fmt: skip
HEALTH = {
    **dict.fromkeys(("n_vertices", "n_faces", "boundary_edges", "boundary_loops"), int),
    **dict.fromkeys(("non_manifold_edges", "non_manifold_vertices", "inconsistent_edges"), int),
    **dict.fromkeys(("degenerate_faces", "unreferenced_vertices"), int),
    **dict.fromkeys(("duplicate_vertices", "seam_vertices", "duplicate_faces"), int),
    **dict.fromkeys(
        ("one_sided", "inside_out", "seems_inside_out", "closed", "robust_needed"), bool
    ),
    **dict.fromkeys(("euler_characteristic", "genus"), (int, type(None))),
    **dict.fromkeys(("area", "edge_min", "edge_median", "edge_max"), MAYBE),
    "component_vertices": [int],
    "component_faces": [int],
}
WAY = dict.fromkeys(
    ("confidence", "confidence_bound", "orientation", "overlap_source", "overlap_target"), MAYBE
)
EXPECTED = {"median": MAYBE, "within_95": MAYBE}
PROTOCOL = {"n_rows": int, "mean": MAYBE, "median": MAYBE, "auc": MAYBE, "curve": [NUMBER]}
SPREAD = dict.fromkeys(("mean", "within_95", "mean_relative", "within_95_relative"), MAYBE)
FAILED = [{"path": str, "reason": str}]
FORMS = {
    "files": [
        {
            "file": str, "n_vertices": int, "n_faces": int, "notes": [str], "method": str,
            "distance": str, "weighting": str, "laplacian": str, "area": NUMBER,
            "eigenvalues": [NUMBER], "stress": NUMBER, "steps": dict,
        }
    ],
    "failed": FAILED,
}  # fmt: skip
FITTED = {
    "template": str,
    "scans": [
        {
            "scan": str, "also": [str], "file": str, "n_vertices": int, "n_covered": int,
            "coverage": NUMBER, "scan_coverage": NUMBER, "tolerance": NUMBER,
            "distance_covered": SPREAD, "distance_all": SPREAD, "confidence": MAYBE,
        }
    ],
    "failed": FAILED,
}  # fmt: skip
COMMON = {"written": [str], "warnings": [str], "seconds": float}
# What stands on the command line, and what its JSON has beside the common keys.
SCHEMA: dict[str, dict[str, Any]] = {
    "check a.ply": {
        "files": [
            {
                "file": str, "usable": bool, "verdict": str, "next_step": (str, type(None)),
                "notes": [str], "health": HEALTH,
            }
        ]
    },
    "canonical a.ply --no-cache": FORMS,
    "canonical a.ply b.ply none.ply -o OUT/forms --no-cache": FORMS,
    "distance a.ply --from 0 --from 5 --no-cache": {
        "file": str, "distance": str,
        "sources": [{"vertex": int, "farthest": int, "distance": NUMBER}],
    },
    "match a.ply b.ply --no-refine --n-matches 2 --no-cache": {
        "source": str, "target": str, "n_source": int, "n_target": int, "n_matched": int, **WAY,
        "area_ratio": MAYBE, "mirror_fits": bool, "missed_landmarks": [int], "hypotheses": [dict],
        "alternatives": [WAY], "expected_error": EXPECTED,
    },
    "symmetry a.ply --no-refine --no-cache": {
        "file": str, "n_vertices": int, "n_matched": int, "confidence": MAYBE, "orientation": MAYBE,
    },
    "morph a.ply b.ply --map map.txt --steps 2 -o OUT/between.ply": {
        "source": str, "target": str, "steps": int, "confidence": MAYBE,
    },
    "evaluate map.txt a.ply map.txt map.txt --mirrored-truth map.txt": {
        "map": str, "target": str, "distance": str, "n_rows": int, "coverage": NUMBER,
        "overlap": {"iou": NUMBER, "precision": NUMBER, "recall": NUMBER}, "thresholds": [NUMBER],
        "protocols": {"direct": PROTOCOL, "map-min": PROTOCOL, "vertex-min": PROTOCOL},
    },
    "transfer a.ply b.ply --map map.txt --values values.csv -o OUT/values.csv": {
        "source": str, "target": str, "values": str, "kind": str, "shape": [int],
        "n_without_preimage": int, "confidence": MAYBE,
    },
    "register a.ply b.ply --map map.txt -o OUT/fitted.ply": FITTED,
    "register a.ply b.ply none.ply -o OUT/fitted": FITTED,
    "view a.ply b.ply --no-open -o OUT/view.html": {"a": str, "b": (str, type(None))},
    "similarity a.ply b.ply --known-correspondence --no-cache": {
        "pairs": [{"model": str, "probe": str, "similarity": NUMBER, "confidence": MAYBE}],
    },
    "demo -o OUT/demo.png": {
        "pairs": [
            {"first": str, "second": str, "same_species": bool, "before": NUMBER, "after": NUMBER}
        ]
    },
    "collection add OUT/store a.ply map.txt --workers 0": {
        "store": str, "n_added": int, "n_skipped": int, "n_new_paths": int, "n_shapes": int,
        "failed": FAILED,
    },
    "collection list store": {"store": str, "shapes": [ENTRY]},
    "collection info store": {
        "store": str, "n_shapes": int, "n_files": int, "n_bytes": int, "version": str,
        "descriptor_length": int, "indexed": bool,
    },
    "collection info store a.ply --thumbnail OUT/a.png": {"store": str, **ENTRY},
    "collection remove OUT/store a.ply": {"store": str, "removed": [ENTRY], "n_shapes": int},
    "collection search store a.ply": {
        "store": str, "query": str, "by_match": bool,
        "hits": [
            {"rank": int, "id": str, "path": str, "also": [str], "distance": NUMBER,
             "energy": MAYBE}
        ],
    },
    "collection matrix store": {
        "store": str, "paths": [str], "also": [list], "distances": [list],
    },
    "collection groups store -n 2": {"store": str, "groups": [list]},
    "collection match store --all -o OUT/matches --workers 0": {
        "store": str, "n_matched": int, "n_skipped": int, "n_doubtful": int,
        "failed": FAILED,
    },
    "collection evaluate store labels.csv": {
        "store": str, "n_shapes": int, "n_classes": int, "n_queries": int, "recall": [NUMBER],
        "precision": [NUMBER],
        **dict.fromkeys(
            ("nearest_neighbor", "first_tier", "second_tier", "e_measure", "dcg", "map"), NUMBER
        ),
    },
    "collection register store --template a.ply -o registered --workers 0": {
        "store": str, "template": str, "n_registered": int, "n_skipped": int, "failed": FAILED,
        "shapes": [
            {
                "name": str, "path": str, "file": str, "confidence": NUMBER, "coverage": NUMBER,
                "scan_coverage": NUMBER, "mean_distance": NUMBER, "distance_95": NUMBER,
                "warnings": [str], "also": [str], "doubtful": bool,
            }
        ],
    },
    "collection mean registered -o OUT/mean --min-confidence 0": {
        "registered": str, "template": str, "files": [str], "n_shapes": int, "failed": FAILED,
        "variances": [NUMBER], "total_variance": NUMBER,
    },
    "collection export store -o OUT/all.csv": {"store": str, "n_rows": int},
    "app --no-browser": {"address": str},
    "cache info": {"folder": str, "n_files": int, "n_bytes": int, "most_bytes": int},
    "cache clear": {"n_removed": int},
}  # fmt: skip


def fits(value: Any, schema: Any) -> bool:
    if isinstance(schema, dict):
        alike = isinstance(value, dict) and value.keys() == schema.keys()
        return alike and all(fits(value[key], one) for key, one in schema.items())
    if isinstance(schema, list):
        return isinstance(value, list) and all(fits(one, schema[0]) for one in value)
    return isinstance(value, schema) and (schema is bool or not isinstance(value, bool))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("json")
    store = write_pair(folder)
    store.register(folder / "a.ply", folder / "registered", workers=0)
    (folder / "labels.csv").write_text("path,label\na.ply,stone\nb.ply,stone\n")
    return folder


@pytest.mark.parametrize("line", SCHEMA)
def test_json_has_the_keys_and_types_of_the_table(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr("unbend.app.serve", lambda paths, ready, **_: ready("http://address/"))
    for name in ("make_quadruped", "make_biped"):
        egg = SimpleNamespace(mesh=make_egg(2))
        monkeypatch.setattr(f"unbend.datasets.{name}", lambda pose, n_vertices, egg=egg: egg)
    monkeypatch.setattr(demo, "_COMPARED", 100)
    monkeypatch.setattr(demo, "_POSES", {"dog": ("standing", "sitting"), "human": ("standing",)})
    if line.startswith("collection remove"):
        Collection(tmp_path / "store").add("a.ply", workers=0)
    words = shlex.split(line.replace("OUT", str(tmp_path)))
    done = invoke([*words, "--json"])
    told = json.loads(done.stdout)
    wanted = {**SCHEMA[line], **COMMON}
    assert told.keys() == wanted.keys()
    for key, schema in wanted.items():
        assert fits(told[key], schema), f"{key}: {told[key]}"
    assert all(Path(path).exists() for path in told["written"])
    assert done.exit_code == (1 if told.get("failed") else 0)


def test_every_command_is_in_the_table() -> None:
    for words, _ in every_command():
        assert any(tuple(line.split()[: len(words)]) == words for line in SCHEMA), words


def test_notes_are_in_the_json_and_quiet_keeps_them_off_the_terminal(
    folder: Path, tmp_path: Path
) -> None:
    write_mesh(tmp_path / "a.stl", read_mesh(folder / "a.ply"))
    given = ["distance", str(tmp_path / "a.stl"), "--from", "0", "--no-cache", "--json"]
    done = invoke(given)
    (note,) = json.loads(done.stdout)["warnings"]
    assert "welded" in note
    assert note.startswith("a.stl: ")  # of two shapes, nobody could tell
    assert done.stderr == f"note: {note}\n"
    quiet = invoke([*given, "--quiet"])
    assert json.loads(quiet.stdout)["warnings"] == [note]
    assert quiet.stderr == ""
