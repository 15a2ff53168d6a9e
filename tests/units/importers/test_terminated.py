"""SIGTERM or SIGHUP while a library call ingests: like Ctrl-C, unless the caller has a handler of its own."""

import os
import signal
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
SOURCE = Path(__file__).parents[3] / "sample_data" / "crossroads"


def own(number, frame):
    raise NotImplementedError


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("before", [signal.SIG_DFL, own], ids=["none", "the caller's"])
def test_the_handler_during_and_after(before, number, tmp_path):
    seen = []
    kept = signal.signal(number, before)
    try:
        ingest(SOURCE, tmp_path / "dataset", progress=lambda _: seen.append(signal.getsignal(number)))
        after = signal.getsignal(number)
    finally:
        signal.signal(number, kept)
    assert set(seen) == {own if before is own else signal.default_int_handler}
    assert after == before
