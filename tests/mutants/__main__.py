"""Change modules in small ways, one at a time: ``python -m tests.mutants io/_maps.py``."""

import argparse
import ast
import contextlib
import faulthandler
import functools
import gc
import importlib
import itertools
import os
import pickle
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import coverage
import pytest
from _pytest.runner import runtestprotocol

from .changes import Place, changes

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "unbend"
UNCOMPILED = bool(os.environ.get("NUMBA_DISABLE_JIT"))
ROOM = 4 << 30  # bytes that a change may take


def main() -> int:
    """Run the tests on every change, and list those changes that no test sees."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("modules", nargs="+", help="files below src/unbend")
    parser.add_argument("--since", help="a commit: only lines that changed since then")
    parser.add_argument("--tests", nargs="*", help="instead of the modules' and their folders'")
    parser.add_argument("--share", type=float, default=1.0, help="of the changes, drawn at random")
    parser.add_argument("--seconds", type=float, default=20.0, help="of tests for one change")
    asked, more = parser.parse_known_args()  # the rest is pytest's
    paths = [SOURCE / one for one in asked.modules]
    tests = asked.tests or sorted({f"tests/{Path(one).parts[0]}" for one in asked.modules})
    kind = ["-m", "kernels"] if UNCOMPILED else []
    runner = Runner(paths, asked.since, asked.share, asked.seconds)
    arguments = ["-q", "--tb=native", "-p", "no:cacheprovider", *kind, *more]
    pytest.main([*arguments, *tests, *map(str, paths)], plugins=[runner])
    kernels = any(any(True for _ in changes(one.read_text("utf-8"), True)) for one in paths)
    if kernels and not UNCOMPILED:
        again = [sys.executable, "-m", "tests.mutants", *sys.argv[1:]]
        runner.failed |= subprocess.call(again, env={**os.environ, "NUMBA_DISABLE_JIT": "1"})
    return runner.failed


class Runner:
    """A plugin of pytest: it collects once, and runs tests in a process forked for every change."""

    def __init__(self, paths: list[Path], since: str | None, share: float, seconds: float) -> None:
        self.paths, self.since, self.share, self.seconds = paths, since, share, seconds
        self.out = os.fdopen(os.dup(1), "w", buffering=1)  # pytest captures the other
        self.failed = 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run what is asked for instead of the tests."""
        for path in self.paths:
            name = path.relative_to(SOURCE).with_suffix("")
            importlib.import_module(".".join(("unbend", *name.parts)).removesuffix(".__init__"))
        functions = [one for one in gc.get_objects() if isinstance(one, FunctionType)]
        reached, times = self._forked(lambda: _follow(self.paths, session.items))
        gc.freeze()  # what is not looked at is not copied
        for path in self.paths:
            tests = [one for one in session.items if one.nodeid in times]
            own = [one for one in functions if one.__code__.co_filename == str(path)]
            self._change(
                path, own, sorted(tests, key=lambda one: times[one.nodeid]), reached, times
            )
        return True

    def _change(
        self,
        path: Path,
        functions: list[FunctionType],
        tests: list[pytest.Item],
        reached: dict[Path, dict[int, list[str]]],
        times: dict[str, float],
    ) -> None:
        """Make the changes of one module."""
        source = path.read_text("utf-8")
        places = [place for place, _ in changes(source, UNCOMPILED)]
        asked = range(len(places))
        if self.since:
            changed = _changed(path, self.since)
            asked = [i for i in asked if changed.intersection(places[i].lines)]
        chosen = set(random.Random(0).sample(asked, round(self.share * len(asked))))
        found = Counter[str]()
        for i, (place, tree) in enumerate(changes(source, UNCOMPILED)):
            if i not in chosen:
                continue
            lines = place.lines if place.function else reached[path]
            seen = {test for line in lines for test in reached[path].get(line, ())}
            items = [one for one in tests if one.nodeid in seen]
            ends = itertools.accumulate(times[one.nodeid] for one in items)
            items = items[: 1 + sum(end < self.seconds for end in ends)]
            limit = 10 + 4 * int(sum(times[one.nodeid] for one in items))
            make = functools.partial(_make, path, place, tree, functions)
            test = functools.partial(_test, make, items, limit)
            result = (self._forked(test) or "killed") if items else "not reached"
            found[result] += 1
            if result != "killed":
                self.failed = 1
                print(place.first, result, place.function, place.text, sep="\t", file=self.out)
        counts = ", ".join(f"{count} {what}" for what, count in sorted(found.items()))
        kind = " uncompiled" if UNCOMPILED else ""
        name = path.relative_to(SOURCE)
        print(f"{name}{kind}: {len(chosen)} of {len(places)}: {counts}", file=self.out)

    def _forked(self, work: Any) -> Any:
        """Do work in a process of its own; return what it returns, or None if it ended early."""
        folder = tempfile.mkdtemp(prefix="mutants-")
        reading, writing = os.pipe()
        pid = os.fork()
        if not pid:
            os.setsid()
            os.environ["PYTEST_DEBUG_TEMPROOT"] = tempfile.tempdir = folder
            try:
                result = work()
            except BaseException:
                traceback.print_exc(file=self.out)
                result = "broken"
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump(result, pipe)
            os._exit(0)
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            data = pipe.read()
        os.waitpid(pid, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # what it began and left
        shutil.rmtree(folder, ignore_errors=True)
        return pickle.loads(data) if data else None


def _changed(path: Path, since: str) -> set[int]:
    """The lines of a file that are not as they were in a commit."""
    run = ["git", "diff", "--unified=0", since, "--", str(path)]
    text = subprocess.run(run, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    pieces = re.findall(r"^@@ \S+ \+(\d+)(?:,(\d+))? @@", text, re.MULTILINE)
    return {int(first) + i for first, count in pieces for i in range(int(count or 1))}


def _follow(
    paths: list[Path], items: list[pytest.Item]
) -> tuple[dict[Path, dict[int, list[str]]], dict[str, float]]:
    """Find which tests run each line, every test on its own, and how long they take."""
    watch = coverage.Coverage(data_file=None, include=list(map(str, paths)), config_file=False)
    kept = [one for one in gc.get_objects() if isinstance(one, functools._lru_cache_wrapper)]
    caches = [one for one in kept if one.__module__.startswith(("unbend", "test", "corpus"))]
    times = {}
    watch.start()
    for item in items:
        # Nothing that a test made stays for the next: each is seen to run all that it needs.
        for one in caches:
            one.cache_clear()
        watch.switch_context(item.nodeid)
        begun = time.perf_counter()
        reports = runtestprotocol(item, log=False, nextitem=None)
        times[item.nodeid] = time.perf_counter() - begun
        for report in reports:
            if report.failed:
                raise RuntimeError(f"{item.nodeid} fails as things are: {report.longreprtext}")
    watch.stop()
    return {path: watch.get_data().contexts_by_lineno(str(path)) for path in paths}, times


def _test(make: Any, items: list[pytest.Item], limit: int) -> str:
    """Make a change and run tests until one fails."""
    faulthandler.disable()  # a change may well end in the middle of a library
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(limit)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + ROOM, used + ROOM))
    make()
    for item, after in zip(items, [*items[1:], None], strict=True):
        if any(report.failed for report in runtestprotocol(item, log=False, nextitem=after)):
            return "killed"
    return "survived"


