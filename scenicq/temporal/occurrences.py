"""Formulas that hang on the next occurrence of something alone: decided for all runs at once, without a trace each.

From sample i, `always p` holds up to the sample before the next one at which p does not hold, `eventually p` from the
next one on at which it does. So each such part of a requirement bounds the last sample of a run from one side, and a
disjunction of conjunctions of them is a few intervals of last samples. Formulas with operators of time inside each
other have no such form (`ltlf` decides those).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Always, And, Atom, Eventually, Formula, Next, Not, Or, Until, operands
from scenicq.temporal.folding import folded
from scenicq.temporal.truth import TRUE, Truth, negated

__all__ = ["Clause", "FormulaPart", "PartKind", "bounds", "clauses_of", "joined", "next_at"]

_MOST_CLAUSES = 16
Places = NDArray[np.int64]


class PartKind(Enum):
    """What a part says of its formula."""

    NOW = auto()
    ALWAYS = auto()
    EVENTUALLY = auto()
    NEXT = auto()
    IF_NEXT = auto()
    UNTIL = auto()
    NOT_UNTIL = auto()


@dataclass(frozen=True, slots=True)
class FormulaPart:
    """A formula without operators of time, and where it must hold.

    Attributes:
        kind: Where: here; at all samples; at one; at the next; at the next, if there is one. For `UNTIL` the formula
            holds at one sample, and `before` at all before that; `NOT_UNTIL` is its negation.
        formula: The formula; negated if not `positive`.
        positive: See there.
        before: See there.
    """

    kind: PartKind
    formula: Formula
    positive: bool = True
    before: Formula | None = None


Clause = tuple[FormulaPart, ...]
"""Parts that hold together."""


def clauses_of(formula: Formula, *, positive: bool = True) -> list[Clause] | None:
    """The clauses of which one must hold for a formula to hold; None if it has no such form.

    Args:
        formula: The formula.
        positive: Whether it shall hold, or not.
    """
    return folded((formula, positive), _clause_parts, _clauses)


def _clause_parts(asked: tuple[Formula, bool]) -> list[tuple[Formula, bool]]:
    """What the clauses of a formula are made of; those of formulas without operators of time are their own."""
    formula, positive = asked
    if isinstance(formula, Not):
        return [(formula.operand, not positive)]
    if isinstance(formula, And | Or) and not _is_plain(formula):
        return [(part, positive) for part in formula.operands]
    return []


def _clauses(asked: tuple[Formula, bool], parts: list[list[Clause] | None]) -> list[Clause] | None:
    """The clauses of a formula, given those of its parts."""
    formula, positive = asked
    if _is_plain(formula):
        return [(FormulaPart(PartKind.NOW, formula, positive),)]
    match formula:
        case Not():
            return parts[0]
        case And() | Or():
            known = [part for part in parts if part is not None]
            if len(known) < len(parts):
                return None
            if isinstance(formula, And) == positive:
                return joined(known)
            either = [clause for part in known for clause in part]
            return either if len(either) <= _MOST_CLAUSES else None
        case Always() | Eventually() | Next():
            if not _is_plain(formula.operand):
                return None
            kinds = {
                Always: (PartKind.ALWAYS, PartKind.EVENTUALLY), Eventually: (PartKind.EVENTUALLY, PartKind.ALWAYS),
                Next: (PartKind.NEXT, PartKind.IF_NEXT),
            }  # fmt: skip
            return [(FormulaPart(kinds[type(formula)][not positive], formula.operand, positive),)]
        case Until():
            if not (_is_plain(formula.left) and _is_plain(formula.right)):
                return None
            kind = PartKind.UNTIL if positive else PartKind.NOT_UNTIL
            return [(FormulaPart(kind, formula.right, positive=True, before=formula.left),)]
        case Atom():
            return [(FormulaPart(PartKind.NOW, formula, positive),)]
        case _:
            assert_never(formula)


def joined(all_of: Sequence[list[Clause]]) -> list[Clause] | None:
    """The clauses of a conjunction; None if they are too many."""
    found: list[Clause] = [()]
    for options in all_of:
        found = [(*one, *other) for one, other in itertools.product(found, options)]
        if len(found) > _MOST_CLAUSES:
            return None
    return found


def _is_plain(formula: Formula) -> bool:
    stack = [formula]
    while stack:
        node = stack.pop()
        if isinstance(node, Always | Eventually | Next | Until):
            return False
        stack.extend(operands(node))
    return True


def _present_value(formula: Formula, atom: Callable[[Atom], Truth]) -> Truth:
    """The value of a formula without operators of time at each place."""

    def value(node: Formula, parts: list[Truth]) -> Truth:
        match node:
            case Atom():
                return atom(node)
            case Not():
                return negated(parts[0])
            case And():
                return np.minimum.reduce(parts)
            case Or():
                return np.maximum.reduce(parts)
            case _:
                raise ValueError("an operator of time inside another")

    return folded(formula, operands, value)


def next_at(holds: NDArray[np.bool_]) -> Places:
    """For each place the first one from there at which something holds; the number of places where none does."""
    n = len(holds)
    places = np.where(holds, np.arange(n), n)
    return np.minimum.accumulate(places[::-1])[::-1]


def bounds(part: FormulaPart, atom: Callable[[Atom], Truth], at_least: int, starts: Places) -> tuple[Places, Places]:
    """Between which last places of a run a part holds, both included; none if the first is behind the second.

    Places of several stretches may follow each other: what is found behind the end of a stretch is behind every last
    place in it.

    Args:
        part: The part.
        atom: The value of an atom at each place, shape (n,).
        at_least: The truth value that counts as holding.
        starts: Where runs start, shape (m,).
    """

    def holds(formula: Formula, *, positive: bool, least: int = at_least) -> NDArray[np.bool_]:
        value = _present_value(formula, atom)
        return (value if positive else negated(value)) >= least

    if part.kind in (PartKind.UNTIL, PartKind.NOT_UNTIL):
        assert part.before is not None
        # a negation holds at least as surely as what it negates fails
        least = at_least if part.kind is PartKind.UNTIL else int(TRUE) + 1 - at_least
        right = holds(part.formula, positive=True, least=least)
        n, first = len(right), next_at(right)[starts]
        met = next_at(~holds(part.before, positive=True, least=least))[starts] >= first
        first = np.where(met, first, n)
        none = np.full(len(starts), n)
        return (first, none) if part.kind is PartKind.UNTIL else (starts, first - 1)
    held = holds(part.formula, positive=part.positive)
    n = len(held)
    always, never = np.full(len(starts), n), np.full(len(starts), n + 1)
    match part.kind:
        case PartKind.NOW:
            return np.where(held[starts], starts, never), always
        case PartKind.ALWAYS:
            return starts, next_at(~held)[starts] - 1
        case PartKind.EVENTUALLY:
            return next_at(held)[starts], always
        case PartKind.NEXT | PartKind.IF_NEXT:
            following = np.append(held, False)[starts + 1]
            if part.kind is PartKind.NEXT:
                return np.where(following, starts + 1, never), always
            return starts, np.where(following, always, starts)
