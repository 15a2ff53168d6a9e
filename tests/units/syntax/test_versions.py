"""Which version a program is written in."""

from __future__ import annotations

import pytest

from .shape import error, module

VERSIONS = {
    "x = 1": {1, 2, 3},
    "ego = Car": {1, 2, 3},
    "ego = new Car": {3},
    "ego = Car at 1 @ 2": {1, 2},
    "ego = Car visible": {1, 2},
    "x = 1 @ 2": {1, 2, 3},
    "ego = new Car at 1 @ 2": {3},
    "x = Range(1, 2)": {2, 3},
    "def Range(a, b): return a\nx = Range(1, 2)": {1, 2, 3},
    "ego = Car at Range(1, 2) @ 3": {2},
    "x = (1, 2) deg": {1},
    "ego = Car offset by (-10, 10) @ (20, 40)": {1},
    "model a.b": {2, 3},
    "behavior B():\n  wait": {2, 3},
    "x = Car above y": set(),
    "require x intersects y": {3},
    "x = front of y": {1, 2, 3},
    "x = top front left of y": {3},
    "class C:\n  a[additive]: 1": {2, 3},
}


@pytest.mark.parametrize("text", VERSIONS)
def test_versions(text: str) -> None:
    expected = VERSIONS[text]
    if not expected:
        assert error(text).startswith("error[mixed-versions]")
        return
    found = module(text)
    assert found.versions == expected
    assert found.version == (next(iter(expected)) if len(expected) == 1 else None)
    for evidence in found.evidence:
        assert expected <= evidence.versions


def test_a_version_that_was_asked_for_wins() -> None:
    assert module("x = 1", 2).version == 2
    assert module("x = 1", 2).versions == {2}
    assert module("ego = Car at 1 @ 2", 1).version == 1


def test_mixed_versions_show_both_places() -> None:
    assert error("ego = new Car\nother = Car at 1 @ 2\n") == (
        "error[mixed-versions]: an instance without `new` is Scenic 1 and 2, but an instance with `new` is Scenic 3\n"
        " --> test.scenic:2:9\n"
        "  |\n"
        "2 | other = Car at 1 @ 2\n"
        "  |         ^^^ this is Scenic 1 and 2\n"
        "  |\n"
        "1 | ego = new Car\n"
        "  |       ------- this is Scenic 3\n"
        "  = hint: Scenic 3 writes `new Car ...`"
    )


def test_scenic_1_intervals_beside_scenic_2_ranges() -> None:
    assert "`Range` is Scenic 2 and 3, but a pair of numbers as an interval is Scenic 1" in error(
        "x = (1, 2) deg\ny = Range(1, 2)\n"
    )


def test_an_instance_without_new_in_scenic_3() -> None:
    assert error("ego = Car at (0, 0)", 3) == (
        "error[parse-error]: an instance without `new` is not part of Scenic 3\n"
        " --> test.scenic:1:7\n"
        "  |\n"
        "1 | ego = Car at (0, 0)\n"
        "  |       ^^^\n"
        "  = hint: write `new Car ...`, or read the program as Scenic 2"
    )


def test_new_in_scenic_2() -> None:
    assert error("ego = new Car", 2) == (
        "error[parse-error]: an instance with `new` is not part of Scenic 2\n"
        " --> test.scenic:1:7\n"
        "  |\n"
        "1 | ego = new Car\n"
        "  |       ^^^^^^^\n"
        "  = hint: leave `new` out, or read the program as Scenic 3"
    )


def test_evidence_is_in_the_order_of_the_text() -> None:
    evidence = module("a = Range(1, 2)\nego = new Car at (Range(0, 1), 2)\n").evidence
    assert [item.span.text for item in evidence] == ["Range", "new Car", "Range"]


def test_no_such_version() -> None:
    with pytest.raises(ValueError, match="version 4"):
        module("x = 1", 4)
