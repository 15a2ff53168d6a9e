"""Draw over a frame what a scenario allows: places and headings, views, hidden points, and what excludes it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scenicq.errors import Span
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import features
from scenicq.geometry import shapes
from scenicq.geometry.angles import direction
from scenicq.geometry.outlines import outline
from scenicq.geometry.shapes import Bounds
from scenicq.match.verdict import Match, Verdict
from scenicq.report.outlines import allowed_headings, allowed_place, views
from scenicq.report.scene import Role, box_of, observe_roles
from scenicq.report.svg import Plane, area_path, element, escape, points_path

__all__ = ["Blame", "blames", "draw_blame", "draw_overlay", "draw_witness"]

_ARC_STEP = math.radians(6)


@dataclass(frozen=True, slots=True)
class Blame:
    """Something that excludes a frame.

    Attributes:
        what: The feature or requirement, in the words of the program.
        objects: Indices of the scenario's objects that it is about.
        requirement: Whether it is a requirement, rather than a feature.
    """

    what: str
    objects: frozenset[int]
    requirement: bool


def blames(scenario: Scenario, causes: Iterable[tuple[str, Span | None]]) -> tuple[Blame, ...]:
    """What excludes a frame, as parts of the scenario.

    Args:
        scenario: The scenario.
        causes: Each in the words of the program, with its place there.
    """
    found: list[Blame] = []
    for what, span in causes:
        name, _, _ = what.partition(".")
        about = frozenset(owner.index for owner in scenario.objects if owner.name == name)
        stated = next((each for each in scenario.requirements if span is not None and each.span == span), None)
        if stated is not None and not about:
            about = frozenset(stated.objects) or frozenset(index for index, _ in features(stated.condition))
        found.append(Blame(what, about, stated is not None))
    return tuple(found)


def _red(broken: tuple[Blame, ...], role: Role, name: str) -> str:
    return " blamed" if any(each.what == f"{role.name}.{name}" for each in broken) else ""


def _wedge(role: Role, low: float, high: float, plane: Plane) -> str:
    x, y = role.member.x, role.member.y
    width, length, _ = box_of(role.member)
    radius = math.hypot(width, length) / 2 + 2.0
    count = max(1, math.ceil((high - low) / _ARC_STEP))
    turns = [direction(low + (high - low) * number / count) for number in range(count + 1)]
    corners = [(x, y), *((x + radius * dx, y + radius * dy) for dx, dy in turns)]
    return points_path(plane.to_picture(np.array(corners)).tolist(), closed=high > low)


def draw_overlay(
    scenario: Scenario, broken: tuple[Blame, ...], roles: tuple[Role, ...], plane: Plane, bounds: Bounds
) -> str:
    """Draw under the boxes: views, where each role may be, which way it may face.

    Args:
        scenario: The scenario.
        broken: What excludes the frame.
        roles: The label object of each role.
        plane: Where the picture lies.
        bounds: What is drawn, in metres.
    """
    observed = observe_roles(roles)
    seen = (area_path(outline(view, bounds), plane) for view in views(scenario, observed))
    parts = [element("path", class_="view", d=area) for area in seen if area]
    for role in roles:
        others = {key: value for key, value in observed.items() if key != (role.index, "position")}
        place = allowed_place(scenario, role.index, others, bounds)
        if place is not None and place.shapes:
            kind = "fixed" if place.fixed else "local"
            rough = "" if place.exact else " rough"
            told = element("title", escape(f"where {role.name} may be{'' if place.exact else ', at most'}"))
            classes = f"place {kind}{rough} {role.colour}{_red(broken, role, 'position')}"
            area = (shapes.union_all(place.shapes),) if place.fixed else place.shapes
            parts.append(element("path", told, class_=classes, d=area_path(area, plane)))
    for role in roles:
        headings = allowed_headings(scenario, role.index, observed)
        for low, high in headings or ():
            told = element("title", escape(f"{role.name} may face {_degrees(low)} to {_degrees(high)}"))
            classes = f"facing {role.colour}{_red(broken, role, 'heading')}"
            parts.append(element("path", told, class_=classes, d=_wedge(role, low, high, plane)))
    return "".join(parts)


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):z.1f}\N{DEGREE SIGN}"


def draw_witness(verdict: Verdict | None, roles: tuple[Role, ...], plane: Plane, bounds: Bounds) -> str:
    """Draw the points of a witness that are no label object's position, as crosses."""
    if not isinstance(verdict, Match):
        return ""
    parts: list[str] = []
    for place, value in verdict.witness.items():
        if not isinstance(value, tuple):
            continue
        x, y = value
        seen = any(math.hypot(role.member.x - x, role.member.y - y) < 0.05 for role in roles)
        if not seen and bounds[0] < x < bounds[2] and bounds[1] < y < bounds[3]:
            left, top = plane.at(x, y)
            told = element("title", escape(f"hidden point of {place}: ({x:z.2f}, {y:z.2f})"))
            cross = f"M{left - 60} {top - 60}l120 120m0 -120l-120 120"
            parts.append(element("path", told, class_="hidden-point", d=cross))
    return "".join(parts)


def draw_blame(broken: tuple[Blame, ...], roles: tuple[Role, ...], plane: Plane) -> str:
    """Draw over the boxes: a line between the objects of a requirement that excludes the frame.

    Args:
        broken: What excludes the frame.
        roles: The label object of each role.
        plane: Where the picture lies.
    """
    parts: list[str] = []
    for blame in broken:
        found = [role for role in roles if role.index in blame.objects]
        if blame.requirement and len(found) > 1:
            ends = (plane.at(role.member.x, role.member.y) for role in found)
            told = element("title", escape(f"excluded by {blame.what}"))
            way = "L".join(f"{x} {y}" for x, y in ends)
            parts.append(element("path", told, class_="between blamed", d=f"M{way}"))
    return "".join(parts)
