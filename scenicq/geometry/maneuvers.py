"""Ways on from the ends of lanes, and the order in which lanes lie around an intersection."""

from __future__ import annotations

from collections.abc import Iterable

from scenicq.geometry.angles import heading_of
from scenicq.geometry.elements import Lane, Maneuver

__all__ = ["by_heading", "maneuvers_of"]


def by_heading(lanes: Iterable[Lane], end: int) -> tuple[Lane, ...]:
    """Lanes by the heading of one of their ends from the middle of all these, from -pi on, as Scenic has them.

    Args:
        lanes: The lanes; each counts once. If one has no centreline, they stay in their order.
        end: Which corner of a centreline counts: 0 for the first, -1 for the last.
    """
    found = tuple(dict.fromkeys(lanes))
    ends = [lane.centerline.lines[end].coords[end] for lane in found if lane.centerline is not None]
    if not found or len(ends) < len(found):
        return found
    x, y = (sum(values) / len(ends) for values in list(zip(*ends, strict=True))[:2])
    headings = {lane: heading_of(at[0] - x, at[1] - y) for lane, at in zip(found, ends, strict=True)}
    return tuple(sorted(found, key=headings.__getitem__))


def maneuvers_of(lane: Lane) -> tuple[Maneuver, ...]:
    """The ways on from the end of a lane, in the map's order."""
    found: list[Maneuver] = []
    for following in lane.successors:
        crossing = following.road.intersection if following.road is not None else None
        if crossing is None:
            found.append(Maneuver(lane, following))
        elif lane not in crossing.lanes:
            found += [Maneuver(lane, end, following, crossing) for end in following.successors]
    return tuple(found)
