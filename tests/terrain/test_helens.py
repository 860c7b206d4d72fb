"""The paper's grid: where it is looked for, how it is downloaded, what happens without it."""

import hashlib
import io
import os
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import platformdirs
import pytest

from infoplan import caches
from infoplan.errors import RunError, UsageError
from infoplan.terrain import (
    TerrainFallbackWarning,
    fetch_helens,
    find_helens,
    helens,
    load_terrain,
)

GRID = np.arange(20.0).reshape(4, 5)


def npy(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.save(content, array)
    return content.getvalue()


RIGHT, WRONG = npy(GRID), npy(GRID + 1)
PUBLISHED = helens.SHA256  # before a fixture puts the made-up grid in its place


class Server(ThreadingHTTPServer):
    """Answers with one file, in one of several ways, and counts the requests."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.answer: Callable[[Handler], None] = lambda handler: handler.send(RIGHT)
        self.requests = 0
        self.closing = threading.Event()


class Handler(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        self.server.requests += 1
        self.server.answer(self)

    def send(self, content: bytes, status: int = 200, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(len(content) if length is None else length))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Keep the tests' output clean."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, no INFOPLAN_DATA, a made-up grid in place of the paper's, no network."""
    folder = tmp_path / "cache"
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: str(folder / name))
    monkeypatch.delenv("INFOPLAN_DATA", raising=False)
    for variable in ("NO_PROXY", "no_proxy"):
        monkeypatch.setenv(variable, "127.0.0.1")
    monkeypatch.setattr(helens, "SHA256", hashlib.sha256(RIGHT).hexdigest())
    monkeypatch.setattr(helens, "URL", "http://127.0.0.1:9/helens.npy")
    return folder / "infoplan"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    with Server() as running:
        threading.Thread(target=running.serve_forever, args=(0.01,), daemon=True).start()
        monkeypatch.setattr(
            helens, "URL", f"http://127.0.0.1:{running.server_address[1]}/helens.npy"
        )
        yield running
        running.closing.set()
        running.shutdown()


def stored(folder: Path, content: bytes = RIGHT, name: str = "helens.npy") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return path


def test_the_grid_is_known_by_its_digest():
    assert PUBLISHED == "d252e96a57705fa1f7217047f777950cafafff4272356210ad6771423198cd26"


class TestLookup:
    def test_path_may_be_the_file_or_its_folder(self, tmp_path):
        file = stored(tmp_path / "maps", name="mine.npy")
        np.testing.assert_array_equal(load_terrain("helens", path=file).elevation, GRID)
        stored(tmp_path / "maps")
        terrain = load_terrain("helens", path=tmp_path / "maps")
        assert (terrain.name, terrain.unit) == ("helens", "ft")
        assert terrain.sha256 == hashlib.sha256(RIGHT).hexdigest()

    def test_row_0_is_the_y_minimum(self, tmp_path):
        terrain = load_terrain("helens", path=stored(tmp_path))
        np.testing.assert_array_equal(terrain.elevation_at([0.0, 50.0], 0.0), GRID[0, [0, -1]])

    @pytest.mark.parametrize("folder", [True, False])
    def test_environment_may_name_the_file_or_its_folder(self, folder, tmp_path, monkeypatch):
        file = stored(tmp_path / "data")
        monkeypatch.setenv("INFOPLAN_DATA", str(file.parent if folder else file))
        assert find_helens() == file

    def test_path_comes_before_environment_before_cache(self, tmp_path, cache, monkeypatch, server):
        cached = stored(cache)
        assert find_helens() == cached
        data = stored(tmp_path / "data")
        monkeypatch.setenv("INFOPLAN_DATA", str(data.parent))
        assert find_helens() == data
        mine = stored(tmp_path / "mine")
        assert find_helens(mine.parent) == mine
        load_terrain("helens")
        assert server.requests == 0

    def test_environment_without_the_grid_is_passed_over(self, tmp_path, cache, monkeypatch):
        monkeypatch.setenv("INFOPLAN_DATA", str(tmp_path / "nowhere"))
        cached = stored(cache)
        assert find_helens() == cached
        cached.unlink()
        with pytest.warns(TerrainFallbackWarning, match=r"INFOPLAN_DATA=\S+nowhere holds no"):
            load_terrain("helens")

    @pytest.mark.parametrize("exists", [True, False])
    def test_path_without_the_grid_is_an_error_even_with_a_cache(self, exists, tmp_path, cache):
        stored(cache)
        folder = tmp_path / "empty"
        if exists:
            folder.mkdir()
        with pytest.raises(UsageError, match=r"terrain\.path=.*empty leads to no helens\.npy"):
            load_terrain("helens", path=folder)

    def test_other_bytes_in_path_are_refused_with_both_digests(self, tmp_path):
        file = stored(tmp_path, WRONG)
        with pytest.raises(UsageError, match=r"from terrain\.path") as caught:
            load_terrain("helens", path=file)
        for part in (str(file), hashlib.sha256(WRONG).hexdigest(), helens.SHA256):
            assert part in str(caught.value)

    def test_other_bytes_in_environment_are_refused(self, tmp_path, cache, monkeypatch):
        stored(cache)
        monkeypatch.setenv("INFOPLAN_DATA", str(stored(tmp_path, WRONG)))
        with pytest.raises(UsageError, match="from INFOPLAN_DATA"):
            load_terrain("helens")


