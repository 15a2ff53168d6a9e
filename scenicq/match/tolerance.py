"""Within tolerance of the label: what it means for each feature, and the one slack of floating point.

A `Tolerance` is what the user chose: a size for each property, for all objects or for those of a scope (an object's
name, or a class). The most specific one holds. What it comes to for one feature is a `Margin`, and everything that asks
whether a value is close enough to a label's asks the margin: a disc or a box around a position, an arc around a
heading, an interval around any other number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

import shapely

from scenicq.errors import DataError, Diagnostic, similar
from scenicq.forest.nodes import Undefined, Value
from scenicq.forest.scenario import Scenario
from scenicq.geometry.angles import distance
from scenicq.option_values import FURTHEST_M
from scenicq.store.classes import ROOT, ancestors, is_class, subclasses

__all__ = ["EXACT", "ROUNDING", "SLACK", "Margin", "Rule", "Tolerance", "parse_tolerance"]

ROUNDING = 1e-9
"""Metres or radians that the evaluation of an expression may be off."""
SLACK = 1e-6
"""Metres or radians by which bounds are grown and witnesses of linear programs may be off: rounding loses no match."""

_POSITION_M = 0.25
_HEADING = math.radians(5)
_EXACT = 1e-3
_COMPARED = ("position", "x", "y", "heading", "speed", "velocity", "width", "length", "height")
"""Properties that a tolerance can always name, whether or not a scenario has them."""
_UNITS = ("m/s", "m")
_SHAPE = "write position=0.25, ego.heading=5deg or Pedestrian.speed=0.5: an object or a class, a property and a size"


@dataclass(frozen=True, slots=True)
class Margin:
    """How far a label's value of one feature may be from what the scenario allows.

    Attributes:
        kind: "disc" and "box" for vectors, "arc" for headings, "interval" for other numbers.
        size: The disc's radius, the half width of the arc or interval, or half the box along the map's x axis.
        y: Half the box along the map's y axis; `size` for the other kinds.
        reach: The furthest that a value may be off, in any direction.
        sure: How far off a value may be whatever the direction and the rounding.
    """

    kind: Literal["disc", "box", "arc", "interval"]
    size: float
    y: float
    reach: float = field(init=False, repr=False)
    sure: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Work out what is asked for every comparison of every label."""
        object.__setattr__(self, "reach", math.hypot(self.size, self.y) if self.kind == "box" else self.size)
        object.__setattr__(self, "sure", max(0.0, min(self.size, self.y) - SLACK))

    def allows(self, value: Value, observed: Value, slack: float) -> bool:
        """Whether a value is close enough to the label's; what is no number must be equal.

        Args:
            value: What the scenario gives.
            observed: The label's value.
            slack: What is allowed beyond the margin.
        """
        if isinstance(value, Undefined):
            return False
        if isinstance(value, tuple) and isinstance(observed, tuple):
            dx, dy = value[0] - observed[0], value[1] - observed[1]
            if self.kind == "box":
                return abs(dx) <= self.size + slack and abs(dy) <= self.y + slack
            return math.hypot(dx, dy) <= self.size + slack
        if isinstance(value, bool) or isinstance(observed, bool):
            return value == observed
        if isinstance(value, float) and isinstance(observed, float):
            off = distance(value, observed) if self.kind == "arc" else abs(value - observed)
            return off <= self.size + slack
        return value == observed

    def around(self, observed: tuple[float, float]) -> tuple[shapely.Geometry, float]:
        """Where a position may be: a shape in metres, and a radius around it."""
        x, y = observed
        if self.kind != "box":
            return shapely.Point(x, y), self.size
        if self.size == 0 or self.y == 0:
            ends = (x - self.size, y - self.y), (x + self.size, y + self.y)
            return (shapely.Point(x, y) if ends[0] == ends[1] else shapely.LineString(ends)), 0.0
        return shapely.box(x - self.size, y - self.y, x + self.size, y + self.y), 0.0


Rule: TypeAlias = tuple[str, str, float]
"""A scope (an object's name or a class; empty for all objects), a property, and the size in the property's unit."""


