"""Does Scenic put everything where a label has it, if its random variables are what a witness says?

Runs where Scenic is and `scenicq` is not. As in the definition of a match, what a program says of an object is worked
out with all other objects where the label has them. Random variables are found by their place in the program.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from scenic.core.distributions import (
    ConstantSamplable,
    DiscreteRange,
    Normal,
    Options,
    Range,
    RejectionException,
    Samplable,
    TruncatedNormal,
    needsSampling,
)
from scenic.core.regions import PointInRegionDistribution
from scenic.core.vectors import Orientation, Vector

LEAVES = (DiscreteRange, Normal, Options, Range, TruncatedNormal, PointInRegionDistribution)
SAMPLES = 5
SLACK_M, SLACK_RAD = 0.35, math.radians(3.0)
"""How far from the label Scenic may put an object: known places of others are the program's here, the label's there."""


@contextmanager
def places(found: dict[tuple[int, int], list[Any]]) -> Generator[None]:
    """Note where in the program, by line and column, random variables are made meanwhile."""
    plain = Samplable.__init__

    def noted(self: Any, dependencies: Any) -> None:
        plain(self, dependencies)
        if isinstance(self, LEAVES) and (place := _place()) is not None:
            found.setdefault(place, []).append(self)

    Samplable.__init__ = noted
    try:
        yield
    finally:
        Samplable.__init__ = plain


def _place() -> tuple[int, int] | None:
    frame = sys._getframe(2)
    while frame is not None and frame.f_code.co_filename != "<string>":
        frame = frame.f_back
    if frame is None:
        return None
    line, _, column, _ = list(frame.f_code.co_positions())[frame.f_lasti // 2]
    return (line, column + 1) if line and column is not None else None


def replay(scenario: Any, found: dict[tuple[int, int], list[Any]], request: dict[str, Any]) -> dict[str, str]:
    """Whether Scenic allows a label with a witness: "allowed", "refuted" or "open", and why.

    Args:
        scenario: The compiled program.
        found: Its random variables by place.
        request: "witness", numbers and points by `line:column`, and "labels", one for each object, the ego first.
    """
    why = _fix(found, request["witness"])
    if why:
        return {"replay": "open", "why": why}
    labels = request["labels"]
    own = [_Conditioned(thing, label) for thing, label in zip(scenario.objects, labels, strict=True)]
    for number, each in enumerate(own):
        for other in own:
            other.observe()
        each.forget()
        apart = [each.apart() for _ in range(SAMPLES)]
        if not any(far <= SLACK_M and turn <= SLACK_RAD for far, turn in apart):
            varies = len({(round(far, 4), round(turn, 4)) for far, turn in apart}) > 1
            why = f"object {number} is {apart[0][0]:.2f} m and {math.degrees(apart[0][1]):.1f} deg from its label"
            return {"replay": "open" if varies else "refuted", "why": why}
    for each in own:
        each.observe()
    try:
        sample = Samplable.sampleAll(scenario.dependencies)
        broken = [req for req in scenario.userRequirements if req.prob == 1 and req.falsifiedBy(sample)]
    except RejectionException as rejection:
        return {"replay": "open", "why": f"rejected: {rejection}"}
    return {"replay": "refuted", "why": str(broken[0])} if broken else {"replay": "allowed", "why": ""}


class _Conditioned:
    """An object whose place and heading may be those of a label."""

    def __init__(self, thing: Any, label: dict[str, float]) -> None:
        self.thing, self.label = thing, label
        turn = Orientation.fromEuler(label["heading"], 0, 0)
        given = {"position": Vector(label["x"], label["y"], 0), "orientation": turn, "heading": label["heading"]}
        self.values = [(getattr(thing, name), value) for name, value in given.items()]
        self.values = [(each, value) for each, value in self.values if needsSampling(each)]
        self.before = [each._conditioned for each, _ in self.values]

    def observe(self) -> None:
        """What others refer to is where the label has it."""
        for each, value in self.values:
            each.conditionTo(ConstantSamplable(value))

    def forget(self) -> None:
        """It is what the program says."""
        for (each, _), before in zip(self.values, self.before, strict=True):
            each._conditioned = before

    def apart(self) -> tuple[float, float]:
        """Metres and radians between what the program says and the label."""
        try:
            found = Samplable.sampleAll([self.thing.position, self.thing.orientation])
        except RejectionException:
            return math.inf, math.inf
        place, turn = found[self.thing.position], found[self.thing.orientation]
        off = turn.yaw - self.label["heading"]
        far = math.hypot(place.x - self.label["x"], place.y - self.label["y"])
        return far, abs(math.remainder(off, math.tau))


def _fix(found: dict[tuple[int, int], list[Any]], witness: dict[str, Any]) -> str:
    """Let random variables have the values of a witness; what keeps it from that."""
    points = [each for made in found.values() for each in made if isinstance(each, PointInRegionDistribution)]
    keys = sorted((tuple(map(int, key.split(":"))) for key, value in witness.items() if isinstance(value, list)))
    if len(points) != len(keys):
        return f"{len(points)} random points, {len(keys)} of which are known"
    in_order = dict(zip(keys, points, strict=True))  # Scenic does not say where in the program they are made
    for key, value in witness.items():
        line, column = map(int, key.split(":"))
        made, point = found.get((line, column), []), isinstance(value, list)
        if point:
            made = [in_order[line, column]]
        if len(made) != 1:
            return f"{len(made)} random variables at {key}"
        variable = made[0].index if isinstance(made[0], Options) else made[0]
        if not isinstance(variable, Samplable):
            return f"no random choice at {key}"
        known = Vector(*value, 0) if point else int(value) if isinstance(made[0], Options) else value
        variable.conditionTo(ConstantSamplable(known))
    return ""
