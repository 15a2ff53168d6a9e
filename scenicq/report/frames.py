"""Facts about one frame beside its picture: roles, witness, cause, sensor files, as tables of HTML."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta

from scenicq.errors import Source
from scenicq.geometry.angles import normalize, rotate
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.recorded_columns import show_cell
from scenicq.query.execution.results import Recorded
from scenicq.query.execution.variable_texts import variable_texts
from scenicq.report.camera_pictures import SpaceBox, camera_image, space_box
from scenicq.report.legend import legend
from scenicq.report.page import page
from scenicq.report.picture import Shot
from scenicq.report.sensors import Sensor
from scenicq.report.svg import element, escape

__all__ = ["badge", "frame_facts", "frame_page", "table", "when"]

_FIRST_US, _LAST_US = 946_684_800_000_000, 4_102_444_800_000_000
"""Start of the years 2000 and 2100: what lies outside is no date."""
_PLACE = re.compile(r":(\d+):(\d+)(#\d+)?$")


def when(timestamp_us: int) -> str:
    """A timestamp as date and time (UTC), or as seconds where it is that of a clock without a date."""
    if not _FIRST_US <= timestamp_us < _LAST_US:
        return f"{timestamp_us / 1e6:.2f} s"
    return f"{datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=timestamp_us):%Y-%m-%d %H:%M:%S.%f}"[:-4]


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
    ego = next((role.member for role in shot.roles if shot.scenario and role.index == shot.scenario.ego), None)
    rows: list[tuple[str, ...]] = []
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
        name = element("span", escape(role.name), class_=f"chip {role.colour}")
        played = element("span", escape(member.id), class_="id") + element(
            "div", escape(member.category), class_="time"
        )
        rows.append((name, played, "<br>".join(element("span", escape(each), class_="where") for each in where)))
    return table("Roles", ("role", "object and class", "from the ego"), rows)


def _value(value: float | tuple[float, float]) -> str:
    shown = f"({value[0]:z.2f}, {value[1]:z.2f})" if isinstance(value, tuple) else f"{value:z.5g}"
    return element("span", escape(shown), class_="where")


def _witness(verdict: Match, source: Source, texts: Mapping[str, str]) -> str:
    rows: list[tuple[str, ...]] = []
    for place, value in verdict.witness.items():
        found = _PLACE.search(place)
        if found is None or place[: found.start()] != source.file_name or int(found[1]) > len(source.line_starts):
            rows.append((escape(place), "", _value(value)))
            continue
        line, column = int(found[1]), int(found[2])
        text = texts.get(place.removesuffix(found[3] or ""), "")
        link = element("a", f"{line}:{column}{found[3] or ''}", href=f"#line-{line}")
        shown = text if len(text) <= 48 else f"{text[:47]}\N{HORIZONTAL ELLIPSIS}"
        rows.append((link, element("code", escape(shown)), _value(value)))
    return table("Values that prove it", ("place", "from", "value"), rows)


def _margins(shot: Shot) -> str:
    """How much is left until each feature and requirement fails, where that was asked for."""
    told = shot.explanation.margins if shot.explanation is not None else ()
    rows = [
        (element("code", escape(each.what)), escape(each.value), escape(each.allowed), escape(each.spare))
        for each in told
    ]
    return table("What the label shows", ("feature or requirement", "value", "allowed", "to spare"), rows)


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


def badge(verdict: Verdict, otherwise: str) -> str:
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
    return element("span", escape(shown), class_=f"badge {kind}")


def _sensors(shot: Shot, sensors: Sequence[Sensor]) -> str:
    cameras: list[str] = []
    files: list[str] = []
    for sensor in sensors:
        text = escape(sensor.path)
        if sensor.thumbnail is not None:
            camera = shot.label.cameras.get(sensor.channel)
            small = camera_image(sensor, camera, _boxes(shot)) + element("span", escape(sensor.channel))
            cameras.append(
                element("li", element("a", small, href=sensor.link, title=sensor.path, target="_blank", rel="noopener"))
            )
            continue
        shown = f"{text} (not found here)"
        if sensor.link is not None:
            shown = element("a", text, href=sensor.link, target="_blank", rel="noopener")
        files.append(element("li", element("b", escape(sensor.channel)), " ", shown))
    seen = element("ul", *cameras, class_="cameras", aria_label="Cameras") if cameras else ""
    if not files:
        return seen
    title = element("summary", f"{'Other sensor' if cameras else 'Sensor'} files ({len(files)})")
    return seen + element("details", title, element("ul", *files, class_="sensors"), open=len(files) <= 3)


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


def _recorded(recorded: Mapping[str, Recorded]) -> str:
    """The recorded values of a match; for a null, why."""
    rows = [
        (element("code", escape(name)), element("span", escape(show_cell(each.values[0])), class_="where"),
         escape(", ".join(each.lacking)))
        for name, each in recorded.items()
    ]  # fmt: skip
    return table("Recorded", ("name", "value", ""), rows)


def frame_facts(
    shot: Shot, sensors: Sequence[Sensor], texts: Mapping[str, str], recorded: Mapping[str, Recorded] | None = None
) -> str:  # fmt: skip
    """All facts about a frame.

    Args:
        shot: The frame.
        sensors: Its sensor files.
        texts: As `variable_texts` gives them.
        recorded: What the program records of it.
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
    if recorded:
        parts.append(_recorded(recorded))
    if isinstance(shot.verdict, Match) and shot.scenario is not None:
        parts.append(_margins(shot))
        parts.append(_witness(shot.verdict, shot.scenario.source, texts))
    return "".join([*parts, _sensors(shot, sensors)])


def frame_page(shot: Shot, picture: str, sensors: Sequence[Sensor]) -> str:
    """A frame as a page that needs nothing but itself: its picture and what is said of it.

    Args:
        shot: The frame.
        picture: As `draw` gives it without a style.
        sensors: Its sensor files.
    """
    label, program = shot.label, ""
    texts = {} if shot.scenario is None else variable_texts(shot.scenario)
    told = f"recording {label.recording}, map {label.map}"
    if shot.scenario is not None:
        source = shot.scenario.source
        told = f"{told}, scenario {source.name}"
        guilty = _guilty_lines(shot)
        rows = (_program_row(source, line, guilty=line in guilty) for line in range(1, _last_line(source) + 1))
        code = element("div", element("table", element("tbody", *rows), class_="program"), class_="scroll")
        program = element("section", element("h2", "Program"), code)
    facts = element("div", frame_facts(shot, sensors, texts), class_="frame")
    body = element("div", element("div", picture, class_="view-pane"), facts, class_="run-body")
    verdict = "" if shot.verdict is None else badge(shot.verdict, "no match")
    head = element("header", element("h1", escape(label.frame)), element("p", escape(told)), verdict)
    return page(label.frame, [head, element("main", legend(), body, program)], script=False)


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


def _program_row(source: Source, line: int, *, guilty: bool) -> str:
    mark = element("span", "excludes", class_="badge no") if guilty else ""
    return element(
        "tr",
        element("th", str(line), scope="row"),
        element("td", element("code", escape(source.line(line))), " ", mark),
        id=f"line-{line}",
        class_="guilty" if guilty else None,
    )
