"""Draws of the random variables of a group, evaluated side by side: what is missing of each, and where fields point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import DEFINED, UNDEFINED, Column
from scenicq.forest.interpret import OnMap, Steps, interpret, steps_of
from scenicq.forest.nodes import Constant, DirectionAt, Feature, Identity, Index, Leaf, Node, PointIn, Select
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.limits import LIMITS
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.fields.hidden_values import HiddenValue
from scenicq.match.fields.residuals import Residuals, residuals_of
from scenicq.match.fields.steps_back import steps_back
from scenicq.match.problem.conditioned import Item

__all__ = ["Trial", "TrialDraws", "TrialSpace"]


_Numbers = NDArray[np.float64]


@dataclass(eq=False)
class TrialDraws:
    """What is tried at once.

    Attributes:
        places: Coordinates of all random variables, (k, n).
        shares: For each use of a field a share of one that tells which of several headings it has, (uses, n).
    """

    places: _Numbers
    shares: _Numbers

    def take(self, some: NDArray[np.intp]) -> TrialDraws:
        """Some of the draws, possibly several times."""
        return TrialDraws(self.places[:, some], self.shares[:, some])

    def beside(self, other: TrialDraws) -> TrialDraws:
        """These draws and others."""
        return TrialDraws(
            np.concatenate([self.places, other.places], axis=1), np.concatenate([self.shares, other.shares], axis=1)
        )


@dataclass(frozen=True, eq=False)
class Trial:
    """Draws with what they come out as.

    Attributes:
        draws: The draws, their coordinates within their ends.
        residuals: What is missing of them.
        headings: Where each use of a field points, (uses, n).
    """

    draws: TrialDraws
    residuals: Residuals
    headings: _Numbers

    def take(self, some: NDArray[np.intp]) -> Trial:
        """Some of the draws."""
        residuals = Residuals(self.residuals.each[:, some], self.residuals.missing[some])
        return Trial(self.draws.take(some), residuals, self.headings[:, some])

    def beside(self, other: Trial) -> Trial:
        """These draws and others."""
        mine, theirs = self.residuals, other.residuals
        return Trial(
            self.draws.beside(other.draws),
            Residuals(np.concatenate([mine.each, theirs.each], axis=1), np.concatenate([mine.missing, theirs.missing])),
            np.concatenate([self.headings, other.headings], axis=1),
        )


@dataclass(frozen=True, slots=True)
class _Lazy(ColumnDomain):
    """Values of draws, where fields are asked only in the draws in which they count.

    Attributes:
        wanted: In which, (n,), by the id of the use; the others in all.
    """

    wanted: Mapping[int, NDArray[np.bool_]] = field(default_factory=dict[int, "NDArray[np.bool_]"])

    def on_map(self, node: OnMap, args: Sequence[Column]) -> Column:
        """What a region or vector field says of points or of other regions."""
        if id(node) in self.wanted:
            status = np.where(self.wanted[id(node)], args[1].status, UNDEFINED)
            args = (args[0], Column(args[1].data, status), *args[2:])
        return ColumnDomain.on_map(self, node, args)


class TrialSpace:
    """What draws of one group are made of, and what they come out as.

    Attributes:
        network: The constraints.
        hidden: The random variables.
        low, high: Ends of all coordinates, (k, 1).
        moving, whole: Which coordinates are numbers of any kind, and which whole ones.
        fields: The uses of fields.
        ways_back: How hidden points follow from what is observed.
        plain: The constraints on numbers alone.
    """

    def __init__(self, start: BoxSet) -> None:
        """Take the place of each random variable from a case."""
        network = self.network = start.network
        self.hidden: dict[Identity, HiddenValue] = {}
        count = 0
        for identity, leaf in network.leaves.items():
            each = HiddenValue.within(leaf, count, start.ranges[identity][..., 0])
            self.hidden[identity] = each
            count = each.rows.stop
        hidden = list(self.hidden.values())
        self.low = np.concatenate([np.empty((0, 1)), *(each.low for each in hidden)])
        self.high = np.concatenate([np.empty((0, 1)), *(each.high for each in hidden)])
        rows = [(row, each.is_whole) for each in hidden for row in range(each.rows.start, each.rows.stop)]
        self.moving = np.array([row for row, is_whole in rows if not is_whole], dtype=np.intp)
        self.whole = np.array([row for row, is_whole in rows if is_whole], dtype=np.intp)
        self._steps = steps_of(*(node for _, node, _ in network.items))
        self.fields = [node for node, _ in self._steps if isinstance(node, DirectionAt)]
        self.ways_back = steps_back(network.items, self._steps) if self.fields else []
        self.plain = [item for item in network.items if _is_plain(item)]
        self._plain_steps = steps_of(*(node for _, node, _ in self.plain))
        self._use = {id(node): number for number, node in enumerate(self.fields)}
        self._only_below: dict[int, list[tuple[int, int]]] = {}
        for select in [node for node, _ in self._steps if isinstance(node, Select) and self.fields]:
            if isinstance(select.index, Index) and any(not isinstance(option, Constant) for option in select.options):
                row = self.hidden[select.index.identity].rows.start
                for number in range(len(select.options)):
                    look()
                    for node in self._fields_below(select.index, number):
                        if (row, number) not in (known := self._only_below.setdefault(node, [])):
                            known.append((row, number))

    def _fields_below(self, index: Index, number: int) -> list[int]:
        """The uses of fields, by their ids, that count only where an option is chosen."""
        todo: list[Node] = [node for _, node, _ in self.network.items]
        seen: set[int] = set()
        while todo:
            node = todo.pop()
            if id(node) not in seen:
                seen.add(id(node))
                below = children(node)
                if isinstance(node, Select) and isinstance(node.index, Index) and node.index.identity is index.identity:
                    below = below[: 1 + number] + below[2 + number :]
                todo += below
        return [node for node in self._use if node not in seen]

    def run(self, draws: TrialDraws, headings: _Numbers | None = None) -> Trial:
        """What draws come out as; their coordinates are cut to their ends.

        Args:
            draws: The draws.
            headings: Where each use of a field points, (uses, n); None to ask the fields.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        count = draws.places.shape[1]
        known = self.values(self._steps, draws, None if headings is None else self._pointing(headings))
        with np.errstate(all="ignore"):
            residuals = residuals_of(self.network.items, known, self.network.tolerance, count)
        pointing = [np.broadcast_to(cast(_Numbers, known[id(node)].data), (count,)) for node in self.fields]
        return Trial(draws, residuals, np.stack([np.empty(count), *pointing])[1:])

    def least_broken(self, draws: TrialDraws, count: int) -> TrialDraws:
        """Those draws of which conditions on numbers alone miss least.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        if not self.plain:
            return draws.take(np.arange(count))
        known = self.values(self._plain_steps, draws)
        with np.errstate(all="ignore"):
            missing = residuals_of(self.plain, known, self.network.tolerance, draws.places.shape[1]).missing
        return draws.take(np.sort(np.argsort(missing, kind="stable")[:count]))

    def use_of(self, node: DirectionAt) -> int:
        """The number of a field's use among all."""
        return self._use[id(node)]

    def values(self, steps: Steps, draws: TrialDraws, given: Mapping[int, Column] | None = None) -> dict[int, Column]:
        """What expressions come out as, by their ids; coordinates are cut to their ends.

        Args:
            steps: Those of the expressions.
            draws: The draws.
            given: Values of some nodes, by their ids.

        Raises:
            CannotEvaluate: Geometry cannot tell.
        """
        look()
        count = draws.places.shape[1]
        draws.places[self.whole] = np.clip(
            np.round(draws.places[self.whole]), self.low[self.whole], self.high[self.whole]
        )

        def observed(node: Feature) -> Column:
            raise CannotEvaluate(f"`{node.property}` is not observed")

        def drawn(leaf: Leaf, args: Sequence[Column]) -> Column:
            each = self.hidden[leaf.identity]
            found = each.column(args, draws.places[each.rows])
            data = found.data if isinstance(found.data, tuple) else (cast(_Numbers, found.data),)
            held = np.stack([np.broadcast_to(axis, (count,)) for axis in data])
            draws.places[each.rows] = np.where(np.isnan(held), draws.places[each.rows], held)
            return found

        def pick(node: DirectionAt, counts: NDArray[np.intp]) -> NDArray[np.intp]:
            return (draws.shares[self._use[id(node)]] * counts).astype(np.intp)

        domain = _Lazy(observed, drawn, pick, LIMITS.witness_places, wanted=self._wanted(draws.places))
        with np.errstate(all="ignore"):
            return interpret(steps, domain, given)

    def _pointing(self, headings: _Numbers) -> dict[int, Column]:
        """The uses of fields, by their ids, as they point."""
        lost = np.isnan(headings)
        return {
            id(node): Column(headings[number], np.where(lost[number], UNDEFINED, DEFINED))
            for number, node in enumerate(self.fields)
        }

    def _wanted(self, places: _Numbers) -> dict[int, NDArray[np.bool_]]:
        """In which draws a field is asked for, (n,), by the id of its use, where choices leave it out in some."""
        return {
            node: reduce(np.logical_and, [places[row] == option for row, option in options])
            for node, options in self._only_below.items()
        }


def _is_plain(item: Item) -> bool:
    """Whether a constraint hangs on no point and no field, and on something random."""
    below = list(postorder([item[1]]))
    return any(map(is_leaf, below)) and not any(isinstance(node, PointIn | OnMap) for node in below)
