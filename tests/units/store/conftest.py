"""Object storage on this machine."""

from __future__ import annotations

import logging
import socket
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

REFUSALS = {
    "503": ("503 Slow Down", "SlowDown", "Please reduce your request rate."),
    "denied": ("403 Forbidden", "AccessDenied", "Access Denied"),
    "expired": ("400 Bad Request", "ExpiredToken", "The provided token has expired."),
    "unknown key": ("403 Forbidden", "InvalidAccessKeyId", "The AWS Access Key Id you provided does not exist."),
}
"""What S3 answers: the status, its code and its words."""


@dataclass
class Faults:
    """What goes wrong on the way to a server, as a WSGI application before its own.

    Attributes:
        real: The server's own application.
        what: A key of `REFUSALS`, "cut" or "slow"; nothing goes wrong if None.
        methods: Requests that it befalls.
        after: So many of these come through before.
        times: So many of these fail then.
    """

    real: Callable[..., Any]
    what: str | None = None
    methods: tuple[str, ...] = ("PUT",)
    after: int = 0
    times: int = 10**9
    seen: int = field(default=0, init=False)

    def set(self, what: str | None, *, after: int = 0, times: int = 10**9, methods: tuple[str, ...] = ()) -> None:
        """Begin to count anew."""
        self.what, self.after, self.times, self.seen = what, after, times, 0
        self.methods = methods or ("PUT",)

    def __call__(self, environ: dict[str, Any], start_response: Callable[..., Any]) -> Any:
        """Answer a request."""
        if environ["REQUEST_METHOD"] in self.methods and not environ["PATH_INFO"].startswith("/moto-api"):
            self.seen += 1
            if self.what is not None and self.after < self.seen <= self.after + self.times:
                environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
                if self.what == "cut":
                    environ["werkzeug.socket"].shutdown(socket.SHUT_RDWR)
                    return []
                if self.what == "slow":
                    time.sleep(8)
                    return []
                status, code, words = REFUSALS[self.what]
                start_response(status, [("Content-Type", "application/xml")])
                return [f"<Error><Code>{code}</Code><Message>{words}</Message></Error>".encode()]
        return self.real(environ, start_response)


@pytest.fixture
def faults(s3_server: Any) -> Iterator[Faults]:
    """What goes wrong on the way to the server."""
    before = s3_server._server.app
    found = s3_server._server.app = Faults(before)
    yield found
    s3_server._server.app = before


@pytest.fixture(scope="module")
def s3_server() -> Iterator[Any]:
    """A server that speaks S3, on the loopback interface."""
    server = pytest.importorskip("moto.server", reason="moto[s3] with flask is not installed")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    yield running
    running.stop()


@pytest.fixture(scope="module")
def bucket(s3_server: Any) -> Iterator[Any]:
    """The file system of a server that speaks S3, with the bucket `fleet`."""
    s3fs = pytest.importorskip("s3fs", reason="scenicq[s3] is not installed")
    host, port = s3_server.get_host_and_port()
    # what moto holds is of the whole process, with what a module before has left
    urllib.request.urlopen(urllib.request.Request(f"http://{host}:{port}/moto-api/reset", method="POST")).close()
    variables = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "somebody",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        # a file system that fsspec has cached speaks to the server of the module before
        s3fs.S3FileSystem.clear_instance_cache()
        files = s3fs.S3FileSystem(skip_instance_cache=True)
        files.mkdir("fleet")
        yield files
    s3fs.S3FileSystem.clear_instance_cache()
