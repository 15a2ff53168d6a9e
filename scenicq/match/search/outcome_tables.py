"""Random choices as finite-domain variables: the outcomes of nested choices as one table.

`Uniform(*intersections)`, then a lane of it, then a maneuver of that: each is a variable whose domain is the options,
and the variables below depend on which option lies above. A table has one row for each outcome of such a tree. Trees
with the same outcomes share one table, so that a lane, its centreline and its last point are chosen at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.bounds import Box, scalar_bounds, vector_bounds
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.interval_ends import ARRAYS
from scenicq.forest.interval_values import Interval
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Kind, Node, Select, Undefined
from scenicq.forest.walk import children, leaves, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Region
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.tolerance import SLACK

__all__ = ["ChoiceTree", "ChoiceVariable", "Outcomes", "above_choices", "tree_of"]

ChoiceVariable: TypeAlias = Identity | Node
"""A random index by its identity; else the expression that says which option is taken."""

_DOMAIN = IntervalDomain(ARRAYS)


@dataclass(frozen=True, slots=True, eq=False)
class Outcomes:
    """What choices nested in each other may come out as.

    Attributes:
        variables: The choices.
        picks: Which option each of them takes, shape (outcomes, variables); -1 where it does not matter.
    """

    variables: tuple[ChoiceVariable, ...]
    picks: NDArray[np.intp]

    def given(self, outcome: int) -> Iterator[tuple[ChoiceVariable, int]]:
        """The choices that matter to an outcome, with their options."""
        for variable, pick in zip(self.variables, self.picks[outcome].tolist(), strict=True):
            if pick >= 0:
                yield variable, pick


@dataclass(frozen=True, eq=False)
class ChoiceTree:
    """A choice with those below it.

    Attributes:
        outcomes: What they may come out as.
        results: The expression that is chosen, by outcome.
    """

    outcomes: Outcomes
    results: tuple[Node, ...]

    @cached_property
    def others(self) -> frozenset[Identity]:
        """The random variables, other than choices, on which the results and the choices depend."""
        roots = [result for result in self.results if not isinstance(result, Constant)]
        roots += [variable for variable in self.outcomes.variables if not isinstance(variable, Identity)]
        return frozenset(leaf.identity for leaf in leaves(*roots) if not isinstance(leaf, Index))

    @cached_property
    def inner(self) -> frozenset[ChoiceVariable]:
        """Further choices inside of the results, which come out when it is known which result is chosen."""
        found: set[ChoiceVariable] = set()
        for node in postorder([result for result in self.results if not isinstance(result, Constant)]):
            if isinstance(node, Index):
                found.add(node.identity)
            elif isinstance(node, Select) and not isinstance(node.index, Index | Select):
                found.add(node.index)
        return frozenset(found)

    @cached_property
    def kind(self) -> Kind:
        """The kind of the results that have a value."""
        kinds: list[Kind] = list(dict.fromkeys(kind_of(result) for result in self.results))
        kinds = [kind for kind in kinds if kind != "other"]
        return kinds[0] if len(kinds) == 1 else "other"

    @cached_property
    def truths(self) -> NDArray[np.bool_]:
        """Whether the results can hold, where they are conditions, shape (outcomes,)."""
        return np.array([not isinstance(result, Constant) or result.value is True for result in self.results])

    @cached_property
    def spans(self) -> NDArray[np.float64]:
        """Bounds of the results where they are numbers: least, greatest, shape (outcomes, 2)."""
        return np.array([scalar_bounds(result) for result in self.results])

    @cached_property
    def boxes(self) -> NDArray[np.float64]:
        """Bounds of the results where they are points or regions: west, south, east, north, shape (outcomes, 4).

        A result without a value has an empty box.
        """
        found: list[tuple[float, ...]] = []
        for result in self.results:
            value = result.value if isinstance(result, Constant) else None
            if isinstance(value, Region):
                found.append(region_bounds(value))
            elif isinstance(result, Constant) and (value is None or isinstance(value, Undefined)):
                found.append((np.inf, np.inf, -np.inf, -np.inf))
            elif kind_of(result) == "vector":
                (west, east), (south, north) = vector_bounds(result)
                found.append((west, south, east, north))
            else:
                found.append((-np.inf, -np.inf, np.inf, np.inf))
        return np.array(found)


@lru_cache(maxsize=4096)
def _shared(variables: tuple[ChoiceVariable, ...], picks: bytes, count: int) -> Outcomes:
    """The one table with this content."""
    table = np.frombuffer(picks, dtype=np.intp).reshape(count, len(variables))
    return Outcomes(variables, table)


@lru_cache(maxsize=256)
def tree_of(root: Select) -> ChoiceTree:
    """The outcomes of a choice and of all choices nested in it.

    Raises:
        Exhausted: There are more than can be listed.
    """
    columns: dict[ChoiceVariable, int] = {}
    rows: list[dict[ChoiceVariable, int]] = []
    results: list[Node] = []
    todo: list[tuple[Node, dict[ChoiceVariable, int]]] = [(root, {})]
    while todo:
        node, path = todo.pop()
        if not isinstance(node, Select):
            rows.append(path)
            results.append(node)
            if len(rows) > LIMITS.nested_outcomes:
                raise limit_exceeded("nested_outcomes")
            for variable in path:
                columns.setdefault(variable, len(columns))
            continue
        todo += reversed(list(_options(node, path)))
    picks = np.full((len(rows), len(columns)), -1, dtype=np.intp)
    for number, path in enumerate(rows):
        for variable, option in path.items():
            picks[number, columns[variable]] = option
    return ChoiceTree(_shared(tuple(columns), picks.tobytes(), len(rows)), tuple(results))


def _options(node: Select, path: dict[ChoiceVariable, int]) -> Iterator[tuple[Node, dict[ChoiceVariable, int]]]:
    """What a choice may lead to, with what is then known of all choices."""
    todo: list[tuple[Node, dict[ChoiceVariable, int]]] = [(node.index, path)]
    while todo:
        index, known = todo.pop()
        if isinstance(index, Constant):
            if not isinstance(index.value, Undefined):
                yield node.options[int(cast(float, index.value))], known
            continue
        # of an index that is chosen itself, such as which of several elements that overlap is meant, that comes first
        asked = index.index if isinstance(index, Select) else index
        variable: ChoiceVariable = asked.identity if isinstance(asked, Index) else asked
        options = index.options if isinstance(index, Select) else node.options
        numbers = [known[variable]] if variable in known else _possible(asked, len(options))
        found = [(options[number], {**known, variable: number}) for number in numbers]
        if isinstance(index, Select):
            todo += reversed(found)
        else:
            yield from found


@lru_cache(maxsize=256)
def _possible(index: Node, count: int) -> Sequence[int]:
    """Which of some options an index may take: what is looked up at a place is one of those near its bounds."""
    fields = [node for node in postorder((index,)) if isinstance(node, DirectionAt)]
    every = range(count)
    if len(fields) != 1 or not isinstance(fields[0].field, Constant):
        return every
    box = np.array(_place(fields[0].point)).T
    if not np.isfinite(box).all():
        return every
    field = cast(VectorField, fields[0].field.value)
    _, headings = field.headings(np.concatenate([box[0] - SLACK, box[1] + SLACK])[None])
    with np.errstate(all="ignore"):
        given = {id(fields[0]): Interval(headings, headings)}
        value = interpret(steps_of(index, known=given), _DOMAIN, given)[id(index)]
    if not isinstance(value, Interval):
        return every
    low, high = np.ceil(value.low - SLACK), np.floor(value.high + SLACK)
    return [number for number in every if ((low <= number) & (number <= high)).any()]


@lru_cache(maxsize=256)
def _place(point: Node) -> Box:
    """Where a point can be, at which many things are looked up."""
    return vector_bounds(point)


def above_choices(root: Node) -> Iterator[tuple[Node, tuple[Node, ...]]]:
    """An expression's nodes down to the outermost choices, with their children, which come before them."""
    done: set[int] = set()
    stack: list[tuple[Node, bool]] = [(root, False)]
    while stack:
        node, expanded = stack.pop()
        if id(node) in done:
            continue
        below = () if isinstance(node, Select) else children(node)
        if expanded or not below:
            done.add(id(node))
            yield node, below
        else:
            stack.append((node, True))
            stack.extend((child, False) for child in reversed(below))
