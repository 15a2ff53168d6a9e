"""What one number of a program would have to be for a requirement to hold, or the program to end, on an interval.

Each comparison of a condition over time is let through by some amount more, or less, and everything else stays. The
amounts at which anything changes are the differences of its sides at the samples; the least that is enough is told.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.build import constant
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, CompareOp, Node
from scenicq.forest.temporal import Atom, Eventually, Formula, operands
from scenicq.forest.walk import features, leaves, postorder, transform
from scenicq.limits import LIMITS
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.formula_values import FormulaValues
from scenicq.temporal.truth import TRUE, Truth

__all__ = ["Shift", "least_changes"]

_GREATER = (CompareOp.GT, CompareOp.GE)
_ORDERS = (*_GREATER, CompareOp.LT, CompareOp.LE)
_SPARE = 1e-3
"""Beyond what is just enough, relative to it, so that a number with few digits does."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A comparison that would do with another number.

    Attributes:
        what: The comparison, in the words of the program.
        amount: By how much more it must let through, less if negative; in the unit of its sides.
        compare: The comparison.
        number: What its one number would have to be; None where neither side is a number that stays the same.
        instead_of: What it is.
    """

    what: str
    amount: float
    compare: Compare
    number: float | None = None
    instead_of: float | None = None

    def made(self, conditions: Sequence[Node]) -> tuple[Node, ...]:
        """The conditions of a program in which the comparison is changed wherever the program says the same."""
        return tuple(transform(each, lambda node: _let(node, self.compare, self.amount)) for each in conditions)

    def text(self) -> str:
        """The change for a person."""
        if self.number is not None and self.instead_of is not None:
            return f"`{self.what}` would do with {self.number:.4g} instead of {self.instead_of:.4g}"
        return (
            f"`{self.what}` would do if it let {abs(self.amount):.4g} {'more' if self.amount > 0 else 'less'} through"
        )


def least_changes(
    columns: AtomColumns, formula: Formula, conditions: Sequence[Node], *, ends: bool = False, goes_on: bool = False,
    quick: bool = False,
) -> Iterator[Shift]:  # fmt: skip
    """For each comparison in a formula that does not hold the least change of it alone that makes it hold.

    Args:
        columns: Over the samples of the interval.
        formula: A formula over conditions.
        conditions: Conditions of the program, by number.
        ends: Whether the formula need only hold at some sample: of the condition of a termination.
        goes_on: Whether the interval is cut off, so that the formula need only be such that it may still hold.
        quick: Whether to bisect, which finds the least where the formula holds for all larger changes, too.
    """
    asked = FormulaValues(Eventually(formula) if ends else formula)
    numbers = sorted({node.number for node in _atoms(formula)})
    try:
        known = {number: columns.truth(conditions[number]) for number in numbers}
    except UnclearVariable:
        return
    told: set[str] = set()
    for number in numbers:
        for compare in _comparisons(conditions[number]):
            change = _least(columns, asked, known, number, conditions[number], compare, goes_on=goes_on, quick=quick)
            if change is not None and change.text() not in told:
                told.add(change.text())
                yield change


def _atoms(formula: Formula) -> Iterator[Atom]:
    stack: list[Formula] = [formula]
    while stack:
        node = stack.pop()
        if isinstance(node, Atom):
            yield node
        stack.extend(operands(node))


def _comparisons(condition: Node) -> list[Compare]:
    """The comparisons of numbers in a condition that the program writes."""
    nodes = postorder((condition,))
    return [
        each
        for each in nodes
        if isinstance(each, Compare) and each.op in _ORDERS and each.span is not None and not leaves(each)
    ]


def _least(
    columns: AtomColumns, formula: FormulaValues, known: Mapping[int, Truth], number: int, condition: Node,
    compare: Compare, *, goes_on: bool, quick: bool,
) -> Shift | None:  # fmt: skip
    """The least change of one comparison that makes a formula hold; None if there is none."""
    sides = [columns.number(columns.expanded(side)) for side in (compare.left, compare.right)]
    left, right = sides
    if left is None or right is None:
        return None
    gaps = left - right if compare.op in _GREATER else right - left
    amounts = np.unique(-gaps[np.isfinite(gaps)])
    size = len(columns.samples)

    def holds(amount: float) -> bool:
        def atom(each: Atom) -> Truth:
            if each.number != number:
                return known[each.number]
            return columns.truth(transform(condition, lambda node: _let(node, compare, amount)))

        return formula.may_hold(atom, size) if goes_on else bool(formula.to_the_end(atom, size)[0] == TRUE)

    # just more than a difference lets its sample through, just less keeps it out
    spare = _SPARE * max(1.0, float(np.abs(amounts).max(initial=0.0)))
    tried = np.concatenate((amounts + spare, amounts - spare))
    tried = tried[np.argsort(np.abs(tried), kind="stable")]
    if quick:
        ends = [_first(tried[side], holds) for side in (tried > 0, tried < 0)]
        enough = min((each for each in ends if each is not None), key=abs, default=None)
    else:
        enough = next((float(amount) for amount in tried[: LIMITS.tried_amounts] if holds(float(amount))), None)
    if enough is None:
        return None
    assert compare.span is not None
    what = " ".join(compare.span.text.split())
    for side, values in ((compare.right, right), (compare.left, left)):
        if len(values) and not set(features(side)):
            more = (compare.op in _GREATER) == (side is compare.left)
            old = float(values[0])
            return Shift(what, enough, compare, old + enough if more else old - enough, old)
    return Shift(what, enough, compare)


def _first(amounts: NDArray[np.float64], holds: Callable[[float], bool]) -> float | None:
    """The first amount for which something holds that holds for all that come after it, too; None if there is none."""
    if not len(amounts) or not holds(float(amounts[-1])):
        return None
    place = bisect_left(range(len(amounts)), True, key=lambda each: holds(float(amounts[each])))
    return float(amounts[place])


def _let(node: Node, compare: Compare, amount: float) -> Node:
    """A comparison that lets an amount more through, if it is the one in question, or the program says the same."""
    if not (isinstance(node, Compare) and node.op is compare.op and node.span is not None and compare.span is not None):
        return node
    if node.span != compare.span and node.span.text != compare.span.text:
        return node
    more = Arithmetic(ArithmeticOp.ADD, (node.right, constant(-amount if node.op in _GREATER else amount)))
    return Compare(node.op, node.left, more, span=node.span)
