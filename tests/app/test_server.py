"""The app's server over HTTP: what it lets nobody do, and the way of a shape through it."""

import json
import os
import queue
import sys
import tempfile
import threading
import time
from pathlib import Path
from urllib.parse import quote

import pytest

from unbend import write_mesh
from unbend.app import _server, _session, serve
from unbend.app._requests import check_request
from unbend.datasets import make_sphere
from unbend.errors import InputError


class Fake:
    """A worker without a process."""

    def __init__(self, memory: int) -> None:
        self.memory = memory

    def begin(self):
        return self.run

    def close(self) -> None: ...


@pytest.fixture(scope="module")
def ply(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("ball") / "ball.ply"
    write_mesh(path, make_sphere(2))
    return path.read_bytes()


def put(app, name: str, data: bytes) -> int:
    return app.send("PUT", f"files?name={quote(name)}", data)["id"]


def shape(state, i: int):
    return next((one for one in state["shapes"] if one["id"] == i), None)


def test_what_a_killed_run_left_is_removed_at_the_next_start(app, temporary: Path) -> None:
    assert list(temporary.glob("*-killed")) == []
    assert len(list(temporary.glob("*-runs"))) == 1  # at its port another app listens


def test_closing_the_last_page_ends_the_app_and_what_it_computes(app, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(_server, "_CLOSED_SECONDS", 0.0)
    begun, go_on, address = queue.Queue(), threading.Event(), queue.Queue()
    (tmp_path / "7f3c").touch()
    link = tmp_path / "scan.ply"
    link.symlink_to(tmp_path / "7f3c")  # as of files that are kept by their hashes

    class Endless(_session.Worker):
        def begin(self):
            return self.run

        def run(self, job, progress):
            begun.put(job["shapes"])
            assert go_on.wait(60)
            return {}

        def close(self):
            go_on.set()
            super().close()

    monkeypatch.setattr(_session, "Worker", Endless)
    monkeypatch.setattr(_server, "Session", _session.Session)
    given = {"ready": address.put}
    thread = threading.Thread(target=serve, args=([str(link)],), kwargs=given, daemon=True)
    thread.start()
    other = type(app)(address.get(timeout=60), None)
    other.get("state?tab=one")
    assert begun.get(timeout=60) == [(str(link), "scan.ply")]
    other.send("POST", "bye?tab=one")
    thread.join(60)
    assert not thread.is_alive()


@pytest.mark.parametrize(
    ("method", "headers", "status"),
    [
        ("GET", {}, 200),
        ("GET", {"Origin": None}, 200),
        ("GET", {"Host": "evil.example"}, 403),  # a name that was made to lead here
        ("GET", {"Host": "127.0.0.1:1"}, 403),
        ("GET", {"Host": None}, 400),
        ("GET", {"Origin": "http://evil.example"}, 403),
        ("GET", {"Origin": "null"}, 403),  # pages of results, in their sandbox
        ("GET", {"Origin": None, "Sec_Fetch_Site": "cross-site"}, 403),
        ("GET", {"Origin": None, "Sec_Fetch_Site": "same-site"}, 403),
        ("GET", {"Origin": None, "Sec_Fetch_Site": "none"}, 200),
        ("POST", {"Origin": None}, 403),
        ("POST", {"Origin": "http://evil.example"}, 403),
    ],
)
def test_only_the_page_itself_is_answered(app, method, headers, status) -> None:
    path = "state" if method == "GET" else "bye?tab=x"
    found, answered, text = app.ask(method, path, **headers)
    assert found == status
    if status == 403:
        assert b"shapes" not in text
        assert "access-control-allow-origin" not in answered


@pytest.mark.parametrize("token", ["", "x", "A" * 32])
def test_without_the_token_there_is_nothing(app, token) -> None:
    for path in ("", "state", "app.js", "files?name=a.ply"):
        assert app.ask("GET", path, token=token)[0] == 404
    assert app.ask("PUT", "files?name=a.ply", b"x", token=token)[0] == 404


def test_pages_have_strict_policies(app) -> None:
    _, headers, text = app.ask("GET", "")
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cache-control"] == "no-store"
    assert b"<script>" not in text
    assert b"style=" not in text


def test_the_way_of_a_shape(app, ply) -> None:
    first, second = put(app, "ball.ply", ply), put(app, "other ball.ply", ply)
    state = app.wait(lambda s: not s["jobs"])
    assert shape(state, first)["size"] == "162 vertices, 320 faces"
    assert shape(state, second)["name"] == "other ball.ply"
    status, headers, picture = app.ask("GET", f"shapes/{first}/picture")
    assert (status, headers["content-type"], picture[:4]) == (200, "image/png", b"\x89PNG")
    nose = {"name": "nose", "at": [3, 4]}
    asked = {"do": "landmarks", "shapes": [first, second], "landmarks": [nose]}
    app.send("POST", "jobs", asked)
    (result,) = app.wait(lambda s: s["results"])["results"]
    assert "path" not in json.dumps(result)
    status, headers, page = app.ask("GET", f"results/{result['id']}/page")
    assert status == 200
    assert headers["content-security-policy"].startswith("sandbox allow-scripts")
    assert b'"at": [3, 4]' in page
    _, headers, saved = app.ask("GET", f"results/{result['id']}/page?save")
    assert headers["content-disposition"].startswith("attachment")
    assert saved == page
    assert app.ask("GET", f"results/{result['id']}/title/0")[0] == 404
    again = app.send("POST", "jobs", asked)["id"]
    titles = [one["title"] for one in app.wait(lambda s: s["results"][1:])["results"]]
    assert titles[1] == f"{titles[0]} (2)"
    app.send("PUT", "up", {"up": "z"})
    state = app.wait(lambda s: not s["jobs"])
    assert state["up"] == "z"
    for way in (
        f"results/{result['id']}",
        f"results/{again}",
        f"shapes/{first}",
        f"shapes/{second}",
    ):
        app.send("DELETE", way)
    state = app.get("state")
    assert (state["shapes"], state["results"]) == ([], [])
    assert app.get(f"state?seen={state['version']}") is None
    assert app.ask("GET", f"results/{result['id']}/page")[0] == 404
    assert app.ask("GET", f"shapes/{first}/picture")[0] == 404


def test_bad_files_are_sentences_with_the_names_of_the_user(app) -> None:
    # Ten bytes that promise millions; text that is none; a name with letters of HTML.
    header = b"ply\nformat binary_little_endian 1.0\nelement vertex 90000000\nproperty float x\n"
    header += b"property float y\nproperty float z\nend_header\n0123456789"
    names = {"bomb.ply": header, "<img src=x>.off": b"PK\x03\x04", "empty.stl": b""}
    made = {name: put(app, name, data) for name, data in names.items()}
    state = app.wait(lambda s: not s["jobs"])
    for name, i in made.items():
        found = shape(state, i)
        assert found["state"] == "bad"
        assert name in found["told"][0]
        assert "upload-" not in found["told"][0]
        app.send("DELETE", f"shapes/{i}")


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "a.zip", "a.3mf", "a.npz", "", "a.ply\x00.exe", "a.html"]
)
def test_files_of_other_kinds_are_refused(app, name) -> None:
    status, _, text = app.ask("PUT", f"files?name={quote(name)}", b"x")
    assert status == 400
    assert "end in .off" in json.loads(text)["error"]


