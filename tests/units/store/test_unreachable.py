"""A dataset that goes away, or does not answer, while it is read: told in words, and in a bounded time."""

from __future__ import annotations

import os
import shutil
import subprocess
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store import remote
from scenicq.store.dataset import open_dataset
from scenicq.store.place import LocalFolder
from scenicq.store.remote import RemoteFolder

fsspec = pytest.importorskip("fsspec", reason="scenicq[s3] is not installed")

ROOT = Path(__file__).parents[3]
PROGRAM = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"


def _read_all(address: str | Path) -> None:
    """Whatever a query reads, checks included."""
    dataset = open_dataset(address)
    list(Query(dataset, read_program(PROGRAM), QueryOptions(jobs=1)).results())
    list(dataset.labels())
    dataset.verify()


FRAME = "03-busy-intersection/10"
READING = {
    "match": ("match", PROGRAM, "TOWN"),
    "without conditions": ("match", PROGRAM, "TOWN", "--no-prefilter", "--all"),
    "info": ("info", "TOWN", "--verify"),
    "index": ("index", "TOWN"),
    "sample": ("sample", PROGRAM, "TOWN", "-n", "1"),
    "show": ("show", "TOWN", FRAME),
    "check": ("check", PROGRAM, "TOWN"),
    "explain": ("explain", PROGRAM, "TOWN", FRAME),
    "export": ("match", PROGRAM, "TOWN", "--export", "interchange", "handed"),
}
"""Commands that read a dataset."""


@pytest.mark.parametrize("what", READING)
@pytest.mark.one_in(10)
@pytest.mark.slow
def test_a_dataset_that_is_removed_while_it_is_read(
    what: str, crossroads: Path, tmp_path: Path, run: Any, rounds: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It goes as soon as somebody asks for something of it, in this process; others find it gone at any time."""
    monkeypatch.chdir(tmp_path)
    town, left = tmp_path / "town", [10**9]

    def going(real: Any) -> Any:
        def look(folder: LocalFolder, *given: Any) -> Any:
            left[0] -= 1
            if left[0] < 0:
                shutil.rmtree(town, ignore_errors=True)
            return real(folder, *given)

        return look

    for name in ("manifest", "problems", "stamp", "file", "checksum"):
        monkeypatch.setattr(LocalFolder, name, going(getattr(LocalFolder, name)))
    for remembered in (False, True):  # what has been found sound before is not looked at again
        shutil.rmtree(town, ignore_errors=True)
        shutil.copytree(crossroads, town)
        words = [town if word == "TOWN" else word for word in READING[what]]
        if remembered:
            run(*words)
        shutil.rmtree(tmp_path / "handed", ignore_errors=True)
        left[0] = 10**9
        usual = run(*words)
        requests = 10**9 - left[0]
        assert requests > 0
        for number in sorted({requests * part // 12 for part in range(0, 12, 12 // rounds(12))}):
            shutil.rmtree(tmp_path / "handed", ignore_errors=True)
            shutil.rmtree(town, ignore_errors=True)
            left[0] = 10**9
            shutil.copytree(crossroads, town)
            if remembered:
                run("check", PROGRAM, town)
            left[0] = number
            done = run(*words)
            if done.exit_code == usual.exit_code:  # all had been opened
                assert done.stdout == usual.stdout
            else:
                assert done.exit_code == 2
                assert done.stderr.startswith(("error[store-damaged]", "error[store-missing]")), (number, done.stderr)
                assert "Error:" not in done.stderr


class NoCredentialsError(Exception):
    """As botocore's."""


@pytest.mark.parametrize(
    ("raised", "words"),
    [
        (PermissionError("The provided token has expired."), "with these credentials: The provided token has expired"),
        (OSError(22, "The provided token is malformed or otherwise invalid."), "with these credentials"),
        (NoCredentialsError("Unable to locate credentials"), "with these credentials"),
        (ConnectionResetError(104, "Connection reset by peer"), "cannot be read: [Errno 104] Connection reset by peer"),
        (TimeoutError(), "nothing answers within"),
        (RuntimeError("out of\nsorts"), "cannot be read: out of sorts"),
    ],
)
@pytest.mark.one_in(8)
@pytest.mark.slow
def test_what_a_store_says_at_any_request_is_told(
    raised: Exception, words: str, crossroads: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each request has its turn to fail, whoever makes it: we, pyarrow or DuckDB."""
    files = fsspec.filesystem("memory")
    files.put(str(crossroads), "/away", recursive=True)
    real, left = RemoteFolder._ask, [10**9]  # pyright: ignore[reportPrivateUsage]

    def ask(folder: RemoteFolder, *given: Any, **options: Any) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise raised
        return real(folder, *given, **options)

    monkeypatch.setattr(RemoteFolder, "_ask", ask)
    _read_all("memory://away")
    requests = 10**9 - left[0]
    assert requests > 20
    for number in sorted({0, 1, 2, 3, *range(5, requests, requests // 8)}):
        left[0] = number
        with pytest.raises(DataError) as error:
            _read_all("memory://away")
        (told,) = error.value.diagnostics
        assert told.code == "store-unreachable", (number, told)
        assert words in told.message
        assert "SELECT" not in told.message
        assert bool(told.hints) == ("credentials" in words)
    files.rm("/away", recursive=True)


@contextmanager
def _server(answer: bytes | None) -> Generator[str]:
    """An address at which every request is answered alike; None where each is cut."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if answer is None:
                self.connection.close()
                return
            self.send_response(400)
            self.send_header("Content-Type", "application/xml")
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(answer)

        do_HEAD = do_GET

        def log_message(self, format: str, *args: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()


EXPIRED = b"<Error><Code>ExpiredToken</Code><Message>The provided token has expired.</Message></Error>"


@pytest.mark.parametrize(("answer", "words"), [(EXPIRED, "these credentials"), (None, "cannot be read")])
@pytest.mark.one_in(2)
def test_of_s3_itself(answer: bytes | None, words: str, run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    s3fs = pytest.importorskip("s3fs", reason="scenicq[s3] is not installed")
    monkeypatch.setattr(remote, "_PATIENCE_S", 3)
    with _server(answer) as address:
        for name, value in {"AWS_ENDPOINT_URL": address, "AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b",
                            "AWS_DEFAULT_REGION": "us-east-1"}.items():  # fmt: skip
            monkeypatch.setenv(name, value)
        s3fs.S3FileSystem.clear_instance_cache()
        began = time.monotonic()
        done = run("match", PROGRAM, "s3://fleet/town")
        assert time.monotonic() - began < 60
        assert done.exit_code == 2
        assert done.stderr.startswith("error[store-unreachable]: s3://fleet/town cannot be read")
        assert words in done.stderr
    s3fs.S3FileSystem.clear_instance_cache()


@pytest.mark.parametrize(
    ("answer", "words"), [(EXPIRED, "these credentials"), pytest.param(None, "cannot be read", marks=pytest.mark.slow)]
)
def test_the_installed_command_says_so_of_s3(answer: bytes | None, words: str, command: str) -> None:
    pytest.importorskip("s3fs", reason="scenicq[s3] is not installed")
    with _server(answer) as address:
        env = {"AWS_ENDPOINT_URL": address, "AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b"}
        done = subprocess.run(
            [command, "match", PROGRAM, "s3://fleet/town"],
            env={**os.environ, **env, "AWS_DEFAULT_REGION": "us-east-1"},
            capture_output=True,
            text=True,
            check=False,
            timeout=150,
        )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error[store-unreachable]: s3://fleet/town cannot be read")
    assert done.stderr.count("error[") == 1
    assert words in done.stderr
