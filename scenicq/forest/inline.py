"""A scenario as expressions over random variables alone: what has to be drawn, and what must hold of it.

References to properties are replaced by their definitions, mutation noise is written out, and requirements are split at
`and`. Built-in requirements see the objects after the noise, all others before (language paper, figure 11).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass

from scenicq.errors import CannotEvaluate, Span
from scenicq.forest import build
from scenicq.forest.angle_wrap import one_turn
from scenicq.forest.collisions import apart, boxes
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

__all__ = ["Assembled", "Check", "assemble"]

Key = tuple[int, str]


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """Something that must hold of a scene.

    Attributes:
        condition: Over random variables; a truth value, or with `defined` anything.
        source: What it is part of, to be named in messages.
        text: What it is, in the words of the program.
        span: Where the program says it.
        defined: Whether the condition need only have a value.
        probability: With which it must hold.
        built_in: Which built-in requirement it is part of, if any.
    """

    condition: Node
    source: int
    text: str
    span: Span | None
    defined: bool = False
    probability: float = 1.0
    built_in: BuiltIn | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """What has to be drawn for a scene, over random variables.

    Attributes:
        values: The expression of each property of each object, noise included.
        params: The expressions of the global parameters.
        checks: What must hold, as few conditions in each as possible.
    """

    values: Mapping[Key, Node]
    params: Mapping[str, Node]
    checks: tuple[Check, ...]


def assemble(scenario: Scenario, enforce: Set[BuiltIn]) -> Assembled:
    """A scenario's expressions over random variables.

    Args:
        scenario: The scenario.
        enforce: The built-in requirements in force; what the author writes always is.
    """
    definitions = _Definitions()
    plain = _plain(scenario, definitions)
    noise = {key: node for owner in scenario.objects if owner.mutated for key, node in _noise(owner, plain)}
    before, after = definitions.into, definitions.into_with(noise) if noise else definitions.into
    params = {name: before(given.value) for name, given in scenario.params.items()}
    checks: list[Check] = []
    for owner in scenario.objects:
        for name in ("position", "heading"):
            given = owner.properties[name]
            span = given.span if given.explicit else owner.span
            text = f"the {name} of `{owner.name}`"
            checks.append(Check(plain[owner.index, name], -1 - owner.index, text, span, defined=True))
    for number, each in enumerate(_requirements(scenario, enforce)):
        into = before if each.built_in is None else after
        text = _told(scenario, each)
        # a library's default says nothing to the author: the object is to blame
        span = each.span if each.built_in is None else scenario.objects[each.objects[-1]].span
        checks += (
            Check(part, number, text, span, probability=each.probability, built_in=each.built_in)
            for part in conjuncts(into(each.condition))
        )
    return Assembled(plain | noise, params, tuple(checks))


def _requirements(scenario: Scenario, enforce: Set[BuiltIn]) -> Iterator[Requirement]:
    for each in (*scenario.requirements, *scenario.soft):
        if each.built_in is None or each.built_in in enforce:
            yield each
    if BuiltIn.COLLISION in enforce:
        frames = boxes(scenario)
        for first, second in itertools.combinations(scenario.solid, 2):
            yield apart(scenario, frames, first, second)


def _told(scenario: Scenario, requirement: Requirement) -> str:
    if requirement.built_in is not None:
        names = " and ".join(f"`{scenario.objects[index].name}`" for index in requirement.objects)
        return f"the {requirement.built_in.value} of {names}"
    return "a requirement" if requirement.span is None else f"`{' '.join(requirement.span.text.split())}`"


class _Definitions:
    """Properties by their expressions over random variables; what is shared stays shared."""

    def __init__(self) -> None:
        self.found: dict[Key, Node] = {}
        self._memo: dict[int, Node] = {}
        # the memo goes by identity: what it knows must stay alive
        self._originals: list[Node] = []

    def into(self, root: Node) -> Node:
        """The expression with definitions in place of references."""
        self._originals.append(root)
        return transform(root, lambda node: _step(node, self.found), self._memo)

    def into_with(self, others: Mapping[Key, Node]) -> Callable[[Node], Node]:
        """The same, but with other definitions of some properties."""

        def into(root: Node) -> Node:
            self.into(root)
            memo: dict[int, Node] = {}
            changed: set[int] = set()
            for node in postorder((root,)):
                refers = isinstance(node, Feature) and (node.object, node.property) in others
                if refers or any(id(child) in changed for child in children(node)):
                    changed.add(id(node))
                else:
                    memo[id(node)] = self._memo[id(node)]
            return transform(root, lambda node: _step(node, others), memo)

        return into


def _step(node: Node, definitions: Mapping[Key, Node]) -> Node:
    if isinstance(node, Feature):
        return definitions.get((node.object, node.property), node)
    if isinstance(node, DirectionAt) and all(isinstance(child, Constant) for child in children(node)):
        return condition(node, {})
    try:
        return fold(node)
    except CannotEvaluate:
        return node


def _plain(scenario: Scenario, definitions: _Definitions) -> dict[Key, Node]:
    """The expression of each property, without noise; those that others refer to come first."""
    given = {
        (owner.index, name): one_turn(each.value) if name == "heading" and scenario.version == 3 else each.value
        for owner in scenario.objects
        for name, each in owner.properties.items()
    }
    found = definitions.found
    todo = list(reversed(given))
    while todo:
        key = todo[-1]
        missing = [each for each in features(given[key]) if each not in found and each in given]
        if key in found or not missing:
            if key not in found:
                found[key] = definitions.into(given[key])
            todo.pop()
        else:
            todo += sorted(missing)
    return {key: found[key] for key in given}


def _noise(owner: ScenarioObject, plain: Mapping[Key, Node]) -> Iterator[tuple[Key, Node]]:
    """Position and heading of a mutated object with the noise added (language paper, section 4.2)."""
    scale = plain[owner.index, "mutationScale"]

    def deviation(name: str) -> Node:
        return build.arithmetic(ArithmeticOp.MUL, plain[owner.index, name], scale, span=owner.span)

    def normal(spread: Node) -> Node:
        return Normal(build.constant(0.0), spread, span=owner.span)

    spread, turn = deviation("positionStdDev"), deviation("headingStdDev")
    position, heading = ((owner.index, name) for name in ("position", "heading"))
    yield position, build.vector_sum(plain[position], build.vector(normal(spread), normal(spread)))
    yield heading, build.add(plain[heading], normal(turn))
