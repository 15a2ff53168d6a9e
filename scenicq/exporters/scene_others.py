"""What is asked of label objects without a role, of a drawn scene: there are no others than those that play one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from scenicq.forest import build
from scenicq.forest.among import asks_others
from scenicq.forest.nodes import (
    ELEMENT,
    GIVEN,
    IDENTITY,
    OPEN,
    RANK,
    TRACK,
    Among,
    AmongOp,
    ArithmeticOp,
    CompareOp,
    Constant,
    Feature,
    LogicOp,
    Node,
    Select,
    Undefined,
)
from scenicq.forest.scenario import Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import transform
from scenicq.store.classes import class_truth

__all__ = ["of_its_objects"]


def of_its_objects(scenario: Scenario) -> Scenario:
    """A scenario of which scenes can be drawn: what it asks of label objects is asked of its own objects."""
    if not asks_others(*(each.condition for each in (*scenario.requirements, *scenario.soft))):
        return scenario

    def asked(requirement: Requirement) -> Requirement:
        return replace(requirement, condition=_of_roles(requirement.condition, scenario.objects))

    written = None if scenario.as_written is None else of_its_objects(scenario.as_written)
    requirements, soft = (tuple(map(asked, each)) for each in (scenario.requirements, scenario.soft))
    return replace(scenario, requirements=requirements, soft=soft, as_written=written)


def _of_roles(root: Node, objects: Sequence[ScenarioObject]) -> Node:
    def step(node: Node) -> Node:
        if isinstance(node, Among):
            return _value(node, objects)
        who = isinstance(node, Feature) and node.object >= 0 and node.property in (IDENTITY, TRACK, RANK)
        return build.constant(cast(Feature, node).object) if who else node

    return transform(root, step)


def _value(node: Among, objects: Sequence[ScenarioObject]) -> Node:
    """A node as an expression over objects; those left out are known by now."""
    out = {each.value for each in node.inputs[: node.excluded] if isinstance(each, Constant)}
    roles = [o for o in objects if o.index not in out and class_truth(node.category, o.category, "fine") == 2]

    def of(body: Node | None, index: int) -> Node:
        def step(each: Node) -> Node:
            if isinstance(each, Feature) and each.object == ELEMENT:
                if each.property == OPEN:
                    return build.constant(False)
                if each.property in (IDENTITY, TRACK, RANK):
                    return build.constant(index)
                return Feature(index, each.property, each.kind, span=each.span)
            given = isinstance(each, Feature) and each.object == GIVEN
            return node.inputs[node.excluded + int(cast(Feature, each).property)] if given else each

        assert body is not None
        return _of_roles(transform(body, step), objects)

    holds = [of(node.body.condition, each.index) for each in roles]
    if node.op is AmongOp.EVERY:
        return build.logic(LogicOp.AND, *holds, build.constant(True))
    if node.op is AmongOp.NEAREST:
        away = [of(node.body.distance, each.index) for each in roles]
        found: Node = build.constant(Undefined("no object of the scene counts"), node.span)
        for place, each in enumerate(roles):
            nearer = [
                build.logic(LogicOp.OR, build.opposite(holds[other]), build.compare(CompareOp.LE, away[place], far))
                for other, far in enumerate(away)
                if other != place
            ]
            first = build.logic(LogicOp.AND, holds[place], *nearer, build.constant(True))
            found = Select(first, (found, of(node.body.value, each.index)), span=node.span)
        return found
    total: Node = build.constant(0.0)
    for each in holds:
        one = Select(each, (build.constant(0.0), build.constant(1.0)))
        total = build.arithmetic(ArithmeticOp.ADD, total, one)
    if node.op is AmongOp.COUNT:
        return total
    return build.compare(CompareOp.GE, total, build.constant(float(node.number)))
