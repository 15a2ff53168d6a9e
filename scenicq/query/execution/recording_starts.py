"""The starts of runs in a block of recordings, between the matcher's labels and the arrays of a block.

The matcher finds correspondences of a label; here they become *members*, rows of the block that follow an object over
time. Arrays find starts as members; here they become labels, which the matcher can be asked about.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import COURSE, LAST_LANE
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS
from scenicq.match.explanation import Finding
from scenicq.match.matcher import Matcher
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.symmetry import classes_of_twins
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.store.labels import Label, LabelObject, Motion
from scenicq.store.reader import LAST
from scenicq.store.track_block import TrackBlock
from scenicq.store.tracks import TrackKey
from scenicq.temporal.stretches import StartTable

__all__ = [
    "DecidedStart",
    "NearestRoles",
    "decided_starts",
    "find_starts",
    "make_start_label",
    "order_by_distance",
    "start_table",
]


@dataclass(frozen=True, slots=True)
class DecidedStart:
    """A start that the matcher has decided.

    Attributes:
        members: The member in each role, by the role's index; interchangeable roles have theirs in the order of tracks.
        found: The members as the matcher found them, which the verdict is about.
        verdict: A match, or unknown.
        label: The label.
        correspondence: The label object of each role, by names.
    """

    members: Mapping[int, int]
    found: Mapping[int, int]
    verdict: Match | Unknown
    label: Label
    correspondence: Mapping[str, str]


def find_starts(
    matcher: Matcher, label: Label, starts: Counter[str], *, among: Candidates | None = None
) -> list[Finding]:
    """Find the starts in a label; the last finding is unknown if the recording has more starts than can be held.

    Args:
        matcher: The matcher.
        label: The label.
        starts: Counts the starts of the recording that match and that are open; those of the label are added.
        among: Candidates of the roles, where they are known.
    """
    findings: list[Finding] = []
    for finding in matcher.findings(label, candidates=among, every_open=True):
        if finding.plan is not None:
            kind = "match" if isinstance(finding.verdict, Match) else "open"
            if starts[kind] >= LIMITS.recording_starts:
                cause = Cause("correspondence search", f"more than {LIMITS.recording_starts:,} starts in the recording")
                return [*findings, Finding(Unknown("budget", cause))]
            starts[kind] += 1
        findings.append(finding)
    return findings


def decided_starts(
    scenario: Scenario, block: TrackBlock, label: Label, members: Sequence[int], findings: Iterable[Finding]
) -> Iterator[DecidedStart | Unknown]:
    """Turn findings into starts of a block; what is undecided without a whole correspondence stays an `Unknown`.

    Interchangeable objects take their tracks in one order in all labels.

    Args:
        scenario: The scenario.
        block: The block, which has the label.
        label: The label.
        members: Its ego and its objects as members of the block.
        findings: What `find_starts` found in it.
    """
    for finding in findings:
        verdict = finding.verdict
        if isinstance(verdict, NoMatch):
            continue
        if finding.search is None or finding.plan is None:
            if isinstance(verdict, Unknown):
                yield verdict
            continue
        numbers = {**finding.assignment, scenario.ego: finding.search.problem.ego}
        own = {index: members[number] for index, number in numbers.items()}
        chosen = dict(own)
        for twins in classes_of_twins(finding.plan.twins):
            ordered = sorted([chosen[index] for index in twins], key=block.key)
            chosen.update(zip(sorted(twins), ordered, strict=True))
        yield DecidedStart(chosen, own, verdict, label, verdict.correspondence)


@dataclass(frozen=True, slots=True)
class NearestRoles:
    """The correspondence of a start as it is reported: interchangeable objects come nearest first.

    Attributes:
        members: The member in each role, by the role's index.
        tracks: The tracks of these members.
        place: Sorts starts: role by role, the distance from the ego, then the name.
    """

    members: Mapping[int, int]
    tracks: Mapping[int, TrackKey]
    place: tuple[tuple[float, TrackKey], ...]


def order_by_distance(
    scenario: Scenario, table: StartTable, twins: Mapping[int, int], wanted: NDArray[np.int64]
) -> list[NearestRoles]:
    """Order interchangeable objects of some starts by their distance from the ego, as results report them.

    Args:
        scenario: The scenario.
        table: The starts.
        twins: For a role, an earlier one that is interchangeable with it over time.
        wanted: The numbers of the starts.
    """
    block, ego = table.block, table.members[scenario.ego][wanted]
    x, y = block.numbers("x"), block.numbers("y")
    indices = sorted(table.members)
    chosen = [table.members[index][wanted] for index in indices]
    far = [(x[mine] - x[ego]) ** 2 + (y[mine] - y[ego]) ** 2 for mine in chosen]
    keys = [block.keys(mine) for mine in chosen]
    classes = [sorted(each) for each in classes_of_twins(twins)]
    found: list[NearestRoles] = []
    for members, away, tracks in zip(
        zip(*(mine.tolist() for mine in chosen), strict=True),
        zip(*(each.tolist() for each in far), strict=True),
        zip(*keys, strict=True),
        strict=True,
    ):
        roles = dict(zip(indices, zip(away, tracks, members, strict=True), strict=True))
        for alike in classes:
            roles.update(zip(alike, sorted(roles[index] for index in alike), strict=True))
        found.append(
            NearestRoles(
                {index: member for index, (_, _, member) in roles.items()},
                {index: track for index, (_, track, _) in roles.items()},
                tuple((away, track) for index, (away, track, _) in roles.items() if index != scenario.ego),
            )
        )
    return found


def start_table(
    scenario: Scenario, block: TrackBlock, arrays: Mapping[int, NDArray[np.int64]], decided: Sequence[DecidedStart],
    outcome: int = 0,
) -> StartTable:  # fmt: skip
    """Make the table of all starts of a block: first those that arrays found, then those that the matcher decided.

    Args:
        scenario: The scenario.
        block: The block.
        arrays: The members of starts that arrays found, by role.
        decided: Starts that the matcher decided.
        outcome: Number of the outcome of the choices over time.
    """
    indices = sorted(owner.index for owner in scenario.objects)
    members = {
        index: np.concatenate(
            (arrays.get(index, np.empty(0, np.int64)), np.array([each.members[index] for each in decided], np.int64))
        )
        for index in indices
    }
    before = len(members[indices[0]]) - len(decided)
    sure = np.concatenate((np.ones(before, np.bool_), [isinstance(each.verdict, Match) for each in decided]))
    return StartTable(block, members, sure.astype(np.bool_), np.full(len(sure), outcome))


def make_start_label(
    scenario: Scenario, block: TrackBlock, members: Mapping[int, int], map_name: str, relevant: Sequence[frozenset[str]]
) -> tuple[Label, dict[str, str]]:
    """Make the label of a start, with only the objects that play a role and what is relevant, and the correspondence.

    Args:
        scenario: The scenario; its ego is the label's.
        block: The block.
        members: Row of the label object of each role.
        map_name: The map of the label.
        relevant: The properties that matter of each object.
    """
    at = int(block.label_of[members[scenario.ego]])
    objects: list[LabelObject] = []
    names: dict[str, str] = {}
    for owner in scenario.objects:
        if owner.index == scenario.ego:
            names[owner.name] = "ego"
        else:
            names[owner.name] = f"{len(objects)}"
            objects.append(_object(block, members[owner.index], names[owner.name], relevant[owner.index]))
    ego = _object(block, members[scenario.ego], "ego", relevant[scenario.ego])
    recording = int(block.recording_of[at])
    label = Label(f"{at}", f"{recording}", int(block.times_us[at]), map_name, ego, tuple(objects))
    if any(COURSE in mine for mine in relevant):
        # by these names the tracks are found that courses are made of
        label = replace(label, frame=block.frame(at), recording=block.name(recording), recorded=block.recorded)
    return label, names


def _object(block: TrackBlock, member: int, id_: str, relevant: frozenset[str]) -> LabelObject:
    def number(name: str, column: str | None = None) -> float | None:
        if name not in relevant:
            return None
        value = float(block.numbers(column or name)[member])
        return None if math.isnan(value) else value

    moves = "velocity" if "velocity" in relevant else "speed"
    vx, vy = number(moves, "motion_vx"), number(moves, "motion_vy")
    velocity = None if vx is None or vy is None else (vx, vy)
    motion = Motion(velocity, number("acceleration"), number("angularSpeed", "yaw_rate"), derived=True)
    kind, name = block.key(member) if COURSE in relevant else ("", "")
    track = name if kind == "track" else None
    codes, classes = block.categories()
    said_codes, said = block.said()
    return LabelObject(
        id_, classes[int(codes[member])], "",
        float(block.numbers("x")[member]), float(block.numbers("y")[member]), number("heading"),
        number("width"), number("length"), number("height"), None, track, said[int(said_codes[member])], motion,
        last_lane=number(LAST_LANE, LAST),
    )  # fmt: skip
