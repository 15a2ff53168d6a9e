"""Which objects there are depends on how a run goes where scenarios begin in some runs alone: each case is a variant.

A variant has the objects of the scenarios that begin in its runs, and a run of it in which one of these does not begin
is none. What begins with the first sample belongs to the initial scene of the variant.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import cast

from scenicq.compiler.composition_graph import ARRIVES, ComposedScenario, Composition
from scenicq.compiler.values import fail
from scenicq.forest.nodes import CLOCK, PAST, Constant, Feature, Node
from scenicq.forest.scenario import Arrival, Requirement, Scenario, ScenarioObject
from scenicq.forest.simplify import rebuilt
from scenicq.forest.temporal import (
    Begin,
    Dynamics,
    End,
    Goto,
    IfRuns,
    Leave,
    Process,
    ProcessStep,
    PutBehavior,
    Reject,
    Stop,
    Terminate,
    Wait,
    successors,
)
from scenicq.forest.walk import features, transform
from scenicq.limits import LIMITS

__all__ = ["with_variants"]

_Begun = frozenset[int]


def with_variants(
    scenario: Scenario, composition: Composition, owners: Mapping[int, int], labels: Sequence[str],
    built_in: Callable[[int], Sequence[Requirement]],
) -> Scenario:  # fmt: skip
    """A scenario with its variants; with the objects that are there in all of them.

    Args:
        scenario: The scenario with all objects that there may be, without the built-in requirements.
        composition: What composes scenarios.
        owners: The number of the scenario that each requirement is of, by its id; not those of the program.
        labels: The variable that each object was given to first.
        built_in: The built-in requirements, for an ego by its index.

    Raises:
        ScenarioError: budget-exceeded, where there are too many; no-ego, where runs have none.
    """
    making = {each.number: each for each in composition.scenarios if each.objects}
    cases = _cases(composition, frozenset(making))
    of_top = composition.ego
    found = [
        _variant(scenario, making, case, ego, owners, labels, built_in(ego), needs=len(cases) > 1)
        for case in cases
        if (ego := _ego(making, case) if of_top is None else of_top) is not None
    ]
    if not found:
        raise fail("no-ego", "no scenario that begins with the first sample makes an ego", composition.process.span,
                   "sets up no ego", ("make the ego in its `setup` block",))  # fmt: skip
    if len(found) == 1:
        return found[0]
    common = frozenset.intersection(*cases)
    ego = _ego(making, common) if of_top is None else of_top
    if ego is None:
        # whoever it is, it is one of the class that they all are
        return replace(found[0], variants=tuple(found))
    base = _variant(scenario, making, common, ego, owners, labels, built_in(ego), needs=False)
    return replace(base, variants=tuple(found))


def _ego(making: Mapping[int, ComposedScenario], case: _Begun) -> int | None:
    """The ego that scenarios make which begin with the first sample; None if they make none."""
    made = (making[number].made.ego for number in sorted(case) if making[number].is_early)
    return next((each.index for each in made if each is not None), None)


def _cases(composition: Composition, making: _Begun) -> list[_Begun]:
    """The sets of scenarios that have begun where a run may wait or end, of those that make objects."""
    steps = composition.process.steps
    found: dict[_Begun, None] = {}
    seen: set[tuple[int, _Begun]] = {(0, _Begun())}
    stack = list(seen)
    while stack:
        at, begun = stack.pop()
        step = steps[at]
        if isinstance(step, Begin) and step.scenario in making:
            begun |= {step.scenario}
        following = successors(step)
        if isinstance(step, Wait):
            following = (step.then,)
        if isinstance(step, Wait | Terminate | End):
            found[begun] = None
            if len(found) > LIMITS.scenario_variants:
                what = f"scenarios that make objects begin in more than {LIMITS.scenario_variants} combinations"
                raise fail("budget-exceeded", what, composition.process.span, "",
                           ("make objects in fewer scenarios, and give them to the others",))  # fmt: skip
        new = [each for each in ((then, begun) for then in following) if each not in seen]
        seen.update(new)
        stack += new
    return sorted(found, key=lambda each: (len(each), sorted(each)))


def _variant(
    scenario: Scenario, making: Mapping[int, ComposedScenario], case: _Begun, ego: int, owners: Mapping[int, int],
    labels: Sequence[str], built_in: Sequence[Requirement], *, needs: bool,
) -> Scenario:  # fmt: skip
    """The scenario with the objects of some scenarios."""
    of = {instance.index: number for number, each in making.items() for instance in each.objects}
    late = [number for number in sorted(case) if making[number].is_late]
    kept = [each for each in scenario.objects if each.index not in of or of[each.index] in case.difference(late)]
    first = {each.index for each in kept}
    kept += [each for number in late for each in scenario.objects if of.get(each.index) == number]
    places = {each.index: place for place, each in enumerate(kept)}
    mine = Counter(labels[each.index] for each in kept)
    alone = [labels[each.index] if mine[labels[each.index]] == 1 else "" for each in kept]
    renamed = [_renamed(each, ego, place, alone[place]) for place, each in enumerate(kept)]

    def is_there(node: Node) -> bool:
        return all(
            index in places or index < 0 or name == CLOCK or name.startswith(PAST) for index, name in features(node)
        )

    def put(node: Node) -> Node:
        if isinstance(node, Feature) and node.object >= 0:
            # what no label says is said of whomever
            mine = node.object if node.object in places and node.property != CLOCK else ego
            return replace(node, object=places[mine])
        return node

    def required(*numbers: int) -> list[Requirement]:
        return [each for each in scenario.requirements if owners.get(id(each), -1) in numbers]

    own = required(-1, *case.difference(late))
    own += [each for each in built_in if all(index in first for index in each.objects)]
    own = [replace(each, objects=tuple(places[index] for index in each.objects)) for each in own]
    dynamics = scenario.dynamics
    assert dynamics is not None
    conditions = tuple(each if is_there(each) else Constant(False) for each in dynamics.conditions)
    processes = tuple(_process(each, places, making, case) for each in dynamics.processes)
    # only a behavior ends a scenario that others run
    ended = {step.scenario for each in processes if not each.composes for step in each.steps if isinstance(step, Stop)}
    processes = tuple(_reachable(each, ended) if each.composes else each for each in processes)
    every = any(_reachable(each, ended).terminates for each in dynamics.processes if each.composes)
    needed = tuple(sorted(case)) if needs else ()
    changed = replace(dynamics, conditions=conditions, processes=processes, needs=needed, closes=every)
    found = replace(
        scenario,
        objects=tuple(renamed[: len(first)]),
        ego=places[ego],
        requirements=tuple(each for each in own if is_there(each.condition)),
        solid=tuple(places[index] for index in scenario.solid if index in first),
        soft=tuple(each for each in scenario.soft if is_there(each.condition)),
        records=tuple(each for each in scenario.records if is_there(each.value)),
        dynamics=_without_silent(changed),
        arrivals=tuple(
            Arrival(
                tuple(at for at, each in enumerate(conditions) if _arrives(each, number)),
                tuple(renamed[places[cast(int, each.index)]] for each in making[number].objects),
                tuple(required(number)),
            )
            for number in late
        ),
    )
    memo: dict[int, Node] = {}
    return rebuilt(found, lambda node: transform(node, put, memo))


def _arrives(condition: Node, number: int) -> bool:
    """Whether a condition stands for the beginning of a scenario."""
    return isinstance(condition, Feature) and condition.property == f"{ARRIVES}{number}"


def _renamed(owner: ScenarioObject, ego: int, place: int, label: str) -> ScenarioObject:
    """An object at its place; the ego alone is called so, others by the variable that they alone were given to."""
    name = f"{owner.category}#{place}" if owner.name == "ego" else owner.name
    if label and label != "ego":
        name = label
    return replace(owner, index=place, name="ego" if owner.index == ego else name)


def _process(
    process: Process, places: Mapping[int, int], making: Mapping[int, ComposedScenario], case: _Begun
) -> Process:
    """A process in which scenarios that are not among those of a variant do not begin."""
    if process.object is not None and process.object not in places:
        return Process(process.span, (End(),), None)

    def of_case(step: ProcessStep) -> ProcessStep:
        match step:
            case Begin() if step.scenario in making and step.scenario not in case:
                return Reject(making[step.scenario].span)
            case PutBehavior():
                return replace(step, object=places[step.object]) if step.object in places else Goto(step.then)
            case _:
                return step

    owner = None if process.object is None else places[process.object]
    return replace(process, steps=tuple(map(of_case, process.steps)), object=owner)


def _reachable(process: Process, ended: set[int]) -> Process:
    """What composes scenarios, without the steps that it never comes to.

    Args:
        process: It.
        ended: The scenarios that may be over without it.
    """
    steps = [
        Goto(step.then) if isinstance(step, IfRuns) and step.scenario not in ended else step for step in process.steps
    ]
    seen, stack = {0}, [0]
    while stack:
        step = steps[stack.pop()]
        new = {*successors(step), *((step.then,) if isinstance(step, Wait) else ())} - seen
        seen |= new
        stack += new
    return replace(process, steps=tuple(step if at in seen else End() for at, step in enumerate(steps)))


def _without_silent(dynamics: Dynamics) -> Dynamics:
    """Remove the scenarios for which it makes no difference whether they have begun."""
    silent = {
        number for number, each in enumerate(dynamics.scenarios)
        if not each.requirements and not each.processes and number not in dynamics.needs
    }  # fmt: skip
    overriding = {step.scenario for each in dynamics.processes for step in each.steps if isinstance(step, PutBehavior)}
    silent -= overriding

    scenarios = () if len(silent) == len(dynamics.scenarios) else dynamics.scenarios

    def without(step: ProcessStep) -> ProcessStep:
        match step:
            case Begin() if step.scenario in silent:
                return Goto(step.then)
            case Leave() if not scenarios:
                return Goto(step.then)
            case _:
                return step

    processes = tuple(replace(each, steps=tuple(map(without, each.steps))) for each in dynamics.processes)
    return replace(dynamics, processes=processes, scenarios=scenarios)
