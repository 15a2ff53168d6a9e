"""Roles in a label, and how its objects are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from scenicq.forest.evaluate import Observation
from scenicq.forest.scenario import Scenario
from scenicq.geometry.angles import direction
from scenicq.geometry.boxes import corners
from scenicq.geometry.shapes import XY
from scenicq.match.explanation import observe
from scenicq.report.placement import Placement
from scenicq.report.svg import Plane, element, escape, points_path
from scenicq.store.classes import class_matches
from scenicq.store.labels import Label, LabelObject

__all__ = ["COLOURS", "Role", "box_of", "draw_object", "draw_text", "find_roles", "observe_roles"]

COLOURS = 8
"""Colours that roles are told apart by, besides their names."""
_NOMINAL = (("Vehicle", 2.0, 4.5), ("Pedestrian", 0.7, 0.7))
"""Width and length in metres drawn where the label has none, by class."""
_OTHER = (0.8, 0.8)
_FULL = 0.95
"""Share of a picture's width that a name takes at most."""
_AHEAD = 1.0
"""Metres ahead of a box around which no name should lie."""
_HIGH, _TALL = 0.6125, 0.7
"""Half the height of a name by that of its letters, and of what it should not hide of a box by its length."""
_BOX, _NAME = 1.0, 9.0
"""How bad it is to hide a box, and another name."""


@dataclass(frozen=True, slots=True)
class Role:
    """A label object that plays an object of the scenario.

    Attributes:
        index: Index of the scenario's object.
        name: Its name.
        member: The label object.
    """

    index: int
    name: str
    member: LabelObject

    @property
    def colour(self) -> str:
        """The class by which the role's marks are coloured."""
        return f"c{self.index % COLOURS}"


def find_roles(scenario: Scenario, label: Label, correspondence: Mapping[str, str]) -> tuple[Role, ...]:
    """List the roles of a correspondence in program order; the ego's is there even if the correspondence is empty."""
    known = {member.id: member for member in label.objects} | ({"ego": label.ego} if label.has_ego else {})
    found: list[Role] = []
    for owner in scenario.objects:
        played = correspondence.get(owner.name, "ego" if owner.index == scenario.ego and not correspondence else "")
        if played in known:
            found.append(Role(owner.index, owner.name, known[played]))
    return tuple(found)


def observe_roles(roles: tuple[Role, ...]) -> Observation:
    """What the label observes of the objects that are played."""
    return {(role.index, name): value for role in roles for name, value in observe(role.member).items()}


def box_of(member: LabelObject) -> tuple[float, float, bool]:
    """Width and length in metres with which an object is drawn, and whether the label has them."""
    if member.width is not None and member.length is not None:
        return member.width, member.length, True
    for category, width, length in _NOMINAL:
        if class_matches(category, member.category, "fine"):
            return width, length, False
    return (*_OTHER, False)


def _point_ahead(member: LabelObject, heading: float, metres: float) -> XY:
    dx, dy = direction(heading)
    return member.x + metres * dx, member.y + metres * dy


def _told(member: LabelObject, role: str) -> str:
    heading = "no heading" if member.heading is None else f"heading {math.degrees(member.heading):z.1f}\N{DEGREE SIGN}"
    where = f"({member.x:z.2f}, {member.y:z.2f}) m"
    said = [role and f"role {role}", member.id, member.category, where, heading]
    if member.velocity is not None:
        said.append(f"{math.hypot(*member.velocity):.1f} m/s")
    return ", ".join(filter(None, said))


def draw_object(
    member: LabelObject, plane: Plane, *, role: Role | None = None, blamed: bool = False, least: float = 0.0
) -> str:
    """Draw an object's box with its front marked; unknown sizes are dashed, and an unknown heading makes a dot.

    Args:
        member: The object.
        plane: Where the picture lies.
        role: Its role, if it has one.
        blamed: Whether it is part of what excludes the frame.
        least: Radius in metres of the dot under people, whose boxes may be too small to see.
    """
    width, length, measured = box_of(member)
    classes = ["box", "ego" if member.id == "ego" else "other", role.colour if role else "", "blamed" if blamed else ""]
    person = class_matches("Pedestrian", member.category, "fine")
    classes += ["person"] * person + ["nominal"] * (not measured)
    told = element("title", escape(_told(member, role.name if role else "")))
    if member.heading is None:
        x, y = plane.at(member.x, member.y)
        shape = element("circle", cx=x, cy=y, r=round(50 * min(width, length)))
    else:
        outline = plane.to_picture(corners(member.x, member.y, member.heading, width, length))
        front = _point_ahead(member, member.heading, length / 2)
        nose = plane.to_picture(np.array([(member.x, member.y), front]))
        shape = element("path", class_="outline", d=points_path(outline.tolist(), closed=True))
        shape += element("path", class_="nose", d=points_path(nose.tolist(), closed=False))
    if person:
        x, y = plane.at(member.x, member.y)
        shape = element("circle", class_="dot", cx=x, cy=y, r=round(100 * max(least, width / 2))) + shape
    return element("g", told, shape, class_=" ".join(filter(None, classes)))


def draw_text(roles: tuple[Role, ...], plane: Plane, placement: Placement, size: int) -> str:
    """Draw the names of the roles beside their boxes, where they hide least.

    Args:
        roles: The roles.
        plane: Where the picture lies.
        placement: What is drawn already; the names become part of it.
        size: Height of the letters in centimetres; names as long as the picture is wide have smaller ones.
    """
    for role in roles:
        half = 100 * box_of(role.member)[1] / 2
        placement.keep(plane.at(role.member.x, role.member.y), half, _TALL * half, _BOX)
        if role.member.heading is not None:
            # the wedge of what it may face lies ahead of it
            ahead = _point_ahead(role.member, role.member.heading, box_of(role.member)[1] / 2 + _AHEAD)
            placement.keep(plane.at(*ahead), 100 * _AHEAD, _TALL * 100 * _AHEAD, _BOX)
    (west, east), (north, south) = placement.across, placement.along
    parts: list[str] = []
    for role in roles:
        x, y = plane.at(role.member.x, role.member.y)
        seen = west < x < east and north < y < south
        height = min(size, (east - west) / len(role.name) * _FULL / 0.68) if seen else size
        wide, away = height * 0.34 * len(role.name), 55 * math.hypot(*box_of(role.member)[:2]) + height * 0.3
        high = away + height / 2
        spots = [(x + away + wide, y), (x - away - wide, y), (x, y - high), (x, y + high)]
        spots += [(x + side * (0.7 * away + wide), y + up * high) for side in (1, -1) for up in (-1, 1)]
        spots += [(x, y - 2 * high), (x, y + 2 * high)]
        if seen:
            # moved to where all of it is in the picture
            spots += [(min(max(a, west + wide + 1), east - wide - 1), b) for a, b in spots]
        left, top = placement.place(spots, wide, _HIGH * height, _NAME)
        parts.append(
            element(
                "text",
                escape(role.name),
                class_=f"name {role.colour}",
                x=round(left),
                y=round(top + height * 0.35),
                font_size=round(height),
                text_anchor="middle",
            )
        )
    return "".join(parts)
