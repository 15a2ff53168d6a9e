"""The discrete choices that conditions over time depend on: each joint outcome makes a scenario without them.

The outcome of a choice is part of a run from its first sample on: one for the initial scene, all requirements, all that
ends a run and all monitors. So outcomes are split off before anything else is decided, and a recording matches if it
matches the scenario of one of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from scenicq.forest.bounds import Box, vector_bounds
from scenicq.forest.condition import condition, expand
from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import Constant, DirectionAt, Feature, Identity, Index, Leaf, Node, Select
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.simplify import rebuilt, roots_of
from scenicq.forest.temporal import Atom, TemporalRequirement
from scenicq.forest.unobserved import is_only_observed
from scenicq.forest.walk import children, deciding_first, features, leaves, postorder, transform
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.limits import LIMITS
from scenicq.match.problem.conditioned import options_of
from scenicq.match.verdict import WitnessValue
from scenicq.temporal.hidden import has_cuts
from scenicq.temporal.literals import literals_of
from scenicq.temporal.samples import is_moving

__all__ = ["Outcome", "outcomes_of", "place_of", "steady_value"]


@dataclass(eq=False)
class Outcome:
    """One joint outcome of choices.

    Attributes:
        whole: The scenario in which the choices are open.
        given: What was chosen.
        witness: That, by the places in the program.
        same_start: Whether the initial scene depends on none of the choices.
    """

    whole: Scenario
    given: Mapping[Identity, float] = field(default_factory=dict[Identity, float])
    witness: Mapping[str, WitnessValue] = field(default_factory=dict[str, WitnessValue])
    same_start: bool = True

    @cached_property
    def scenario(self) -> Scenario:
        """The scenario with the choices made: of many outcomes, few have a start in a recording."""
        memo = dict[int, Node]()
        made = rebuilt(self.whole, lambda node: condition(node, {}, self.given, memo)) if self.given else self.whole
        return _from_the_start(made)

    @cached_property
    def start_boxes(self) -> Mapping[int, Box]:
        """Where objects may be at the start, by object; what hangs on others, or has noise, may be anywhere."""
        return {
            owner.index: vector_bounds(condition(owner.properties["position"].value, {}, self.given))
            for owner in self.whole.objects
            if "position" in owner.properties and "position" not in owner.mutated
        }


def outcomes_of(scenario: Scenario) -> tuple[Outcome, ...]:
    """The joint outcomes of the choices that conditions over time depend on; one without choices if there are none.

    Args:
        scenario: The scenario as compiled.
    """
    whole = Outcome(scenario)
    dynamics = scenario.dynamics
    conditions = () if dynamics is None else dynamics.conditions
    initial = {leaf.identity for leaf in leaves(*roots_of(replace(scenario, dynamics=None)))}
    # a choice among elements has hundreds of options: what is asked of each is about the conditions alone
    roots = [expand(each, lambda feature: steady_value(scenario, feature)) for each in conditions]
    found: list[Outcome] = []
    stack = [(whole, roots)]
    while stack:
        outcome, roots = stack.pop()
        choice = _choice(roots)
        if choice is None:
            found.append(outcome)
            continue
        leaf, options = choice
        same_start = outcome.same_start and leaf.identity not in initial
        further: list[tuple[Outcome, list[Node]]] = []
        for option in options:
            given, memo = {leaf.identity: float(option)}, dict[int, Node]()
            made = Outcome(
                scenario, {**outcome.given, **given}, {**outcome.witness, place_of(leaf): float(option)}, same_start
            )
            further.append((made, [condition(root, {}, given, memo) for root in roots]))
        stack += reversed(further)
        if len(found) + len(stack) > LIMITS.outcomes_over_time:
            return (whole,)
    return tuple(found) or (whole,)


def place_of(leaf: Leaf) -> str:
    """Where the program says a random variable."""
    return leaf.span.mark if leaf.span else type(leaf).__name__


def steady_value(scenario: Scenario, feature: Feature) -> Node | None:
    """What the program says of a property that does not change, should no label tell."""
    if is_moving(feature.property) or is_only_observed(scenario, feature.object, feature.property):
        return None
    return scenario.every_object[feature.object].properties[feature.property].value


def _choice(roots: Sequence[Node]) -> tuple[Leaf, range] | None:
    """A choice that conditions over time depend on, written out, with its options."""
    # which of several elements lie at a hidden place is for the matcher to tell
    of_places = {
        node.index.identity
        for node in postorder(roots)
        if isinstance(node, Select) and isinstance(node.index, Index) and all(map(_is_hidden_lookup, node.options))
    }
    # a choice that decides which others matter comes first
    for leaf in deciding_first(roots):
        options = options_of(leaf)
        if options is not None and leaf.identity not in of_places:
            return leaf, options
    return None


def _is_hidden_lookup(node: Node) -> bool:
    return any(
        isinstance(each, DirectionAt)
        and isinstance(each.field, Constant)
        and isinstance(each.field.value, ElementAtPoint)
        for each in (node, *children(node))
    ) and bool(leaves(node))


def _from_the_start(scenario: Scenario) -> Scenario:
    """The scenario with requirements on its first sample among those over time, where both depend on a hidden number.

    What both say of the number is then decided together, exactly. The initial scene may leave these requirements out
    where nothing else in it depends on the numbers. Where both say the same condition or its negation, they come out
    together, too, even where nothing observes what the condition reads.
    """
    dynamics = scenario.dynamics
    if dynamics is None:
        return scenario

    def written_out(root: Node) -> Node:
        return expand(root, lambda feature: steady_value(scenario, feature))

    hidden = {leaf.identity for leaf in leaves(*map(written_out, dynamics.conditions))}
    nodes, requirements = list(dynamics.conditions), list(dynamics.requirements)
    left: list[Requirement] = []
    shared = set(map(id, _shared(scenario)))
    for each in scenario.requirements:
        read = {index for index, _ in features(each.condition)}
        plain = each.built_in is None and PARAMS not in read
        noisy = any(scenario.objects[index].mutated for index in read if index != PARAMS)
        said = written_out(each.condition) if plain and not noisy else each.condition
        own = {leaf.identity for leaf in leaves(said)}
        cuts = bool(own) and own <= hidden and has_cuts(said)
        if each.span is None or not plain or noisy or not (cuts or id(each) in shared):
            left.append(each)
            continue
        if not cuts:
            left.append(each)
        requirements.append(TemporalRequirement(Atom(len(nodes)), each.span))
        nodes.append(transform(each.condition, _at_sample))
    over_time = replace(dynamics, conditions=tuple(nodes), requirements=tuple(requirements))
    without = replace(scenario, requirements=tuple(left), dynamics=None)
    still = {leaf.identity for leaf in leaves(*roots_of(without))}
    needed = scenario.requirements if still & hidden else tuple(left)
    return replace(scenario, requirements=needed, dynamics=over_time)


def _shared(scenario: Scenario) -> list[Requirement]:
    """The requirements on the first sample, nothing of them random, that are a condition over time or its negation."""
    conditions = () if scenario.dynamics is None else scenario.dynamics.conditions
    known = [each for each in scenario.requirements if not leaves(each.condition)]
    literals = literals_of([*conditions, *(transform(each.condition, _at_sample) for each in known)])
    alike = Counter(literal.atom for literal in literals)
    return [each for each, own in zip(known, literals[len(conditions) :], strict=True) if alike[own.atom] > 1]


def _at_sample(node: Node) -> Node:
    """A feature as it is at a sample, which is the first one here."""
    return replace(node, current=True) if isinstance(node, Feature) else node