@dataclass(frozen=True)
class Tolerance:
    """How far a label's values may be from what the scenario allows.

    Attributes:
        x, y: Half extents of a box along the map's axes in metres, or None for a disc.
        position: Radius of the disc in metres.
        heading: Half width of an arc in radians.
        other: For all other numbers and vectors, in their own unit.
        rules: What holds instead for some properties, of all objects or of some.
        scopes: For each object of a scenario, the scopes that it is in, the most specific first; see `for_scenario`.
    """

    x: float | None = None
    y: float | None = None
    position: float = _POSITION_M
    heading: float = _HEADING
    other: float = _EXACT
    rules: tuple[Rule, ...] = ()
    scopes: tuple[tuple[str, ...], ...] = ()

    @cached_property
    def _margins(self) -> dict[tuple[int, str], Margin]:
        # asked for every comparison of every label
        return {}

    def for_scenario(self, scenario: Scenario) -> Tolerance:
        """The tolerance with its scopes tied to a scenario's objects.

        Raises:
            DataError: option-invalid: a scope is no object and no class, or nothing has such a property.
        """
        if not self.rules:
            return self
        names = {owner.name for owner in scenario.objects}
        known = {*_COMPARED, *scenario.params}.union(*(owner.properties for owner in scenario.objects))
        for scope, name, _ in self.rules:
            if scope and scope not in names and not is_class(scope):
                raise _unknown(scope, "no object of the scenario and no class", {*names, *subclasses(ROOT)})
            if name not in known:
                raise _unknown(name, "no property of the scenario's objects", known)
        lines = tuple(
            (owner.name, *(ancestors(owner.category) if is_class(owner.category) else (ROOT,)))
            for owner in scenario.objects
        )
        return replace(self, scopes=lines)

    def scope(self, index: int, name: str) -> str:
        """The scope by which a feature is compared; empty for the one of all objects.

        Args:
            index: The object's index, or `PARAMS`.
            name: The property.
        """
        if not self.scopes or index not in range(len(self.scopes)):
            return ""
        parts = ("position", "x", "y") if name == "position" else (name,)
        given = {scope for scope, each, _ in self.rules if each in parts}
        return next((scope for scope in self.scopes[index] if scope in given), "")

    def of(self, index: int, name: str) -> Margin:
        """How far one feature may be off.

        Args:
            index: The object's index, or `PARAMS`.
            name: The property.
        """
        known = self._margins.get((index, name))
        if known is None:
            known = self._margins[index, name] = self._margin(index, name)
        return known

    def _margin(self, index: int, name: str) -> Margin:
        scope = self.scope(index, name)
        sizes = {each: size for where, each, size in self.rules if where == scope}
        if name == "position":
            x, y = (self.x, self.y) if "position" not in sizes else (None, None)
            x, y = sizes.get("x", x), sizes.get("y", y)
            if x is not None and y is not None:
                return Margin("box", x, y)
            radius = sizes.get("position", self.position)
            return Margin("disc", radius, radius)
        size = sizes.get(name, self.heading if name == "heading" else self.other)
        return Margin("arc" if name == "heading" else "interval", size, size)

    def widened(self, amount: float, heading: float) -> Tolerance:
        """All sizes grown.

        Args:
            amount: By how much: metres for a position, else the property's own unit.
            heading: By how many radians headings grow; to half a turn at most.
        """

        def wider(name: str, size: float) -> float:
            return min(math.pi, size + heading) if name == "heading" else size + amount

        return replace(
            self,
            x=None if self.x is None else self.x + amount,
            y=None if self.y is None else self.y + amount,
            position=self.position + amount,
            heading=wider("heading", self.heading),
            other=self.other + amount,
            rules=tuple((scope, name, wider(name, size)) for scope, name, size in self.rules),
        )

    def same_scopes(self, other: Tolerance) -> bool:
        """Whether two tolerances differ in sizes only: what is known of which features are compared alike holds."""
        mine, its = ([rule[:2] for rule in each.rules] for each in (self, other))
        return mine == its and self.scopes == other.scopes

    def __str__(self) -> str:
        """As the option takes it, rounded up so that it is not too small."""
        box = self.x is not None and self.y is not None
        sizes = [("x", self.x), ("y", self.y)] if box else [("position", self.position)]
        shown = [_shown("", name, size or 0.0) for name, size in [*sizes, ("heading", self.heading)]]
        if self.other != _EXACT:
            shown.insert(0, f"{self.other:g}")
        return ",".join([*shown, *(_shown(*rule) for rule in self.rules)])


