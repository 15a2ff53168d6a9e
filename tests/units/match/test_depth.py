"""Expressions nested deeper than Python's stack: matching ends in a verdict, and in the right one where it is easy."""

from __future__ import annotations

import pytest
from scenes import STREET, compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.store.labels import Label, LabelObject

LABEL = Label("f", "r", 0, "street", LabelObject("ego", "Car", "car", 0.0, 0.3, 0.0, 2.0, 4.5), ())
VIEW = "a = new Point at Range(0, 1) @ 0\nr = CircularRegion(0 @ 0, 10)\n"
EASY = {
    "sum": ("h = Range(0, 1)", "h = h + 0.0001", "ego = new Object at 0 @ h", 3000),
    "conjunction": (
        "c = Range(0, 1) > 0.1", "c = c and (Range(0, 1) > 0.1)", "ego = new Object at 0 @ 0.3\nrequire c", 300,
    ),
    "intersection": (
        "r = CircularRegion(0 @ 0, 10)", "r = r.intersect(CircularRegion(0 @ 0, 9))", "ego = new Object in r", 300,
    ),
    "turns": (
        "h = Range(0, 1) deg", "h = (h + 1 deg) relative to -1 deg", "ego = new Object at 0 @ 0.3, facing h", 200,
    ),
}  # fmt: skip
HARD = {
    "magnitude": ("h = Range(0, 1)", "h = abs(h - 0.0001)", "ego = new Object at 0 @ h", 2000),
    "equality of truths": (
        "c = Range(0, 1) > 0.5", "c = (c == (Range(0, 1) > 0.5))", "ego = new Object at 0 @ 0.3\nrequire c", 300,
    ),
    "alternatives": (
        "c = Range(0, 1) > 0.1", "c = (c or (Range(0, 1) > 0.9)) and (Range(0, 1) > 0.1)",
        "ego = new Object at 0 @ 0.3\nrequire c", 300,
    ),
    "views": (f"{VIEW}", "r = r visible from a", "ego = new Object in r", 300),
}  # fmt: skip


def verdict(begin: str, step: str, end: str, times: int, timeout_s: float = 60.0) -> Verdict:
    program = f"{begin}\nfor i in range({times}):\n    {step}\n{end}\n"
    return Matcher(compiled(program, STREET), MatchOptions(timeout_s=timeout_s)).match(LABEL)


@pytest.mark.parametrize("name", EASY)
@pytest.mark.one_in(2)
def test_what_is_deep_and_easy_is_decided(name):
    assert isinstance(verdict(*EASY[name]), Match)


@pytest.mark.parametrize("name", HARD)
@pytest.mark.one_in(2)
def test_what_is_deep_and_hard_ends_in_a_verdict(name):
    assert isinstance(verdict(*HARD[name], timeout_s=0.5), Match | NoMatch | Unknown)