def hang(handler: Handler) -> None:
    handler.server.closing.wait(30)


def trickle(handler: Handler) -> None:
    handler.send(b"", length=len(RIGHT))
    for k in range(len(RIGHT)):
        if handler.server.closing.wait(0.1):
            return
        handler.wfile.write(RIGHT[k : k + 1])


class TestDownload:
    def test_happens_once(self, server, cache):
        for _ in range(2):
            np.testing.assert_array_equal(load_terrain("helens").elevation, GRID)
        assert server.requests == 1
        assert (cache / "helens.npy").read_bytes() == RIGHT
        assert os.listdir(cache) == ["helens.npy"]

    def test_replaces_a_cached_file_with_other_bytes(self, server, cache):
        stored(cache, WRONG)
        assert find_helens() is None
        assert fetch_helens().read_bytes() == RIGHT
        assert os.listdir(cache) == ["helens.npy"]

    def test_is_left_out_where_the_cache_has_the_grid(self, server, cache):
        assert fetch_helens() == fetch_helens() == cache / "helens.npy"
        assert server.requests == 1

    @pytest.mark.parametrize(
        ("answer", "patience", "reason"),
        [
            (lambda handler: handler.send(WRONG), 20, "another SHA-256"),
            (lambda handler: handler.send(b"gone", status=404), 20, "the server answers 404"),
            (
                lambda handler: handler.send(RIGHT[:50], length=len(RIGHT)),
                20,
                "the connection fails",
            ),
            (hang, 0.5, "silent|did not arrive within 0.5 s"),
            (trickle, 0.5, "did not arrive within 0.5 s"),
        ],
        ids=["wrong bytes", "404", "half a file", "hanging", "trickling"],
    )
    def test_failure_is_told_and_leaves_nothing_behind(
        self, answer, patience, reason, server, cache
    ):
        server.answer = answer
        # The server neither hangs up nor finishes before the test ends: only patience can end it.
        with pytest.raises(RunError, match=reason):
            fetch_helens(patience)
        assert server.requests <= 1  # never again; not at all if the machine is that slow
        assert not list(cache.rglob("*"))

    def test_a_wrong_file_in_the_cache_is_never_used(self, server, cache):
        stored(cache, WRONG)
        server.answer = lambda handler: handler.send(WRONG)
        with pytest.warns(TerrainFallbackWarning, match="another SHA-256"):
            assert load_terrain("helens").name == "volcano"

    def test_where_the_cache_cannot_be_written_a_temporary_folder_keeps_it(
        self, server, cache, tmp_path, monkeypatch
    ):
        stored(cache.parent, name="infoplan")  # a file where the folder should be
        own = tmp_path / "own"
        own.mkdir()
        monkeypatch.setattr(caches, "temporary_folder", lambda: own)
        assert fetch_helens() == own / "helens.npy"
        assert find_helens() == own / "helens.npy"

    def test_where_nothing_can_be_written_it_says_so(self, server, cache, monkeypatch):
        stored(cache.parent, name="infoplan")
        monkeypatch.setattr(caches, "temporary_folder", lambda: None)
        with pytest.raises(RunError, match=r"helens\.npy can be kept nowhere.*XDG_CACHE_HOME"):
            fetch_helens()


class TestMissing:
    def test_fallback_is_volcano_under_its_own_name(self, volcano):
        with pytest.warns(TerrainFallbackWarning) as caught:
            terrain = load_terrain("helens", extent=(0, 10, 0, 10))
        assert (terrain.name, terrain.sha256) == ("volcano", volcano.sha256)
        assert terrain.extent == (0, 10, 0, 10)
        assert len(caught) == 1
        assert caught[0].filename == __file__

    def test_fallback_says_what_why_and_what_to_do(self):
        with pytest.warns(TerrainFallbackWarning) as caught:
            load_terrain("helens")
        message = str(caught[0].message)
        for part in (
            "volcano takes the place of helens",
            f"cannot be downloaded from {helens.URL}: the connection fails",
            "INFOPLAN_DATA",
            "terrain.path",
            "infoplan terrain fetch",
            "terrain.on_missing=error",
        ):
            assert part in message

    def test_error_is_asked_for(self):
        with pytest.raises(UsageError, match=r"INFOPLAN_DATA .* `infoplan terrain fetch`"):
            load_terrain("helens", on_missing="error")

    def test_no_warning_where_the_grid_is_there(self, cache):
        stored(cache)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            load_terrain("helens")

    def test_other_choices_are_refused(self):
        with pytest.raises(UsageError, match=r"terrain\.on_missing=maybe"):
            load_terrain("helens", on_missing="maybe")


def test_importing_loads_no_library_that_takes_long():
    code = (
        "import sys, infoplan.terrain; "
        "print(*{'pooch', 'requests', 'pandas', 'matplotlib', 'scipy'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
