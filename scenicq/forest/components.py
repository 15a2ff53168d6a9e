"""Connected components: what hangs together because it shares something, directly or through others."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence

__all__ = ["connected_components"]


def connected_components(used: Sequence[Collection[Hashable]]) -> list[list[int]]:
    """Partition numbers so that those that use something in common are together (union-find).

    Args:
        used: What each number uses; a number that uses nothing is a part by itself.

    Returns:
        The parts, numbers ascending within each, by their first number.
    """
    parent = list(range(len(used)))

    def root(number: int) -> int:
        while parent[number] != number:
            parent[number] = parent[parent[number]]
            number = parent[number]
        return number

    first: dict[Hashable, int] = {}
    for number, keys in enumerate(used):
        for key in keys:
            # the earlier one stays the root, so that parts come by their first number
            one, other = sorted((root(number), root(first.setdefault(key, number))))
            parent[other] = one
    parts: dict[int, list[int]] = {}
    for number in range(len(used)):
        parts.setdefault(root(number), []).append(number)
    return list(parts.values())
