"""What a page may ask for: every word of a request is checked here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from unbend._text import printable
from unbend.errors import InputError

# What there is to do: its title, and of how many shapes.
JOBS = {
    "look": ("Reading {}", (1,)),
    "sample": ("Making a sample pair", (0,)),
    "match": ("Matching {}", (2,)),
    "choose": ("Taking another map of {}", (2,)),
    "symmetry": ("Looking for left and right of {}", (1,)),
    "landmarks": ("Opening {}", (1, 2)),
    "distance": ("Measuring distances on {}", (1,)),
    "form": ("Computing the canonical form of {}", (1,)),
    "transfer": ("Carrying values of {}", (2,)),
    "register": ("Fitting {}", (2,)),
    "morph": ("Morphing {}", (2,)),
    "search": ("Searching with {}", (1,)),
    "groups": ("Grouping the collection", (0,)),
}
_WITH_MAP = ("choose", "transfer", "register", "morph")
_MOST_STEPS = 9
_MOST_LETTERS = 120


def check_request(
    asked: Mapping[str, Any],
    shapes: Mapping[int, Any],
    results: Mapping[int, Any],
    values: Mapping[int, Any],
    collection: str | None,
) -> dict[str, Any]:
    """Turn what a page asked for into a job; raise InputError for anything else."""
    what, chosen = asked.get("do"), asked.get("shapes", [])
    if what not in [*JOBS] or what == "look":  # which need not be text
        raise InputError("there is no such job")
    job: dict[str, Any] = {"do": what}
    result: Mapping[str, Any] = {}
    if what in _WITH_MAP:
        result = results.get(_whole(asked.get("result")), {})
        if "map_file" not in result:
            raise InputError("that match is not there any more")
        chosen = result["shapes"]
        job |= {"map_file": result["map_file"], "map_name": result["files"][0]["name"]}
    if not isinstance(chosen, list) or len(chosen) not in JOBS[what][1]:
        raise InputError("choose another number of shapes for this")
    if any(shapes.get(_whole(one), {}).get("state") != "good" for one in chosen):
        raise InputError("that shape is not there any more, or cannot be used")
    job["shapes"] = chosen
    if what in ("match", "landmarks"):
        job["landmarks"] = _landmarks(asked.get("landmarks", []), len(chosen))
    if what == "match":
        job["mirror"] = asked.get("mirror") is True
    elif what == "distance":
        job["landmarks"] = _landmarks(asked.get("landmarks", []), 1)
        if not job["landmarks"]:
            raise InputError("click a place on the shape first")
    elif what == "choose":
        alternatives = dict(enumerate(result["alternatives"]))
        other = alternatives.get(_whole(asked.get("alternative")))
        if other is None:
            raise InputError("that map is not there")
        job |= {"map_file": other["path"], "map_name": other["name"]}
        job |= {"command": other["command"], "python": other["python"]}
        job["landmarks"] = result["landmarks"]
    elif what == "transfer":
        job["values"] = values.get(_whole(asked.get("values")))
        if job["values"] is None and asked.get("values") is not None:
            raise InputError("those values are not there any more")
        job["column"] = str(asked.get("column", ""))[:_MOST_LETTERS] or None
    elif what == "morph":
        job["steps"] = min(max(_whole(asked.get("steps")), 1), _MOST_STEPS)
    elif what in ("search", "groups"):
        if collection is None:
            raise InputError("there is no collection: start with unbend app --collection STORE")
        job["store"] = collection
    return job


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) else -1


def _landmarks(given: Any, width: int) -> list[dict[str, Any]]:
    """Check landmarks: each a label, and a vertex number of each shape."""
    refusal = InputError("landmarks are labels with vertex numbers, one of each shape")
    try:
        found = [(printable(str(one["name"])), list(one["at"])) for one in given]
    except (LookupError, TypeError):
        raise refusal from None
    for _, at in found:
        if len(at) != width or not all(0 <= _whole(vertex) < 2**53 for vertex in at):
            raise refusal
    return [{"name": name[:_MOST_LETTERS], "at": at} for name, at in found]