def test_what_carries_values_is_told_once_each(app) -> None:
    status, _, text = app.ask("PUT", "files?as=values&name=x.docx", b"x")
    assert status == 400
    kinds = json.loads(text)["error"].split(" end in ")[1].split(", ")
    assert {".csv", ".json", ".pp", ".npy", ".ply"} < set(kinds)
    assert len(kinds) == len(set(kinds))


def test_names_are_labels_and_never_paths(app, ply, temporary: Path) -> None:
    before = set(temporary.parent.rglob("*.ply"))
    i = put(app, "../../../outside.ply", ply)
    state = app.wait(lambda s: not s["jobs"])
    assert shape(state, i)["name"] == "outside.ply"
    new = set(temporary.parent.rglob("*.ply")) - before
    assert [path.name.startswith("upload-") for path in new] == [True]
    for path in ("shapes/1/../../x", "results/1/files/%2e%2e", "..%2f..%2fetc%2fpasswd", "app.py"):
        assert app.ask("GET", path)[0] in (400, 404)
    app.send("DELETE", f"shapes/{i}")


def test_uploads_are_bounded_whatever_they_promise(app, temporary, monkeypatch) -> None:
    monkeypatch.setattr(_session, "_MOST_BYTES", 1000)
    files = set(temporary.rglob("*"))
    status, _, text = app.ask("PUT", "files?name=a.ply", b"x" * 2000)
    assert (status, "too large" in json.loads(text)["error"]) == (400, True)
    chunked = b"".join(b"200\r\n" + b"x" * 512 + b"\r\n" for _ in range(4)) + b"0\r\n\r\n"
    more = {"Transfer_Encoding": "chunked", "Content_Length": None}
    status, _, text = app.ask("PUT", "files?name=a.ply", chunked, **more)
    assert (status, "too large" in json.loads(text)["error"]) == (400, True)
    monkeypatch.setattr(_session, "_MOST_BYTES_IN_ALL", 100)
    assert app.ask("PUT", "files?name=a.ply", b"x" * 200)[0] == 400
    monkeypatch.setattr(_session, "_MOST_SHAPES", 0)
    assert app.ask("PUT", "files?name=a.ply", b"x")[0] == 400
    assert set(temporary.rglob("*")) == files


