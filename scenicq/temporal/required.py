"""What every run of a program that matches meets, read off its formulas."""

from __future__ import annotations

from dataclasses import dataclass

from scenicq.forest.temporal import (
    Always,
    And,
    Atom,
    Dynamics,
    Eventually,
    Formula,
    Next,
    Until,
)

__all__ = ["RequiredAtoms"]


@dataclass(frozen=True, slots=True)
class RequiredAtoms:
    """Atoms that runs which match need; there may be more that they need.

    Attributes:
        at_start: Those that hold at the first sample.
        always: Those that hold at all samples.
        later: Those that hold at some sample.
        ends: Where no monitor ends a run: those of which one holds at the last sample, unless its time is over there.
        within_s: After how many seconds a run ends; None where no time ends it.
    """

    at_start: tuple[Atom, ...]
    always: tuple[Atom, ...]
    later: tuple[Atom, ...]
    ends: tuple[Atom, ...]
    within_s: float | None

    @classmethod
    def of(cls, dynamics: Dynamics) -> RequiredAtoms:
        """Read them off a program."""
        when: dict[str, list[Atom]] = {"now": [], "always": [], "later": []}
        stack: list[tuple[Formula, str]] = [(each.formula, "now") for each in dynamics.requirements]
        while stack:
            formula, at = stack.pop()
            match formula:
                case Atom():
                    when[at].append(formula)
                case Always():
                    stack.append((formula.operand, "always" if at == "now" else at))
                case And():
                    stack += [(each, at) for each in formula.operands]
                case Eventually() | Next():
                    stack.append((formula.operand, "later"))
                case Until():
                    stack.append((formula.right, "later"))
                case _:
                    pass
        monitored = any(each.terminates for each in dynamics.processes)
        ends = tuple(each.condition for each in dynamics.terminations if each.condition is not None)
        now, always, later = (tuple(when[at]) for at in ("now", "always", "later"))
        return cls(now, always, later, () if monitored else ends, dynamics.time_limit_s)
