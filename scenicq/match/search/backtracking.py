"""Object correspondence search: which candidate each slot gets (query paper, algorithm 1, lines 3-9 and 15).

Knows slots, candidates and causes, nothing of geometry. A callable judges partial assignments; the search backtracks to
what is to blame, and never looks at more than it must: slots that hang together and have few candidates first, a
matching of all open slots to free candidates at every step, interchangeable slots in one order only.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from scenicq.budget import Exhausted, look
from scenicq.match.problem.bipartite_matching import BipartiteMatching, Slot

__all__ = ["Consistency", "Reporter", "SilentReporter", "find_assignments"]


class Consistency(Enum):
    """What is known of a partial assignment."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"


class Reporter(Protocol):
    """Watches a search; the tests and explanations are reporters."""

    def assigned(self, slot: int, candidate: int) -> None:
        """A slot is given a candidate that passes."""
        ...

    def rejected(self, slot: int, candidate: int, blamed: frozenset[int]) -> None:
        """A candidate is rejected because of the slots blamed, itself among them."""
        ...

    def jumped(self, slot: int, back_to: int) -> None:
        """A slot ran out of candidates and the search goes back to another."""
        ...


class SilentReporter:
    """A reporter that ignores everything."""

    def assigned(self, slot: int, candidate: int) -> None:
        """Nothing."""

    def rejected(self, slot: int, candidate: int, blamed: frozenset[int]) -> None:
        """Nothing."""

    def jumped(self, slot: int, back_to: int) -> None:
        """Nothing."""


Check = Callable[[int, Mapping[int, int]], tuple[Consistency, frozenset[int]]]
"""Judges an assignment after its newest slot got a candidate: the answer and the slots it rests on."""


@dataclass(slots=True)
class _Frame:
    slot: Slot
    options: Iterator[int]
    blamed: set[int] = field(default_factory=set[int])


def find_assignments(
    slots: Sequence[Slot],
    check: Check,
    *,
    fixed: Mapping[int, int] | None = None,
    twins: Mapping[int, int] | None = None,
    links: Mapping[int, Collection[int]] | None = None,
    ranks: Mapping[int, int] | None = None,
    budget: int = 1_000_000,
    spent: Exhausted | None = None,
    reporter: Reporter | None = None,
    in_order: bool = False,
) -> Iterator[dict[int, int]]:
    """Every assignment of distinct candidates to slots that passes the check, depth first with backjumping.

    Args:
        slots: What to assign, in any order.
        check: Called once for each extension, with the newest slot; must be consistent: an assignment that fails makes
            every extension fail.
        fixed: Slots assigned beforehand.
        twins: For a slot, an earlier one that is interchangeable with it: it then takes later candidates only.
        links: For a slot, those that it shares conditions with: they are assigned soon after it.
        ranks: In which order candidates stand, where that is not the order of their numbers.
        budget: Candidates to try at most; in order so many from one assignment to the next.
        spent: What is raised then; without it, that there are more steps.
        reporter: Watches.
        in_order: Whether slots are assigned in the order of their names, not the most constrained first.

    Raises:
        Exhausted: The budget is used up.
    """
    watch, most = reporter or SilentReporter(), budget
    assignment = dict(fixed or {})
    used = {candidate: slot for slot, candidate in assignment.items()}
    twin_of, rank = twins or {}, ranks or {}
    order = sorted(slots, key=lambda slot: slot.name) if in_order else _order(slots, twin_of, links or {})
    matching = BipartiteMatching([Slot(s.name, tuple(c for c in s.candidates if c not in used)) for s in order])
    if not matching.complete():
        return
    if not order:
        yield dict(assignment)
        return
    names = {slot.name for slot in order}
    waiting = _followers(order, twin_of)
    frames = [_Frame(order[0], iter(order[0].candidates))]

    def drop(slot: int) -> None:
        candidate = assignment.pop(slot)
        del used[candidate]
        matching.release(candidate)

    while frames:
        frame = frames[-1]
        slot = frame.slot.name
        if slot in assignment:
            drop(slot)
        advanced = False
        for candidate in frame.options:
            if candidate in used:
                frame.blamed |= {used[candidate]} & names
                continue
            twin = twin_of.get(slot)
            if twin is not None and twin in assignment and not _is_later(candidate, assignment[twin], rank):
                frame.blamed.add(twin)
                continue
            if slot in waiting:
                # those that are interchangeable with it take later ones, of which there must be enough
                later = [each for each in frame.slot.candidates if _is_later(each, candidate, rank)]
                if len(later) - sum(each in used for each in later) < waiting[slot]:
                    frame.blamed |= {used[each] for each in later if each in used} & names
                    continue
            look()
            budget -= 1
            if budget < 0:
                raise spent or Exhausted("budget", f"more than {most:,} steps")
            assignment[slot] = candidate
            answer, blamed = check(slot, assignment)
            if answer is not Consistency.NO:
                blocked = matching.pin(slot, candidate)
                # the open slots that are left without a candidate are so because of the assigned ones alone
                answer, blamed = (
                    (Consistency.NO, frozenset(blocked & assignment.keys())) if blocked else (answer, blamed)
                )
            if answer is Consistency.NO:
                del assignment[slot]
                frame.blamed |= (blamed - {slot}) & names
                watch.rejected(slot, candidate, blamed)
                continue
            used[candidate] = slot
            watch.assigned(slot, candidate)
            advanced = True
            break
        if not advanced:
            frames.pop()
            _jump(frames, frame, assignment, drop, watch)
        elif len(frames) == len(order):
            yield dict(assignment)
            budget = most if in_order else budget
            # below a solution nothing may be skipped: each slot goes back to the one before it
            for earlier, later in itertools.pairwise(frames):
                later.blamed.add(earlier.slot.name)
        else:
            following = order[len(frames)]
            frames.append(_Frame(following, iter(following.candidates)))


