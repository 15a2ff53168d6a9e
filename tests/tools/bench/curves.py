"""Curves over sizes, both axes logarithmic, as SVG text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

__all__ = ["Series", "svg"]

_WIDTH, _HEIGHT, _LEFT, _TOP, _BOTTOM = 560, 400, 64, 36, 48
_RIGHT = 200
"""Pixels for the names of the curves."""
_COLOURS = ("#1b6ca8", "#0f9d58", "#e37400", "#9334e6", "#c5221f", "#00838f", "#6d4c41", "#ad1457", "#455a64")


@dataclass(frozen=True, slots=True)
class Series:
    """A curve: positive values by positive size."""

    name: str
    values: Mapping[int, float]


def svg(panels: Mapping[str, Sequence[Series]], across: str, up: str) -> str:
    """A picture with one panel a heading, side by side, all on the same scale."""
    every = [series for found in panels.values() for series in found]
    sizes = sorted({size for series in every for size in series.values})
    values = [value for series in every for value in series.values.values()]
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    body = [_panel(head, found, sizes, (low, high), across, up, n) for n, (head, found) in enumerate(panels.items())]
    width = (_WIDTH + _RIGHT) * max(1, len(panels))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT}" font-family="sans-serif">\n'
        f'<rect width="{width}" height="{_HEIGHT}" fill="white"/>\n' + "".join(body) + "</svg>\n"
    )


def _panel(
    head: str, found: Sequence[Series], sizes: list[int], powers: tuple[int, int], across: str, up: str, number: int
) -> str:
    left = number * (_WIDTH + _RIGHT) + _LEFT
    right, bottom = left + _WIDTH - _LEFT, _HEIGHT - _BOTTOM
    (low, high), span = powers, math.log(sizes[-1] / sizes[0]) or 1.0

    def x(size: int) -> float:
        return left + (right - left) * math.log(size / sizes[0]) / span

    def y(value: float) -> float:
        return bottom - (bottom - _TOP) * (math.log10(value) - low) / (high - low)

    lines = [f'<text x="{left}" y="{_TOP - 14}" font-size="14">{escape(head)}: {escape(up)}</text>']
    for power in range(low, high + 1):
        at = y(10.0**power)
        lines.append(f'<path d="M{left} {at:.1f}H{right}" stroke="#ddd"/>')
        lines.append(f'<text x="{left - 6}" y="{at + 4:.1f}" font-size="10" text-anchor="end">1e{power}</text>')
    for size in sizes:
        lines.append(f'<text x="{x(size):.1f}" y="{bottom + 14}" font-size="10" text-anchor="middle">{size}</text>')
    lines.append(
        f'<text x="{(left + right) / 2}" y="{bottom + 32}" font-size="11" text-anchor="middle">{escape(across)}</text>'
    )
    for place, series in enumerate(found):
        colour = _COLOURS[place % len(_COLOURS)]
        points = " ".join(f"{x(size):.1f},{y(value):.1f}" for size, value in series.values.items())
        lines.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for size, value in series.values.items():
            lines.append(f'<circle cx="{x(size):.1f}" cy="{y(value):.1f}" r="2.5" fill="{colour}"/>')
        lines.append(
            f'<text x="{right + 8}" y="{_TOP + 14 * place}" font-size="11" fill="{colour}">{escape(series.name)}</text>'
        )
    return "\n".join(lines) + "\n"
