"""A frame as a picture: a map's backdrop, what the scenario allows, boxes, names, scale and north.

Shot (label, scenario, verdict) -> View (what is shown) -> groups of SVG -> one file, or part of a report
"""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from importlib import resources
from typing import Literal

from scenicq.forest.scenario import Scenario
from scenicq.geometry.shapes import XY, Bounds
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.own_lanes import OwnLanes, show_standing
from scenicq.query.explain.frame_explanation import Explanation
from scenicq.report.backdrop import Backdrop
from scenicq.report.distances import draw_distances, measured_distances
from scenicq.report.overlay import Blame, blames, draw_blame, draw_overlay, draw_witness
from scenicq.report.placement import Placement
from scenicq.report.scene import Role, box_of, draw_object, draw_text, find_roles, observe_roles
from scenicq.report.svg import Plane, element, escape
from scenicq.store.labels import Label

__all__ = [
    "LETTERS",
    "Shot",
    "Style",
    "View",
    "caption",
    "draw",
    "draw_shot",
    "ground",
    "plane_of",
    "stylesheet",
    "view_of",
]

Style = Literal["adaptive", "light", "none"]

_NEAREST, _FARTHEST = 25.0, 250.0
"""Metres from the middle to the edge of a picture, at least and at most."""
_BARS = (1, 2, 5, 10, 20, 50)
_SMALL = 0.06
"""Boxes smaller than this share of the picture's half get a ring around them if they play a role."""
_LEAST = 0.014
"""Radius of a person's dot by the picture's half, at least."""
LETTERS = 6.0
"""Height of names, in hundredths of a picture's half."""
_METRES = 0.8
"""Height of the length of a distance by that of names."""
_LETTER = 0.7
"""Width of a letter by its height, about."""
_MARGIN = 2.0
"""Metres drawn beyond the edges, so that no outline seems to end there."""


@dataclass(frozen=True, slots=True)
class Shot:
    """What is shown of one frame.

    Attributes:
        label: The label.
        scenario: The scenario that it was matched with, if any.
        verdict: What came out.
        explanation: Why, where somebody asked.
    """

    label: Label
    scenario: Scenario | None = None
    verdict: Verdict | None = None
    explanation: Explanation | None = None

    @property
    def roles(self) -> tuple[Role, ...]:
        """The roles in the picture, as far as the verdict says."""
        if self.scenario is None:
            return ()
        if self.explanation is not None:
            return find_roles(self.scenario, self.label, self.explanation.correspondence)
        match self.verdict:
            case Match() | Unknown():
                return find_roles(self.scenario, self.label, self.verdict.correspondence)
            case NoMatch():
                return find_roles(self.scenario, self.label, self.verdict.partial)
            case None:
                return ()

    @property
    def broken(self) -> tuple[Blame, ...]:
        """What excludes the frame."""
        if self.scenario is None or not isinstance(self.verdict, NoMatch):
            return ()
        if self.explanation is not None:
            return blames(self.scenario, ((each.what, each.span) for each in self.explanation.violations))
        return blames(self.scenario, [(self.verdict.cause.what, self.verdict.cause.span)])


@dataclass(frozen=True, slots=True)
class View:
    """A square of the map.

    Attributes:
        center: Its middle, metres.
        half: Metres from there to each edge.
    """

    center: XY
    half: float

    @property
    def bounds(self) -> Bounds:
        """The square as a box."""
        (x, y), half = self.center, self.half
        return x - half, y - half, x + half, y + half

    @property
    def drawn(self) -> Bounds:
        """What is drawn: somewhat more than what is seen."""
        return View(self.center, self.half + _MARGIN).bounds

    def box(self, plane: Plane) -> tuple[int, int, int, int]:
        """The square as the `viewBox` of a picture: left, top, width, height."""
        west, _, _, north = self.bounds
        return (*plane.at(west, north), round(200 * self.half), round(200 * self.half))


