"""Rewrite a scenario to expressions over random variables alone: the values of a scene, and what must hold of it.

- A reference to a property becomes the property's definition.
- Mutation becomes noise that is added to position and heading.
- Requirements are split at `and`, so that what rejects a scene is as small as can be.

Built-in requirements see the objects after the noise, all others before it (language paper, figure 11).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass

from scenicq.errors import CannotEvaluate, Span
from scenicq.forest import build
from scenicq.forest.angle_wrap import one_turn
from scenicq.forest.collisions import boxes, no_overlap
from scenicq.forest.compute import fold
from scenicq.forest.condition import condition
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    DirectionAt,
    Feature,
    Node,
    Normal,
)
from scenicq.forest.scenario import BuiltIn, Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import children, conjuncts, features, postorder, transform

__all__ = ["Check", "InlinedScenario", "inline_scenario"]

_PropertyKey = tuple[int, str]
"""An object's index, and the name of a property."""


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """A condition that a scene must meet.

    Attributes:
        condition: An expression over random variables that must be true, or with `defined` only have a value.
        source: Number of the requirement that it is part of, from 0; below 0 for a position or heading of an object.
        text: The requirement, in the words of the program.
        span: Where the program states it.
        defined: Whether it is enough that the condition has a value, whichever it is.
        probability: The probability with which the condition must hold.
        built_in: The built-in requirement that it is part of; None for one that the author wrote.
    """

    condition: Node
    source: int
    text: str
    span: Span | None
    defined: bool = False
    probability: float = 1.0
    built_in: BuiltIn | None = None


@dataclass(frozen=True, slots=True, eq=False)
class InlinedScenario:
    """A scenario as expressions over random variables.

    Attributes:
        values: The properties of the objects, noise included, by the object's index and the property's name.
        params: The global parameters, by name.
        checks: The conditions that a scene must meet, each as small as can be.
    """

    values: Mapping[_PropertyKey, Node]
    params: Mapping[str, Node]
    checks: tuple[Check, ...]


def inline_scenario(scenario: Scenario, enforce: Set[BuiltIn]) -> InlinedScenario:
    """Rewrite a scenario to expressions over random variables.

    Args:
        scenario: The scenario.
        enforce: The built-in requirements that hold; what the author requires always holds.
    """
    definitions = _Definitions()
    plain = _inline_properties(scenario, definitions)
    noisy = {key: node for owner in scenario.objects if owner.mutated for key, node in _add_noise(owner, plain)}
    inline = definitions.inline
    inline_noisy = definitions.inliner_with(noisy) if noisy else inline
    params = {name: inline(param.value) for name, param in scenario.params.items()}
    checks: list[Check] = []
    for owner in scenario.objects:
        for name in ("position", "heading"):
            definition = owner.properties[name]
            span = definition.span if definition.explicit else owner.span
            text = f"the {name} of `{owner.name}`"
            checks.append(Check(plain[owner.index, name], -1 - owner.index, text, span, defined=True))
    for number, each in enumerate(_requirements(scenario, enforce)):
        inlined = inline(each.condition) if each.built_in is None else inline_noisy(each.condition)
        text = _requirement_text(scenario, each)
        # the library's line of a default says nothing to the author: blame the object
        span = each.span if each.built_in is None else scenario.objects[each.objects[-1]].span
        checks += (
            Check(part, number, text, span, probability=each.probability, built_in=each.built_in)
            for part in conjuncts(inlined)
        )
    return InlinedScenario(plain | noisy, params, tuple(checks))


def _requirements(scenario: Scenario, enforce: Set[BuiltIn]) -> Iterator[Requirement]:
    for each in (*scenario.requirements, *scenario.soft):
        if each.built_in is None or each.built_in in enforce:
            yield each
    if BuiltIn.COLLISION in enforce:
        frames = boxes(scenario)
        for first, second in itertools.combinations(scenario.solid, 2):
            yield no_overlap(scenario, frames, first, second)


def _requirement_text(scenario: Scenario, requirement: Requirement) -> str:
    if requirement.built_in is not None:
        names = " and ".join(f"`{scenario.objects[index].name}`" for index in requirement.objects)
        return f"the {requirement.built_in.value} of {names}"
    return "a requirement" if requirement.span is None else f"`{' '.join(requirement.span.text.split())}`"


class _Definitions:
    """The properties of a scenario as expressions over random variables; what expressions share stays shared."""

    def __init__(self) -> None:
        self.inlined: dict[_PropertyKey, Node] = {}
        self._memo: dict[int, Node] = {}
        # the memo goes by identity, so the nodes that it knows must stay alive
        self._originals: list[Node] = []

    def inline(self, root: Node) -> Node:
        """Put the definitions in place of references."""
        self._originals.append(root)
        return transform(root, lambda node: _inline_node(node, self.inlined), self._memo)

    def inliner_with(self, replacements: Mapping[_PropertyKey, Node]) -> Callable[[Node], Node]:
        """A function like `inline` that takes other definitions of some properties."""

        def inline(root: Node) -> Node:
            self.inline(root)
            # what refers to none of these properties is shared with the plain expression
            memo: dict[int, Node] = {}
            changed: set[int] = set()
            for node in postorder((root,)):
                refers = isinstance(node, Feature) and (node.object, node.property) in replacements
                if refers or any(id(child) in changed for child in children(node)):
                    changed.add(id(node))
                else:
                    memo[id(node)] = self._memo[id(node)]
            return transform(root, lambda node: _inline_node(node, replacements), memo)

        return inline


def _inline_node(node: Node, definitions: Mapping[_PropertyKey, Node]) -> Node:
    """A node whose children are inlined: its definition if it is a reference, its value if it is constant."""
    if isinstance(node, Feature):
        return definitions.get((node.object, node.property), node)
    if isinstance(node, DirectionAt) and all(isinstance(child, Constant) for child in children(node)):
        return condition(node, {})
    try:
        return fold(node)
    except CannotEvaluate:
        return node


def _inline_properties(scenario: Scenario, definitions: _Definitions) -> dict[_PropertyKey, Node]:
    """The expression of each property, without noise; properties that others refer to are inlined first."""
    written = {
        (owner.index, name): one_turn(each.value) if name == "heading" and scenario.version == 3 else each.value
        for owner in scenario.objects
        for name, each in owner.properties.items()
    }
    inlined = definitions.inlined
    todo = list(reversed(written))
    while todo:
        key = todo[-1]
        missing = [each for each in features(written[key]) if each not in inlined and each in written]
        if key in inlined or not missing:
            if key not in inlined:
                inlined[key] = definitions.inline(written[key])
            todo.pop()
        else:
            todo += sorted(missing)
    return {key: inlined[key] for key in written}


def _add_noise(owner: ScenarioObject, plain: Mapping[_PropertyKey, Node]) -> Iterator[tuple[_PropertyKey, Node]]:
    """Add the noise of mutation to an object's position and heading (language paper, section 4.2)."""
    scale = plain[owner.index, "mutationScale"]

    def deviation(name: str) -> Node:
        return build.arithmetic(ArithmeticOp.MUL, plain[owner.index, name], scale, span=owner.span)

    def normal(spread: Node) -> Node:
        return Normal(build.constant(0.0), spread, span=owner.span)

    spread, turn = deviation("positionStdDev"), deviation("headingStdDev")
    position, heading = ((owner.index, name) for name in ("position", "heading"))
    yield position, build.vector_sum(plain[position], build.vector(normal(spread), normal(spread)))
    yield heading, build.add(plain[heading], normal(turn))
