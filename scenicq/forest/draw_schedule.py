"""An order in which to draw a scene so that what is wrong shows early and spoils little.

Rejection must keep the distribution: whatever shares a random variable with a failed condition, directly or through
another condition, is drawn anew. But parts of a scene that share none are independent: each is drawn until its own
conditions hold, and only a condition over several of them sends all of these back. So the steps stand on a schedule,
parts one after the other, and a failed condition goes back to the first step of its part.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol, cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.compute import compute, directions
from scenicq.forest.draws import draw_leaf, draw_point
from scenicq.forest.inline import Check
from scenicq.forest.nodes import Constant, DirectionAt, Feature, Identity, Leaf, Node, PointIn, Undefined, Value, Vector
from scenicq.forest.proximity_pruning import Window
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.regions import Region

__all__ = ["DrawSchedule", "lay_out"]

_Values = list[Value]


class DrawStep(Protocol):
    """One step: computes a value, or tests one."""

    def run(self, values: _Values, rng: random.Random) -> bool:
        """Whether all is well so far."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class _Compute:
    slot: int
    node: Node
    args: tuple[int, ...]

    def run(self, values: _Values, rng: random.Random) -> bool:
        values[self.slot] = compute(self.node, tuple([values[arg] for arg in self.args]))
        return True


@dataclass(frozen=True, slots=True, eq=False)
class _Direct:
    """The direction of a field; of several any one."""

    slot: int
    args: tuple[int, ...]

    def run(self, values: _Values, rng: random.Random) -> bool:
        allowed = directions(*(values[arg] for arg in self.args))
        values[self.slot] = allowed if isinstance(allowed, Undefined) else rng.choice(allowed)
        return True


@dataclass(frozen=True, slots=True, eq=False)
class _Draw:
    slot: int
    leaf: Leaf
    args: tuple[int, ...]

    def run(self, values: _Values, rng: random.Random) -> bool:
        values[self.slot] = draw_leaf(self.leaf, tuple([values[arg] for arg in self.args]), rng)
        return True


class _DrawPoint:
    """A point of a region that is known: what draws from it is prepared once."""

    def __init__(self, slot: int, region: Region) -> None:
        self.slot = slot
        self.draw = draw_point(region)

    def run(self, values: _Values, rng: random.Random) -> bool:
        values[self.slot] = self.draw(rng)
        return True


@dataclass(frozen=True, slots=True, eq=False)
class _DrawInWindow:
    """A point of a region close to another point; fails as often as the window there is smaller than any can be."""

    slot: int
    center: int
    window: Window

    def run(self, values: _Values, rng: random.Random) -> bool:
        center = values[self.center]
        if isinstance(center, Undefined):
            return False
        point = self.window.draw(cast(Vector, center), rng)
        if point is not None:
            values[self.slot] = point
        return point is not None


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    slot: int
    check: Check

    def run(self, values: _Values, rng: random.Random) -> bool:
        value = values[self.slot]
        return not isinstance(value, Undefined) and (self.check.defined or bool(value))


@dataclass(slots=True, eq=False)
class _Part:
    """Steps that depend on some random variables (a bit each) and on no others."""

    mask: int
    steps: list[DrawStep] = field(default_factory=list[DrawStep])


@dataclass(frozen=True, slots=True, eq=False)
class DrawSchedule:
    """The steps that draw a scene.

    Attributes:
        steps: In order.
        restarts: For each step, where to go back to if it fails.
        slots: How many values there are.
        constants: Values that are known, by slot.
        places: The slots of the expressions that were asked for, in their order.
    """

    steps: tuple[DrawStep, ...]
    restarts: tuple[int, ...]
    slots: int
    constants: Mapping[int, Value]
    places: tuple[int, ...]

    def checks(self) -> tuple[Check | None, ...]:
        """The condition that each step tests, None for those that only compute."""
        return tuple(step.check if isinstance(step, _Test) else None for step in self.steps)


