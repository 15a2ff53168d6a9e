"""Conditions that every run that matches meets: some at its first sample, some at one of its samples.

Where nobody reads what runs fail at, a track that does not meet them plays no role. Only what one object shows counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import (
    Arithmetic,
    Bearing,
    Compare,
    Constant,
    Coordinate,
    Feature,
    Logic,
    Node,
    Norm,
    Rotate,
    Scale,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import Atom
from scenicq.forest.walk import features, postorder
from scenicq.store.track_block import TrackBlock, in_order
from scenicq.temporal.atoms import AtomColumns, reads_start
from scenicq.temporal.first_exits import next_at
from scenicq.temporal.hidden import necessary_condition
from scenicq.temporal.required import RequiredAtoms
from scenicq.temporal.samples import MOVING, BoundSamples
from scenicq.temporal.starts import RoleCandidates, narrow_candidates
from scenicq.temporal.truth import FALSE, Truth

__all__ = ["NecessaryConditions"]

Members = NDArray[np.int64]
_NUMERIC = (
    Arithmetic, Bearing, Compare, Constant, Coordinate, Feature, Logic, Norm, Rotate, Scale, VectorOf, VectorSum,
)  # fmt: skip
"""Nodes of which columns are computed at once: all samples of a track are asked."""


@dataclass(eq=False, slots=True)
class NecessaryConditions:
    """What every run of a scenario that matches meets, as far as it is about one object beside the ego.

    Attributes:
        scenario: The scenario.
        at_start: Conditions at the first sample, by object.
        later: Conditions of which one holds at some sample, by object.
        within_s: How long after the first sample that is at most, or at the next sample.
    """

    scenario: Scenario
    at_start: dict[int, list[Node]] = field(init=False, default_factory=dict[int, "list[Node]"])
    later: dict[int, list[tuple[Node, ...]]] = field(init=False, default_factory=dict[int, "list[tuple[Node, ...]]"])
    within_s: float | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Read the conditions off the program."""
        dynamics = self.scenario.dynamics
        if dynamics is None:
            return
        required = RequiredAtoms.of(dynamics)
        self.within_s = required.within_s
        some: list[tuple[Atom, ...]] = [(atom,) for atom in required.later]
        if required.ends and self.within_s is None:
            some.append(required.ends)
        conditions = [necessary_condition(each) for each in dynamics.conditions]
        for atom in (*required.at_start, *required.always):
            condition = conditions[atom.number]
            if condition is not None and (role := self._role([condition])) is not None:
                self.at_start.setdefault(role, []).append(condition)
        for atoms in some:
            mine = tuple(each for atom in atoms if (each := conditions[atom.number]) is not None)
            if len(mine) == len(atoms) and (role := self._role(mine)) is not None:
                self.later.setdefault(role, []).append(mine)

    def _role(self, conditions: Sequence[Node]) -> int | None:
        """The one object beside the ego that conditions are about, if each sample by itself says whether they hold."""
        about = features(*conditions)
        roles = {index for index, _ in about} - {self.scenario.ego}
        moving = all(index != PARAMS and name in MOVING for index, name in about)
        cheap = all(isinstance(node, _NUMERIC) for node in postorder(tuple(conditions)))
        if len(roles) != 1 or not moving or not cheap or any(map(reads_start, conditions)):
            return None
        return roles.pop()

    def narrow(self, block: TrackBlock, candidates: RoleCandidates) -> RoleCandidates:
        """The candidates without those whose tracks do not meet the conditions, in labels that have some for each role.

        Args:
            block: The recordings.
            candidates: The labels, and who may play whom beside their own egos.
        """
        may = dict(candidates.may)
        for role in self.at_start.keys() & may.keys():
            for condition in self.at_start[role]:
                chosen = np.flatnonzero(may[role])
                truth = self._truth(block, role, candidates.members[chosen], condition)
                may[role] = _without(may[role], chosen[truth == FALSE])
        if later := self.later.keys() & may.keys():
            tracks = _Tracks.of(block)
            for role in later:
                for conditions in self.later[role]:
                    chosen = np.flatnonzero(may[role])
                    met = self._met(block, tracks, role, candidates.members[chosen], conditions)
                    may[role] = _without(may[role], chosen[~met])
        place = np.searchsorted(candidates.labels, block.label_of[candidates.members])
        there = [np.bincount(place[mine], minlength=len(candidates.labels)) > 0 for mine in may.values()]
        found = RoleCandidates(candidates.labels, candidates.members, may)
        return narrow_candidates(found, np.logical_and.reduce(there), place) if there else found

    def _truth(self, block: TrackBlock, role: int, members: Members, condition: Node) -> Truth:
        """The value of a condition where an object plays a role."""
        places = BoundSamples(
            block, {self.scenario.ego: block.present_ego(block.label_of[members]), role: members}, len(members)
        )
        return AtomColumns(self.scenario, places).truth_of(condition)

    def _met(
        self, block: TrackBlock, tracks: _Tracks, role: int, members: Members, conditions: Sequence[Node]
    ) -> NDArray[np.bool_]:
        """Whether one of some conditions may hold of the tracks of members, from their samples on."""
        at = tracks.place[members]
        wanted = np.zeros(len(tracks.last), np.bool_)
        wanted[tracks.last[at]] = True
        # a track is known by its last place
        mine = np.flatnonzero(wanted[tracks.last])
        holds = np.zeros(len(tracks.last), np.bool_)
        for condition in conditions:
            holds[mine] |= self._truth(block, role, tracks.order[mine], condition) > FALSE
        first = next_at(holds)[at]
        met = first <= tracks.last[at]
        if self.within_s is not None:
            due = block.labels_after(block.label_of[members], self.within_s)
            met &= block.label_of[tracks.order[np.minimum(first, len(tracks.order) - 1)]] <= due
        # where a track is not seen, the condition may hold
        return met | tracks.gaps[at]


@dataclass(frozen=True, slots=True)
class _Tracks:
    """The label objects of a block, track by track in order of time.

    Attributes:
        order: The member at each place.
        place: The place of each member that is a label object.
        last: The last place of the same track, for each place.
        gaps: Whether the track is not seen in some label between its first and its last one, for each place.
    """

    order: Members
    place: Members
    last: Members
    gaps: NDArray[np.bool_]

    @classmethod
    def of(cls, block: TrackBlock) -> _Tracks:
        """Those of a block."""
        m = block.object_count
        tracks = block.tracks(np.arange(m))
        order = in_order(tracks)
        place = np.empty(m, np.int64)
        place[order] = np.arange(m)
        ends = np.append(np.diff(tracks[order]) != 0, True)[:m]
        lasts = np.flatnonzero(ends)
        number = np.cumsum(ends) - ends
        labels = block.label_of[order]
        skips = np.append(0, np.diff(labels) > 1)[:m]
        skips[1:][ends[:-1]] = 0
        gaps = np.bincount(number, skips, minlength=len(lasts)) > 0
        return cls(order, place, lasts[number], gaps[number])


def _without(may: NDArray[np.bool_], which: NDArray[np.int64]) -> NDArray[np.bool_]:
    found = may.copy()
    found[which] = False
    return found
