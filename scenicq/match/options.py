"""What a run of the matcher is told besides scenario and labels."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from scenicq.errors import DataError, Diagnostic
from scenicq.forest.scenario import BuiltIn
from scenicq.store.classes import Granularity

__all__ = ["Exhausted", "MatchOptions", "Method", "Tolerance", "parse_angle", "parse_tolerance"]

Method = Literal["auto", "smt", "monolithic"]

DEFAULT_TOLERANCE = 1e-3

EXEMPT_PARAMS = frozenset(
    {"map", "carla_map", "lgsvl_map", "render", "use2DMap", "time_step", "timestep", "weather_file"}
)
"""Parameters that say how to simulate, not what the scene is."""


class Exhausted(Exception):
    """The search took more steps than `MatchOptions.budget` allows."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a label's value may be from what the scenario allows.

    Attributes:
        x, y: Half extents of a box along the map's axes in metres, or None for a disc.
        position: Radius of the disc in metres.
        heading: Half width of an arc in radians.
        other: For all other numbers, in their own unit.
    """

    x: float | None = None
    y: float | None = None
    position: float = DEFAULT_TOLERANCE
    heading: float = DEFAULT_TOLERANCE
    other: float = DEFAULT_TOLERANCE

    @property
    def reach(self) -> float:
        """The furthest that a position may be off, in metres."""
        return self.position if self.x is None or self.y is None else math.hypot(self.x, self.y)


@dataclass(frozen=True, slots=True)
class MatchOptions:
    """Options of a match.

    Attributes:
        tolerance: Per feature.
        classes: Whether classes are folded.
        ego: Whether the scenario's ego is the label's ego, or any label object of its class.
        radius: Metres around the ego beyond which neither label objects nor the map are considered.
        enforce: Built-in requirements in force.
        exact: Whether the correspondence must cover all label objects.
        method: How groups are decided.
        timeout_s: Seconds for one call of a solver.
        precision: The solver's precision (δ).
        ignore_params: Global parameters that are not compared.
        budget: Steps of the correspondence search for one label.
    """

    tolerance: Tolerance = Tolerance()
    classes: Granularity = "fine"
    ego: Literal["label", "any"] = "label"
    radius: float | None = None
    enforce: frozenset[BuiltIn] = frozenset({BuiltIn.VISIBILITY})
    exact: bool = False
    method: Method = "auto"
    timeout_s: float = 10.0
    precision: float = 1e-4
    ignore_params: frozenset[str] = field(default=EXEMPT_PARAMS)
    budget: int = 1_000_000


def _invalid(text: str, why: str) -> DataError:
    hints = ("write lengths in metres and angles in degrees or radians, as in `position=0.25,heading=5deg`",)
    return DataError(Diagnostic("option-invalid", f"`{text}` is not a tolerance: {why}", hints=hints))


def _number(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise _invalid(whole, f"`{text}` is not a number") from None
    if not (math.isfinite(value) and value >= 0):
        raise _invalid(whole, "a tolerance is finite and not negative")
    return value


def parse_angle(text: str) -> float:
    """An angle in radians from `5deg`, `0.1rad` or `0.1` (radians).

    Raises:
        DataError: option-invalid.
    """
    text = text.strip()
    if text.endswith("deg"):
        return math.radians(_number(text.removesuffix("deg").strip(), text))
    return _number(text.removesuffix("rad").strip(), text)


def parse_tolerance(text: str) -> Tolerance:
    """A tolerance from `position=0.25,heading=5deg` or `x=0.25,y=0.25,heading=5deg`.

    Raises:
        DataError: option-invalid.
    """
    given: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = (part.strip() for part in item.partition("="))
        value = value.removesuffix("m") if name != "heading" else value
        if not equals or name not in ("position", "x", "y", "heading"):
            raise _invalid(item, "it must be one of position=, x=, y=, heading=")
        if name in given:
            raise _invalid(item, f"`{name}` is given twice")
        given[name] = parse_angle(value) if name == "heading" else _number(value, item)
    if ("x" in given) != ("y" in given):
        raise _invalid(text, "`x` and `y` go together")
    if "x" in given and "position" in given:
        raise _invalid(text, "`position` is a disc and `x`, `y` are a box: give one of them")
    if given.get("heading", 0.0) > math.pi:
        raise _invalid(text, "a heading is never more than 180deg off")
    return Tolerance(**given)