def _jump(
    frames: list[_Frame], failed: _Frame, assignment: Mapping[int, int], drop: Callable[[int], None], watch: Reporter
) -> None:
    """Go back to the latest slot that the failed one blames, dropping those in between (conflict-directed)."""
    while frames and frames[-1].slot.name not in failed.blamed:
        dropped = frames.pop().slot.name
        if dropped in assignment:
            drop(dropped)
    if frames:
        back = frames[-1]
        back.blamed |= failed.blamed - {back.slot.name}
        watch.jumped(failed.slot.name, back.slot.name)


def _is_later(one: int, other: int, ranks: Mapping[int, int]) -> bool:
    """Whether a candidate stands behind another one."""
    return ranks.get(one, one) > ranks.get(other, other)


def _followers(order: Sequence[Slot], twins: Mapping[int, int]) -> Mapping[int, int]:
    """For slots that others are interchangeable with, how many of the same candidates are taken after theirs."""
    found: dict[int, int] = {}
    candidates = {slot.name: slot.candidates for slot in order}
    for slot in reversed(order):
        if slot.name in twins and candidates.get(twins[slot.name]) == slot.candidates:
            found[twins[slot.name]] = found.get(slot.name, 0) + 1
    return found


def _order(slots: Sequence[Slot], twins: Mapping[int, int], links: Mapping[int, Collection[int]]) -> list[Slot]:
    """Slots most linked to those before them first, then fewest candidates; a twin never before the one it follows."""
    open_slots = {slot.name: slot for slot in slots}
    linked = dict.fromkeys(open_slots, 0)
    ordered: list[Slot] = []
    while open_slots:
        ready = [slot for slot in open_slots.values() if twins.get(slot.name) not in open_slots]
        chosen = min(ready, key=lambda slot: (-linked[slot.name], len(slot.candidates), slot.name))
        del open_slots[chosen.name]
        ordered.append(chosen)
        for other in links.get(chosen.name, ()):
            if other in linked:
                linked[other] += 1
    return ordered
