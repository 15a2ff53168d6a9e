"""Distinct candidates for slots: a maximum bipartite matching, kept while slots are pinned and released."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

__all__ = ["BipartiteMatching", "Slot", "matchable"]


@dataclass(frozen=True, slots=True)
class Slot:
    """Something to be given a candidate.

    Attributes:
        name: Its index among the objects.
        candidates: Indices of the candidates that pass its own conditions, in the order in which they are tried.
    """

    name: int
    candidates: tuple[int, ...]


class BipartiteMatching:
    """A matching of all slots to distinct candidates, kept while slots are pinned to candidates and released."""

    def __init__(self, slots: Sequence[Slot]) -> None:
        self.options = {slot.name: slot.candidates for slot in slots}
        self.mate: dict[int, int] = {}
        self.holder: dict[int, int] = {}
        self.pinned: dict[int, int] = {}

    def _augment(self, name: int) -> set[int]:
        """Match a slot along an augmenting path; empty on success, else the pinned slots that stand in the way."""
        blocked: set[int] = set()
        seen: set[int] = set()
        path: list[tuple[int, Iterator[int], int]] = [(name, iter(self.options[name]), -1)]
        while path:
            slot, options, _ = path[-1]
            # a free one ends the path at once
            free = next((c for c in self.options[slot] if c not in self.holder and c not in self.pinned), None)
            if free is not None:
                path[-1] = (slot, options, free)
                for taker, _, taken in path:
                    self.mate[taker], self.holder[taken] = taken, taker
                return set()
            for candidate in options:
                if candidate in seen:
                    continue
                seen.add(candidate)
                if candidate in self.pinned:
                    blocked.add(self.pinned[candidate])
                    continue
                path[-1] = (slot, options, candidate)
                owner = self.holder.get(candidate)
                if owner is None:
                    for taker, _, taken in path:
                        self.mate[taker], self.holder[taken] = taken, taker
                    return set()
                path.append((owner, iter(self.options[owner]), -1))
                break
            else:
                path.pop()
        return blocked | {name}

    def complete(self) -> bool:
        """Match every slot, if that is possible."""
        return not any(self._augment(name) for name in self.options if name not in self.mate)

    def pin(self, slot: int, candidate: int) -> set[int]:
        """Fix a slot on a candidate that nothing is fixed on, and keep the rest matched.

        Returns:
            Empty on success. Else nothing has changed, and these are the slots whose pins forbid it, with the one that
            would be left without a candidate.
        """
        old, displaced = self.mate[slot], self.holder.get(candidate)
        self.pinned[candidate] = slot
        if old == candidate:
            return set()
        before = (dict(self.mate), dict(self.holder)) if displaced is not None else None
        del self.holder[old]
        self.mate[slot], self.holder[candidate] = candidate, slot
        if displaced is None or before is None:
            return set()
        del self.mate[displaced]
        blocked = self._augment(displaced)
        if blocked:
            self.mate, self.holder = before
            del self.pinned[candidate]
        return blocked

    def release(self, candidate: int) -> None:
        """Let a slot move again."""
        del self.pinned[candidate]


def matchable(slots: Sequence[Slot]) -> Mapping[int, int] | None:
    """A way to give all slots distinct candidates, or None if there is none (augmenting paths)."""
    matching = BipartiteMatching(slots)
    return matching.mate if matching.complete() else None
