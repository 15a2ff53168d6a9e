"""Groups put to a solver, and its answer checked: the last step of the cascade."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from scenicq.budget import waiting
from scenicq.forest.groups import Comparison, Constraint
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided

if TYPE_CHECKING:  # takes long to load, and most queries ask no solver
    from scenicq.smt.answer import Solver
    from scenicq.smt.encode import Encoding, Target

__all__ = ["ask", "encoded"]

_ATTEMPTS = 3
_REFINED = 100.0


def encoded(items: Sequence[Sequence[Item]], options: MatchOptions, *, borders: bool = True) -> Encoding:
    """Groups as one problem for a solver.

    Args:
        items: The groups after conditioning.
        options: The options.
        borders: As of `encode`.

    Raises:
        UnsupportedError: A construct has no formula.
    """
    from scenicq.smt.encode import encode  # noqa: PLC0415 - takes long to load

    targets = [[(_target_of(c, options), node, value) for c, node, value in group] for group in items]
    return encode(targets, borders=borders)


def ask(items: Sequence[Sequence[Item]], options: MatchOptions, solver: Solver | None) -> Outcome:
    """Decide groups together by a solver; a witness that does not replay is repaired, refined, then given up.

    Args:
        items: The groups after conditioning.
        options: The options.
        solver: The solver, if there is one.
    """
    flat = [item for group in items for item in group]
    blame = flat[0][0]
    if solver is None:
        return Undecided(blame, "no solver")  # without encoding: cells of fields take seconds
    from scenicq.match.fields.field_solver import repaired  # noqa: PLC0415 - these take long to load
    from scenicq.smt.answer import NoAnswer, Sat, Unsat  # noqa: PLC0415
    from scenicq.smt.case_split import check_by_cases  # noqa: PLC0415
    from scenicq.smt.encode import UnsupportedError  # noqa: PLC0415

    try:
        encoding = encoded(items, options, borders=False)
    except UnsupportedError as error:
        return Undecided(blame, f"unsupported: {error}")
    precision = options.precision
    for attempt in range(_ATTEMPTS):
        if attempt == 1:
            # what was left out to keep the question small may be what the witness breaks
            encoding = encoded(items, options)
        with waiting(options.timeout_s) as left_s:
            answer = check_by_cases(solver, encoding.problem, precision=precision, timeout_s=left_s)
        match answer:
            case Unsat():
                return Refuted(blame)
            case NoAnswer():
                return Undecided(blame, answer.reason)
            case Sat():
                values = encoding.values(answer.witness)
                if replay(flat, values, options.tolerance, options.precision):
                    return Satisfied(values)
                close = repaired(flat, values, options.tolerance)
                if close is not None:
                    return close
        precision /= _REFINED
    return Undecided(blame, "precision")


def _target_of(constraint: Constraint, options: MatchOptions) -> Target:
    """How a constraint's expression is compared with the label."""
    from scenicq.smt.encode import Target  # noqa: PLC0415 - takes long to load

    if not isinstance(constraint, Comparison):
        return Target(None, 0.0, 0.0)
    margin = options.tolerance.of(constraint.object, constraint.property)
    match margin.kind:
        case "box":
            return Target("box", margin.size, margin.y)
        case "arc":
            return Target("angle", margin.size, 0.0)
        case "disc" | "interval":
            return Target("disc", margin.size, 0.0)
