"""Plain requirements about the ego and one more object, decided for all samples of a track at once.

Which tracks can play a role at which samples is clear then before any label is matched, and the matcher need not ask
these requirements again.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from scenicq.forest.groups import PARAMS
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.walk import features, leaves
from scenicq.match.options import MatchOptions
from scenicq.store.tracks import RecordingTracks, TrackKey
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.samples import Samples
from scenicq.temporal.truth import FALSE, Truth

__all__ = ["StartColumns"]

_EGO: TrackKey = ("ego", "")


@dataclass(eq=False)
class StartColumns:
    """The requirements of a scenario that are decided so.

    Attributes:
        scenario: The scenario.
        options: Of the matcher; with any object as the ego, nothing is decided here.
    """

    scenario: Scenario
    options: MatchOptions
    by_role: dict[int, list[Requirement]] = field(init=False, default_factory=dict[int, list[Requirement]])

    def __post_init__(self) -> None:
        """Choose them; those about the ego alone have its index."""
        if self.options.ego != "label" or self.options.method != "auto":
            return
        for requirement in self.scenario.requirements:
            about = {index for index, _ in features(requirement.condition)}
            roles = about - {self.scenario.ego}
            noisy = any(self.scenario.objects[index].mutated for index in about if index != PARAMS)
            if requirement.built_in is not None or PARAMS in about or len(roles) > 1 or noisy:
                continue
            if not leaves(requirement.condition):
                self.by_role.setdefault(min(roles, default=self.scenario.ego), []).append(requirement)

    def rest(self) -> Scenario:
        """The scenario without them."""
        mine = {id(requirement) for found in self.by_role.values() for requirement in found}
        left = tuple(each for each in self.scenario.requirements if id(each) not in mine)
        return replace(self.scenario, requirements=left)

    def decide(self, tracks: RecordingTracks, role: int, track: TrackKey) -> list[tuple[Requirement, Truth]]:
        """The value of each requirement of a role at each sample, if a track plays it."""
        samples = Samples(tracks, {self.scenario.ego: _EGO, role: track}, 0, len(tracks))
        columns = AtomColumns(self.scenario, samples)
        found: list[tuple[Requirement, Truth]] = []
        for requirement in self.by_role.get(role, ()):
            expanded = columns.expanded(requirement.condition)
            if leaves(expanded):
                # what no label of the track observes is random: the matcher decides it
                found.append((requirement, columns.unknown()))
            else:
                found.append((requirement, columns.truth_of(expanded)))
        return found

    @staticmethod
    def excluded(values: list[tuple[Requirement, Truth]], sample: int) -> Requirement | None:
        """The first requirement that does not hold at a sample."""
        return next((requirement for requirement, truth in values if truth[sample] == FALSE), None)
