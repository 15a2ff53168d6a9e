"""Contraction of boxes by nonlinear atoms: forward evaluation in intervals, then backward through the same operations.

The procedure is known as HC4-revise. Equal parts of all atoms of a tape are computed once. Part of the portable solver.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf

from scenicq.smt.backward import BACKWARD, root
from scenicq.smt.formula import Conjunction, Operator, Relation, TermComparison, flatten
from scenicq.smt.interval import FORWARD, EmptyError, Interval, power

__all__ = ["Tape"]

_OPERATORS = {operator.value: operator for operator in Operator}
_FOLDS = (Operator.ADD, Operator.MUL, Operator.MIN, Operator.MAX)

_Step = tuple[int, Callable[..., Interval], Callable[..., tuple[Interval, ...]], tuple[int, ...]]
"""Place of the result, range of the function, ranges of its arguments, places of the arguments."""


class Tape:
    """The operations of several atoms in order."""

    def __init__(self, atoms: Sequence[TermComparison], index: Mapping[str, int]) -> None:
        """Write the operations down.

        Args:
            atoms: The atoms.
            index: The number of each variable in a box.
        """
        self._start: list[Interval] = []
        self._inputs: list[tuple[int, int]] = []
        self._steps: list[_Step] = []
        self._atoms: list[tuple[str, int, int]] = []
        places: list[int] = []
        for kind, text, children in flatten(Conjunction(tuple(atoms))):
            args = [places[child] for child in children] if kind != "and" else []
            places.append(-1)
            if kind == "var":
                places[-1] = self._place((-inf, inf))
                self._inputs.append((places[-1], index[text]))
            elif kind == "num":
                places[-1] = self._place((float(text), float(text)))
            elif kind in _OPERATORS:
                places[-1] = self._write(_OPERATORS[kind], args)
            elif kind != "and":
                self._atoms.append((kind, args[0], args[1]))

    def _place(self, value: Interval) -> int:
        self._start.append(value)
        return len(self._start) - 1

    def _write(self, operator: Operator, args: list[int]) -> int:
        if operator is Operator.POW:
            return self._power(args[0], int(self._start[args[1]][0]))
        if operator not in _FOLDS:
            return self._step(FORWARD[operator], BACKWARD[operator], tuple(args))
        if operator is Operator.MUL:
            # equal factors as powers: a power's range is known exactly
            args = [self._power(arg, args.count(arg)) for arg in dict.fromkeys(args)]
        result = args[0]
        for arg in args[1:]:
            result = self._step(FORWARD[operator], BACKWARD[operator], (result, arg))
        return result

    def _power(self, base: int, exponent: int) -> int:
        if exponent == 1:
            return base

        def forward(a: Interval) -> Interval:
            return power(a, exponent)

        def backward(r: Interval, a: Interval) -> tuple[Interval]:
            return (root(r, a, exponent),)

        return self._step(forward, backward, (base,))

    def _step(
        self, forward: Callable[..., Interval], backward: Callable[..., tuple[Interval, ...]], args: tuple[int, ...]
    ) -> int:
        place = self._place((-inf, inf))
        self._steps.append((place, forward, backward, args))
        return place

    def contract(self, low: list[float], high: list[float]) -> bool:
        """Narrow a box in place; False if no point of it satisfies all atoms."""
        values = self._start[:]
        for place, variable in self._inputs:
            values[place] = (low[variable], high[variable])
        try:
            self._forward(values)
            for relation, left, right in self._atoms:
                _compare(relation, left, right, values)
            self._backward(values)
        except EmptyError:
            return False
        for place, variable in self._inputs:
            low[variable], high[variable] = values[place]
        return True

    def _forward(self, values: list[Interval]) -> None:
        for place, forward, _, args in self._steps:
            if len(args) == 1:
                values[place] = forward(values[args[0]])
            else:
                values[place] = forward(values[args[0]], values[args[1]])

    def _backward(self, values: list[Interval]) -> None:
        for place, _, backward, args in reversed(self._steps):
            found = backward(values[place], *[values[arg] for arg in args])
            for arg, (low, high) in zip(args, found, strict=True):
                old_low, old_high = values[arg]
                if low > old_low or high < old_high:
                    values[arg] = both = max(low, old_low), min(high, old_high)
                    if not both[0] <= both[1]:
                        raise EmptyError


def _compare(relation: str, left: int, right: int, values: list[Interval]) -> None:
    """Narrow both sides of an atom."""
    (a, b), (c, d) = values[left], values[right]
    if a > d or (relation == Relation.LT and a >= d):
        raise EmptyError
    if relation == Relation.EQ:
        if c > b:
            raise EmptyError
        values[left] = values[right] = max(a, c), min(b, d)
        return
    values[left] = a, min(b, d)
    values[right] = max(a, c), d
    if left == right:
        values[left] = a, b