EXACT = Tolerance(position=_EXACT, heading=_EXACT)
"""For generated labels."""


def _shown(scope: str, name: str, size: float) -> str:
    turned = name == "heading"
    digits = 2 if turned else 3
    value = min(180.0, math.degrees(size)) if turned else size
    text = f"{math.ceil(value * 10**digits - ROUNDING) / 10**digits:g}{'deg' if turned else ''}"
    return f"{scope}{'.' if scope else ''}{name}={text}"


def _unknown(word: str, why: str, known: Iterable[str]) -> DataError:
    close = similar(word, known)
    hint = f"`{close}` has a similar name" if close else _SHAPE
    return DataError(Diagnostic("option-invalid", f"`{word}` in the tolerance is {why}", hints=(hint,)))


def _invalid(text: str, why: str) -> DataError:
    hints = ("write lengths in metres and angles in degrees or radians, as in `position=0.25,ego.heading=5deg`",)
    return DataError(Diagnostic("option-invalid", f"`{text}` is not a tolerance: {why}", hints=hints))


def _number(text: str, item: str, units: Iterable[str]) -> float:
    """A size with or without one of the units."""
    digits = next((text.removesuffix(unit) for unit in units if text.endswith(unit)), text).strip()
    try:
        value = float(digits)
    except ValueError:
        raise _invalid(item, f"`{digits}` is not a number") from None
    if not (math.isfinite(value) and value >= 0):
        raise _invalid(item, "a tolerance is finite and not negative")
    if value > FURTHEST_M:
        raise _invalid(item, f"a tolerance is at most {FURTHEST_M:,.0f}")
    return math.radians(value) if text.endswith("deg") else value


def parse_tolerance(text: str) -> Tolerance:
    """A tolerance from `position=0.25,heading=5deg`, `x=0.25,y=0.25`, `ego.heading=15deg,speed=0.5`, `0.1` or `exact`.

    What is not given has its default: that of `exact`, or the bare number, where one of these comes first.

    Raises:
        DataError: option-invalid.
    """
    items = [part for part in (part.strip() for part in text.split(",")) if part]
    base = Tolerance()
    if items and "=" not in items[0]:
        first = items.pop(0)
        if first == "exact":
            base = EXACT
        else:
            size = _number(first, first, ())
            base = Tolerance(position=size, heading=min(size, math.pi), other=size)
    given: dict[tuple[str, str], float] = {}
    for item in items:
        path, equals, value = (part.strip() for part in item.partition("="))
        scope, dot, name = path.rpartition(".")
        if not equals or not name or (dot and not scope):
            raise _invalid(item, "it must be a property and a size, `heading=5deg` or `ego.heading=5deg`")
        if (scope, name) in given:
            raise _invalid(item, f"`{path}` is given twice")
        length = name in ("position", "x", "y")
        units = _UNITS if length else ("deg", "rad") if name == "heading" else (*_UNITS, "deg", "rad")
        given[scope, name] = _number(value, item, units)
        if name == "heading" and given[scope, name] > math.pi:
            raise _invalid(item, "a heading is never more than 180deg off")
    for scope in dict.fromkeys(scope for scope, _ in given):
        if ((scope, "x") in given) != ((scope, "y") in given):
            raise _invalid(text, "`x` and `y` go together")
        if (scope, "x") in given and (scope, "position") in given:
            raise _invalid(text, "`position` is a disc and `x`, `y` are a box: give one of them")
    plain = {name: size for (scope, name), size in given.items() if not scope}
    x, y = plain.pop("x", None), plain.pop("y", None)
    position, heading = plain.pop("position", base.position), plain.pop("heading", base.heading)
    rules = [("", name, size) for name, size in plain.items()]
    rules += [(scope, name, size) for (scope, name), size in given.items() if scope]
    return Tolerance(x, y, position, heading, base.other, tuple(rules))
