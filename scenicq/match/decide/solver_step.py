"""Groups put to a solver: the last step of the cascade.

The built-in solver is branch and prune over boxes (`fields/branch_and_prune`). Another one is asked a formula, and its
witness is checked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from scenicq.budget import waiting
from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import Constant, Identity, Leaf, Node, Value
from scenicq.forest.walk import deciding_first
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import Item, condition_items, options_of
from scenicq.match.problem.evaluation import holds, replay
from scenicq.match.problem.outcome import Outcome, Refuted, Satisfied, Undecided

if TYPE_CHECKING:  # takes long to load, and most queries ask no solver
    from scenicq.smt.answer import Solver
    from scenicq.smt.encode import Encoding, Target

__all__ = ["AskSolver", "ask", "discrete_options", "encode_groups"]

_REFINED = 100.0


class AskSolver(Protocol):
    """Has groups decided together by a solver."""

    def __call__(self, items: Sequence[Sequence[Item]], doubt: Undecided | None = None) -> Outcome:
        """Decide groups; arguments as of `ask`."""
        ...


def encode_groups(items: Sequence[Sequence[Item]], options: MatchOptions, *, borders: bool = True) -> Encoding:
    """Groups as one problem for a solver.

    Args:
        items: The groups after conditioning.
        options: The options.
        borders: As of `encode`.

    Raises:
        CannotEvaluate: A construct has no formula.
    """
    from scenicq.smt.encode import encode  # noqa: PLC0415 - takes long to load

    targets = [[(_target_of(c, options), node, value) for c, node, value in group] for group in items]
    return encode(targets, borders=borders)


def ask(
    items: Sequence[Sequence[Item]], options: MatchOptions, solver: Solver | None, doubt: Undecided | None = None
) -> Outcome:
    """Decide groups together by a solver.

    Args:
        items: The groups after conditioning.
        options: The options.
        solver: The solver; None for the built-in one, which also decides where the solver does not load.
        doubt: What the built-in solver has left undecided, if it was asked.
    """
    if solver is None or not solver.loads():
        from scenicq.match.fields.branch_and_prune import branch_and_prune  # noqa: PLC0415 - takes long to load

        return doubt or branch_and_prune([item for group in items for item in group], options.tolerance)
    return _ask_for_each(items, options, solver)


def _ask_for_each(items: Sequence[Sequence[Item]], options: MatchOptions, solver: Solver) -> Outcome:
    """Ask for one outcome of the discrete variables after the other, if there are few."""
    known = discrete_options([node for group in items for _, node, _ in group])
    if not known or math.prod(len(numbers) for _, numbers in known) > LIMITS.asked_outcomes:
        return _ask_once(items, options, solver)
    blamed: Outcome = Refuted(next(constraint for group in items for constraint, _, _ in group))
    todo: list[tuple[Sequence[Sequence[Item]], dict[Identity, Value]]] = [(items, {})]
    while todo:
        asked, given = todo.pop()
        open_ = discrete_options([node for group in asked for _, node, _ in group])
        ground = [item for group in asked for item in group if isinstance(item[1], Constant)]
        lost = next((c for c, node, seen in ground if not _is_met(c, node, seen, options)), None)
        if lost is not None:
            blamed = blamed if isinstance(blamed, Undecided) else Refuted(lost)
            continue
        if not open_:
            rest = [[item for item in group if not isinstance(item[1], Constant)] for group in asked]
            rest = [group for group in rest if group]
            outcome = _ask_once(rest, options, solver) if rest else Satisfied({})
            if isinstance(outcome, Satisfied):
                return Satisfied({**outcome.values, **given})
            blamed = blamed if isinstance(blamed, Undecided) else outcome
            continue
        leaf, numbers = open_[0]
        for number in reversed(numbers):
            chosen: dict[Identity, Value] = {leaf.identity: float(number)}
            memo: dict[int, Node] = {}
            todo.append(([condition_items(group, chosen, memo=memo) for group in asked], given | chosen))
    return blamed


def _is_met(constraint: Constraint, node: Node, seen: Value, options: MatchOptions) -> bool:
    return isinstance(node, Constant) and holds(constraint, node.value, seen, options.tolerance)


def discrete_options(roots: Sequence[Node]) -> list[tuple[Leaf, range]]:
    """The discrete variables of expressions whose options are known; those that decide which others matter first."""
    found = [(leaf, options_of(leaf)) for leaf in deciding_first(roots)]
    return [(leaf, options) for leaf, options in found if options is not None]


def _ask_once(items: Sequence[Sequence[Item]], options: MatchOptions, solver: Solver) -> Outcome:
    """Decide groups by one question; a witness that does not replay is repaired, refined, then given up."""
    flat = [item for group in items for item in group]
    blame = flat[0][0]
    from scenicq.match.fields.field_solver import repair_solution  # noqa: PLC0415 - these take long to load
    from scenicq.smt.answer import NoAnswer, Sat, Unsat  # noqa: PLC0415
    from scenicq.smt.case_split import check_by_cases  # noqa: PLC0415

    try:
        encoding = encode_groups(items, options, borders=False)
    except CannotEvaluate as error:
        return Undecided(blame, f"unsupported: {error}")
    precision = options.precision
    for attempt in range(LIMITS.solver_attempts):
        if attempt == 1:
            # what was left out to keep the question small may be what the witness breaks
            encoding = encode_groups(items, options)
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
                close = repair_solution(flat, values, options.tolerance)
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
