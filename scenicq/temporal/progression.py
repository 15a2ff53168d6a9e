"""Formulas followed from sample to sample: what must hold of the samples that are left.

What is left of a formula after a sample is a disjunction of conjunctions of obligations, each a part of the formula
that must hold from the next sample on; a strong one demands that there is a next sample, a weak one does not. As
clauses that another clause implies are left out, equal rests are equal values, and there are finitely many.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import assert_never

from scenicq.forest.temporal import Always, And, Atom, Eventually, Formula, Next, Not, Or, Until
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.temporal.folding import fold_value

__all__ = ["HOLDS", "LOST", "Progression", "Rest", "accepts"]


Obligation = tuple[int, bool]
"""The number of a part of a formula, and whether there must be a next sample for it."""
Rest = frozenset[frozenset[Obligation]]
"""What must hold from the next sample on: some clause, all of its obligations."""

LOST: Rest = frozenset()
HOLDS: Rest = frozenset((frozenset[Obligation](),))


@dataclass(frozen=True, slots=True)
class _Part:
    """A part of a formula in negation normal form.

    Attributes:
        kind: An atom, a negated one, an operator; `next` and `if next` differ where there is no next sample.
        atom: The number of the atom.
        parts: The numbers of the parts that it is made of.
    """

    kind: str
    atom: int = -1
    parts: tuple[int, ...] = ()


@dataclass(eq=False, slots=True)
class Progression:
    """Formulas, made ready to be followed; equal parts are one."""

    _parts: list[_Part] = field(default_factory=lambda: [_Part("and"), _Part("or")])
    _numbers: dict[_Part, int] = field(default_factory=dict["_Part", int])

    def add(self, formula: Formula) -> Rest:
        """What must hold from the first sample on, for a formula to hold."""
        number = fold_value((formula, True), _operands, self._part)
        return frozenset((frozenset(((number, True),)),))

    def _part(self, asked: tuple[Formula, bool], parts: list[int]) -> int:
        every, nothing = 0, 1
        formula, positive = asked
        match formula:
            case Atom():
                found = _Part("is" if positive else "is not", formula.number)
            case Not():
                return parts[0]
            case And() | Or():
                found = _Part("and" if isinstance(formula, And) == positive else "or", parts=tuple(parts))
            case Always() | Eventually():
                always = isinstance(formula, Always) == positive
                found = _Part("release" if always else "until", parts=(nothing if always else every, parts[0]))
            case Next():
                found = _Part("next" if positive else "if next", parts=(parts[0],))
            case Until():
                found = _Part("until" if positive else "release", parts=tuple(parts))
            case _:
                assert_never(formula)
        if found not in self._numbers:
            self._numbers[found] = len(self._parts)
            self._parts.append(found)
        return self._numbers[found]

    def after(self, rest: Rest, holds: Callable[[int], bool]) -> Rest:
        """What is left of a rest after one more sample.

        Args:
            rest: What must hold from that sample on.
            holds: Whether an atom holds there, by its number.

        Raises:
            Exhausted: It has too many clauses.
        """
        values: dict[int, Rest] = {}
        for number in self._here({number for clause in rest for number, _ in clause}):
            values[number] = self._value(number, values, holds)
        return _any_of(_all_of(values[number] for number, _ in clause) for clause in rest)

    def _here(self, numbers: set[int]) -> list[int]:
        """The parts that depend on this sample, each behind those that it is made of."""
        found = set(numbers)
        stack = list(numbers)
        while stack:
            part = self._parts[stack.pop()]
            if part.kind not in ("next", "if next"):
                new = [each for each in part.parts if each not in found]
                found.update(new)
                stack += new
        return sorted(found)

    def _value(self, number: int, values: dict[int, Rest], holds: Callable[[int], bool]) -> Rest:
        part = self._parts[number]
        below = [values[each] for each in part.parts] if part.kind not in ("next", "if next") else []
        match part.kind:
            case "is" | "is not":
                return HOLDS if holds(part.atom) == (part.kind == "is") else LOST
            case "and":
                return _all_of(below)
            case "or":
                return _any_of(below)
            case "next" | "if next":
                return _later(part.parts[0], strong=part.kind == "next")
            case "until":
                return _any_of((below[1], _all_of((below[0], _later(number, strong=True)))))
            case _:
                return _all_of((below[1], _any_of((below[0], _later(number, strong=False)))))


def accepts(rest: Rest) -> bool:
    """Whether a rest holds where no sample is left."""
    return any(not any(strong for _, strong in clause) for clause in rest)


def _operands(asked: tuple[Formula, bool]) -> list[tuple[Formula, bool]]:
    formula, positive = asked
    match formula:
        case Atom():
            return []
        case Not():
            return [(formula.operand, not positive)]
        case Always() | Eventually() | Next():
            return [(formula.operand, positive)]
        case And() | Or():
            return [(each, positive) for each in formula.operands]
        case Until():
            return [(formula.left, positive), (formula.right, positive)]


def _later(number: int, *, strong: bool) -> Rest:
    return frozenset((frozenset(((number, strong),)),))


def _any_of(rests: Iterable[Rest]) -> Rest:
    return _without_implied({clause for rest in rests for clause in rest})


def _all_of(rests: Iterable[Rest]) -> Rest:
    found = HOLDS
    for rest in rests:
        found = _without_implied({one | other for one in found for other in rest})
    return found


def _without_implied(clauses: set[frozenset[Obligation]]) -> Rest:
    """The clauses that imply no other one."""
    if len(clauses) > LIMITS.formula_clauses:
        raise limit_exceeded("formula_clauses")
    if len(clauses) < 2:
        return frozenset(clauses)
    return frozenset(one for one in clauses if not any(other < one for other in clauses))
