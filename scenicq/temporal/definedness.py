"""Where expressions have no value, as conditions: the matcher says no to these, where all that is asked has one.

A condition without a value holds no more than its negation does. So that it holds for all values of random variables
is only said if neither its negation can hold nor something in it be without a value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

from shapely import MultiPolygon, Polygon

from scenicq.forest import build
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    Distance,
    Logic,
    LogicOp,
    Node,
    Select,
    Undefined,
)
from scenicq.forest.value_numbers import is_total
from scenicq.forest.walk import children, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import PolygonSet
from scenicq.temporal.folding import fold_value

__all__ = ["untrue"]

_LARGEST_EXPONENT = 709.0
"""The largest whole exponent to which e has a finite value."""
_NEVER, _ALWAYS = Constant(False), Constant(True)


def untrue(condition: Node) -> Node | None:
    """What holds where a condition does not: where it is false, and where it has no value.

    Perhaps it holds of some place besides where it is not known whether the condition has a value; None if where that
    is cannot be said.

    Args:
        condition: A boolean expression.
    """
    if all(map(is_total, postorder((condition,)))):
        return Logic(LogicOp.NOT, (condition,))
    without = _Without({})

    def below(asked: _Asked) -> list[_Asked]:
        if not isinstance(asked.node, Logic):
            return []
        return [_Asked(part, asked.positive != (asked.node.op is LogicOp.NOT)) for part in asked.node.args]

    def opposite(asked: _Asked, parts: list[Node | None]) -> Node | None:
        node = asked.node
        if not isinstance(node, Logic):
            plain = Logic(LogicOp.NOT, (node,)) if asked.positive else node
            return _any_of([plain, without.value(node)])
        if node.op is LogicOp.NOT:
            return parts[0]
        known = [part for part in parts if part is not None]
        every = (node.op is LogicOp.OR) == asked.positive
        return None if len(known) < len(parts) else Logic(LogicOp.AND if every else LogicOp.OR, tuple(known))

    return fold_value(_Asked(condition, positive=True), below, opposite)


@dataclass(frozen=True, slots=True)
class _Asked:
    """A condition of which is asked where it does not hold, or where its negation does not."""

    node: Node
    positive: bool


@dataclass(frozen=True, slots=True)
class _Without:
    """Where expressions have no value, remembered by their ids; None where that cannot be said."""

    found: dict[int, Node | None]

    def value(self, root: Node) -> Node | None:
        """Where an expression has no value."""
        for node in postorder((root,)):
            if id(node) not in self.found:
                self.found[id(node)] = self._of(node)
        return self.found[id(root)]

    def _of(self, node: Node) -> Node | None:
        if isinstance(node, Select):
            lost = [self.found[id(node.index)]]
            for number, option in enumerate(node.options):
                own = self.found[id(option)]
                picked = _picks(node.index, number)
                lost.append(own if own is None or own is _NEVER else build.logic(LogicOp.AND, picked, own))
            return _any_of(lost)
        parts = children(node)
        # a choice of fields is asked field by field
        own = _own(node)
        return _any_of([*(self.found[id(part)] for part in parts), own])


def _own(node: Node) -> Node | None:
    """Where a node has no value though those below it have one."""
    match node:
        case _ if is_total(node):
            return _NEVER
        case Constant():
            return _ALWAYS
        case Arithmetic() if node.op in _LOST:
            return _LOST[node.op](node.args)
        case DirectionAt(field=Select() as choice):
            fields = [_beyond(option, node.point) for option in choice.options]
            known = [each for each in fields if each is not None]
            if len(known) < len(fields):
                return None
            return _any_of([build.logic(LogicOp.AND, _picks(choice.index, n), each) for n, each in enumerate(known)])
        case DirectionAt():
            return _beyond(node.field, node.point)
        case _:
            return None


def _beyond(field: Node, point: Node) -> Node | None:
    """Where a point lies farther off than a field reaches."""
    match field:
        case Constant(value=Undefined()):
            return _ALWAYS
        case Constant(value=VectorField() as known):
            near = _near(known)
            if near is None:
                return _NEVER
            region, far = near
            return Compare(CompareOp.GT, Distance(Constant(region), point), build.constant(far))
        case _:
            return None


@lru_cache(maxsize=256)
def _near(field: VectorField) -> tuple[PolygonSet, float] | None:
    """Where a field reaches, as a region; made once, for what is indexed of it."""
    if field.reach is None:
        return None
    areas, far = field.reach
    return PolygonSet(cast("tuple[Polygon | MultiPolygon, ...]", tuple(areas)), field.name), far


def _picks(index: Node, number: int) -> Node:
    """That an index picks an option."""
    if kind_of(index) == "boolean":
        return index if number else Logic(LogicOp.NOT, (index,))
    return build.compare(CompareOp.EQ, index, build.constant(number))


def _any_of(parts: Sequence[Node | None]) -> Node | None:
    """That one of some conditions holds."""
    known = [part for part in parts if part is not None and not (isinstance(part, Constant) and part.value is False)]
    if None in parts:
        return None
    return known[0] if len(known) == 1 else Logic(LogicOp.OR, tuple(known)) if known else _NEVER


def _power(args: tuple[Node, ...]) -> Node | None:
    base, exponent = args
    if not (isinstance(exponent, Constant) and isinstance(exponent.value, float)):
        return None
    if exponent.value.is_integer():
        return _NEVER if exponent.value >= 0 else _is_zero(base)
    return build.compare(CompareOp.LT if exponent.value > 0 else CompareOp.LE, base, build.constant(0))


def _is_zero(number: Node) -> Node:
    return build.compare(CompareOp.EQ, number, build.constant(0))


def _than(op: CompareOp, end: float) -> Callable[[tuple[Node, ...]], Node]:
    return lambda args: build.compare(op, args[0], build.constant(end))


def _beyond_one(args: tuple[Node, ...]) -> Node:
    return build.compare(CompareOp.GT, build.arithmetic(ArithmeticOp.ABS, args[0]), build.constant(1))


_LOST: Mapping[ArithmeticOp, Callable[[tuple[Node, ...]], Node | None]] = {
    ArithmeticOp.DIV: lambda args: _is_zero(args[1]),
    ArithmeticOp.FLOORDIV: lambda args: _is_zero(args[1]),
    ArithmeticOp.MOD: lambda args: _is_zero(args[1]),
    ArithmeticOp.POW: _power,
    ArithmeticOp.SQRT: _than(CompareOp.LT, 0.0),
    ArithmeticOp.LOG: _than(CompareOp.LE, 0.0),
    ArithmeticOp.EXP: _than(CompareOp.GT, _LARGEST_EXPONENT),
    ArithmeticOp.ASIN: _beyond_one,
    ArithmeticOp.ACOS: _beyond_one,
    ArithmeticOp.TAN: lambda _: _NEVER,
}
"""Where operations have no value."""
