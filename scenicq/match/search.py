"""Object correspondence search: which candidate each slot gets (query paper, algorithm 1, lines 3-9 and 15).

Knows slots, candidates and causes, nothing of geometry. A callable judges partial assignments; the search backtracks to
what is to blame, and never looks at more than it must: slots with fewest candidates first, a matching of all slots to
distinct candidates as a necessary condition, interchangeable slots in one order only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

__all__ = ["Answer", "Exhausted", "Reporter", "SilentReporter", "Slot", "find_assignments", "matchable"]


class Answer(Enum):
    """What is known of a partial assignment."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Slot:
    """Something to be given a candidate.

    Attributes:
        name: Its index among the objects.
        candidates: Indices of the candidates that pass its own conditions, in order of preference.
    """

    name: int
    candidates: tuple[int, ...]


class Exhausted(Exception):
    """The search took more steps than it may."""


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


Check = Callable[[int, Mapping[int, int]], tuple[Answer, frozenset[int]]]
"""Judges an assignment after its newest slot got a candidate: the answer and the slots it rests on."""


def matchable(slots: Sequence[Slot]) -> Mapping[int, int] | None:
    """A way to give all slots distinct candidates, or None if there is none (augmenting paths)."""
    holder: dict[int, int] = {}
    by_name = {slot.name: slot for slot in slots}

    def place(name: int) -> bool:
        # Iterative depth-first augmentation: each frame is a slot and an iterator over its candidates.
        seen: set[int] = set()
        path: list[tuple[int, Iterator[int], int]] = [(name, iter(by_name[name].candidates), -1)]
        while path:
            slot, options, _ = path[-1]
            for candidate in options:
                if candidate in seen:
                    continue
                seen.add(candidate)
                path[-1] = (slot, options, candidate)
                if candidate not in holder:
                    for taker, _, taken in path:
                        holder[taken] = taker
                    return True
                owner = holder[candidate]
                path.append((owner, iter(by_name[owner].candidates), -1))
                break
            else:
                path.pop()
        return False

    for slot in slots:
        if not place(slot.name):
            return None
    return {slot: candidate for candidate, slot in holder.items()}


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
    budget: int = 1_000_000,
    reporter: Reporter | None = None,
) -> Iterator[dict[int, int]]:
    """Every assignment of distinct candidates to slots that passes the check, depth first with backjumping.

    Args:
        slots: What to assign, in any order.
        check: Called once for each extension, with the newest slot; must be consistent: an assignment that fails makes
            every extension fail.
        fixed: Slots assigned beforehand.
        twins: For a slot, an earlier one that is interchangeable with it: it then takes later candidates only.
        budget: Candidates to try at most.
        reporter: Watches.

    Raises:
        Exhausted: The budget is used up.
    """
    watch = reporter or SilentReporter()
    assignment = dict(fixed or {})
    used = {candidate: slot for slot, candidate in assignment.items()}
    order = _order(slots, twins or {})
    if matchable([Slot(s.name, tuple(c for c in s.candidates if c not in used)) for s in order]) is None:
        return
    if not order:
        yield dict(assignment)
        return
    names = {slot.name for slot in order}
    frames = [_Frame(order[0], iter(order[0].candidates))]
    while frames:
        frame = frames[-1]
        slot = frame.slot.name
        if slot in assignment:
            del used[assignment.pop(slot)]
        advanced = False
        for candidate in frame.options:
            budget -= 1
            if budget < 0:
                raise Exhausted
            if candidate in used:
                frame.blamed |= {used[candidate]} & names
                continue
            twin = (twins or {}).get(slot)
            if twin is not None and twin in assignment and candidate <= assignment[twin]:
                frame.blamed.add(twin)
                continue
            assignment[slot] = candidate
            answer, blamed = check(slot, assignment)
            if answer is Answer.NO:
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
            _jump(frames, frame, assignment, used, watch)
        elif len(frames) == len(order):
            yield dict(assignment)
            # Everything below a solution has to be tried for the next one: blame all that came before.
            for earlier, later in zip(order, order[1:], strict=False):
                frames[order.index(later)].blamed.add(earlier.name)
        else:
            following = order[len(frames)]
            frames.append(_Frame(following, iter(following.candidates)))


def _jump(
    frames: list[_Frame], failed: _Frame, assignment: dict[int, int], used: dict[int, int], watch: Reporter
) -> None:
    """Go back to the latest slot that the failed one blames, dropping those in between (conflict-directed)."""
    while frames and frames[-1].slot.name not in failed.blamed:
        dropped = frames.pop().slot.name
        if dropped in assignment:
            del used[assignment.pop(dropped)]
    if frames:
        back = frames[-1]
        back.blamed |= failed.blamed - {back.slot.name}
        watch.jumped(failed.slot.name, back.slot.name)


def _order(slots: Sequence[Slot], twins: Mapping[int, int]) -> list[Slot]:
    """Fewest candidates first; a twin right after the slot it follows, so that their order can prune."""
    followers = {earlier: later for later, earlier in twins.items()}
    by_name = {slot.name: slot for slot in slots}
    heads = [slot for slot in slots if slot.name not in twins or twins[slot.name] not in by_name]
    ordered: list[Slot] = []
    for slot in sorted(heads, key=lambda slot: (len(slot.candidates), slot.name)):
        current: int | None = slot.name
        while current is not None and current in by_name:
            ordered.append(by_name[current])
            current = followers.get(current)
    return ordered
