"""Hatching of the areas where roles may be: lines of one direction a role, so that areas that overlap stay apart."""

from __future__ import annotations

from scenicq.report.svg import element

__all__ = ["hatching"]

_TURNS = (45, -45, 0, 90, 20, -20, 70, -70)
"""Degrees by which the lines of each role are turned, in the order of the roles' colours."""
_APART = 240
"""Centimetres between two lines."""


def hatching() -> str:
    """The patterns `hatch-c0`, `hatch-c1`, ... to fill areas with; one set is enough for all pictures of a page."""
    patterns = (
        element(
            "pattern",
            element("path", class_=f"hatch c{number}", d=f"M{_APART // 2} 0v{_APART}"),
            id=f"hatch-c{number}",
            patternUnits="userSpaceOnUse",
            width=_APART,
            height=_APART,
            patternTransform=f"rotate({turn})",
        )
        for number, turn in enumerate(_TURNS)
    )
    return element("defs", *patterns)
