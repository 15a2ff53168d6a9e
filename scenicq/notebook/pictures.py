"""What a notebook shows: a frame as a picture, and the explanation of a verdict as text."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

__all__ = ["SCROLLS", "DisplayedText", "Picture"]

SCROLLS = "overflow-x:auto;max-width:100%;padding-bottom:8px"
"""Style of what may be long, so that it makes nothing else wide."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A frame from above.

    Attributes:
        svg: The picture as a file of SVG.
    """

    svg: str

    def save(self, path: str | Path) -> None:
        """Write the picture into a file."""
        Path(path).write_text(self.svg, encoding="utf-8")

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        """Short, for the picture is long."""
        return f"<picture, {len(self.svg):,} characters of SVG>"


class DisplayedText(str):
    """A text of several lines that a notebook shows as it is."""

    __slots__ = ()

    def __repr__(self) -> str:
        """The text itself, which has lines."""
        return str(self)

    def _repr_html_(self) -> str:
        return f'<pre style="{SCROLLS}">{escape(self)}</pre>'