def _make(path: Path, place: Place, tree: ast.Module, functions: list[FunctionType]) -> None:
    """Put changed code into the functions of a loaded module, or changed defaults or constants."""
    code = compile(tree, str(path), "exec")
    new = dict(_codes(code))
    for one in functions:
        one.__code__ = new.get((one.__qualname__, one.__code__.co_firstlineno), one.__code__)
    if not place.at_import:
        return
    loaded = next(one for one in sys.modules.values() if getattr(one, "__file__", "") == str(path))
    again = ModuleType(loaded.__name__)
    again.__dict__.update(__file__=str(path), __package__=loaded.__package__)
    exec(code, vars(again))
    for one in gc.get_objects():
        if isinstance(one, FunctionType) and one.__globals__ is vars(again):
            for old in functions:
                if old.__qualname__ == one.__qualname__:
                    old.__defaults__, old.__kwdefaults__ = one.__defaults__, one.__kwdefaults__
    names = [one for one in tree.body if one.lineno == place.first and not place.function]
    for name in [one.id for one in ast.walk(ast.Module(names)) if isinstance(one, ast.Name)]:
        was = vars(loaded).get(name)
        for module in list(sys.modules.values()):
            if was is not None and vars(module).get(name) is was:
                setattr(module, name, vars(again)[name])


def _codes(code: CodeType) -> Iterator[tuple[tuple[str, int], CodeType]]:
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield (one.co_qualname, one.co_firstlineno), one
            yield from _codes(one)


if __name__ == "__main__":
    sys.exit(main())
