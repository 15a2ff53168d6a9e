"""Does Scenic put everything where a label has it, if its random variables are what a witness says?

Runs where Scenic is and `scenicq` is not. As in the definition of a match, what a program says of an object is worked
out with all other objects where the label has them. Random variables are found by their place in the program.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Generator, Iterator
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
MOST_ORDERS = 24
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
    # which of the points are those of the witness is not known: they may be any that can lie there
    orders = itertools.islice(_orders(found, request["witness"]), MOST_ORDERS)
    answers = [_replay(scenario, found, request, points) for points in orders]
    return next((each for each in answers if each["replay"] == "allowed"), None) or min(
        answers, key=lambda each: each["replay"] == "refuted", default={"replay": "open", "why": "random points"}
    )


def _orders(found: dict[tuple[int, int], list[Any]], witness: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The random points that those of a witness may be; Scenic does not say where in the program they are made."""
    points = [each for made in found.values() for each in made if isinstance(each, PointInRegionDistribution)]
    keys = [key for key, value in witness.items() if isinstance(value, list)]
    keys.sort(key=lambda key: (not _in_program(key), _place_of(key)))
    for order in itertools.permutations(points, len(keys)):
        if all(_may_be(point, witness[key]) for key, point in zip(keys, order, strict=True)):
            yield dict(zip(keys, order, strict=True))


def _in_program(key: str) -> bool:
    return key.count(":") == 1


def _place_of(key: str) -> tuple[int, int]:
    """The line and column of a random variable."""
    line, column = key.split(":")[-2:]
    return int(line), int(column)


def _may_be(point: Any, place: list[float]) -> bool:
    try:
        return needsSampling(point.region) or point.region.distanceTo(Vector(*place, 0)) <= SLACK_M
    except NotImplementedError:
        return True


def _replay(
    scenario: Any, found: dict[tuple[int, int], list[Any]], request: dict[str, Any], points: dict[str, Any]
) -> dict[str, str]:
    for each in (each for made in found.values() for each in made):
        each._conditioned = each
    why = _fix(found, request["witness"], points)
    if why:
        return {"replay": "open", "why": why}
    others = any(not _in_program(key) or _place_of(key) not in found for key in request["witness"])
    labels = request["labels"]
    own = [_Conditioned(thing, label) for thing, label in zip(scenario.objects, labels, strict=True)]
    for number, each in enumerate(own):
        if each.is_noisy:
            continue  # its noise may bring it anywhere
        for other in own:
            other.observe()
        each.forget()
        apart = [each.apart() for _ in range(SAMPLES)]
        if not any(far <= SLACK_M and turn <= SLACK_RAD for far, turn in apart):
            varies = len({(round(far, 4), round(turn, 4)) for far, turn in apart}) > 1
            why = f"object {number} is {apart[0][0]:.2f} m and {math.degrees(apart[0][1]):.1f} deg from its label"
            return {"replay": "open" if varies or others else "refuted", "why": why}
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

    @property
    def is_noisy(self) -> bool:
        """Whether the program mutates it."""
        return bool(self.thing.mutationScale)

    def observe(self) -> None:
        """What others refer to is where the label has it, unless noise hides where it was before."""
        for each, value in () if self.is_noisy else self.values:
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


def _fix(found: dict[tuple[int, int], list[Any]], witness: dict[str, Any], points: dict[str, Any]) -> str:
    """Let random variables have the values of a witness; what keeps it from that."""
    for key, value in witness.items():
        if key in points:
            points[key].conditionTo(ConstantSamplable(Vector(*value, 0)))
            continue
        made = found.get(_place_of(key), []) if _in_program(key) else []
        indices = {id(each.index) for each in made if isinstance(each, Options)}
        made = [each for each in made if not isinstance(each, PointInRegionDistribution) and id(each) not in indices]
        if not made:
            continue  # a choice that Scenic does not have
        if len(made) != 1:
            return f"{len(made)} random variables at {key}: {[type(each).__name__ for each in made]}"
        variable = made[0].index if isinstance(made[0], Options) else made[0]
        if not isinstance(variable, Samplable):
            return f"no random choice at {key}"
        variable.conditionTo(ConstantSamplable(int(value) if isinstance(made[0], Options) else value))
    return ""
