"""What holds of the label objects of a label: how many count, whether all do, what the nearest of them is.

A `Body` is evaluated in columns over rows, one for each label object of each place, and then told for each place, in
three truth values: what a label object does not observe, and whether one of a coarser class is of the class in
question, are unknown, and so is what depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.forest.column_domain import ColumnDomain, first_direction
from scenicq.forest.columns import (
    DEFINED,
    UNDEFINED,
    UNKNOWN,
    Array,
    CodedValues,
    Column,
    Data,
    PlacedRegions,
    truth_of,
)
from scenicq.forest.interpret import Steps, interpret, steps_of
from scenicq.forest.nodes import ELEMENT, OPEN, RANK, Among, AmongOp, Body, Feature, Leaf, Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.forest.walk import children, postorder
from scenicq.number_ranges import expand_ranges

__all__ = [
    "LABEL_OBJECTS", "LabelElements", "among_column", "asks_each_once", "asks_others", "concatenate",
    "properties_of_others", "take_rows",
]  # fmt: skip

_NO, _MAYBE, _YES = np.int8(0), np.int8(1), np.int8(2)
Truths = NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class LabelElements:
    """The label objects at some places, a row each.

    Attributes:
        place: The place of each row, ascending, shape (m,).
        known: Whether it is known which there are at each place, shape (n,).
        ids: Who each row is, as a number, shape (m,).
        belongs: How each row is of a class: 0 for not, 1 for perhaps, 2 for surely, shape (m,).
        observed: The column of a property over the rows.
    """

    place: NDArray[np.intp]
    known: NDArray[np.bool_]
    ids: NDArray[np.float64]
    belongs: Callable[[str], Truths]
    observed: Callable[[str], Column]


LABEL_OBJECTS = (-1, "#objects")
"""Under what the label objects of a label, at one place, stand among what is observed of it."""


def asks_others(*roots: Node) -> bool:
    """Whether expressions ask for label objects that may play no role."""
    return any(isinstance(node, Among) for node in postorder(roots))


def asks_each_once(root: Node) -> bool:
    """Whether no two questions that a condition asks of label objects are one, or hang together.

    Kleene's logic then tells of the condition all that is known.
    """
    nodes = [*postorder((root,))]
    uses = dict.fromkeys(map(id, nodes), 0)
    uses[id(root)] = 1
    for node in reversed(nodes):
        for each in children(node):
            uses[id(each)] += uses[id(node)]
    asked = [node for node in nodes if isinstance(node, Among)]
    if any(uses[id(each)] > 1 for each in asked):
        return False
    numbers = ValueNumbers()
    alone = all(each.kind == "boolean" for each in asked)
    return len(asked) <= 1 or (alone and len({*map(numbers.expression, asked)}) == len(asked))


def properties_of_others(scenario: Scenario) -> frozenset[str] | None:
    """The properties that a scenario asks of label objects that may play no role; None where it asks none."""
    todo = [each.condition for each in scenario.requirements]
    todo += scenario.dynamics.conditions if scenario.dynamics is not None else ()
    if not asks_others(*todo):
        return None
    found: set[str] = set()
    while todo:
        for node in postorder((todo.pop(),)):
            if isinstance(node, Among):
                todo += node.body.parts
            elif isinstance(node, Feature) and node.object == ELEMENT and node.property != OPEN:
                found.add(node.property)
    return frozenset(found)


def among_column(node: Among, inputs: Sequence[Column], elements: LabelElements) -> Column:
    """The value of a node at each place.

    Args:
        node: The node.
        inputs: The columns of its inputs.
        elements: The label objects.
    """
    counts = elements.belongs(node.category).copy()
    place, n = elements.place, len(elements.known)
    for each in inputs[: node.excluded]:
        who, status = np.broadcast_to(np.asarray(each.data), n)[place], np.broadcast_to(each.status, n)[place]
        counts[(who == elements.ids) & (status == DEFINED)] = _NO
        counts[status != DEFINED] = np.minimum(counts[status != DEFINED], _MAYBE)
    rows = np.flatnonzero(counts)
    counts, place = counts[rows], place[rows]
    given = inputs[node.excluded :]
    domain = ColumnDomain(
        lambda feature: _read(feature, rows, place, n, given, elements),
        _drawn,
        first_direction,
        others=lambda inner, args: among_column(inner, args, _of_rows(elements, place, n)),
    )
    with np.errstate(all="ignore"):
        found = interpret(_steps(node.body), domain)
    holds = _truths(found[id(node.body.condition)], len(rows))
    unknown = np.where(elements.known, DEFINED, UNKNOWN)
    if node.op is AmongOp.NEAREST:
        return _nearest(node.body, found, np.minimum(counts, holds), place, (rows, elements, unknown))
    if node.op is AmongOp.EVERY:
        # what has no value is no yes
        broken = np.minimum(counts, _YES - holds)
        surely, possibly = _tally(broken, place, n)
        return Column(possibly == 0, np.maximum(unknown, np.where((possibly > 0) & (surely == 0), UNKNOWN, DEFINED)))
    surely, possibly = _tally(np.minimum(counts, holds), place, n)
    if node.op is AmongOp.COUNT:
        return Column(surely.astype(np.float64), np.maximum(unknown, np.where(possibly > surely, UNKNOWN, DEFINED)))
    open_ = (possibly >= node.number) & (surely < node.number)
    return Column(surely >= node.number, np.maximum(unknown, np.where(open_, UNKNOWN, DEFINED)))


def _of_rows(elements: LabelElements, place: NDArray[np.intp], n: int) -> LabelElements:
    """The label objects of the place of each row, where each row is a place."""
    sizes = np.bincount(elements.place, minlength=n)
    firsts = np.cumsum(sizes) - sizes
    mine = sizes[place]
    which = expand_ranges(firsts[place], mine)

    def observed(name: str) -> Column:
        return take_rows(elements.observed(name), which, len(elements.place))

    return LabelElements(
        np.repeat(np.arange(len(place)), mine), elements.known[place], elements.ids[which],
        lambda category: elements.belongs(category)[which], observed,
    )  # fmt: skip


def _nearest(
    body: Body, found: dict[int, Column], holds: Truths, place: NDArray[np.intp],
    about: tuple[NDArray[np.intp], LabelElements, NDArray[np.int8]],
) -> Column:  # fmt: skip
    """The value of the nearest row that holds at each place; unknown where a row that may hold comes before."""
    rows, elements, unknown = about
    assert body.distance is not None
    assert body.value is not None
    left = np.flatnonzero(holds)
    away, rank = found[id(body.distance)], elements.observed(RANK)
    far = np.broadcast_to(np.asarray(away.data), len(rows))[left]
    ranks = np.broadcast_to(np.asarray(rank.data), len(elements.place))[rows[left]]
    order = left[np.lexsort((ranks, far, place[left]))]
    first = order[np.flatnonzero(np.diff(place[order], prepend=-1))]
    status = np.full(len(elements.known), UNDEFINED)
    status[place[first]] = np.where(holds[first] == _YES, DEFINED, UNKNOWN)
    picked = np.zeros(len(elements.known), np.intp)
    picked[place[first]] = first
    if not len(rows):
        return Column(np.full(1, np.nan), np.maximum(status, unknown))
    value = take_rows(found[id(body.value)], picked, len(rows))
    own = np.where(status == DEFINED, value.status, DEFINED)
    return Column(value.data, np.maximum(np.maximum(status, unknown), own))


def _tally(truths: Truths, place: NDArray[np.intp], n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """How many rows of each place surely hold, and how many may."""
    return np.bincount(place[truths == _YES], minlength=n), np.bincount(place[truths > _NO], minlength=n)


def _truths(found: Column, n: int) -> Truths:
    held = np.where(truth_of(found.data), _YES, _NO)
    truth = np.where(found.status == DEFINED, held, np.where(found.status == UNDEFINED, _NO, _MAYBE))
    return np.broadcast_to(truth, n).astype(np.int8)


def _read(
    feature: Feature, rows: NDArray[np.intp], place: NDArray[np.intp], n: int, given: Sequence[Column],
    elements: LabelElements,
) -> Column:  # fmt: skip
    """What a feature of a body is in each row."""
    if feature.object == ELEMENT:
        return take_rows(elements.observed(feature.property), rows, len(elements.place))
    return take_rows(given[int(feature.property)], place, n)


def concatenate(columns: Sequence[Column]) -> Column:
    """Columns of places one after the other, of one kind."""
    lengths = [len(each.status) for each in columns]
    status = np.concatenate([each.status for each in columns])

    def whole(parts: Sequence[Array]) -> Array:
        return np.concatenate([np.broadcast_to(part, n) for part, n in zip(parts, lengths, strict=True)])

    first = columns[0].data
    if isinstance(first, tuple):
        pairs = [each.data for each in columns if isinstance(each.data, tuple)]
        if len(pairs) == len(columns):
            return Column((whole([x for x, _ in pairs]), whole([y for _, y in pairs])), status)
    numbers = [each.data for each in columns if isinstance(each.data, np.ndarray)]
    if len(numbers) == len(columns):
        return Column(whole(numbers), status)
    raise CannotEvaluate("the value asked of the nearest object has several types")


def take_rows(column: Column, rows: NDArray[np.intp], n: int) -> Column:
    """A column of n rows at some of them."""

    def take(values: Array) -> Array:
        return values if values.size == 1 else np.broadcast_to(values, n)[rows]

    data: Data = column.data
    match data:
        case CodedValues():
            data = CodedValues(np.broadcast_to(data.which, n)[rows], data.options)
        case PlacedRegions():
            x, y = data.center
            data = PlacedRegions(data.node, (take(x), take(y)), tuple(map(take, data.numbers)))
        case (x, y):
            data = take(x), take(y)
        case _:
            data = take(data)
    return Column(data, np.broadcast_to(column.status, n)[rows])


def _drawn(_leaf: Leaf, _args: Sequence[Column]) -> Column:
    raise CannotEvaluate("a condition on label objects depends on a random value")


@lru_cache(maxsize=256)
def _steps(body: Body) -> Steps:
    return steps_of(*body.parts)