@pytest.mark.parametrize(
    "body",
    [
        *(b"", b"{", b"[1]", b'"x"', b"[" * 100_000, b" " * (2**20 + 1)),
        *({}, {"do": "look", "shapes": [1]}, {"do": "run"}, {"do": "match", "shapes": [1]}),
        {"do": "match", "shapes": [99, 98]},
        {"do": "match", "shapes": "ab"},
        {"do": "match", "shapes": [[], {}]},
        {"do": "morph", "result": 99},
        {"do": "choose", "result": {}},
        {"do": "search", "shapes": []},
        {"do": "sample", "shapes": [1]},
    ],
)
def test_requests_that_make_no_sense_are_refused(app, body) -> None:
    status, _, text = app.ask("POST", "jobs", body)
    assert status == 400
    assert json.loads(text)["error"]
    assert app.get("state")["jobs"] == []


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"do": "distance", "landmarks": []}, "click a place"),
        ({"do": "distance", "landmarks": [{"name": "", "at": ["x"]}]}, "vertex numbers"),
        ({"do": "landmarks", "landmarks": [{"name": "", "at": [1, 2]}]}, "vertex numbers"),
        ({"do": "landmarks", "landmarks": [{"name": "", "at": [-1]}]}, "vertex numbers"),
        ({"do": "landmarks", "landmarks": {"a": 1}}, "vertex numbers"),
        ({"do": "landmarks", "landmarks": [[1]]}, "vertex numbers"),
        ({"do": "landmarks", "landmarks": 1}, "vertex numbers"),
    ],
)
def test_options_are_checked(app, ply, asked, told) -> None:
    i = put(app, "ball.ply", ply)
    app.wait(lambda s: not s["jobs"])
    status, _, text = app.ask("POST", "jobs", asked | {"shapes": [i]})
    assert status == 400
    assert told in json.loads(text)["error"]
    assert app.ask("PUT", "up", {"up": "w"})[0] == 400
    app.send("DELETE", f"shapes/{i}")


def test_without_a_collection_none_is_searched() -> None:
    for asked, shapes in (("search", {1: {"state": "good"}}), ("groups", {})):
        with pytest.raises(InputError, match="no collection"):
            check_request({"do": asked, "shapes": list(shapes)}, shapes, {}, {}, None)


def test_values_that_are_gone_are_not_replaced_by_those_of_the_first_shape() -> None:
    shapes = {1: {"state": "good"}, 2: {"state": "good"}}
    results = {3: {"shapes": [1, 2], "map_file": "0.npz", "files": [{"name": "map.npz"}]}}
    asked = {"do": "transfer", "result": 3}
    assert check_request(asked, shapes, results, {}, None)["values"] is None
    with pytest.raises(InputError, match="those values are not there any more"):
        check_request(asked | {"values": 4}, shapes, results, {}, None)