def view_of(label: Label, roles: tuple[Role, ...], half: float | None = None) -> View:
    """Choose a square around the ego in which every role is seen.

    Args:
        label: The label.
        roles: The label object of each role.
        half: Metres from the middle to the edge; chosen if None.
    """
    ego = label.ego
    if half is None:
        far = (math.hypot(role.member.x - ego.x, role.member.y - ego.y) + box_of(role.member)[1] for role in roles)
        half = math.ceil(min(_FARTHEST, max(_NEAREST, 1.25 * max(far, default=0.0))))
    return View((ego.x, ego.y), half)


def plane_of(label: Label) -> Plane:
    """Make a plane with its origin near the ego, on whole metres."""
    return Plane((math.floor(label.ego.x), math.floor(label.ego.y)))


def _furniture(plane: Plane, view: View) -> str:
    """A scale bar, and an arrow to the map's north."""
    left, top, size, _ = view.box(plane)
    unit = size / 100
    metres = max(bar for bar in _BARS if bar <= max(view.half / 2.5, 1))
    x, y, end = left + 4 * unit, top + 95 * unit, left + 4 * unit + 100 * metres
    bar = element("path", class_="scale", d=f"M{x:.0f} {y - unit:.0f}v{unit:.0f}H{end:.0f}v{-unit:.0f}")
    bar += element(
        "text", f"{metres} m", class_="furniture", x=f"{x:.0f}", y=f"{y - 2 * unit:.0f}", font_size=round(3 * unit)
    )
    x, y, aside = left + 95 * unit, top + 4 * unit, 1.4 * unit
    north = element(
        "path",
        class_="north",
        d=f"M{x:.0f} {y:.0f}l{aside:.0f} {4.5 * unit:.0f}l{-aside:.0f} {-unit:.0f}l{-aside:.0f} {unit:.0f}z",
    )
    north += element(
        "text",
        "N",
        class_="furniture",
        x=f"{x:.0f}",
        y=f"{y + 8 * unit:.0f}",
        font_size=round(3 * unit),
        text_anchor="middle",
    )
    return bar + north


def ground(plane: Plane, bounds: Bounds) -> str:
    """Draw the ground under the map, within bounds in metres."""
    left, top = plane.at(bounds[0], bounds[3])
    right, bottom = plane.at(bounds[2], bounds[1])
    return element("rect", class_="ground", x=left, y=top, width=right - left, height=bottom - top)


def draw_shot(shot: Shot, plane: Plane, view: View, letters: float = LETTERS) -> str:
    """Draw all of a picture but the map: overlay, boxes, names, scale and north.

    Args:
        shot: The frame.
        plane: Where the picture lies.
        view: What is shown.
        letters: Height of names, in hundredths of the way from the middle to an edge.
    """
    label, scenario, bounds = shot.label, shot.scenario, view.bounds
    roles = shot.roles
    by_id = {role.member.id: role for role in roles}
    broken = shot.broken
    guilty = frozenset[int]().union(*(each.objects for each in broken))
    parts: list[str] = []
    if scenario is not None:
        parts.append(draw_overlay(scenario, broken, roles, plane, view.drawn))
    for member in (*label.objects, *([label.ego] if label.has_ego else [])):
        reach = math.hypot(*box_of(member)[:2])
        if abs(member.x - view.center[0]) < view.half + reach and abs(member.y - view.center[1]) < view.half + reach:
            role = by_id.get(member.id)
            blamed = role is not None and role.index in guilty
            parts.append(draw_object(member, plane, role=role, blamed=blamed, least=_LEAST * view.half))
    for role in roles:
        if math.hypot(*box_of(role.member)[:2]) < _SMALL * view.half:
            x, y = plane.at(role.member.x, role.member.y)
            parts.append(element("circle", class_=f"ring {role.colour}", cx=x, cy=y, r=round(_SMALL * 50 * view.half)))
    (west, north), (east, south) = plane.at(bounds[0], bounds[3]), plane.at(bounds[2], bounds[1])
    placement = Placement((west, east), (north, south))
    if scenario is not None:
        parts += [draw_witness(shot.verdict, roles, plane, bounds), draw_blame(broken, roles, plane)]
        ways = measured_distances(scenario, observe_roles(roles), view.drawn)
        parts.append(draw_distances(ways, plane, placement, round(view.half * letters * _METRES)))
    parts += [draw_text(roles, plane, placement, round(view.half * letters)), _furniture(plane, view)]
    return "".join(parts)


