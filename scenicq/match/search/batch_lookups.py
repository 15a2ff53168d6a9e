"""What the map says of the positions of many labels, looked up side by side."""

from __future__ import annotations

from collections.abc import Iterable

from scenicq.geometry.road_direction import RoadDirection
from scenicq.match.decide.closed_form import ClosedForm
from scenicq.match.problem.candidates import Candidates
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.search.group_plan import MatchPlan
from scenicq.store.labels import Label

__all__ = ["look_up_positions"]


def look_up_positions(
    plans: Iterable[MatchPlan], ego: int, labels: Iterable[tuple[Label, Candidates | None]]
) -> MapLookups:
    """What the closed forms of plans will ask the map about labels.

    Args:
        plans: The plans met so far: what they ask is what labels to come will ask.
        ego: Index of the ego in the scenario.
        labels: Labels, each with what is known of who may play whom.
    """
    asked: dict[int, list[ClosedForm]] = {}
    for plan in plans:
        for group in plan.groups:
            form = group.closed_form
            if form is not None and form.index >= 0:
                asked.setdefault(form.index, []).append(form)
    positions: dict[int, list[tuple[float, float]]] = {index: [] for index in asked}
    for label, among in labels:
        for index, found in positions.items():
            if index == ego:
                found.append((label.ego.x, label.ego.y))
            else:
                numbers = range(1, len(label.objects) + 1) if among is None else among.get(index, ())
                found += [(label.objects[number - 1].x, label.objects[number - 1].y) for number in numbers]
    lookups = MapLookups()
    fields: dict[RoadDirection, list[tuple[float, float]]] = {}
    for index, forms in asked.items():
        for form in forms:
            if form.field is not None:
                fields.setdefault(form.field, []).extend(positions[index])
            if form.region is not None:
                lookups.look_up((), (form.region,), positions[index])
    for field, found in fields.items():
        lookups.look_up((field,), (), found)
    return lookups
