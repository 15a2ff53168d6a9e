"""A witness by trial: values of the random variables drawn where narrowing leaves them, better ones near the best.

Where a label matches, this mostly finds a witness long before all ways that fields may point have been gone through
(cross-entropy method: what is drawn next spreads around the best of what was drawn before). It refutes nothing. Where
going through the ways takes long, it is worth more draws, in which roads that branch are tried anew (`Effort`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import DEFINED, Column
from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.groups import Comparison
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import (
    Constant,
    DirectionAt,
    DiscreteRange,
    Feature,
    Identity,
    Index,
    Leaf,
    PointIn,
    Value,
)
from scenicq.geometry import shapes
from scenicq.geometry.angles import normalize_array
from scenicq.geometry.regions import PolylineSet, Region, UnionOf
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Satisfied
from scenicq.match.tolerance import SLACK, Margin, Tolerance

__all__ = ["LITTLE", "MUCH", "Effort", "probed"]


@dataclass(frozen=True, slots=True)
class Effort:
    """How much a trial is worth.

    Attributes:
        draws: Values of each random variable that are tried at once.
        best: Of these, how many the next ones are drawn around.
        idle: Rounds in a row without progress of which the last is the last of all.
        anew: The share of draws that take any of several headings, whatever was best before.
    """

    draws: int
    best: int
    idle: int
    anew: float


LITTLE = Effort(96, 8, 2, 0.0)
MUCH = Effort(512, 32, 3, 0.1)
_ROUNDS = 12
_CLOSER = 0.45
"""The share of the spread of one round that the next one has."""
_PROGRESS = 0.7
"""A round that leaves more than this share of what is missing made no progress."""
_METRES_A_RADIAN = 5.0
"""How much a wrong heading counts beside a wrong place."""
_REPLAYED = 6
"""Draws that are put to the test."""
_FEW, _NARROW = 4, 0.01
"""Draws of the first round where no range is wider than this."""
_MOST_PLACES = 4096
"""Places at which the map is asked at once."""

_Numbers = NDArray[np.float64]


def probed(start: BoxSet, tolerance: Tolerance, effort: Effort = LITTLE) -> Satisfied | None:
    """A witness of a group with fields at hidden points, or None if none was found.

    Args:
        start: One case: where the random variables can be.
        tolerance: Per feature.
        effort: How much it is worth.
    """
    items = list(start.network.items)
    spaces: dict[Identity, _Line | _Box] = {}
    for identity, leaf in start.network.leaves.items():
        space = _space(leaf, start.ranges[identity][..., 0])
        if space is None:
            return None
        spaces[identity] = space
    rng = np.random.default_rng(0)
    draws = _Draws.anywhere(spaces, rng, effort)
    before, idle, replayed = np.inf, 0, 0
    for number in range(1, _ROUNDS + 1):
        look()
        try:
            missing, headings = _missing(items, draws, spaces, tolerance)
        except CannotEvaluate:
            return None
        order = np.argsort(missing, kind="stable")
        for index in order[missing[order] <= 0][: _REPLAYED - replayed].tolist():
            replayed += 1
            values = {identity: space.value(draws.places[identity][:, index]) for identity, space in spaces.items()}
            pointing = {key: float(each[index]) for key, each in headings.items()}
            if replay(items, values, tolerance, SLACK, pointing):
                return Satisfied(values)
        least = float(missing[order[0]])
        idle = idle + 1 if least > _PROGRESS * before else 0
        if not np.isfinite(least) or idle == effort.idle or replayed == _REPLAYED:
            return None
        before = least
        draws = draws.near(order[: effort.best], spaces, _CLOSER**number)
    return None


@dataclass(frozen=True, eq=False)
class _Box:
    """Numbers, or points of a box, each coordinate by itself.

    Attributes:
        low, high: Ends of each coordinate, (k, 1).
        whole: Whether only whole numbers count.
    """

    low: _Numbers
    high: _Numbers
    whole: bool = False

    def column(self, place: _Numbers) -> Column:
        """The values at places (k, n)."""
        data = (place[0], place[1]) if len(place) == 2 else place[0]
        return Column(data, np.full(1, DEFINED))

    def value(self, place: _Numbers) -> Value:
        """The value at one place (k,)."""
        found: list[float] = place.tolist()
        return (found[0], found[1]) if len(found) == 2 else found[0]


@dataclass(frozen=True, eq=False)
class _Line:
    """Points of polylines, by how far along them, one after the other.

    Attributes:
        low, high: Zero and the length of all of them in metres, (1, 1).
        starts: Where each begins, by the length of those before it.
        segments: Their segments, (n, 4) rows x0, y0, x1, y1.
    """

    low: _Numbers
    high: _Numbers
    starts: _Numbers
    segments: _Numbers
    whole: bool = False

    def points(self, place: _Numbers) -> _Numbers:
        """The points (2, n) at places (1, n)."""
        along: _Numbers = place[0]
        number = np.clip(np.searchsorted(self.starts, along, side="right") - 1, 0, len(self.segments) - 1)
        x0, y0, x1, y1 = self.segments[number].T
        share = np.clip((along - self.starts[number]) / np.hypot(x1 - x0, y1 - y0), 0.0, 1.0)
        return np.stack([x0 + share * (x1 - x0), y0 + share * (y1 - y0)])

    def column(self, place: _Numbers) -> Column:
        """The points at places (1, n)."""
        x, y = self.points(place)
        return Column((x, y), np.full(1, DEFINED))

    def value(self, place: _Numbers) -> Value:
        """The point at one place (1,)."""
        ((x,), (y,)) = self.points(place[:, None]).tolist()
        return x, y


@dataclass(eq=False)
class _Draws:
    """What is tried at once.

    Attributes:
        places: Of each random variable, in the coordinates of its space, (k, n).
        rng: What they are drawn by.
        effort: How much the trial is worth.
        picks: For each use of a field shares of one that tell which of several headings it has, (n,).
    """

    places: dict[Identity, _Numbers]
    rng: np.random.Generator
    effort: Effort
    picks: dict[int, _Numbers] = field(default_factory=dict[int, _Numbers])

    @classmethod
    def anywhere(cls, spaces: Mapping[Identity, _Line | _Box], rng: np.random.Generator, effort: Effort) -> _Draws:
        """Evenly over all that there is."""
        wide = any(bool((each.high - each.low > _NARROW).any()) for each in spaces.values())
        count = effort.draws if wide else _FEW
        places = {
            identity: _rounded(each, each.low + rng.random((len(each.low), count)) * (each.high - each.low))
            for identity, each in spaces.items()
        }
        return cls(places, rng, effort)

    def near(self, best: NDArray[np.intp], spaces: Mapping[Identity, _Line | _Box], spread: float) -> _Draws:
        """The best again, and others around them."""
        count = self.effort.draws
        mine = best[np.arange(count) % len(best)]
        places: dict[Identity, _Numbers] = {}
        for identity, each in spaces.items():
            off = self.rng.standard_normal((len(each.low), count)) * spread * (each.high - each.low)
            off[:, : len(best)] = 0.0
            moved = self.places[identity][:, mine] + off
            places[identity] = _rounded(each, np.clip(moved, each.low, each.high))
        picks = {key: each[mine % len(each)] for key, each in self.picks.items()}
        if self.effort.anew:
            for each in picks.values():
                anew = self.rng.random(count) < self.effort.anew
                anew[: len(best)] = False
                each[anew] = self.rng.random(int(anew.sum()))
        return _Draws(places, self.rng, self.effort, picks)

    def pick(self, node: DirectionAt, counts: NDArray[np.intp]) -> NDArray[np.intp]:
        """Which of some headings each draw has at a use of a field."""
        if id(node) not in self.picks:
            self.picks[id(node)] = self.rng.random(self.effort.draws)
        shares = self.picks[id(node)]
        return (shares[: counts.size] * counts).astype(np.intp) if counts.size > 1 else np.zeros(1, dtype=np.intp)


def _rounded(space: _Line | _Box, place: _Numbers) -> _Numbers:
    return np.round(place) if space.whole else place


def _space(leaf: Leaf, limits: _Numbers) -> _Line | _Box | None:
    """Where a random variable can be, between the ends (2,) or corners (2, 2: axis, end); None without ends."""
    low, high = limits.reshape(-1, 2).T[..., None]
    if not np.isfinite(limits).all():
        return None
    if isinstance(leaf, PointIn) and isinstance(leaf.region, Constant):
        sets = _polylines(cast(Region, leaf.region.value))
        if sets is not None:
            return _line(sets, (low[0, 0], low[1, 0], high[0, 0], high[1, 0]))
    whole = isinstance(leaf, Index | DiscreteRange)
    return _Box(np.ceil(low), np.floor(high), whole=True) if whole else _Box(low, high)


def _polylines(region: Region) -> list[PolylineSet] | None:
    """The polylines that make up a region; None if it is made of anything else."""
    sets: list[PolylineSet] = []
    todo = [region]
    while todo:
        part = todo.pop()
        if isinstance(part, UnionOf):
            todo += reversed(part.parts)
        elif isinstance(part, PolylineSet):
            sets.append(part)
        else:
            return None
    return sets


def _line(sets: Sequence[PolylineSet], bounds: tuple[float, float, float, float]) -> _Line | None:
    """The parts of polylines in a box; None if there are none."""
    west, south, east, north = bounds
    box = (west - SLACK, south - SLACK, east + SLACK, north + SLACK)
    area = shapes.box(*box)
    cut = shapes.simple_parts([shapes.intersection(piece, area) for each in sets for piece in each.near(box)])
    edges = [shapes.coordinates(part) for part in cut if part.geom_type == "LineString"]
    if not edges:
        return None
    segments = np.concatenate([np.concatenate([line[:-1], line[1:]], axis=1) for line in edges])
    lengths = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    segments, lengths = segments[lengths > 0], lengths[lengths > 0]
    ends = np.cumsum(lengths)
    if not len(ends):
        return None
    return _Line(np.zeros((1, 1)), ends[-1:, None], ends - lengths, segments)


def _missing(
    items: Sequence[Item], draws: _Draws, spaces: Mapping[Identity, _Line | _Box], tolerance: Tolerance
) -> tuple[_Numbers, dict[int, _Numbers]]:
    """How far each draw is from what the label observes, (n,), and where each field points, by the id of its use."""
    compared = [item for item in items if isinstance(item[0], Comparison)]
    count = len(next(iter(draws.places.values()))[0])

    def observed(node: Feature) -> Column:
        raise CannotEvaluate(f"`{node.property}` is not observed")

    def drawn(leaf: Leaf, _: Sequence[Column]) -> Column:
        return spaces[leaf.identity].column(draws.places[leaf.identity])

    roots = [node for _, node, _ in compared]
    with np.errstate(all="ignore"):
        known = interpret(steps_of(*roots), ColumnDomain(observed, drawn, draws.pick, _MOST_PLACES))
    missing = np.zeros(count)
    for constraint, node, seen in compared:
        assert isinstance(constraint, Comparison)
        margin = tolerance.of(constraint.object, constraint.property)
        missing = missing + _off(known[id(node)], seen, margin)
    fields = [node for node, _ in steps_of(*roots) if isinstance(node, DirectionAt)]
    pointing = {id(node): known[id(node)] for node in fields}
    return missing, {key: np.broadcast_to(cast(_Numbers, each.data), (count,)) for key, each in pointing.items()}


def _off(column: Column, seen: Value, margin: Margin) -> _Numbers:
    """By how much values miss what a label observes, beyond the tolerance; infinite where there is none."""
    data = column.data
    if isinstance(data, tuple) and isinstance(seen, tuple):
        dx, dy = np.abs(data[0] - seen[0]), np.abs(data[1] - seen[1])
        if margin.kind == "box":
            off = np.maximum(dx - margin.size, 0) + np.maximum(dy - margin.y, 0)
        else:
            off = np.maximum(np.hypot(dx, dy) - margin.size, 0)
    elif isinstance(data, np.ndarray) and isinstance(seen, float):
        turned = np.abs(normalize_array(data - seen)) if margin.kind == "arc" else np.abs(data - seen)
        off = np.maximum(turned - margin.size, 0) * (_METRES_A_RADIAN if margin.kind == "arc" else 1.0)
    else:
        return np.zeros(1)
    return np.where(np.equal(column.status, DEFINED) & np.isfinite(off), off, np.inf)
