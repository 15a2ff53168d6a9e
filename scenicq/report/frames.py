"""What is said of one frame beside its picture: roles, witness, cause, sensor files, as tables of HTML."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from scenicq.errors import Source
from scenicq.geometry.angles import normalize, rotate
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.report.page import page
from scenicq.report.picture import Shot
from scenicq.report.sensors import Sensor
from scenicq.report.svg import element, escape

__all__ = ["frame_facts", "frame_page", "table", "when"]

_PLACE = re.compile(r":(\d+):(\d+)(#\d+)?$")


def when(timestamp_us: int) -> str:
    """A timestamp as date and time (UTC), or as the number where it is no date."""
    try:
        return f"{datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=timestamp_us):%Y-%m-%d %H:%M:%S.%f}"[:-4]
    except OverflowError:
        return str(timestamp_us)


def table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table with a caption; nothing without rows.

    Args:
        title: The caption.
        head: Names of the columns.
        rows: Cells as markup.
    """
    if not rows:
        return ""
    top = element("tr", *(element("th", escape(name), scope="col") for name in head))
    body = [
        element("tr", element("th", row[0], scope="row"), *(element("td", cell) for cell in row[1:])) for row in rows
    ]
    caption = element("caption", escape(title))
    found = element("table", caption, element("thead", top), element("tbody", *body), class_="facts")
    return element("div", found, class_="wide")


def _roles(shot: Shot) -> str:
    ego = next((role.thing for role in shot.roles if shot.scenario and role.index == shot.scenario.ego), None)
    rows: list[tuple[str, ...]] = []
    for role in shot.roles:
        thing = role.thing
        where = turn = ""
        if ego is not None and thing is not ego and ego.heading is not None:
            right, ahead = rotate(thing.x - ego.x, thing.y - ego.y, -ego.heading)
            where = "<br>".join(
                element("span", escape(each), class_="where")
                for each in (f"{ahead:+.1f} m ahead", f"{right:+.1f} m right")
            )
            if thing.heading is not None:
                turn = f"{math.degrees(normalize(thing.heading - ego.heading)):+.0f}\N{DEGREE SIGN}"
        name = element("span", escape(role.name), class_=f"chip {role.colour}")
        rows.append((name, element("span", escape(thing.id), class_="id"), escape(thing.category), where, turn))
    return table("Roles", ("role", "object", "class", "from the ego", "turned"), rows)


def _value(value: float | tuple[float, float]) -> str:
    shown = f"({value[0]:.2f}, {value[1]:.2f})" if isinstance(value, tuple) else f"{value:.5g}"
    return element("span", escape(shown), class_="where")


def _witness(verdict: Match, source: Source) -> str:
    rows: list[tuple[str, ...]] = []
    for place, value in verdict.witness.items():
        found = _PLACE.search(place)
        if found is None or place[: found.start()] != source.name or int(found[1]) > len(source.line_starts):
            rows.append((escape(place), "", _value(value)))
            continue
        line, column = int(found[1]), int(found[2])
        text = source.line(line)[column - 1 :].strip()
        link = element("a", f"{line}:{column}{found[3] or ''}", href=f"#line-{line}")
        shown = text if len(text) <= 48 else f"{text[:47]}\N{HORIZONTAL ELLIPSIS}"
        rows.append((link, element("code", escape(shown)), _value(value)))
    return table("Values that prove it", ("place", "from", "value"), rows)


def _cause(shot: Shot) -> str:
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
    return element("ul", *(element("li", escape(each)) for each in told), class_="cause") if told else ""


def _sensors(sensors: Sequence[Sensor]) -> str:
    items: list[str] = []
    for sensor in sensors:
        text = escape(sensor.path)
        if sensor.thumbnail is not None:
            image = element("img", src=sensor.thumbnail, alt=f"Thumbnail of {sensor.channel}", loading="lazy")
            text = image.removesuffix("</img>") + element("span", text)
        shown = text if sensor.link is None else element("a", text, href=sensor.link, target="_blank", rel="noopener")
        items.append(element("li", element("b", escape(sensor.channel)), " ", shown))
    if not items:
        return ""
    title = element("summary", f"Sensor files ({len(items)})")
    return element("details", title, element("ul", *items, class_="sensors"), open=len(items) <= 3)


def frame_facts(shot: Shot, sensors: Sequence[Sensor]) -> str:
    """All that is said of a frame.

    Args:
        shot: The frame.
        sensors: Its sensor files.
    """
    label = shot.label
    parts = [
        element(
            "p",
            element("b", escape(label.frame)),
            " ",
            element("span", escape(when(label.timestamp_us)), class_="time"),
            class_="which",
        ),
        _cause(shot),
        _roles(shot),
    ]
    if isinstance(shot.verdict, Match) and shot.scenario is not None:
        parts.append(_witness(shot.verdict, shot.scenario.source))
    return "".join([*parts, _sensors(sensors)])


def frame_page(shot: Shot, picture: str) -> str:
    """A frame as a page that needs nothing but itself: its picture and what is said of it.

    Args:
        shot: The frame.
        picture: As `draw` gives it without a style.
    """
    label, program = shot.label, ""
    told = f"recording {label.recording}, map {label.map}"
    if shot.scenario is not None:
        source = shot.scenario.source
        told = f"{told}, scenario {source.name}"
        lines = range(1, len(source.line_starts) + 1)
        rows = (
            element(
                "tr",
                element("th", str(line), scope="row"),
                element("td", element("code", escape(source.line(line)))),
                id=f"line-{line}",
            )
            for line in lines
        )
        code = element("div", element("table", element("tbody", *rows), class_="program"), class_="scroll")
        program = element("section", element("h2", "Program"), code)
    sensors = [Sensor(channel, path) for channel, path in sorted(label.sensors.items())]
    facts = element("div", frame_facts(shot, sensors), class_="frame")
    body = element("div", element("div", picture, class_="view-pane"), facts, class_="run-body")
    head = element("header", element("h1", escape(label.frame)), element("p", escape(told)))
    return page(label.frame, [head, element("main", body, program)], script=False)
