"""One run of the app: its shapes, its results, and the queue of jobs."""

from __future__ import annotations

import contextlib
import functools
import itertools
import os
import shutil
import socket
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

from unbend._text import printable
from unbend.app._requests import JOBS, check_request
from unbend.app._worker import Worker
from unbend.choices import Axis
from unbend.errors import InputError

_PREFIX = "unbend-app-"  # of folders; the port follows
# Suffixes of uploads that only carry values or landmarks.
_VALUE_SUFFIXES = (".csv", ".txt", ".json", ".fcsv", ".pp")
_SHAPE_SUFFIXES = (".off", ".obj", ".ply", ".stl", ".vtk", ".vtp", ".xyz", ".npy", ".glb")
_MOST_BYTES = 512 * 2**20  # of one upload
_MOST_BYTES_IN_ALL = 2 * 2**30
_MOST_SHAPES, _MOST_JOBS = 200, 500
_MOST_LETTERS = 120  # of a name
_HIDDEN = ("path", "map_file", "folder", "stamp", "job")  # from pages


class Session:
    """Shapes, results and jobs, each of which may take so many bytes of memory.

    Every method may be called from any thread.
    """

    def __init__(self, port: int, memory: int, collection: str | None) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{port}-"))
        self._collection = collection
        self._worker = Worker(memory)
        self._ids = itertools.count(1)
        self._changed = threading.Condition()
        self._version = 0
        self._shapes: dict[int, dict[str, Any]] = {}
        self._values: dict[int, tuple[str, str]] = {}
        self._results: dict[int, dict[str, Any]] = {}
        self._jobs: dict[int, dict[str, Any]] = {}
        self._troubles: dict[int, dict[str, str]] = {}
        self._up: Axis = "y"
        self._bytes = 0
        self._closed = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the worker and remove all files."""
        with self._changed:
            self._closed = True
            self._jobs.clear()
            self._changed.notify_all()
        self._worker.close()
        self._thread.join()
        shutil.rmtree(self.folder, ignore_errors=True)

    def state(self, seen: int) -> dict[str, Any] | None:
        """Everything that a page shows, or None if nothing has changed since it was `seen`."""
        with self._changed:
            if seen == self._version:
                return None
            return {
                "version": self._version,
                "shapes": _shown(self._shapes),
                "results": _shown(self._results),
                "jobs": _shown(self._jobs),
                "troubles": _shown(self._troubles),
                "collection": printable(self._collection or ""),
                "up": self._up,
            }

    def new_upload(self, name: str, size: int, *, values: bool) -> tuple[Path, str, int]:
        """Give the path for a file of the user, the name to show, and the bytes that it may have.

        Nothing of the user's name but its suffix is used for the path.
        """
        label = printable(name.replace("\\", "/").rsplit("/", 1)[-1])[-_MOST_LETTERS:]
        suffix = Path(label).suffix.lower()
        allowed = _VALUE_SUFFIXES + _SHAPE_SUFFIXES if values else _SHAPE_SUFFIXES
        if suffix not in allowed:
            raise InputError(f"{label}: files that can be opened here end in {', '.join(allowed)}")
        with self._changed:
            if len(self._shapes) + len(self._values) >= _MOST_SHAPES:
                raise InputError(f"{_MOST_SHAPES} files are open; remove some first")
            room = min(_MOST_BYTES, _MOST_BYTES_IN_ALL - self._bytes)
            if size > room:
                raise InputError(f"{label} is too large: {room // 2**20} MiB can be taken")
            kept = label.lower().endswith(".mrk.json")
            path = self.folder / f"upload-{next(self._ids)}{'.mrk.json' if kept else suffix}"
        return path, label, room

    def add(self, path: Path, label: str, *, values: bool = False) -> int:
        """Add a file that is there; a shape is then looked at."""
        with self._changed:
            i = next(self._ids)
            if self.folder in path.parents:
                self._bytes += path.stat().st_size
            if values:
                self._values[i] = str(path), label
                return i
            taken = {one["name"] for one in self._shapes.values()}
            name = _not_taken(printable(Path(label).stem), printable(Path(label).suffix), taken)
            shape = {"path": str(path), "name": name, "state": "reading", "stamp": _stamp(path)}
            self._shapes[i] = shape
            self._submit({"do": "look", "shapes": [i]})
        return i

    def turn(self, up: Axis) -> None:
        """Take another axis for the one that points upward, and draw all shapes again."""
        if up not in get_args(Axis):
            raise InputError("the upward axis is x, y or z")
        with self._changed:
            self._up = up
            for i, entry in list(self._jobs.items()):
                if entry["job"]["do"] == "look" and not entry["running"]:
                    del self._jobs[i]  # which would draw with the axis of before
            for i, shape in self._shapes.items():
                if shape["state"] != "bad":
                    self._submit({"do": "look", "shapes": [i]})

    def page(self, i: int) -> tuple[str, str]:
        """Path of the page of a result, and its name."""
        result = self._results[i]
        return f"{result['folder']}/page.html", f"{result['title']}.html"

    def file(self, i: int, kind: str, n: int | None = None) -> tuple[str, str | None]:
        """Path of the file or picture of a shape, or the n-th of a result; files have a name."""
        if n is not None:
            if kind not in ("files", "pictures"):
                raise LookupError(kind)
            one = self._results[i][kind][n]
            return one["path"], one.get("name")
        shape = self._shapes[i]
        if kind == "picture":
            return shape["pictures"][0]["path"], None
        return shape["path"], shape["name"]

    def remove(self, kind: str, i: int) -> None:
        """Forget a shape, a result or a trouble, with our files of it, or cancel a job."""
        forget = {
            "shapes": self._remove_shape,
            "results": lambda i: _remove_folder(self._results.pop(i)),
            "troubles": lambda i: self._troubles.pop(i, None),
            "jobs": self._cancel,
        }[kind]
        with self._change():
            forget(i)

    def _remove_shape(self, i: int) -> None:
        shape = self._shapes.pop(i)
        _remove_folder(shape)
        self._remove_file(Path(shape["path"]))

    def _remove_values(self, given: Any) -> None:
        """Remove the files of values that a job was given."""
        for i in [i for i, one in self._values.items() if one == given]:
            self._remove_file(Path(self._values.pop(i)[0]))

    def _remove_file(self, path: Path) -> None:
        if self.folder in path.parents:
            with contextlib.suppress(OSError):  # it is gone, or Windows keeps what is being read
                self._bytes -= path.stat().st_size
                path.unlink()

    def open_found(self, i: int, n: int) -> int:
        """Add a shape of the collection that a search has found."""
        with self._changed:
            one = self._results[i]["found"][n]
            return self.add(Path(one["path"]), one["name"])

    def submit(self, asked: dict[str, Any]) -> int:
        """Put into the queue what a page asked for, after checking every word of it."""
        with self._changed:
            if len(self._jobs) >= _MOST_JOBS:
                raise InputError("too many jobs wait; cancel some first")
            open_now = self._shapes, self._results, self._values
            try:
                job = check_request(asked, *open_now, self._collection)
            except InputError:
                given = (one for i, one in self._values.items() if i == asked.get("values"))
                self._remove_values(next(given, None))
                raise
            return self._submit(job)

    def _cancel(self, i: int) -> None:
        if (entry := self._jobs.pop(i, None)) is None:
            return
        self._remove_values(entry["job"].get("values"))
        shapes = [self._shapes.get(one, {}) for one in entry["job"]["shapes"]]
        if entry["job"]["do"] == "look" and shapes[0].get("state") == "reading":
            self._failed(i, entry, "cancelled")  # others are only drawn again
        if entry["running"]:
            self._worker.cancel()

    def _submit(self, job: dict[str, Any]) -> int:
        job = job | {"up": self._up}
        for i, entry in self._jobs.items():
            if entry["job"] == job:  # asked for twice
                return i
        i = next(self._ids)
        names = " and ".join(self._shapes[one]["name"] for one in job["shapes"])
        entry = {"title": JOBS[job["do"]][0].format(names), "job": job}
        self._jobs[i] = entry | {"stage": "waiting", "share": 0.0, "running": False}
        self._note()
        return i

    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._jobs and not self._closed:
                    self._changed.wait()
                if self._closed:
                    return
                i, entry = next(iter(self._jobs.items()))
                job = entry["job"]
                if any(one not in self._shapes for one in job["shapes"]):
                    del self._jobs[i]
                    self._remove_values(job.get("values"))
                    self._note()
                    continue
                entry |= {"running": True, "stage": "starting"}
                folder = self.folder / f"result-{i}"
                used = [self._shapes[one] for one in job["shapes"]]
                shapes = [(one["path"], one["name"]) for one in used]
                changed = [one["name"] for one in used if one["stamp"] != _stamp(one["path"])]
                run = self._worker.begin()  # what is cancelled from here on does not start
                self._note()
            if changed:
                found = {"error": f"{changed[0]} has changed since it was opened; open it again"}
            else:
                given = job | {"shapes": shapes, "folder": str(folder)}
                found = run(given, functools.partial(self._step, entry))
            with self._change():
                self._remove_values(job.get("values"))
                there = self._jobs.pop(i, None) is not None
                if "error" in found and any(one not in self._shapes for one in job["shapes"]):
                    there = False  # it may have failed for that
                if there and "error" in found:
                    self._failed(i, entry, found["error"])
                elif there and found:
                    self._finished(i, job, found | {"folder": str(folder)})
                else:
                    shutil.rmtree(folder, ignore_errors=True)

    def _step(self, entry: dict[str, Any], stage: str, share: float) -> None:
        with self._change():
            entry |= {"stage": stage, "share": share}

    def _failed(self, i: int, entry: dict[str, Any], error: str) -> None:
        """Show a sentence, with the names that the user knows in place of paths."""
        job = entry["job"]
        shapes = [self._shapes[one] for one in job["shapes"] if one in self._shapes]
        files = [(one["path"], one["name"]) for one in shapes]
        files += [job["values"]] if job.get("values") else []
        files += [(job["map_file"], job["map_name"])] if "map_file" in job else []
        for path, name in files:
            error = error.replace(path, name)
            if self.folder in Path(path).parents:  # a name of ours, which no user knows
                error = error.replace(Path(path).name, name)
        if job["do"] == "look":
            for shape in shapes:
                shape |= {"state": "bad", "told": [error]}
        else:
            self._troubles[i] = {"text": f"{entry['title']}: {error}"}

    def _finished(self, i: int, job: dict[str, Any], found: dict[str, Any]) -> None:
        if job["do"] == "look":
            (one,) = job["shapes"]
            state = "good" if found["usable"] else "bad"
            if one in self._shapes:
                _remove_folder(self._shapes[one])  # with the picture of before
                self._shapes[one] |= found | {"state": state, "drawn": i}
            else:
                _remove_folder(found)
        elif job["do"] == "sample":
            for one in found["samples"]:
                self._shapes[self.add(Path(one["path"]), one["name"])]["sample"] = True
        else:
            title = _not_taken(found["title"], "", {one["title"] for one in self._results.values()})
            self._results[i] = found | {"title": title, "do": job["do"], "shapes": job["shapes"]}

    def _note(self) -> None:
        self._version += 1
        self._changed.notify_all()

    @contextlib.contextmanager
    def _change(self) -> Iterator[None]:
        with self._changed:
            yield
            self._note()


def remove_dead() -> None:
    """Remove the folders of earlier runs that were killed: nothing listens at their ports."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*-*"):
        with contextlib.suppress(OSError, ValueError):  # the port is taken, or the name has none
            port = int(folder.name.split("-")[2]) % 2**16
            socket.create_server(("127.0.0.1", port)).close()
            if not hasattr(os, "getuid") or folder.lstat().st_uid == os.getuid():
                shutil.rmtree(folder, ignore_errors=True)


def _not_taken(start: str, end: str, taken: set[str]) -> str:
    """Return a name, with a number before its end if others have it."""
    names = (f"{start} ({n}){end}" for n in itertools.count(2))
    return next(name for name in itertools.chain([start + end], names) if name not in taken)


def _stamp(path: str | Path) -> tuple[int, int] | None:
    """Size of a file and when it was written; None if it is gone."""
    with contextlib.suppress(OSError):
        about = os.stat(path)
        return about.st_size, about.st_mtime_ns
    return None


def _remove_folder(of: dict[str, Any]) -> None:
    """Remove our files of a result, or pictures of a shape, if there are any."""
    if "folder" in of:
        shutil.rmtree(of["folder"], ignore_errors=True)


def _shown(entries: dict[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """List what a page is told of shapes, results or jobs: everything but paths."""
    return [{"id": i} | _without_hidden(one) for i, one in entries.items()]


def _without_hidden(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_hidden(one) for one in value]
    if isinstance(value, dict):
        return {key: _without_hidden(one) for key, one in value.items() if key not in _HIDDEN}
    return value
