"""In which lanes the roles of a match stand, where the program asks for lanes of theirs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

from scenicq.compiler.element_lookups import LookupTable
from scenicq.forest.nodes import AheadInLanes, Constant, DirectionAt, Feature, Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.simplify import roots_of
from scenicq.forest.walk import postorder
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import ElementAtPoint, Occupancy
from scenicq.match.verdict import Match
from scenicq.query.execution.members import Members, fill_by_recording
from scenicq.query.execution.results import ObjectLanes, Result
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.reader import LAST

__all__ = ["OwnLanes", "show_standing"]


@dataclass(frozen=True, slots=True)
class _Asked:
    """How the lanes of a role are asked for.

    Attributes:
        lanes: The lanes of the map.
        along: Whether those are its own that lead its way.
    """

    lanes: Occupancy
    along: bool


def _asked_by(node: Node) -> _Asked | None:
    """How a node asks for the lanes at a place, if it does."""
    match node:
        case DirectionAt(field=Constant(value=ElementAtPoint() as ranked)) if ranked.options.is_of_lanes:
            return _Asked(ranked.options, ranked.by_heading)
        case AheadInLanes():
            return _Asked(_lanes_of(node.network), not isinstance(node.heading, Constant))
        case _:
            return None


@lru_cache(maxsize=16)
def _lanes_of(network: Network) -> Occupancy:
    return LookupTable.of_network(network, "laneAt").occupancy


@dataclass(eq=False)
class OwnLanes:
    """Names the lanes of roles.

    Attributes:
        scenario: The scenario.
    """

    scenario: Scenario

    @cached_property
    def asked(self) -> dict[str, _Asked]:
        """The roles whose lanes are asked for, by name, in the order of the program."""
        found: dict[int, _Asked] = {}
        for node in postorder(roots_of(self.scenario)):
            asked = _asked_by(node)
            if asked is not None and isinstance(node, DirectionAt | AheadInLanes) and isinstance(node.point, Feature):
                before = found.get(node.point.object)
                along = asked.along or (before is not None and before.along)
                found[node.point.object] = _Asked(asked.lanes, along)
        return {owner.name: found[owner.index] for owner in self.scenario.objects if owner.index in found}

    def of_label(self, label: Label, correspondence: Mapping[str, str]) -> dict[str, ObjectLanes]:
        """The lanes of the roles that play in a label.

        Args:
            label: The label.
            correspondence: The label object of each role.
        """
        if not self.asked:
            return {}
        known = {each.id: each for each in label.objects} | ({"ego": label.ego} if label.has_ego else {})
        there = ((name, known.get(correspondence.get(name, ""))) for name in self.asked)
        return {
            name: self._standing(name, each.x, each.y, each.heading, each.last_lane)
            for name, each in there
            if each is not None
        }

    def _standing(self, name: str, x: float, y: float, heading: float | None, last: float | None) -> ObjectLanes:
        asked = self.asked[name]
        going = heading if asked.along and heading is not None else math.nan
        found = asked.lanes.owners_at((x, y), going, math.nan if last is None else last)
        return ObjectLanes(tuple(lane for lane, own in found if own), tuple(lane for lane, own in found if not own))

    def at_the_start(self, dataset: Dataset, results: Sequence[Result]) -> Iterator[Result]:
        """Put the lanes at their first frames into intervals that match.

        Args:
            dataset: The dataset.
            results: The intervals, those of one recording together.
        """
        return fill_by_recording(results, partial(self._of_recording, dataset))

    def _of_recording(self, dataset: Dataset, recording: str, results: Iterable[Result]) -> Iterator[Result]:
        with Members.of_recording(dataset, recording) as members:
            columns = [members.block.numbers(name) for name in ("x", "y", "heading", LAST)]
            for each in results:
                if not isinstance(each.verdict, Match):
                    yield each
                    continue
                roles, number = each.verdict.correspondence, members.numbers[each.frame]
                playing = {
                    name: int(members.along(roles[name], number, number + 1)[0]) for name in self.asked if name in roles
                }
                lanes = {
                    name: self._standing(name, *(float(column[member]) for column in columns))
                    for name, member in playing.items()
                    if member >= 0
                }
                yield replace(each, lanes=lanes)


def show_standing(standing: ObjectLanes) -> str:
    """In which lanes somebody stands, as text."""
    own = f"in {' or '.join(f'`{lane}`' for lane in standing.own)}" if standing.own else "in no lane"
    return f"{own}, lies in {', '.join(f'`{lane}`' for lane in standing.others)}, too" if standing.others else own
