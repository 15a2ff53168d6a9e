"""A second look at what a solver did not decide in its time: the same question cell by cell.

A solver that gets lost among the cells of a map, or the directions at a point, often decides each of them at once.
"""

from __future__ import annotations

from scenicq.budget import clock
from scenicq.forest.nodes import LogicOp
from scenicq.limits import LIMITS
from scenicq.smt.answer import Answer, NoAnswer, Sat, Solver, Unsat
from scenicq.smt.problem import Problem
from scenicq.smt.terms import conjunction, parts

__all__ = ["cases", "check_by_cases"]


def cases(problem: Problem) -> list[Problem]:
    """The problem split by its widest disjunction, so that it has a solution if one of these has; empty without one."""
    wholes = parts(LogicOp.AND, problem.constraint)
    choices = {number: parts(LogicOp.OR, whole) for number, whole in enumerate(wholes)}
    choices = {number: options for number, options in choices.items() if 1 < len(options) <= LIMITS.split_cases}
    if not choices:
        return []
    chosen = max(choices, key=lambda number: len(choices[number]))
    rest = [whole for number, whole in enumerate(wholes) if number != chosen]
    return [Problem(problem.variables, conjunction([*rest, option])) for option in choices[chosen]]


def check_by_cases(solver: Solver, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Decide a problem, case by case where the solver uses up its time or its budget on the whole.

    Takes no more than twice the time, however many cases there are.

    Args:
        solver: The solver.
        problem: See `Solver.check`.
        precision: See `Solver.check`.
        timeout_s: See `Solver.check`; for the whole, and once more for all cases together.
    """
    answer = solver.check(problem, precision=precision, timeout_s=timeout_s)
    if not isinstance(answer, NoAnswer) or answer.reason not in ("timeout", "budget"):
        return answer
    waiting = cases(problem)
    if not waiting:
        return answer
    deadline = clock() + timeout_s
    decided = True
    while waiting:
        left_s = deadline - clock()
        if left_s <= 0:
            return answer
        case = waiting.pop(0)
        found = solver.check(case, precision=precision, timeout_s=left_s / (len(waiting) + 1))
        if isinstance(found, Sat):
            return found
        decided = decided and isinstance(found, Unsat)
    return Unsat() if decided else answer
