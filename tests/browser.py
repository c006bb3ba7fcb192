"""A browser without a window, driven by Chromium's own protocol over two pipes."""

from __future__ import annotations

import base64
import io
import json
import os
import selectors
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import numpy.typing as npt
import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# Half the resolution is drawn in software in half the time, and is no sight for people.
SCALE = 1 if os.environ.get("UNBEND_SCREENSHOTS") else 0.5
# As many as may draw at once, fewer than elsewhere: a page with more is soon made.
CONTEXTS = 4
_PATIENCE = 60.0
# Chromium reads commands from descriptor 3 and answers on 4.
_LAUNCH = (
    "import os, sys\n"
    "for new, old in ((3, int(sys.argv[1])), (4, int(sys.argv[2]))):\n"
    "    os.dup2(old, new)\n"
    "os.execv(sys.argv[3], sys.argv[3:])\n"
)


def find_browser() -> str | None:
    """Find Chromium: what UNBEND_BROWSER names, or one on the path."""
    if sys.platform == "win32":
        return None  # pipes do not pass to it as they do elsewhere
    return os.environ.get("UNBEND_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)


def start_browser(folder: Path, address: str = "") -> Browser:
    """Start a browser that keeps its files in a folder; without any, skip what needs it."""
    program = find_browser()
    if program is None and not os.environ.get("UNBEND_BROWSER_NEEDED"):
        pytest.skip("no Chromium here: make test-browser installs it")
    assert program, "no Chromium was found"
    return Browser(program, folder / "profile", address=address)


class Browser:
    """A page in a browser that has no network; everything that goes wrong is in `problems`.

    What the browser itself says beside that is in `notes`. With an address, what begins with it
    may be asked for.
    """

    def __init__(
        self, program: str, profile: Path, *, width: int = 940, height: int = 720, address: str = ""
    ):
        self._allowed = ("file:", "data:", "blob:", "about:", *([address] if address else []))
        # High descriptors, which the two that Chromium wants cannot overwrite.
        import fcntl

        pipes = [os.pipe(), os.pipe()]
        ends = [[fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 50) for fd in pipe] for pipe in pipes]
        for fd in (*pipes[0], *pipes[1]):
            os.close(fd)
        (theirs_in, self._write), (self._read, theirs_out) = ends
        # Without a graphics processor, what puts pages together is faster without it, too. Frames
        # share the process and the contexts of their page, as in browsers that keep them together.
        arguments = [
            "--headless=new", "--no-sandbox", "--remote-debugging-pipe", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--disable-gpu-compositing", "--no-first-run",
            f"--max-active-webgl-contexts={CONTEXTS}", "--disable-features=IsolateSandboxedIframes",
            "--disable-extensions", "--disable-background-networking", "--disable-dev-shm-usage",
            f"--user-data-dir={profile}", f"--window-size={width},{height}", "--hide-scrollbars",
            "about:blank",
        ]  # fmt: skip
        self._log = open(profile.with_suffix(".log"), "wb")  # noqa: SIM115
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LAUNCH, str(theirs_in), str(theirs_out), program, *arguments],
            pass_fds=(theirs_in, theirs_out),
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._read, selectors.EVENT_READ)
        self._buffer, self._number, self._session = b"", 0, ""
        self.problems: list[str] = []
        self.notes: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = self._first = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        offline = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
        self.call("Network.emulateNetworkConditions", offline=not address, **offline)
        self._size = width, height
        self.resize()

    def resize(self, width: int = 0, *, mobile: bool = False, scale: float = SCALE) -> None:
        """Show the page as wide as this, or as at first, in so many pixels for one of CSS."""
        size = {"width": width or self._size[0], "height": self._size[1]}
        more = {"deviceScaleFactor": scale, "mobile": mobile}
        self.call("Emulation.setDeviceMetricsOverride", **size, **more)

    def close(self) -> None:
        """End the browser."""
        self._process.kill()
        self._process.wait()
        self._selector.close()
        self._log.close()
        os.close(self._read)
        os.close(self._write)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send one command and wait for its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                result: dict[str, Any] = answer["result"]
                return result

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            if not self._selector.select(_PATIENCE):
                raise TimeoutError("the browser does not answer")
            read = os.read(self._read, 2**20)
            if not read:
                raise RuntimeError(f"the browser has ended; see {self._log.name}")
            self._buffer += read
        line, _, self._buffer = self._buffer.partition(b"\0")
        event: dict[str, Any] = json.loads(line)
        self._note(event.get("method", ""), event.get("params", {}))
        return event

    def _note(self, method: str, told: dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            self.problems.append(details.get("exception", {}).get("description", details["text"]))
        if method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.problems.append(str([one.get("value") for one in told["args"]]))
        if method == "Log.entryAdded":
            kind = self.problems if told["entry"]["level"] == "error" else self.notes
            kind.append(told["entry"]["text"])
        if method == "Network.requestWillBeSent":
            address = told["request"]["url"]
            if not address.startswith(self._allowed):
                self.problems.append(f"asked the network for {address}")

    def run(self, script: str) -> Any:
        """Evaluate JavaScript in the page, a promise to its end."""
        answer = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"]["exception"]["description"])
        return answer["result"].get("value")

    def open(self, page: Path) -> None:
        """Open a file from disk and wait until it has drawn."""
        self.visit(page.resolve().as_uri())

    def visit(self, address: str) -> None:
        """Open an address and wait until the page there says that it is ready."""
        self.call("Page.navigate", url=address)
        until = time.monotonic() + _PATIENCE
        while not self.run("document.documentElement?.dataset.ready || ''"):
            if self.problems or time.monotonic() > until:
                raise RuntimeError(f"{address} did not draw: {self.problems}")
            time.sleep(0.02)
        self.settle()

    def switch(self, session: str | None) -> None:
        """Go on with another page, or with the first one again."""
        self._session = session or self._first

    def settle(self) -> None:
        """Wait until two frames have been drawn."""
        self.run("new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))")

    def middle(self, selector: str, right: float = 0.0, up: float = 0.0) -> tuple[float, float]:
        """Place on the screen within an element, from its middle, in shares of half its size."""
        box = self.run(
            f"(e => {{ e.scrollIntoView({{block: 'center'}}); const b = e.getBoundingClientRect();"
            f" return [b.left, b.top, b.width, b.height] }})(document.querySelector({selector!r}))"
        )
        left, top, width, height = box
        return left + width * (1 + right) / 2, top + height * (1 - up) / 2

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """Send one event of the mouse."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, x: float, y: float) -> None:
        """Point at a place, press and release."""
        self.mouse("mouseMoved", x, y)
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, button="left", clickCount=1)
        self.settle()

    def drag(self, start: tuple[float, float], right: float, down: float) -> None:
        """Press at a place, move and release."""
        x, y = start
        self.mouse("mousePressed", x, y, button="left", clickCount=1)
        for share in (0.5, 1.0):
            self.mouse("mouseMoved", x + share * right, y + share * down, button="left", buttons=1)
        self.mouse("mouseReleased", x + right, y + down, button="left", clickCount=1)
        self.settle()

    def press(self, key: str, **more: Any) -> None:
        """Press a key on what has the focus."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, **more)
        self.settle()

    def touch(self, *places: tuple[float, float]) -> None:
        """Put a finger on the first place, move it to the others and lift it."""
        kinds = ["touchStart"] + ["touchMove"] * (len(places) - 1)
        for kind, (x, y) in zip(kinds, places, strict=True):
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.settle()

    def choose_file(self, selector: str, *paths: Path) -> None:
        """Choose files in a file input."""
        found = self.call("Runtime.evaluate", expression=f"document.querySelector({selector!r})")
        name = found["result"]["objectId"]
        self.call("DOM.setFileInputFiles", objectId=name, files=list(map(str, paths)))

    def drop(self, x: float, y: float, *paths: Path) -> None:
        """Drop files onto a place on the screen."""
        data = {"items": [], "files": list(map(str, paths)), "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)

    def wait_for(self, condition: str) -> None:
        """Wait until JavaScript is true."""
        until = time.monotonic() + _PATIENCE
        while not self.run(condition):
            if time.monotonic() > until:
                raise TimeoutError(f"never true: {condition}")
            time.sleep(0.02)

    def picture(self, selector: str = "", save: Path | None = None) -> npt.NDArray[np.float64]:
        """Pixels of an element, or of the whole page, kept as a file if named."""
        name = selector or "html"
        box = self.run(
            f"(b => [b.left + scrollX, b.top + scrollY, b.width, b.height])"
            f"(document.querySelector({name!r}).getBoundingClientRect())"
        )
        clip = dict(zip(("x", "y", "width", "height"), box, strict=True), scale=1)
        more = {"captureBeyondViewport": True, "optimizeForSpeed": SCALE < 1, "clip": clip}
        data = base64.b64decode(self.call("Page.captureScreenshot", **more)["data"])
        if save is not None:
            save.write_bytes(data)
        return np.asarray(matplotlib.image.imread(io.BytesIO(data)), dtype=np.float64)[..., :3]


def changed(before: npt.NDArray[np.float64], after: npt.NDArray[np.float64]) -> float:
    """Share of the pixels that differ."""
    return float((np.abs(before - after).max(axis=2) > 0.05).mean())


def drawn(picture: npt.NDArray[np.float64]) -> float:
    """Share of the pixels that are not the ground's, whose colours hardly differ from grey."""
    return float((np.ptp(picture, axis=2) > 0.1).mean())
