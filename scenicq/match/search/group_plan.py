"""What matching can know of a scenario before it sees a label: its groups, sorted, with their shapes and twins."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass

from scenicq.forest.among import asks_others
from scenicq.forest.groups import Group
from scenicq.forest.nodes import Node
from scenicq.forest.scenario import Scenario
from scenicq.match.decide.closed_form import ClosedForm
from scenicq.match.decide.closed_forms import closed_form_of
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import Signature, build_groups
from scenicq.match.problem.subgroups import subgroups_of
from scenicq.match.problem.symmetry import GroupShape, interchangeable, shape_of
from scenicq.match.search.interval_relaxation import Relaxation

__all__ = ["GroupPlan", "MatchPlan", "make_plan"]


@dataclass(frozen=True, slots=True, eq=False)
class GroupPlan:
    """A group with its shape.

    Attributes:
        group: The group.
        kind: Number of its shape: equal for groups that ask the same question of their roles.
        roles: The objects that it is about, the ego left out, in the order in which the question speaks of them.
        closed_form: Its closed form, if it has one.
        parts: What a group about many objects demands of one or two of them.
        relaxation: Its necessary conditions.
    """

    group: Group
    kind: int
    roles: tuple[int, ...]
    closed_form: ClosedForm | None = None
    parts: tuple[GroupPlan, ...] = ()
    relaxation: Relaxation | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MatchPlan:
    """A scenario's groups for one signature, sorted by how many objects they are about.

    Attributes:
        groups: All of them, in dependency order.
        ego_only: Those about the ego and parameters alone.
        unary: Those about one object and the ego, by that object.
        joint: Those about several objects, and those that ask of label objects without a role.
        twins: For an object, an earlier one that is interchangeable with it.
        links: For an object, those that it shares a group with.
        signature: What is observed.
    """

    groups: tuple[GroupPlan, ...]
    ego_only: tuple[GroupPlan, ...]
    unary: Mapping[int, tuple[GroupPlan, ...]]
    joint: tuple[GroupPlan, ...]
    twins: Mapping[int, int]
    links: Mapping[int, frozenset[int]]
    signature: Signature


def make_plan(scenario: Scenario, signature: Signature, options: MatchOptions, kinds: dict[Hashable, int]) -> MatchPlan:
    """Analyse a scenario for what is observed.

    Args:
        scenario: The scenario.
        signature: What is observed.
        options: Which built-in requirements are in force, which parameters are ignored, the scopes of the tolerance.
        kinds: Numbers of shapes, extended as new ones are met.
    """
    shapes: list[GroupShape] = []
    groups: list[GroupPlan] = []
    links: dict[int, set[int]] = {}
    built = build_groups(scenario, signature, options)
    for group in built:
        shape = shape_of(group, scenario.ego, options.tolerance)
        shapes.append(shape)
        parts: list[GroupPlan] = []
        for part in subgroups_of(group, scenario.ego):
            small = shape_of(part, scenario.ego, options.tolerance)
            number = kinds.setdefault(small.key, len(kinds))
            small_form = None if asks_others(*_expressions(part)) else closed_form_of(part, scenario.ego)
            parts.append(GroupPlan(part, number, small.roles, small_form))
        number = kinds.setdefault(shape.key, len(kinds))
        form = None if group.doubtful or asks_others(*_expressions(group)) else closed_form_of(group, scenario.ego)
        groups.append(GroupPlan(group, number, shape.roles, form, tuple(parts), Relaxation.of(group)))
        paired = [part.roles for part in parts if len(part.roles) > 1]
        # of a chain, the next one is what can be checked next
        chained = set(shape.roles) == {index for roles in paired for index in roles}
        for roles in paired if chained else [shape.roles]:
            for index in roles:
                links.setdefault(index, set()).update(roles)
    unary: dict[int, list[GroupPlan]] = {}
    # what is asked of all label objects comes last, and only of those that are tried
    late = {each for each in groups if each.roles and asks_others(*_expressions(each.group))}
    for each in groups:
        if len(each.roles) == 1 and each not in late:
            unary.setdefault(each.roles[0], []).append(each)
    return MatchPlan(
        tuple(groups),
        tuple(each for each in groups if not each.roles),
        {index: tuple(found) for index, found in unary.items()},
        tuple(each for each in groups if len(each.roles) > 1 or each in late),
        interchangeable(scenario, built, shapes, options.tolerance),
        {index: frozenset(others - {index}) for index, others in links.items()},
        signature,
    )


def _expressions(group: Group) -> list[Node]:
    return [each.expression for each in group.constraints]
