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
from scenicq.query.prefilter.condition_reader import EGO, object_columns
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, SqlTruth
from scenicq.store.classes import ROOT, Granularity, class_truth, subclasses
from scenicq.store.sql import sql_text

__all__ = ["OTHER", "OtherCondition", "other_conditions"]

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
    """The conditions of a scenario, whose ego is that of the label.

    Args:
        scenario: The scenario.
        classes: How classes are compared.
    """
    for requirement in scenario.requirements:
        for part in conjuncts(requirement.condition):
            negated = isinstance(part, Logic) and part.op is LogicOp.NOT
            node = part.args[0] if isinstance(part, Logic) and negated else part
            if isinstance(node, Among) and (found := _read(node, scenario.ego, classes, negated=negated)) is not None:
                counted, at_least, most = found
                yield OtherCondition(counted, at_least, most, requirement.span)


def _read(
    node: Among, ego: int, classes: Granularity, *, negated: bool
) -> tuple[str, int | None, int] | None:  # fmt: skip
    """What counts and how many must, or may; None where SQL cannot tell."""
    every = node.op is AmongOp.EVERY
    given = node.inputs[node.excluded :]
    about = {index for index, _ in features(*given)}
    if node.op not in (AmongOp.AT_LEAST, AmongOp.EVERY) or about - {ego} or (every and negated):
        return None
    columns = {(ELEMENT, name): column for name, column in object_columns(OTHER).items()}
    columns |= {(ego, name): column for name, column in object_columns(EGO, "ego_").items()}
    bounds = SqlBounds(columns)

    def put_in(each: Node) -> Node:
        if isinstance(each, Feature) and each.object == GIVEN:
            return given[int(each.property)]
        match each:
            case Contains(region=DiscAt(center=center, radius=radius), point=point):
                away = Norm(VectorSum(point, Scale(center, Constant(-1.0))))
                return Compare(CompareOp.LE, away, radius)
            case _:
                return each

    body = in_ego_frame(transform(node.body.condition, put_in), ego)
    roles = node.excluded - 1
    if not negated and not every:
        return _and(_of_class(node.category, classes, 1), bounds.can_hold(body), unknown=True), node.number, 0
    # what surely counts must be few
    surely = bounds.can_hold(body) if every else bounds.can_fail(body)
    counted = _and(_of_class(node.category, classes, 2), SQL.negation(surely), unknown=False)
    return counted, None, (1 if every else node.number) - 1 + roles


def _of_class(category: str, classes: Granularity, least: int) -> str:
    names = [name for name in subclasses(ROOT) if class_truth(category, name, classes) >= least]
    return f"{OTHER}.class IN ({', '.join(map(sql_text, sorted(names)))})" if names else "false"


def _and(of_class: str, condition: SqlTruth, *, unknown: bool) -> str:
    if isinstance(condition, bool):
        return of_class if condition else "false"
    return f"({of_class} AND coalesce({condition}, {str(unknown).lower()}))"
