"""A scenario as constraints on a label: which features are compared, which requirements hold, in groups.

Depends on what label objects observe (their *signature*), not on their values, so it is done once per scenario.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Container, Mapping
from dataclasses import replace

from scenicq.forest import build
from scenicq.forest.among import asks_others
from scenicq.forest.collisions import boxes, no_overlap
from scenicq.forest.condition import expand
from scenicq.forest.groups import PARAMS, Comparison, Condition, Constraint, Group, group_constraints
from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, WHO, Among, Feature, Node
from scenicq.forest.scenario import BuiltIn, Requirement, Scenario, ScenarioObject
from scenicq.forest.unobserved import certain_and_possible, is_only_observed, is_open, with_any_value
from scenicq.forest.walk import features, postorder
from scenicq.match.options import MatchOptions

__all__ = ["Signature", "build_groups", "describe_constraint", "relevant_properties", "unobserved_motion"]

Signature = tuple[frozenset[str], ...]
"""What is observed of each object of the scenario, by index; of the parameters at the end."""

_ALWAYS = ("position", "heading")


def relevant_properties(scenario: Scenario, options: MatchOptions) -> tuple[frozenset[str], ...]:
    """For each object, the properties for which it matters whether a label observes them.

    They are those that are compared, and those that what is compared or required is computed of.
    """
    used: dict[int, set[str]] = {owner.index: set[str]() for owner in scenario.objects}
    conditions = [requirement.condition for requirement in scenario.requirements]
    todo = list(features(*conditions, *(given.value for given in scenario.params.values())))
    for owner in scenario.objects:
        named = [*_ALWAYS, *(name for name, given in owner.properties.items() if given.explicit)]
        sizes = ("width", "length") if BuiltIn.COLLISION in options.enforce else ()
        todo += [(owner.index, name) for name in (*named, *sizes)]
    while todo:
        index, name = todo.pop()
        if name not in (*WHO, *used[index]):
            used[index].add(name)
            given = scenario.objects[index].properties.get(name)
            todo += features(given.value) if given is not None else ()
    return tuple(frozenset(used[owner.index]) for owner in scenario.objects)


def _definition(scenario: Scenario, signature: Signature, feature: Feature, *, noisy: bool = False) -> Node | None:
    """The expression of a feature that is not observed (or, unless `noisy`, whose observed value has noise added).

    None for one that is, and for what is only ever observed.
    """
    owner = scenario.objects[feature.object]
    said = "heading" if feature.property in (GOING, LAST_LANE) else feature.property
    hidden = said in owner.mutated and not noisy
    if feature.property in WHO or (feature.property in signature[feature.object] and not hidden):
        return None
    if is_only_observed(scenario, feature.object, feature.property):
        return None
    return owner.properties[feature.property].value


def compared_properties(owner: ScenarioObject, seen: frozenset[str]) -> list[str]:
    """The properties of an object that are compared with the label, in the order in which they are checked."""
    always = [name for name in _ALWAYS if name in seen and name not in owner.mutated]
    others = sorted(
        name for name, given in owner.properties.items() if name in seen and name not in _ALWAYS and given.explicit
    )
    return always + others


def build_groups(scenario: Scenario, signature: Signature, options: MatchOptions) -> tuple[Group, ...]:
    """The scenario's groups of jointly dependent constraints, in dependency order.

    Args:
        scenario: The scenario.
        signature: What is observed.
        options: Which built-in requirements are in force, which parameters are ignored.
    """

    def observed(root: Node) -> Node:
        return expand(root, lambda feature: _definition(scenario, signature, feature))

    def after_noise(root: Node) -> Node:
        # built-in requirements are checked once the noise is added (language paper, figure 11)
        return expand(root, lambda feature: _definition(scenario, signature, feature, noisy=True))

    found: list[Constraint] = []
    for name in sorted(signature[PARAMS] & scenario.params.keys() - options.ignore_params):
        given = scenario.params[name]
        if given.explicit:
            found.append(Comparison(PARAMS, name, observed(given.value), given.span))
    for owner in scenario.objects:
        for name in compared_properties(owner, signature[owner.index]):
            given = owner.properties[name]
            found.append(Comparison(owner.index, name, observed(given.value), given.span))
    for requirement in scenario.requirements:
        if requirement.built_in is None:
            found.append(Condition(requirement, observed(requirement.condition)))
        elif requirement.built_in in options.enforce:
            found.append(Condition(requirement, after_noise(requirement.condition)))
    if BuiltIn.COLLISION in options.enforce:
        frames = boxes(scenario)
        for first, second in itertools.combinations(scenario.solid, 2):
            requirement = no_overlap(scenario, frames, first, second)
            found.append(Condition(requirement, after_noise(requirement.condition)))

    def unobserved(feature: Feature | Among) -> bool:
        if isinstance(feature, Among):
            return False
        only = is_only_observed(scenario, feature.object, feature.property)
        return only and feature.property not in signature[feature.object]

    return tuple(_with_doubts(group, unobserved) for group in group_constraints(found))


def _with_doubts(group: Group, unobserved: Callable[[Feature | Among], bool]) -> Group:
    """A group whose constraints read only what is known; see `Group.certain`."""
    doubtful = [
        item for item in group.constraints if any(is_open(node, unobserved) for node in postorder((item.expression,)))
    ]
    if not doubtful:
        return group
    certain, possible = list[Constraint](), list[Constraint]()
    for item in group.constraints:
        if item not in doubtful:
            certain.append(item)
            possible.append(item)
            continue
        if isinstance(item, Condition):
            sure, may = certain_and_possible(item.expression, unobserved)
            certain.append(Condition(item.requirement, sure))
            possible.append(Condition(item.requirement, may))
        else:
            # no value of what is compared is known to be the label's
            certain.append(Condition(Requirement(item.expression, item.span), build.constant(False)))
            possible.append(replace(item, expression=with_any_value(item.expression, unobserved)))
    return replace(group, constraints=tuple(possible), doubtful=tuple(doubtful), certain=tuple(certain))


def unobserved_motion(scenario: Scenario, seen: Mapping[int, Container[str]], constraint: Constraint) -> str:
    """What a constraint reads and no label tells, such as `ego.speed is not observed`.

    Args:
        scenario: The scenario.
        seen: The properties that are observed of each object, by index.
        constraint: The constraint.
    """
    read = sorted(features(constraint.expression))
    names = [
        f"{scenario.objects[index].name}.{name}"
        for index, name in read
        if index in seen and name not in seen[index] and is_only_observed(scenario, index, name)
    ]
    if names:
        return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'} not observed"
    if asks_others(constraint.expression):
        return "of other label objects not all that counts is observed"
    on = {scenario.objects[index].name for index, name in read if name == COURSE}
    return f"where on the course of {' and '.join(sorted(on))} it is, is not known" if on else ""


def describe_constraint(scenario: Scenario, constraint: Constraint) -> str:
    """A constraint in the words of the program."""
    if isinstance(constraint, Comparison):
        if constraint.object == PARAMS:
            return f"param {constraint.property}"
        return f"{scenario.objects[constraint.object].name}.{constraint.property}"
    requirement = constraint.requirement
    names = " and ".join(scenario.objects[index].name for index in requirement.objects)
    if requirement.built_in is not None:
        return f"{requirement.built_in.value} of {names}"
    if requirement.span is None:
        return "requirement"
    return " ".join(requirement.span.text.split())
