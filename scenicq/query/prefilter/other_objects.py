"""What conditions on label objects without a role say in SQL: how many there may be, or surely are, in a frame.

Read off are conditions on what the label objects and the ego are alone. Whoever plays a role is one of those
counted: where others must be few, so many more as there are roles may be there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from scenicq.errors import Span
from scenicq.forest.ego_frame import in_ego_frame
from scenicq.forest.nodes import (
    ELEMENT,
    GIVEN,
    Among,
    AmongOp,
    Compare,
    CompareOp,
    Constant,
    Contains,
    DiscAt,
    Feature,
    Logic,
    LogicOp,
    Node,
    Norm,
    Scale,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import conjuncts, features, transform
from scenicq.query.prefilter.condition_reader import EGO, course_column, object_columns
from scenicq.query.prefilter.said_columns import in_said_truths, said_columns
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, SqlTruth
from scenicq.store.classes import ROOT, Granularity, class_truth, subclasses
from scenicq.store.sql import sql_text

__all__ = ["OBJECTS", "OTHER", "OtherCondition", "other_conditions", "proof"]

OBJECTS = "block_objects"
"""The view of the label objects of a block, with their `number` in the file."""
OTHER = "o"
"""Alias of a row of a label object."""


@dataclass(frozen=True, slots=True)
class OtherCondition:
    """What a frame must have, or must not.

    Attributes:
        counted: SQL that is true of each label object `o` that counts, over its columns and the ego's.
        at_least: How many there must be; None where they must be few.
        most: How many there may be; of no meaning where `at_least` is given.
        span: Where the program says it.
    """

    counted: str
    at_least: int | None
    most: int
    span: Span | None


def other_conditions(scenario: Scenario, classes: Granularity) -> Iterator[OtherCondition]:
    """The conditions that a frame misses only where it does not match; the ego is that of the label.

    Args:
        scenario: The scenario.
        classes: How classes are compared.
    """
    for requirement in scenario.requirements:
        for part in conjuncts(requirement.condition):
            found = _read(part, scenario, classes, proving=False)
            if found is not None:
                yield OtherCondition(*found, requirement.span)


def proof(part: Node, scenario: Scenario, classes: Granularity) -> str | None:
    """SQL over a frame `ego` that proves a condition on label objects; None where SQL cannot tell.

    Args:
        part: The condition.
        scenario: The scenario; the ego is that of the label.
        classes: How classes are compared.
    """
    found = _read(part, scenario, classes, proving=True)
    if found is None:
        return None
    counted, at_least, most = found
    few = f"<= {most}" if at_least is None else f">= {at_least}"
    return f"(SELECT count(*) FROM {OBJECTS} {OTHER} WHERE {OTHER}.frame = {EGO}.frame AND {counted}) {few}"


def _read(part: Node, scenario: Scenario, classes: Granularity, *, proving: bool) -> tuple[str, int | None, int] | None:
    """What counts and how many must, or may; None where SQL cannot tell."""
    ego = scenario.ego
    negated = isinstance(part, Logic) and part.op is LogicOp.NOT
    node = part.args[0] if isinstance(part, Logic) and negated else part
    if not isinstance(node, Among) or node.op not in (AmongOp.AT_LEAST, AmongOp.EVERY):
        return None
    every, given = node.op is AmongOp.EVERY, node.inputs[node.excluded :]
    if {index for index, _ in features(*given)} - {ego} or (every and negated):
        return None
    columns = {(ELEMENT, name): column for name, column in object_columns(OTHER).items()}
    columns |= {(ego, name): column for name, column in object_columns(EGO, "ego_").items()} | course_column(scenario)

    def put_in(each: Node) -> Node:
        if isinstance(each, Feature) and each.object == GIVEN:
            return given[int(each.property)]
        match each:
            case Contains(region=DiscAt(center=center, radius=radius), point=point):
                away = Norm(VectorSum(point, Scale(center, Constant(-1.0))))
                return Compare(CompareOp.LE, away, radius)
            case _:
                return each

    body = in_said_truths(in_ego_frame(transform(node.body.condition, put_in), ego))
    bounds = SqlBounds({**columns, **said_columns((body,), {ELEMENT: f"{OTHER}.attributes"}, columns)})
    # of those who are all that is known is that some may play a role
    roles = node.excluded - 1
    few = negated or every
    if few == proving:
        # those that may count
        may = bounds.can_fail(body) if every else bounds.can_hold(body)
        counted = _and(_of_class(node.category, classes, 1), may, unknown=True)
    else:
        surely = bounds.can_hold(body) if every else bounds.can_fail(body)
        counted = _and(_of_class(node.category, classes, 2), SQL.negation(surely), unknown=False)
    least = 1 if every else node.number
    if few:
        return counted, None, least - 1 + (0 if proving else roles)
    return counted, least + (roles if proving else 0), 0


def _of_class(category: str, classes: Granularity, least: int) -> str:
    names = [name for name in subclasses(ROOT) if class_truth(category, name, classes) >= least]
    return f"{OTHER}.class IN ({', '.join(map(sql_text, sorted(names)))})" if names else "false"


def _and(of_class: str, condition: SqlTruth, *, unknown: bool) -> str:
    if isinstance(condition, bool):
        return of_class if condition else "false"
    return f"({of_class} AND coalesce({condition}, {str(unknown).lower()}))"
