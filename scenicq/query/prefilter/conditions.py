"""What a plan asks of columns: conditions that are necessary for a match, and conditions that together are sufficient.

Together they cut the frames in three: those that miss a necessary condition do not match, those with objects that meet
the sufficient ones match, and about the others the matcher is asked. Both are read by one reader (`condition_reader`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.among import asks_each_once, asks_others
from scenicq.forest.groups import PARAMS, Comparison, Condition, Group
from scenicq.forest.nodes import Node, PointIn, Select
from scenicq.forest.scenario import Scenario
from scenicq.forest.unobserved import is_only_observed
from scenicq.forest.value_numbers import without_negation
from scenicq.forest.walk import conjuncts, postorder
from scenicq.geometry.abstract_map import AbstractOccupancy
from scenicq.geometry.network import Network
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import build_groups, compared_properties, relevant_properties
from scenicq.query.prefilter.condition_reader import (
    EGO,
    ColumnCondition,
    ConditionReader,
    course_column,
    object_columns,
)
from scenicq.query.prefilter.map_relations import (
    LookUp,
    MapRelations,
    MeantElements,
    allowed_elements,
    is_along,
    look_up_of,
    shared_look_ups,
)
from scenicq.query.prefilter.other_objects import conditions_of, proof, role_conditions
from scenicq.query.prefilter.sql_ends import all_of, any_of
from scenicq.store.classes import Granularity
from scenicq.store.sql import sql_text

__all__ = ["necessary_conditions", "sufficient_conditions"]

_COLUMNED = frozenset(object_columns(EGO))
"""Properties that a label has in columns; all others are among its attributes."""


def necessary_conditions(
    scenario: Scenario, network: Network, options: MatchOptions, relations: MapRelations
) -> Iterator[ColumnCondition]:
    """What must hold of a frame's columns for it to match, where the ego is the label's own, in the program's order.

    Args:
        scenario: The scenario.
        network: The map it was compiled for.
        options: Tolerances.
        relations: Those of the map, which gets the tables that conditions ask for.
    """
    if any(owner.mutated for owner in scenario.objects):
        return  # noise of any size hides where things are
    reader = ConditionReader(scenario, options.tolerance.for_scenario(scenario), relations, network.roadDirection)
    for owner in scenario.objects:
        for name in compared_properties(owner, frozenset(owner.properties)):
            given = owner.properties[name]
            heading = owner.properties["heading"].value if "heading" in owner.properties else None
            found = reader.comparison(Comparison(owner.index, name, given.value, given.span), heading=heading)
            yield from _named(found, f"{owner.name}.{name}", given.span)
    for requirement in scenario.requirements:
        if requirement.built_in is None and requirement.span is not None:
            what = " ".join(requirement.span.text.split())
            found = reader.requirement(requirement.condition)
            others = role_conditions(requirement.condition, scenario, options.classes)
            yield from _named(chain(found, others), what, requirement.span)


def _named(found: Iterator[ColumnCondition], what: str, span: Span | None) -> Iterator[ColumnCondition]:
    """Conditions that exclude something, with what they come from."""
    for each in found:
        if each.region or each.sql is not True:
            yield replace(each, sql=each.sql or "false", what=what, span=span)


def sufficient_conditions(
    scenario: Scenario, network: Network, options: MatchOptions, relations: MapRelations
) -> tuple[ColumnCondition, ...] | None:
    """Conditions that together prove that a label matches, for distinct label objects within the radius.

    They are read off each group of constraints in which one comparison at most depends on what random variables come
    out as; all else must hold whatever that is.

    Args:
        scenario: The scenario, ready to be matched.
        network: The map it was compiled for.
        options: Tolerances and what is in force.
        relations: Those of the map, which gets the tables that conditions ask for.

    Returns:
        None if the columns cannot prove it.
    """
    noisy = any(owner.mutated for owner in scenario.objects)
    if noisy or options.method != "auto" or options.ego != "label" or options.exact or scenario.dynamics is not None:
        return None
    tolerance = options.tolerance.for_scenario(scenario)
    reader = ConditionReader(scenario, tolerance, relations, network.roadDirection, proving=True, radius=options.radius)
    relevant = relevant_properties(scenario, options)
    on_course = course_column(scenario)
    # read from columns, or never taken for granted as labels alone tell it
    told = [
        frozenset(
            name
            for name in names
            if name in _COLUMNED or (index, name) in on_course or is_only_observed(scenario, index, name)
        )
        for index, names in enumerate(relevant)
    ]
    found = list(_without_attributes(scenario, options, [a - b for a, b in zip(relevant, told, strict=True)]))
    signature = (*told, frozenset[str]())
    for group in build_groups(scenario, signature, options):
        # what is known up to two ends must hold whichever it is
        proved = [*_proof(group.certain_group, reader, scenario, options.classes)]
        found += _told_apart(proved, group, reader, scenario, options.classes)
    if any(each.sql is False for each in found):
        return None
    return tuple(each for each in found if each.region or each.sql is not True)


def _without_attributes(
    scenario: Scenario, options: MatchOptions, without_columns: Sequence[frozenset[str]]
) -> Iterator[ColumnCondition]:
    """That a label has an ego and nothing that is compared but what has columns."""
    yield ColumnCondition((), f"{EGO}.ego_class <> ''")
    for index, names in enumerate(without_columns):
        if names and index == scenario.ego:
            yield ColumnCondition((), _lacks(f"{EGO}.ego_attributes", sorted(names)))
        elif names:
            yield ColumnCondition((index,), _lacks("a.attributes", sorted(names)))
    params = [name for name, given in scenario.params.items() if given.explicit and name not in options.ignore_params]
    if params:
        yield ColumnCondition((), _lacks(f"{EGO}.params", params))


def _proof(
    group: Group, reader: ConditionReader, scenario: Scenario, classes: Granularity
) -> Iterator[ColumnCondition]:
    """What proves that all constraints of a group can be satisfied together."""
    comparisons = [each for each in group.constraints if isinstance(each, Comparison)]
    told = (each for each in comparisons if any(_is_told_by(each, place, reader.road) for place in comparisons))
    along = next(told, None)
    if len(comparisons) > 1 + (along is not None) or any(each.object == PARAMS for each in comparisons):
        yield ColumnCondition((), False)
        return
    meant = _meant_elements(group, scenario.ego, along)
    for constraint in group.constraints:
        if isinstance(constraint, Condition):
            for part in conditions_of(constraint.expression):
                proved = proof(part, scenario, classes)
                if proved is None:
                    yield from reader.requirement(part, meant)
                else:
                    yield proved
        elif constraint is not along:
            yield from reader.comparison(constraint, meant, None if along is None else along.expression)


def _told_apart(
    proved: Sequence[ColumnCondition], group: Group, reader: ConditionReader, scenario: Scenario, classes: Granularity
) -> Sequence[ColumnCondition]:
    """What proves a group, as one condition that also says where the group is surely open, if SQL can tell that."""
    if len(group.constraints) != 1 or not isinstance(group.constraints[0], Condition):
        return proved
    possible, certain = (each.constraints[0].expression for each in (group, group.certain_group))
    asking = asks_others(possible)
    # what two conditions on others have in common takes a search; what is known of both kinds, too
    if asking is not (possible is certain) or not asks_each_once(possible):
        return proved
    holds = [each for part in conditions_of(possible) for each in _possibly(part, reader, scenario, classes)]
    parts = map(without_negation, conditions_of(certain))
    opposites = [build.opposite(base) if positive else base for base, positive in parts]
    fails = [[*_possibly(part, reader, scenario, classes)] for part in opposites]
    told = [*proved, *holds, *(each for some in fails for each in some)]
    about = {index for each in told for index in each.objects}
    if len(about) > 1 or any(each.region for each in told):
        return proved
    failing = any_of([all_of([each.sql for each in some]) for some in fails])
    open_ = all_of([*(each.sql for each in holds), failing])
    return [ColumnCondition(tuple(about), all_of([each.sql for each in proved]), open=open_)]


def _possibly(
    part: Node, reader: ConditionReader, scenario: Scenario, classes: Granularity
) -> Iterator[ColumnCondition]:
    """What proves that a condition holds for something of what is not known."""
    found = proof(part, scenario, classes, possibly=True)
    if found is not None:
        yield found
    else:
        yield from reader.requirement(part)


def _is_told_by(heading: Comparison, place: Comparison, road: RoadDirection) -> bool:
    """Whether a heading is the direction of the lane that an object is in, which is told together with the lane."""
    about = (place.property, heading.property, heading.object) == ("position", "heading", place.object)
    node = place.expression
    return about and isinstance(node, PointIn) and is_along(heading.expression, node.region, place.object, road)


def _meant_elements(group: Group, ego: int, along: Comparison | None) -> MeantElements | None:
    """Which elements may be meant where the ego is, for all that a group asks of them together; None of none.

    Where conditions look up elements of several kinds, it is not known which of each go together; nor of one that is
    drawn, which of several is meant by two of them.

    Args:
        group: The group.
        ego: Index of the ego.
        along: A heading that is told together with the place.
    """
    said = [each.expression for each in group.constraints if isinstance(each, Condition)]
    equations = [places for each in said if (places := shared_look_ups(each)) is not None]
    asked = [each.expression for each in group.constraints if not isinstance(each, Condition)]
    nodes = postorder([*asked, *(each for each in said if allowed_elements(each) is None)])
    found = [look_up for node in nodes if isinstance(node, Select) and (look_up := look_up_of(node.index))]
    found += [place for places in equations for place in places]
    allowed = [known for each in said if (known := allowed_elements(each))]
    # that there is what leads to another is said by what is said of the other
    some = frozenset({0})
    there = [*found, *(one for one, numbers in allowed if numbers == some)]
    allowed = [each for each in allowed if each[1] != some or not any(each[0].leads_to(other) for other in there)]
    found += [look_up for look_up, _ in allowed]
    if not found:
        return None
    # what several ask for is one element: of several at the place each might be met by another one
    asking = sum(
        allowed_elements(part) is None and any(_looks_up(node) for node in postorder((part,)))
        for each in group.constraints
        if each is not along
        for part in conjuncts(each.expression)
    )
    if asking > 1 and any(_is_drawn(each) for each in found):
        return None
    objects = {each.object for each in found}
    alike = all(each.occupancy is found[0].occupancy for each in found)
    ranks = min(each.ranks for each in found) if asking <= 1 else 1
    if not alike or ego not in objects or len(objects) != 1 + len(equations):
        # which of those at each place is meant matters where more is asked of it than that it is there
        more = any(
            numbers != some or not any(one.is_same(place) for places in equations for place in places)
            for one, numbers in allowed
        )
        return MeantElements(None, 1 if more else ranks)
    among = frozenset(range(found[0].occupancy.nothing)).intersection(*(numbers for _, numbers in allowed))
    return MeantElements(among, ranks, shared=bool(equations))


def _looks_up(node: Node) -> bool:
    """Whether a node is the number of the element that lies somewhere."""
    return look_up_of(node) is not None


def _is_drawn(look_up: LookUp) -> bool:
    """Whether the element is one of several, at random."""
    return isinstance(look_up.occupancy, AbstractOccupancy) and look_up.occupancy.is_drawn


def _lacks(column: str, names: Sequence[str]) -> str | bool:
    """That an object in JSON has none of some names; that cannot be said of names that are no identifiers."""
    if not all(name.isidentifier() for name in names):
        return False
    paths = [f'$."{name}"' for name in names]
    absent = [f"json_extract({column}, {sql_text(path)}) IS NULL" for path in paths]
    return f"({' AND '.join(absent)})"
