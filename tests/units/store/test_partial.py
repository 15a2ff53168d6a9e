"""The folder of a dataset that is not finished."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from scenicq.store import partial as partial_module
from scenicq.store.partial import Partial


@pytest.mark.parametrize("moment", ["before the lock", "after the lock"])
def test_an_interrupt_while_opening_leaves_nothing(tmp_path, monkeypatch, moment):
    partial = Partial(tmp_path / "dataset")
    real = Partial._take_lock
    calls = []

    def interrupted(self):
        calls.append(self)
        if len(calls) > 1:
            return real(self)
        if moment == "after the lock":
            real(self)
        raise KeyboardInterrupt

    monkeypatch.setattr(Partial, "_take_lock", interrupted)
    with pytest.raises(KeyboardInterrupt):
        partial.open()
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_opening_keeps_what_is_worth_going_on_from(tmp_path, monkeypatch):
    first = Partial(tmp_path / "dataset")
    first.folder.mkdir()
    (first.folder / "labels").mkdir()
    real = Partial._take_lock
    calls = []

    def interrupted(self):
        calls.append(self)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return real(self)

    monkeypatch.setattr(Partial, "_take_lock", interrupted)
    with pytest.raises(KeyboardInterrupt):
        first.open()
    assert (first.folder / "labels").is_dir()


def test_an_interrupt_at_any_line_leaves_no_folder(tmp_path: Path) -> None:
    number = 0
    for number in itertools.count():
        partial, lines = Partial(tmp_path / "d"), itertools.count()

        def trace(frame: FrameType, event: str, _: object, lines: Any = lines, number: int = number) -> Any:
            if frame.f_code.co_filename != partial_module.__file__:
                return None
            if event == "line" and next(lines) == number:
                sys.settrace(None)
                raise KeyboardInterrupt
            return trace

        before = sys.gettrace()
        try:
            sys.settrace(trace)
            partial.open()
        except KeyboardInterrupt:
            assert not partial.folder.exists(), number
        else:
            sys.settrace(before)
            partial.remove()
            break
        finally:
            sys.settrace(before)
    assert number > 8