def lay_out(roots: tuple[Node, ...], checks: Iterable[Check], windows: Mapping[Identity, Window]) -> DrawSchedule:
    """The schedule that draws what expressions and conditions depend on.

    Args:
        roots: Expressions whose values are wanted; evaluated last, once all conditions hold.
        checks: Conditions, over the same random variables.
        windows: Random points that are drawn close to the last part of their region's intersection.
    """
    checks = tuple(checks)
    layout = _Layout(windows)
    masks = _masks((*(check.condition for check in checks), *roots))
    for check in sorted(checks, key=lambda each: masks[id(each.condition)].bit_count()):
        layout.add_check(check, masks[id(check.condition)])
    return layout.finish(roots)


def _masks(roots: tuple[Node, ...]) -> dict[int, int]:
    """The random variables below each node, a bit each."""
    bits: dict[Identity, int] = {}
    masks: dict[int, int] = {}
    for node in postorder(roots):
        mask = 0
        for child in children(node):
            mask |= masks[id(child)]
        if is_leaf(node):
            mask |= bits.setdefault(cast(Leaf, node).identity, 1 << len(bits))
        masks[id(node)] = mask
    return masks


class _Layout:
    """A schedule in the making."""

    def __init__(self, windows: Mapping[Identity, Window]) -> None:
        self.windows = windows
        self.parts: list[_Part] = []
        self.slot_of: dict[int, int] = {}
        self.leaf_slots: dict[Identity, int] = {}
        self.constants: dict[int, Value] = {}
        self.slots = 0
        self.restart: dict[int, DrawStep] = {}

    def add_check(self, check: Check, mask: int) -> None:
        """Put a condition, and what it needs, after all parts that it depends on, which become one."""
        joined = [part for part in self.parts if part.mask & mask]
        whole = _Part(mask)
        for part in joined:
            whole.mask |= part.mask
            whole.steps += part.steps
        steps = [*self._needed(check.condition)]
        steps.append(_Test(self.slot_of[id(check.condition)], check))
        whole.steps += steps
        for step in steps:
            self.restart[id(step)] = whole.steps[0]
        self.parts = [part for part in self.parts if not part.mask & mask]
        self.parts.append(whole)

    def finish(self, roots: tuple[Node, ...]) -> DrawSchedule:
        """The whole schedule."""
        rest: list[DrawStep] = []
        for root in roots:
            rest += self._needed(root)
        steps = [step for part in self.parts for step in part.steps] + rest
        index = {id(step): number for number, step in enumerate(steps)}
        restarts = tuple(index[id(self.restart.get(id(step), steps[0]))] for step in steps)
        return DrawSchedule(
            tuple(steps), restarts, self.slots, self.constants, tuple(self.slot_of[id(root)] for root in roots)
        )  # fmt: skip

    def _needed(self, root: Node) -> list[DrawStep]:
        """Steps for the nodes below a root that have none yet."""
        steps: list[DrawStep] = []
        stack: list[tuple[Node, bool]] = [(root, False)]
        while stack:
            node, ready = stack.pop()
            if id(node) in self.slot_of:
                continue
            if ready or not (below := children(node)):
                step = self._step(node)
                if step is not None:
                    steps.append(step)
            else:
                stack.append((node, True))
                stack += ((child, False) for child in reversed(below) if id(child) not in self.slot_of)
        return steps

    def _step(self, node: Node) -> DrawStep | None:
        if is_leaf(node) and (known := self.leaf_slots.get(cast(Leaf, node).identity)) is not None:
            self.slot_of[id(node)] = known
            return None
        slot = self.slot_of[id(node)] = self.slots
        self.slots += 1
        args = tuple(self.slot_of[id(child)] for child in children(node))
        if isinstance(node, Constant):
            self.constants[slot] = node.value
            return None
        if isinstance(node, Feature):
            raise CannotEvaluate(f"`{node.property}` of an object has no value")
        if isinstance(node, DirectionAt):
            return _Direct(slot, args)
        if not is_leaf(node):
            return _Compute(slot, node, args)
        leaf = cast(Leaf, node)
        self.leaf_slots[leaf.identity] = slot
        if leaf.identity in self.windows:
            window = self.windows[leaf.identity]
            return _DrawInWindow(slot, self.slot_of[id(window.center)], window)
        if isinstance(leaf, PointIn) and isinstance(leaf.region, Constant) and not _undefined(leaf.region):
            return _DrawPoint(slot, cast(Region, leaf.region.value))
        return _Draw(slot, leaf, args)


def _undefined(node: Constant) -> bool:
    return isinstance(node.value, Undefined)