def test_another_map_of_a_match_is_asked_for_by_its_number() -> None:
    shapes = {1: {"state": "good"}, 2: {"state": "good"}}
    other = {"path": "1.npz", "name": "other.npz", "command": ["match"], "python": ["match()"]}
    result = {"shapes": [1, 2], "map_file": "0.npz", "files": [{"name": "map.npz"}]}
    result |= {"alternatives": [other], "landmarks": [{"name": "nose", "at": [4, 5]}]}
    results = {3: result}
    asked = {"do": "choose", "result": 3}
    job = check_request(asked | {"alternative": 0}, shapes, results, {}, None)
    assert (job["map_file"], job["map_name"]) == ("1.npz", "other.npz")
    assert (job["command"], job["python"]) == (["match"], ["match()"])
    assert (job["shapes"], job["landmarks"]) == ([1, 2], result["landmarks"])
    for wrong in (1, -1, None, "0", True):
        with pytest.raises(InputError, match="that map is not there"):
            check_request(asked | {"alternative": wrong}, shapes, results, {}, None)


def test_jobs_wait_in_a_queue_and_are_cancelled_or_go_with_their_shape(app, ply) -> None:
    i, removed = put(app, "ball.ply", ply), put(app, "other.ply", ply)
    app.wait(lambda s: not s["jobs"])
    asked = {"do": "distance", "shapes": [i]}
    wanted = [{"do": "sample"}, *(asked | {"landmarks": [{"name": "", "at": [v]}]} for v in (1, 2))]
    jobs = [app.send("POST", "jobs", job)["id"] for job in wanted]
    assert [app.send("POST", "jobs", job)["id"] for job in wanted] == jobs  # nothing is done twice
    state = app.get("state")
    assert [one["id"] for one in state["jobs"]] == jobs
    assert state["jobs"][0]["title"] == "Making a sample pair"
    app.send("POST", "jobs", wanted[1] | {"shapes": [removed]})
    app.send("DELETE", f"shapes/{removed}")
    for job in jobs[::-1]:
        app.send("DELETE", f"jobs/{job}")
    app.send("DELETE", "jobs/99999")
    state = app.wait(lambda s: not s["jobs"])
    assert [one["id"] for one in state["shapes"]] == [i]
    assert (state["results"], state["troubles"]) == ([], [])
    app.send("DELETE", f"shapes/{i}")


def wait_for(session: _session.Session) -> None:
    while session.state(-1)["jobs"]:
        time.sleep(0.001)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names there are text")
def test_names_that_are_no_text_are_shown(tmp_path, monkeypatch) -> None:
    class Worker(Fake):
        def run(self, job, progress):
            return {"usable": True, "told": []}

    monkeypatch.setattr(_session, "Worker", Worker)
    session = _session.Session(0, 0, os.fsdecode(b"st\xe4ll"))
    try:
        path = tmp_path / os.fsdecode(b"b\xe4r.ply")
        path.touch()
        session.add(path, path.name)
        wait_for(session)
        state = session.state(-1)
        assert state["shapes"][0]["name"] == r"b\udce4r.ply"
        json.dumps(state, ensure_ascii=False).encode()
    finally:
        session.close()


def test_cancelling_leaves_a_shape_that_is_only_drawn_again(tmp_path, monkeypatch) -> None:
    class Worker(Fake):
        def __init__(self, memory: int) -> None:
            self.cancelled = threading.Event()

        def run(self, job, progress):
            if job["up"] == "y":
                return {"usable": True, "told": []}
            self.cancelled.wait(60)
            return {}

        def cancel(self) -> None:
            self.cancelled.set()

        close = cancel

    monkeypatch.setattr(_session, "Worker", Worker)
    session = _session.Session(0, 0, None)
    try:
        session.add(tmp_path, "seen.ply")
        wait_for(session)
        session.turn("z")
        session.add(tmp_path, "new.ply")
        for job in session.state(-1)["jobs"][::-1]:
            session.remove("jobs", job["id"])
        assert [one["state"] for one in session.state(-1)["shapes"]] == ["good", "bad"]
    finally:
        session.close()