def caption(shot: Shot) -> list[tuple[str, str]]:
    """What a picture shows, as lines: a class for the style, and the text."""
    label = shot.label
    lines = [("title", f"{label.frame}, recording {label.recording}, map {label.map}")]
    match shot.verdict:
        case Match():
            lines.append(("yes", "match"))
        case NoMatch() if shot.explanation is not None:
            lines.append(("no", "no match"))
            for each in shot.explanation.violations:
                place = f" ({each.span.place})" if each.span else ""
                told = "; ".join(filter(None, (f"{each.what} {each.value}".rstrip(), each.allowed)))
                lines.append(("no", f"excluded: {told}{place}"))
        case NoMatch(cause):
            place = f" ({cause.place})" if cause.place else ""
            lines.append(("no", f"no match: excluded by {cause.what}{place}"))
            if cause.detail:
                lines.append(("no", cause.detail))
        case Unknown(reason, cause):
            lines.append(("unknown", f"unknown ({reason}): {cause.what}"))
        case None:
            pass
    roles = shot.roles
    playing = {role.name: role.member.id for role in roles}
    lanes = {} if shot.scenario is None else OwnLanes(shot.scenario).of_label(label, playing)
    for role in roles:
        member = role.member
        told = f"{role.name} = {member.id} ({member.source_class or member.category})"
        where = f", {show_standing(lanes[role.name])}" if role.name in lanes else ""
        lines.append((f"name {role.colour}", told + where))
    return lines


def stylesheet(*, dark: bool = True) -> str:
    """The style of pictures; without the rules for dark mode where a renderer knows no media queries."""
    text = resources.files("scenicq.report").joinpath("assets", "picture.css").read_text(encoding="utf-8")
    return text if dark else text.partition("@media")[0]


def draw(
    shot: Shot,
    backdrop: Backdrop,
    *,
    half: float | None = None,
    pixels: int = 900,
    style: Style = "adaptive",
    captioned: bool = True,
    letters: float = LETTERS,
) -> str:
    """Draw a frame as a file of SVG.

    Args:
        shot: The frame.
        backdrop: Its map.
        half: Metres from the ego to the edges; chosen if None.
        pixels: Width of the picture.
        style: "adaptive" to dark surroundings, "light" for renderers that know no media queries, or "none" for a page
            that has the style.
        captioned: Whether lines of text below say what it shows.
        letters: Height of names, in hundredths of the way from the middle to an edge.
    """
    plane = plane_of(shot.label)
    view = view_of(shot.label, shot.roles, half)
    left, top, width, _ = view.box(plane)
    size = width / 50
    told = caption(shot) if captioned else []
    longest = int(width / size / _LETTER)
    lines = [(kind, part) for kind, text in told for part in textwrap.wrap(text, longest) or [""]]
    height = width + (size * (1.5 * len(lines) + 1) if lines else 0)
    texts = [
        element(
            "text",
            escape(text),
            class_=f"caption {kind}",
            x=f"{left + size:.0f}",
            y=f"{top + width + size * 1.5 * (number + 1):.0f}",
            font_size=round(size),
        )
        for number, (kind, text) in enumerate(lines)
    ]
    picture = element(
        "svg",
        ground(plane, view.bounds) + backdrop.draw(plane, view.drawn) + draw_shot(shot, plane, view, letters),
        class_="picture",
        x=left,
        y=top,
        width=width,
        height=width,
        viewBox=f"{left} {top} {width} {width}",
    )
    return element(
        "svg",
        element("title", escape(shot.label.frame)),
        element("style", stylesheet(dark=style == "adaptive")) if style != "none" else "",
        element("rect", class_="paper", x=left, y=top, width=width, height=f"{height:.0f}"),
        picture,
        *texts,
        xmlns="http://www.w3.org/2000/svg",
        class_="frame-picture",
        role="img",
        viewBox=f"{left} {top} {width} {height:.0f}",
        width=pixels,
        height=round(pixels * height / width),
        data_origin=f"{plane.origin[0]} {plane.origin[1]}",
    )
