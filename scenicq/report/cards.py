"""A run of frames as a card of the report: a picture with a slider, and facts about each frame."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.report.backdrop import Backdrop
from scenicq.report.frames import badge, frame_facts
from scenicq.report.picture import Shot, View, draw_shot, ground, plane_of, view_of
from scenicq.report.runs import FrameRun
from scenicq.report.sensors import Sensor
from scenicq.report.sheet import tile
from scenicq.report.svg import element
from scenicq.report.templates import markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["TILE_LETTERS", "Card", "best_frame", "draw_card", "draw_tile"]

TILE_LETTERS = 10.0
"""Height of names in small pictures, in hundredths of the way from the middle to an edge."""


@dataclass(frozen=True, slots=True)
class Card:
    """What a card is made of.

    Attributes:
        number: From 1, unique in the report.
        run: The run.
        shots: Its frames.
        sensors: The sensor files of each.
        backdrop: The map.
        texts: What the program says at the place of each random variable.
        pictures: Addresses of the frames' pictures beside the report; None if they are drawn in it.
    """

    number: int
    run: FrameRun
    shots: tuple[Shot, ...]
    sensors: tuple[Sequence[Sensor], ...]
    backdrop: Backdrop
    texts: Mapping[str, str]
    pictures: tuple[str, ...] | None = None

    @property
    def half(self) -> float:
        """Metres from the ego to the edges of every picture: enough for all of them."""
        return max(view_of(shot.label, shot.roles).half for shot in self.shots)


def _told(shot: Shot) -> str:
    played = ", ".join(f"{role.name} is {role.member.id}" for role in shot.roles)
    return f"Bird's-eye view of frame {shot.label.frame}: {played or 'no roles'}"


def _inline(card: Card) -> str:
    """Draw all frames of a run in one picture over one map; the first is shown."""
    plane, half = plane_of(card.shots[0].label), card.half
    views = [View((shot.label.ego.x, shot.label.ego.y), half) for shot in card.shots]
    boxes = [view.drawn for view in views]
    west, south = (min(box[axis] for box in boxes) for axis in (0, 1))
    east, north = (max(box[axis] for box in boxes) for axis in (2, 3))
    bounds = (west, south, east, north)
    groups = [
        element(
            "g",
            draw_shot(shot, plane, view),
            class_="shot",
            data_view=" ".join(map(str, view.box(plane))),
            data_told=_told(shot),
            hidden=number > 0,
        )
        for number, (shot, view) in enumerate(zip(card.shots, views, strict=True))
    ]
    return element(
        "svg",
        element("g", ground(plane, bounds), card.backdrop.draw(plane, bounds), id=f"map-{card.number}"),
        *groups,
        class_="picture",
        role="img",
        aria_label=_told(card.shots[0]),
        viewBox=" ".join(map(str, views[0].box(plane))),
    )


def best_frame(run: FrameRun, shots: Sequence[Shot]) -> int:
    """Choose the frame in which the farthest role is nearest to the ego; of equal ones the middle one.

    Args:
        run: The run.
        shots: Its frames.
    """
    middle = (len(shots) - 1) / 2
    far = [max((math.hypot(r.member.x - s.label.ego.x, r.member.y - s.label.ego.y) for r in s.roles), default=0.0)
           for s in shots]  # fmt: skip
    return min(range(len(run.results)), key=lambda place: (round(far[place], 1), abs(place - middle)))


def draw_tile(card: Card, image: str | None = None) -> Markup:
    """Draw the best frame of a run as a small picture that links to the run.

    Args:
        card: What the run's card is made of.
        image: Address of the small picture beside the report; None if it is drawn in it, over the card's map.
    """
    best = best_frame(card.run, card.shots)
    shot, plane = card.shots[best], plane_of(card.shots[0].label)
    told = _told(shot)
    if image is not None:
        picture: str = markup("cards", "image", source=image, told=told)
    else:
        view = view_of(shot.label, shot.roles)
        below = element("use", href=f"#map-{card.number}")
        picture = element("svg", below, draw_shot(shot, plane, view, TILE_LETTERS), class_="small", role="img",
                          aria_label=told, viewBox=" ".join(map(str, view.box(plane))))  # fmt: skip
    return tile(card.run, card.number, best, picture)


def draw_card(card: Card) -> Markup:
    """Draw a card, as markup.

    Args:
        card: What it is made of.
    """
    run, count = card.run, len(card.shots)
    frames = f"frame {run.first}" if count == 1 else f"frames {run.first}\N{EN DASH}{run.first + count - 1}"
    if card.pictures is None:
        picture = _inline(card)
    else:
        beside = [(name, _told(shot)) for name, shot in zip(card.pictures, card.shots, strict=True)]
        picture = markup("cards", "beside", pictures=beside)
    facts = [
        frame_facts(shot, sensors, card.texts, each.recorded)
        for shot, sensors, each in zip(card.shots, card.sensors, run.results, strict=True)
    ]
    return markup(
        "cards", "card", number=card.number, run=run, frames=frames, badge=badge(run.results[0].verdict, "near miss"),
        picture=picture, facts=facts, time=run.results[0].timestamp_us,
    )  # fmt: skip
