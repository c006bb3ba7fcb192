"""Downloads, from a server on this machine."""

import hashlib
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path

import pytest

from unbend.datasets import fetch_tosca_remeshed
from unbend.datasets.fetch import TOSCA_REMESHED_URL, fetch_files
from unbend.errors import FileError, InputError, MissingExtraError

FILES = {"cat0.off": b"OFF\n0 0 0\n", "corres/cat0.vts": b"1\n", "corres/cat0.sym.vts": b"2\n"}
REGISTRY = {name: hashlib.sha256(data).hexdigest() for name, data in FILES.items()}


class Server:
    """Serves a folder and remembers what was asked for."""

    def __init__(self, folder: Path) -> None:
        asked = self.asked = []

        class Handler(SimpleHTTPRequestHandler):
            def log_message(self, *args: object) -> None:
                asked.append(self.path)

        self._server = ThreadingHTTPServer(
            ("127.0.0.1", 0), partial(Handler, directory=str(folder))
        )
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/"

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@pytest.fixture(autouse=True)
def _no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setenv("no_proxy", "127.0.0.1")


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    pytest.importorskip("pooch")
    for name, data in FILES.items():
        path = tmp_path / "served" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    server = Server(tmp_path / "served")
    yield server
    server.stop()


def _whole(folder: Path) -> bool:
    return all((folder / name).read_bytes() == data for name, data in FILES.items())


def test_only_what_is_missing_or_broken_is_downloaded(server, tmp_path, capsys):
    folder = tmp_path / "made" / "here"
    assert fetch_files(REGISTRY, folder, server.url, "the terms") == folder
    assert _whole(folder)
    assert sorted(server.asked) == sorted(f"/{name}" for name in FILES)
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("the terms") == 1

    server.asked.clear()
    fetch_files(REGISTRY, folder, server.url, "the terms")
    assert server.asked == []
    assert "the terms" not in capsys.readouterr().err

    (folder / "cat0.off").write_bytes(b"OFF\n0 0")  # cut off
    (folder / "corres/cat0.vts").unlink()
    fetch_files(REGISTRY, folder, server.url.rstrip("/"), "the terms")
    assert sorted(server.asked) == ["/cat0.off", "/corres/cat0.vts"]
    assert _whole(folder)


def test_a_wrong_file_is_refused_and_the_rest_resumed(server, tmp_path):
    wrong = tmp_path / "served" / "corres" / "cat0.vts"
    wrong.write_bytes(b"somebody else's\n")
    with pytest.raises(FileError, match=r"corres/cat0\.vts is not the file it should be"):
        fetch_files(REGISTRY, tmp_path / "to", server.url, "")
    left = [path for path in (tmp_path / "to").rglob("*") if path.is_file()]
    assert left == [tmp_path / "to" / "cat0.off"]
    wrong.write_bytes(FILES["corres/cat0.vts"])
    server.asked.clear()
    fetch_files(REGISTRY, tmp_path / "to", server.url, "")
    assert "/cat0.off" not in server.asked
    assert _whole(tmp_path / "to")


def test_a_missing_file_or_server_is_said_in_one_sentence(server, tmp_path):
    (tmp_path / "served" / "cat0.off").unlink()
    with pytest.raises(FileError, match=r"cannot download http.*cat0\.off to .*404.*try again"):
        fetch_files(REGISTRY, tmp_path / "to", server.url, "")
    server.stop()
    with pytest.raises(FileError, match=r"cannot download http.*cat0\.off"):
        fetch_files(REGISTRY, tmp_path / "to", server.url, "")


@pytest.mark.parametrize(
    ("url", "error", "message"),
    [
        ("ftp://127.0.0.1/", InputError, "must begin with https://"),
        ("http://example.org/", InputError, "must begin with https://"),
        ("http://127.0.0.1.example.org/", InputError, "must begin with https://"),
        ("https://", FileError, "cannot download"),
    ],
)
def test_an_address_that_is_none_is_said(url, error, message, tmp_path):
    pytest.importorskip("pooch")
    with pytest.raises(error, match=message):
        fetch_files(REGISTRY, tmp_path / "to", url, "")


def test_a_folder_that_cannot_be_made_is_said(server, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="cannot download"):
        fetch_files(REGISTRY, tmp_path / "file" / "below", server.url, "")


def test_another_server_with_other_files_is_refused(server, tmp_path, capsys):
    with pytest.raises(FileError, match=r"cat0\.off is not the file it should be"):
        fetch_tosca_remeshed(tmp_path / "to", base_url=server.url)
    assert "academic purposes" in capsys.readouterr().err


def test_without_pooch(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(MissingExtraError, match="pip install pooch"):
        fetch_tosca_remeshed(tmp_path)


def test_registry_lists_each_shape_with_both_its_lists_of_points():
    text = (files("unbend.datasets") / "tosca_remeshed.sha256").read_text("utf-8")
    names = [line.split()[1] for line in text.splitlines()]
    shapes = {name.removesuffix(".off") for name in names if name.endswith(".off")}
    assert len(shapes) == 23
    expected = {f(n) for n in shapes for f in ("{}.off".format, "corres/{}.vts".format)}
    assert set(names) == expected | {f"corres/{name}.sym.vts" for name in shapes}
    assert TOSCA_REMESHED_URL.endswith("/")


def test_real_shapes_from_a_mirror(real_data, tmp_path, monkeypatch):
    pytest.importorskip("pooch")
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path))
    mirror = Server(real_data / "tosca_remeshed")
    try:
        folder = fetch_tosca_remeshed(base_url=mirror.url)
        assert len(mirror.asked) == 69
        assert fetch_tosca_remeshed(base_url=mirror.url) == folder == tmp_path / "tosca_remeshed"
        assert len(mirror.asked) == 69
    finally:
        mirror.stop()
    assert len(list(folder.glob("*.off"))) == 23