def test_of_two_files_of_one_name_the_bad_one_is_named(tmp_path, monkeypatch) -> None:
    class Worker(Fake):
        def run(self, job, progress):
            (_, first), *others = job["shapes"]
            error = {"error": f"{first}: the surface has only one side"}
            return error if others else {"usable": True, "told": []}

    monkeypatch.setattr(_session, "Worker", Worker)
    session = _session.Session(0, 0, None)
    try:
        pair = [session.add(tmp_path / folder / "dog.ply", "dog.ply") for folder in "ab"]
        wait_for(session)
        session.submit({"do": "match", "shapes": pair})
        wait_for(session)
        (trouble,) = session.state(-1)["troubles"]
        assert trouble["text"].endswith("dog (2).ply: dog.ply: the surface has only one side")
    finally:
        session.close()


def test_files_of_ours_go_with_what_they_are_of(app, ply, temporary: Path) -> None:
    def left() -> set[str]:
        return {path.name for path in app.session.folder.iterdir()} - before

    before = {path.name for path in app.session.folder.iterdir()}
    i = put(app, "a.ply", ply)
    app.wait(lambda state: not state["jobs"])
    for up in "zy":
        app.send("PUT", "up", {"up": up})
        app.wait(lambda state: not state["jobs"])
    assert len(left()) == 2  # the file, and one folder with its picture
    values = app.send("PUT", "files?as=values&name=v.csv", b"1\n")["id"]
    asked = {"do": "transfer", "result": 10**6, "values": values}
    assert app.ask("POST", "jobs", asked)[0] == 400
    assert len(left()) == 2
    app.send("DELETE", f"shapes/{i}")
    assert not left()


def test_a_full_queue_refuses_work_and_takes_shapes(app, ply, monkeypatch) -> None:
    monkeypatch.setattr(_session, "_MOST_JOBS", 0)
    status, _, text = app.ask("POST", "jobs", {"do": "sample"})
    assert (status, "too many jobs" in json.loads(text)["error"]) == (400, True)
    i = put(app, "ball.ply", ply)
    assert shape(app.wait(lambda s: not s["jobs"]), i)["state"] == "good"
    app.send("DELETE", f"shapes/{i}")


def test_each_shape_is_drawn_once_more_however_often_the_axis_changes(app, ply) -> None:
    made = [put(app, f"{i}.ply", ply) for i in range(3)]
    app.wait(lambda s: not s["jobs"])
    for up in "zxzxzy":
        app.send("PUT", "up", {"up": up})
    assert len(app.get("state")["jobs"]) <= 4  # one may run already
    state = app.wait(lambda s: not s["jobs"])
    assert [shape(state, i)["state"] for i in made] == ["good"] * 3
    for i in made:
        app.send("DELETE", f"shapes/{i}")


def test_shapes_of_one_name_get_two(app, ply) -> None:
    names = [app.send("PUT", "files?as=shape&name=dog.ply", ply)["id"] for _ in range(3)]
    state = app.wait(lambda state: not state["jobs"])
    shown = {one["id"]: one["name"] for one in state["shapes"]}
    assert [shown[i] for i in names] == ["dog.ply", "dog (2).ply", "dog (3).ply"]
    for i in names:
        app.send("DELETE", f"shapes/{i}")


def test_a_file_that_changed_since_it_was_opened_is_not_used(app, ply, tmp_path: Path) -> None:
    path = tmp_path / "mine.ply"
    path.write_bytes(ply)
    i = app.session.add(path, "mine.ply")
    app.wait(lambda state: not state["jobs"])
    path.write_bytes(ply + b"\n")
    app.send("POST", "jobs", {"do": "form", "shapes": [i]})
    (trouble,) = app.wait(lambda state: state["troubles"])["troubles"]
    assert trouble["text"].endswith("mine.ply has changed since it was opened; open it again")
    app.send("DELETE", f"troubles/{trouble['id']}")
    app.send("DELETE", f"shapes/{i}")


def test_a_failed_job_is_a_sentence(app, ply) -> None:
    i = put(app, "ball.ply", ply)
    app.wait(lambda s: not s["jobs"])
    asked = {"do": "distance", "shapes": [i], "landmarks": [{"name": "", "at": [162]}]}
    app.send("POST", "jobs", asked)
    (trouble,) = app.wait(lambda s: s["troubles"])["troubles"]
    assert trouble["text"].startswith("Measuring distances on ball.ply: ")
    app.send("DELETE", f"troubles/{trouble['id']}")
    app.send("DELETE", f"shapes/{i}")
    state = app.get("state")
    assert (state["shapes"], state["troubles"]) == ([], [])
