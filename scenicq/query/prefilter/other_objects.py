"""What conditions on label objects without a role say in SQL: how many there may be, or surely are, in a frame.

Read off are conditions on what the label objects, the ego and whoever plays one role are. Whoever plays a role is one
of those counted: where others must be few, so many more as there are roles may be there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from scenicq.errors import Span
from scenicq.forest.build import connect
from scenicq.forest.ego_frame import in_ego_frame
from scenicq.forest.nodes import (
    ELEMENT,
    GIVEN,
    IDENTITY,
    OPEN,
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
    Select,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import conjuncts, features, transform
from scenicq.query.prefilter.condition_reader import EGO, ColumnCondition, course_column, object_columns
from scenicq.query.prefilter.said_columns import in_said_truths, said_columns
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, SqlTruth
from scenicq.store.classes import ROOT, Granularity, class_truth, subclasses
from scenicq.store.sql import sql_text

__all__ = ["OBJECTS", "OTHER", "OtherCondition", "conditions_of", "other_conditions", "proof", "role_conditions"]

OBJECTS = "block_objects"
"""The view of the label objects of a block, with their `number` in the file."""
OTHER = "o"
"""Alias of a row of a label object."""


@dataclass(frozen=True, slots=True)
class OtherCondition:
    """What the label objects of a frame must be, or must not.

    Attributes:
        role: The role that it is about besides; None for the frame alone.
        counted: SQL that is true of each label object `o` that counts, over its columns and the ego's, and over those
            of whoever plays the role, `a`.
        at_least: How many there must be; None where they must be few.
        most: How many there may be; of no meaning where `at_least` is given.
        span: Where the program says it.
    """

    role: int | None
    counted: str
    at_least: int | None = None
    most: int = 0
    span: Span | None = None

    @property
    def as_column_condition(self) -> ColumnCondition:
        """The condition on the frame, or on its object in the role."""
        objects = () if self.role is None else (self.role,)
        limit = f"<= {self.most}" if self.at_least is None else f">= {self.at_least}"
        among = f"FROM {OBJECTS} {OTHER} WHERE {OTHER}.frame = {EGO}.frame AND {self.counted}"
        return ColumnCondition(objects, f"(SELECT count(*) {among}) {limit}")


def other_conditions(scenario: Scenario, classes: Granularity) -> Iterator[OtherCondition]:
    """The conditions that a frame misses only where it does not match; the ego is that of the label.

    Args:
        scenario: The scenario.
        classes: How classes are compared.
    """
    for requirement in scenario.requirements:
        for part in conditions_of(requirement.condition):
            found = _read(part, scenario, classes, proving=False)
            if isinstance(found, OtherCondition) and found.role is None:
                yield replace(found, span=requirement.span)


def role_conditions(root: Node, scenario: Scenario, classes: Granularity) -> Iterator[ColumnCondition]:
    """What a condition on label objects says of one role, that whoever plays it misses only in no match.

    Args:
        root: The condition.
        scenario: The scenario; the ego is that of the label.
        classes: How classes are compared.
    """
    for part in conditions_of(root):
        found = _read(part, scenario, classes, proving=False)
        if isinstance(found, ColumnCondition):
            yield found
        elif found is not None and found.role is not None:
            yield found.as_column_condition


def proof(part: Node, scenario: Scenario, classes: Granularity, *, possibly: bool = False) -> ColumnCondition | None:
    """What proves a condition on label objects; None where SQL cannot tell.

    Args:
        part: The condition, one of `conditions_of`, or the opposite of one.
        scenario: The scenario; the ego is that of the label.
        classes: How classes are compared.
        possibly: Whether it is enough that it holds for something of what is not known of them.
    """
    found = _read(part, scenario, classes, proving=True, possibly=possibly)
    return found.as_column_condition if isinstance(found, OtherCondition) else found


def conditions_of(root: Node) -> Iterator[Node]:
    """The parts of a condition that all must hold; whoever plays a role in a frame is seen in it."""
    todo = [root]
    while todo:
        for part in conjuncts(todo.pop()):
            match part:
                case Select(
                    index=Compare(CompareOp.EQ, Feature(property=name) as one, Feature() as other),
                    options=(Constant(value=False), seen),
                ) if name == IDENTITY and (one.object, one.property) == (other.object, other.property):
                    todo.append(seen)
                case _:
                    yield part


def _read(
    part: Node, scenario: Scenario, classes: Granularity, *, proving: bool, possibly: bool = False
) -> OtherCondition | ColumnCondition | None:
    """What a condition says of label objects, or of a role alone; None where SQL cannot tell."""
    ego = scenario.ego
    negated = isinstance(part, Logic) and part.op is LogicOp.NOT
    node = part.args[0] if isinstance(part, Logic) and negated else part
    if not isinstance(node, Among) or node.op not in (AmongOp.AT_LEAST, AmongOp.EVERY):
        return None
    every, given = node.op is AmongOp.EVERY, node.inputs[node.excluded :]
    spoken = {index for index, _ in features(*given)} - {ego}
    # parameters are none of the columns
    if len(spoken) > 1 or min(spoken, default=0) < 0 or (every and negated):
        return None
    role = next(iter(spoken), None)
    columns = {(ELEMENT, name): column for name, column in object_columns(OTHER).items()}
    columns |= {(ego, name): column for name, column in object_columns(EGO, "ego_").items()} | course_column(scenario)
    said = {ELEMENT: f"{OTHER}.attributes"}
    if role is not None:
        columns |= {(role, name): column for name, column in object_columns("a").items()}
        said[role] = "a.attributes"

    def put_in(each: Node) -> Node:
        if isinstance(each, Feature) and each.object == GIVEN:
            return given[int(each.property)]
        match each:
            case Feature(object=index) if index == ELEMENT:
                # a frame is one moment, at which what is given is seen, too
                return replace(each, current=False)
            case Contains(region=DiscAt(center=center, radius=radius), point=point):
                away = Norm(VectorSum(point, Scale(center, Constant(-1.0))))
                return Compare(CompareOp.LE, away, radius)
            case _:
                return each

    body = in_said_truths(in_ego_frame(transform(node.body.condition, put_in), ego))
    bounds = SqlBounds({**columns, **said_columns((body,), said, columns)})
    parts = [] if every else list(conjuncts(body))
    own = [each for each in parts if _is_same(each, role, CompareOp.EQ)]
    excluded = {each.object for each in node.inputs[: node.excluded] if isinstance(each, Feature)}

    def counts(asked: Node, *, most: bool, alias: str = OTHER) -> str:
        """SQL that is true of all that count, or of those alone that surely do; or of those that may."""
        if possibly:
            asked = _with_truth(asked, most is every)
        may = most is not every
        held = bounds.can_hold(asked) if may else bounds.can_fail(asked)
        of_class = _of_class(node.category, classes, 1 if most is not possibly else 2, alias)
        return _and(of_class, held if most else SQL.negation(held), unknown=most)

    few = negated or every
    if role is not None and own and node.number == 1 and role not in excluded:
        asked = _of_role(connect(LogicOp.AND, [each for each in parts if each not in own]), role)
        found = counts(asked, most=negated is proving, alias="a")
        return ColumnCondition((role,), f"NOT {found}" if negated else found)
    apart = [each for each in parts if _is_same(each, role, CompareOp.NE)]
    if apart:
        body = connect(LogicOp.AND, [each for each in parts if each not in apart])
    # of those who are all that is known is that some may play a role
    roles = node.excluded - 1 - (role in excluded)
    counted = counts(body, most=few is proving)
    if apart or role in excluded:
        counted = f"({counted} AND {OTHER}.number <> a.number)"
    least = 1 if every else node.number
    if few:
        return OtherCondition(role, counted, most=least - 1 + (0 if proving else roles))
    return OtherCondition(role, counted, least + (roles if proving else 0))


def _with_truth(root: Node, truth: bool) -> Node:
    """A condition on a label object where what is not known of it has a truth value."""

    def put_in(node: Node) -> Node:
        is_open = isinstance(node, Feature) and node.object == ELEMENT and node.property == OPEN
        return Constant(truth) if is_open else node

    return transform(root, put_in)


def _of_role(root: Node, role: int) -> Node:
    """What a condition on a label object says of the one that plays a role."""

    def of_role(node: Node) -> Node:
        return replace(node, object=role) if isinstance(node, Feature) and node.object == ELEMENT else node

    return transform(root, of_role)


def _is_same(node: Node, role: int | None, op: CompareOp) -> bool:
    """Whether a condition is that a label object plays a role, or does not."""
    match node:
        case Compare(found, Feature() as one, Feature() as other):
            compared = {(each.object, each.property) for each in (one, other)}
            return found is op and compared == {(ELEMENT, IDENTITY), (role, IDENTITY)}
        case _:
            return False


def _of_class(category: str, classes: Granularity, least: int, alias: str = OTHER) -> str:
    names = [name for name in subclasses(ROOT) if class_truth(category, name, classes) >= least]
    return f"{alias}.class IN ({', '.join(map(sql_text, sorted(names)))})" if names else "false"


def _and(of_class: str, condition: SqlTruth, *, unknown: bool) -> str:
    if isinstance(condition, bool):
        return of_class if condition else "false"
    return f"({of_class} AND coalesce({condition}, {str(unknown).lower()}))"
