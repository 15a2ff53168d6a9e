"""Facts about one frame beside its picture: roles, witness, cause, sensor files, as tables of HTML."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from scenicq.errors import Source
from scenicq.geometry.angles import normalize, rotate
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.recorded_columns import show_cell
from scenicq.query.execution.results import CarriedValue
from scenicq.query.execution.variable_texts import variable_texts
from scenicq.query.explain.bands import shorten
from scenicq.report.camera_pictures import SpaceBox, camera_image, space_box
from scenicq.report.legend import SIGNS
from scenicq.report.page import page
from scenicq.report.picture import Shot
from scenicq.report.scene import Role
from scenicq.report.sensors import Sensor
from scenicq.report.templates import markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["badge", "format_time", "frame_facts", "frame_page"]

_FIRST_US, _LAST_US = 946_684_800_000_000, 4_102_444_800_000_000
"""Start of the years 2000 and 2100: what lies outside is no date."""
_PLACE = re.compile(r":(\d+):(\d+)(#\d+)?$")


def format_time(timestamp_us: int) -> str:
    """A timestamp as date and time (UTC), or as seconds where it is that of a clock without a date."""
    if not _FIRST_US <= timestamp_us < _LAST_US:
        return f"{timestamp_us / 1e6:.2f} s"
    return f"{datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=timestamp_us):%Y-%m-%d %H:%M:%S.%f}"[:-4]


def _roles(shot: Shot) -> Iterator[tuple[Role, list[str]]]:
    """The roles, each with where it is from the ego."""
    ego = next((role.member for role in shot.roles if shot.scenario and role.index == shot.scenario.ego), None)
    for role in shot.roles:
        member = role.member
        where: list[str] = []
        if ego is not None and member is not ego and ego.heading is not None:
            right, ahead = rotate(member.x - ego.x, member.y - ego.y, -ego.heading)
            where = [
                f"{abs(ahead):.1f} m {'behind' if ahead < 0 else 'ahead'}",
                f"{abs(right):.1f} m {'left' if right < 0 else 'right'}",
            ]
            if member.heading is not None:
                turned = math.degrees(normalize(member.heading - ego.heading))
                where.append(f"turned {abs(turned):.0f}\N{DEGREE SIGN} {'right' if turned < 0 else 'left'}")
        yield role, where


def _value(value: float | tuple[float, float]) -> str:
    return f"({value[0]:z.2f}, {value[1]:z.2f})" if isinstance(value, tuple) else f"{value:z.5g}"


def _witness(verdict: Match, source: Source, texts: Mapping[str, str]) -> Iterator[tuple[str, int | None, str, str]]:
    """The values of a witness: the place, its line of the program if it is in there, what stands there, the value."""
    for place, value in verdict.witness.items():
        found = _PLACE.search(place)
        if found is None or place[: found.start()] != source.file_name or int(found[1]) > len(source.line_starts):
            yield place, None, "", _value(value)
            continue
        line, column = int(found[1]), int(found[2])
        text = texts.get(place.removesuffix(found[3] or ""), "")
        yield f"{line}:{column}{found[3] or ''}", line, shorten(text), _value(value)


def _causes(shot: Shot) -> list[str]:
    match shot.verdict:
        case NoMatch(cause):
            told = [" ".join(filter(None, (cause.what, cause.detail)))]
            if shot.explanation is not None:
                told = [
                    "; ".join(filter(None, (f"{v.what} {v.value}", v.allowed))) for v in shot.explanation.violations
                ]
                told += [cause.detail] if cause.detail else []
        case Unknown(reason, cause):
            told = [f"not decided ({reason}): {cause.what} {cause.detail}".rstrip()]
        case _:
            told = []
    return told


def badge(verdict: Verdict, otherwise: str) -> Markup:
    """A verdict as a mark; shape and colour both tell it.

    Args:
        verdict: The verdict.
        otherwise: What to say of a frame that does not match.
    """
    match verdict:
        case Match():
            kind, shown = "match", "match"
        case Unknown(reason):
            kind, shown = "unknown", f"unknown: {reason}"
        case NoMatch():
            kind, shown = ("near", otherwise) if otherwise == "near miss" else ("no", otherwise)
    return markup("frames", "badge", kind=kind, words=shown)


def _boxes(shot: Shot) -> Iterator[SpaceBox]:
    """The objects of a frame, those with a role in its colour and last."""
    roles = {role.member.id: role for role in shot.roles}
    for member in sorted(shot.label.objects, key=lambda member: member.id in roles):
        role = roles.get(member.id)
        told = (
            f"{member.id}, {member.category}" if role is None else f"role {role.name}, {member.id}, {member.category}"
        )
        box = space_box(member, "other" if role is None else f"asked {role.colour}", told)
        if box is not None:
            yield box


def frame_facts(
    shot: Shot, sensors: Sequence[Sensor], texts: Mapping[str, str], recorded: Mapping[str, CarriedValue] | None = None
) -> Markup:  # fmt: skip
    """All facts about a frame.

    Args:
        shot: The frame.
        sensors: Its sensor files.
        texts: As `variable_texts` gives them.
        recorded: What the program records of it.
    """
    witness, margins = [], ()
    if isinstance(shot.verdict, Match) and shot.scenario is not None:
        witness = list(_witness(shot.verdict, shot.scenario.source, texts))
        margins = shot.explanation.margins if shot.explanation is not None else ()
    recorded = recorded or {}
    cameras = [
        (each, camera_image(each, shot.label.cameras.get(each.channel), _boxes(shot)))
        for each in sensors
        if each.thumbnail is not None
    ]
    return markup(
        "frames", "facts", label=shot.label, time=format_time(shot.label.timestamp_us), causes=_causes(shot),
        roles=list(_roles(shot)), witness=witness, margins=margins, cameras=cameras,
        recorded=[(name, show_cell(each.values[0]), ", ".join(each.lacking)) for name, each in recorded.items()],
        files=[each for each in sensors if each.thumbnail is None],
    )  # fmt: skip


def frame_page(shot: Shot, picture: str, sensors: Sequence[Sensor]) -> Markup:
    """A frame as a page that needs nothing but itself: its picture and what is said of it.

    Args:
        shot: The frame.
        picture: As `draw` gives it without a style.
        sensors: Its sensor files.
    """
    label, program = shot.label, None
    texts = {} if shot.scenario is None else variable_texts(shot.scenario)
    told = f"recording {label.recording}, map {label.map}"
    if shot.scenario is not None:
        source = shot.scenario.source
        told = f"{told}, scenario {source.name}"
        guilty = _guilty_lines(shot)
        program = [(line, source.line(line), line in guilty) for line in range(1, _last_line(source) + 1)]
    body = markup(
        "frames", "frame_page", label=label, told=told, signs=SIGNS, picture=picture, program=program,
        verdict="" if shot.verdict is None else badge(shot.verdict, "no match"),
        facts=frame_facts(shot, sensors, texts),
    )  # fmt: skip
    return page(label.frame, [body], script=False)


def _guilty_lines(shot: Shot) -> frozenset[int]:
    """Lines of the program that exclude a frame."""
    if shot.scenario is None or shot.explanation is None:
        return frozenset()
    source = shot.scenario.source
    spans = (each.span for each in shot.explanation.violations if each.span is not None)
    return frozenset(source.position(span.start)[0] for span in spans if span.source is source)


def _last_line(source: Source) -> int:
    """The last line that says something."""
    return max((line for line in range(1, len(source.line_starts) + 1) if source.line(line).strip()), default=0)
