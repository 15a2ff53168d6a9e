"""What the map says of the positions of many labels, looked up side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.search.group_plan import MatchPlan
from scenicq.store.labels import Label

__all__ = ["look_up_positions"]


def look_up_positions(
    plans: Iterable[MatchPlan], ego: int, labels: Sequence[tuple[Label, Candidates | None]]
) -> MapLookups:
    """What the closed forms of plans will ask the map about labels.

    Args:
        plans: The plans met so far: what they ask is what labels to come will ask.
        ego: Index of the ego in the scenario.
        labels: Labels, each with what is known of who may play whom.
    """
    asked: dict[int, tuple[set[RoadDirection], dict[int, Region]]] = {}
    for plan in plans:
        for group in plan.groups:
            form = group.closed_form
            if form is not None and form.index >= 0:
                fields, regions = asked.setdefault(form.index, (set(), {}))
                if form.field is not None:
                    fields.add(form.field)
                regions.update((id(region), region) for region in form.regions)
    lookups = MapLookups()
    of_fields: dict[RoadDirection, list[tuple[float, float]]] = {}
    for index, (fields, regions) in asked.items():
        found: list[tuple[float, float]] = []
        if index == ego:
            found = [(label.ego.x, label.ego.y) for label, _ in labels]
        else:
            for label, among in labels:
                numbers = range(1, len(label.objects) + 1) if among is None else among.get(index, ())
                found += [(label.objects[number - 1].x, label.objects[number - 1].y) for number in numbers]
        for field in fields:
            of_fields.setdefault(field, []).extend(found)
        lookups.look_up((), regions.values(), found)
    for field, found in of_fields.items():
        lookups.look_up((field,), (), found)
    return lookups
