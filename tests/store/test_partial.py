"""The folder of a dataset that is not finished."""

from __future__ import annotations

import pytest

from scenicq.store.partial import Partial


@pytest.mark.parametrize("moment", ["before the lock", "after the lock"])
def test_an_interrupt_while_opening_leaves_nothing(tmp_path, monkeypatch, moment):
    partial = Partial(tmp_path / "dataset")
    real = Partial._locked
    calls = []

    def interrupted(self):
        calls.append(self)
        if len(calls) > 1:
            return real(self)
        if moment == "after the lock":
            real(self)
        raise KeyboardInterrupt

    monkeypatch.setattr(Partial, "_locked", interrupted)
    with pytest.raises(KeyboardInterrupt):
        partial.open()
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_while_opening_keeps_what_is_worth_going_on_from(tmp_path, monkeypatch):
    first = Partial(tmp_path / "dataset")
    first.folder.mkdir()
    (first.folder / "labels").mkdir()
    real = Partial._locked
    calls = []

    def interrupted(self):
        calls.append(self)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return real(self)

    monkeypatch.setattr(Partial, "_locked", interrupted)
    with pytest.raises(KeyboardInterrupt):
        first.open()
    assert (first.folder / "labels").is_dir()
