"""What a program does over time as a picture: a box for each mode, and from each of its ways a line to another box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from scenicq.forest.scenario import Scenario
from scenicq.forest.show_modes import ProcessMode, ProcessModes, modes_of
from scenicq.query.explain.bands import shorten
from scenicq.report.svg import element, escape

__all__ = ["draw_modes"]

_ROW, _GAP, _PAD, _LETTER, _CHANNEL = 18, 12, 8, 7.3, 12
"""Heights and widths in pixels: of a row, between boxes, of a margin, of a letter, between lines side by side."""
_LETTERS = 96
"""Letters of a row."""
_COLOURS = ("#0b5fa5", "#a84300", "#00705a", "#8f2d75", "#6b5900", "#4b46b8", "#2f6b1f", "#00657a")
_STYLE = (
    "svg { background: #fff } text { font: 12px ui-monospace, 'DejaVu Sans Mono', Menlo, monospace; fill: #1b1f24 } "
    ".head { font-weight: 600 } .box { fill: #f7f8f9; stroke: #59626d } .way { fill: none; stroke-width: 1.5 }"
)


@dataclass(frozen=True, slots=True)
class _Line:
    """A line from a row to a box.

    Attributes:
        start: The height of the row.
        end: That of the box.
        target: The number of the mode that it leads to.
    """

    start: float
    end: float
    target: int

    @property
    def ends(self) -> tuple[float, float]:
        """Its heights, the upper one first."""
        return min(self.start, self.end), max(self.start, self.end)


def draw_modes(scenario: Scenario) -> str:
    """The modes of a program as SVG.

    Args:
        scenario: The program.
    """
    every = modes_of(scenario)
    letters = [
        shorten(text, _LETTERS)
        for process in every
        for text in (process.head, *map(_title, process.modes), *_rows(process))
    ]
    width = 2 * _PAD + _LETTER * max(map(len, letters))
    parts: list[str] = []
    height, right = float(_PAD), width
    for process in every:
        drawn, height, channels = _process(process, height, width)
        parts += drawn
        right = max(right, width + _CHANNEL * (channels + 2))
    right += _PAD
    return element(
        "svg", element("title", "modes"), element("style", _STYLE), *parts, xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {right + _PAD:g} {height:g}", width=f"{right + _PAD:g}", height=f"{height:g}", role="img",
        aria_label="The modes of a program, and where each leads",
    )  # fmt: skip


def _process(process: ProcessModes, top: float, width: float) -> tuple[list[str], float, int]:
    """A process from a height on: its markup, where it ends, and how many lines run side by side."""
    found = [_text(process.head, _PAD, top + _ROW - 5, "head")]
    height = top + _ROW + (_GAP if process.modes else 0)
    begins: dict[int, float] = {}
    starts: list[tuple[float, int]] = []
    for mode in process.modes:
        rows = _rows_of(mode)
        found.append(
            element("rect", x=_PAD, y=f"{height:g}", width=f"{width - _PAD:g}", height=_ROW * (1 + len(rows)), rx=4,
                    class_="box")
        )  # fmt: skip
        begins[mode.number] = height + _ROW / 2
        found.append(_text(_title(mode), 2 * _PAD, height + _ROW - 5, "head"))
        for place, (row, target) in enumerate(rows, 1):
            found.append(_text(row, 3 * _PAD, height + _ROW * (place + 1) - 5))
            if target is not None:
                starts.append((height + _ROW * (place + 0.5), target))
        height += _ROW * (1 + len(rows)) + _GAP
    lines = [_Line(start, begins[target], target) for start, target in starts]
    channels = _channels(lines)
    for line, channel in zip(lines, channels, strict=True):
        found.append(_arrow(line, width, width + _CHANNEL * (channel + 1)))
    return found, height, max(channels, default=-1) + 1


def _channels(lines: Sequence[_Line]) -> list[int]:
    """How far to the right each line runs, so that none covers another that leads elsewhere; short ones are near."""
    found = [0] * len(lines)
    taken: list[list[_Line]] = []
    for number in sorted(range(len(lines)), key=lambda each: lines[each].ends[1] - lines[each].ends[0]):
        line = lines[number]
        free = (
            channel for channel, others in enumerate(taken)
            if all(each.target == line.target or not _meet(each, line) for each in others)
        )  # fmt: skip
        found[number] = next(free, len(taken))
        if found[number] == len(taken):
            taken.append([])
        taken[found[number]].append(line)
    return found


def _meet(one: _Line, other: _Line) -> bool:
    (low, high), (least, most) = one.ends, other.ends
    return low <= most and least <= high


def _arrow(line: _Line, left: float, right: float) -> str:
    colour = _COLOURS[line.target % len(_COLOURS)]
    way = element(
        "path", d=f"M{left:g} {line.start:g}H{right:g}V{line.end:g}H{left + 4:g}", class_="way", stroke=colour
    )
    tip = f"M{left:g} {line.end:g}l7 -4v8z"
    return way + element("path", d=tip, fill=colour)


def _title(mode: ProcessMode) -> str:
    return f"{mode.number}  {mode.does}"


def _rows(process: ProcessModes) -> list[str]:
    return [f"  {row}" for mode in process.modes for row, _ in _rows_of(mode)]


def _rows_of(mode: ProcessMode) -> list[tuple[str, int | None]]:
    """The rows of a box, each with the mode that it leads to."""
    rows = [
        (f"\N{RIGHTWARDS ARROW} {way.text}", way.target if isinstance(way.target, int) else None) for way in mode.ways
    ]
    return [*rows, *([("and more", None)] if mode.more else [])]


def _text(text: str, x: float, y: float, kind: str | None = None) -> str:
    short = shorten(text, _LETTERS)
    whole = [element("title", escape(text))] if short != text else []
    return element("text", *whole, escape(short), x=f"{x:g}", y=f"{y:g}", class_=kind)
