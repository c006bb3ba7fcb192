"""One running app for the tests of a module, with its own temporary folder."""

import socket
import tempfile
import threading
from http.client import HTTPConnection
from json import dumps, loads
from pathlib import Path

import pytest

from sheets import make_torus
from unbend import write_mesh
from unbend.app import _server, serve
from unbend.collection import Collection
from unbend.datasets import make_quadruped


class App:
    """A running app, and requests to it as its own page makes them."""

    def __init__(self, address: str, session: _server.Session) -> None:
        self.address, self.session = address, session
        self.origin, self.token = address.rsplit("/", 2)[:2]
        self.port = int(self.origin.rsplit(":", 1)[1])

    def ask(self, method: str, path: str, body=None, *, token=None, **headers):
        """Status, headers and body of an answer; headers that are None are left out."""
        given = {"Host": f"127.0.0.1:{self.port}", "Origin": self.origin}
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            address = f"/{self.token if token is None else token}/{path}"
            connection.putrequest(method, address, skip_host=True)
            data = dumps(body).encode() if isinstance(body, dict | list) else body
            if data is not None and "Content_Length" not in headers:
                given["Content-Length"] = str(len(data))
            for name, value in given.items():
                if value is not None:
                    connection.putheader(name, value)
            connection.endheaders(data)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()
        finally:
            connection.close()

    def get(self, path: str):
        return loads(self.ask("GET", path)[2])

    def send(self, method: str, path: str, body=None):
        status, _, text = self.ask(method, path, body)
        assert status == 200, text
        return loads(text)

    def wait(self, true, seconds: float = 60.0):
        """Wait for a state of the app."""
        pause = threading.Event()
        for _ in range(int(seconds / 0.02)):
            state = self.get("state")
            if true(state):
                return state
            pause.wait(0.02)
        raise AssertionError(state)


@pytest.fixture(scope="module")
def temporary(tmp_path_factory: pytest.TempPathFactory):
    """The folder in which apps keep their files, with what another one and a killed one have."""
    folder = tmp_path_factory.mktemp("temporary")
    with socket.create_server(("127.0.0.1", 0)) as ended:
        (folder / f"unbend-app-{ended.getsockname()[1]}-killed").mkdir()
    (folder / "unbend-app-odd-one").mkdir()
    with socket.create_server(("127.0.0.1", 0)) as other:
        (folder / f"unbend-app-{other.getsockname()[1]}-runs").mkdir()
        yield folder


@pytest.fixture(scope="session")
def store(tmp_path_factory: pytest.TempPathFactory) -> Collection:
    """A collection of a ring and two dogs, only to be read."""
    folder = tmp_path_factory.mktemp("collection")
    write_mesh(folder / "ring.ply", make_torus(30, 20))
    for pose in ("standing", "galloping"):
        write_mesh(folder / f"dog-{pose}.ply", make_quadruped(pose, n_vertices=600).mesh)
    found = Collection(folder / "store")
    found.add([str(folder)], workers=0)
    return found


@pytest.fixture(scope="module")
def app(temporary: Path, store: Collection):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tempfile, "tempdir", str(temporary))
        patch.setattr(_server, "_CLOSED_SECONDS", 600.0)
        addresses, sessions, ready = [], [], threading.Event()
        make_session = _server.Session

        def noted(*given) -> _server.Session:
            sessions.append(make_session(*given))
            return sessions[0]

        patch.setattr(_server, "Session", noted)

        def note(address: str) -> None:
            addresses.append(address)
            ready.set()

        given = {"collection": store.path, "ready": note}
        thread = threading.Thread(target=serve, args=([],), kwargs=given, daemon=True)
        thread.start()
        assert ready.wait(60)
        app = App(addresses[0], sessions[0])
        yield app
        app.ask("GET", "state?tab=last")
        app.ask("POST", "bye?tab=last")
        for name in ("_CLOSED_SECONDS", "_SILENT_SECONDS"):  # a killed browser says nothing
            patch.setattr(_server, name, 0.1)
        thread.join(60)
        assert not thread.is_alive(), "the app goes on after its last page was closed"
        assert sorted(one.name[-4:] for one in temporary.iterdir()) == ["-one", "runs"]
