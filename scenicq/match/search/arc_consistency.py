"""Candidates removed by necessary conditions of pairs, before any group is decided (arc consistency)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import Value
from scenicq.limits import LIMITS
from scenicq.match.problem.candidates import LabelProblem
from scenicq.match.search.group_plan import GroupPlan, MatchPlan
from scenicq.match.tolerance import Tolerance

__all__ = ["arc_consistent"]


def arc_consistent(
    plan: MatchPlan, candidates: Mapping[int, tuple[int, ...]], problem: LabelProblem, ego: int, tolerance: Tolerance
) -> tuple[dict[int, tuple[int, ...]], tuple[int, GroupPlan] | None]:
    """Candidates that no group about one or two objects excludes by intervals alone (arc consistency).

    Args:
        plan: The groups.
        candidates: For each object but the ego, the label objects that it may be.
        problem: The label.
        ego: Index of the ego in the scenario.
        tolerance: Per feature.

    Returns:
        The candidates that are left, and an object that has none with the group that took the last one, if there is
        one.
    """
    columns = _Columns(problem, plan, ego)
    alive = {index: np.ones(len(numbers), dtype=bool) for index, numbers in candidates.items()}
    pairs: list[tuple[GroupPlan, NDArray[np.bool_]]] = []
    known: dict[tuple[int, tuple[tuple[int, ...], ...]], Any] = {}
    for group in [*(each for found in plan.unary.values() for each in found), *plan.joint]:
        if group.relaxation is None or len(group.roles) > LIMITS.arc_roles:
            continue
        options = tuple(candidates[index] for index in group.roles)
        if (group.kind, options) not in known:
            known[group.kind, options] = group.relaxation.possible(columns.of(group, options), tolerance)
        answer: Any = known[group.kind, options]
        if len(group.roles) == 1:
            alive[group.roles[0]] &= np.broadcast_to(answer, len(options[0]))
            if not alive[group.roles[0]].any():
                return {}, (group.roles[0], group)
        elif not np.all(answer):
            matrix = np.broadcast_to(answer, (len(options[0]), len(options[1])))
            pairs.append((group, matrix))
    failed = _propagate(alive, pairs)
    left = {index: tuple(np.array(numbers, dtype=int)[alive[index]].tolist()) for index, numbers in candidates.items()}
    return left, failed


def _propagate(
    alive: dict[int, NDArray[np.bool_]], pairs: Sequence[tuple[GroupPlan, NDArray[np.bool_]]]
) -> tuple[int, GroupPlan] | None:
    """Drop candidates without a partner in some pair, until nothing changes or an object has none."""
    left = {index: int(each.sum()) for index, each in alive.items()}
    seen: list[tuple[int, int] | None] = [None] * len(pairs)
    changed = True
    while changed:
        changed = False
        for place, (group, matrix) in enumerate(pairs):
            first, second = group.roles
            if seen[place] == (left[first], left[second]):
                # candidates are only dropped, so nothing is new
                continue
            one, other = alive[first], alive[second]
            supported = one & matrix[:, other].any(axis=1)
            backed = other & matrix[supported].any(axis=0)
            counts = int(supported.sum()), int(backed.sum())
            if counts != (left[first], left[second]):
                alive[first], alive[second] = supported, backed
                left[first], left[second] = counts
                changed = True
                if not counts[0]:
                    return first, group
            seen[place] = counts
    return None


class _Columns:
    """Observed values as arrays over the candidates of a group's roles."""

    def __init__(self, problem: LabelProblem, plan: MatchPlan, ego: int) -> None:
        self.problem = problem
        self.plan = plan
        self.ego = ego
        self.columns: dict[tuple[tuple[int, ...], str], Any] = {}

    def of(self, group: GroupPlan, options: tuple[tuple[int, ...], ...]) -> _Lookup:
        return _Lookup(self, group, options)

    def column(self, numbers: tuple[int, ...], name: str) -> Any:
        """Values of one property: an array, a pair of arrays, or None if they are no numbers."""
        if (numbers, name) not in self.columns:
            self.columns[numbers, name] = _stacked([self.problem.seen[number][name] for number in numbers])
        return self.columns[numbers, name]


class _Lookup:
    """What is observed of the objects of one group."""

    def __init__(self, columns: _Columns, group: GroupPlan, options: tuple[tuple[int, ...], ...]) -> None:
        self.columns = columns
        self.group = group
        self.options = options

    def __call__(self, index: int, name: str) -> Any:
        if index == PARAMS:
            return _number(self.columns.problem.params.get(name))
        if name not in self.columns.plan.signature[index]:
            return None
        if index == self.columns.ego:
            return _number(self.columns.problem.seen[self.columns.problem.ego][name])
        role = self.group.roles.index(index)
        found = self.columns.column(self.options[role], name)
        if found is None or len(self.options) == 1:
            return found
        axis = 1 - role
        if isinstance(found, tuple):
            return tuple(np.expand_dims(part, axis) for part in cast("tuple[Any, Any]", found))
        return np.expand_dims(found, axis)


def _number(value: Value) -> Any:
    if isinstance(value, bool):
        return None
    return value if isinstance(value, float | tuple) else None


def _stacked(values: Sequence[Value]) -> Any:
    if all(isinstance(value, tuple) for value in values):
        xy = np.array(values, dtype=float).reshape(-1, 2)
        return (xy[:, 0], xy[:, 1])
    if all(isinstance(value, float) for value in values):
        return np.array(values, dtype=float)
    return None
