"""What a notebook shows: a frame as a picture, and the explanation of a verdict as text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from html import escape
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.option_values import HALF, WIDTH, read_option
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import Shot, draw
from scenicq.report.png import png
from scenicq.store.atomic_files import whole_file
from scenicq.store.remote_path import any_path

__all__ = ["SCROLLS", "DisplayedText", "Picture", "take_picture"]

SCROLLS = "overflow-x:auto;max-width:100%;padding-bottom:8px"
"""Style of what may be long, so that it makes nothing else wide."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A frame from above.

    Attributes:
        svg: The picture as a file of SVG.
        light: The same for what knows no style of the reader's, such as a converter to PNG.
    """

    svg: str
    light: Callable[[], str]

    def save(self, path: str | Path) -> None:
        """Write the picture into a file, completely or not at all.

        Args:
            path: Here or elsewhere, as `s3://bucket/x.svg`; its name ends in `.svg`, or in `.png`, which needs
                `scenicq[png]`.

        Raises:
            DataError: option-invalid: another ending, or nothing here makes PNG; target-unwritable.
        """
        target = any_path(path)
        if target.suffix.lower() not in (".svg", ".png"):
            hints = ("known are .svg and .png",)
            raise DataError(Diagnostic("option-invalid", f"the name {target} does not say which format", hints=hints))
        data = png(self.light()) if target.suffix.lower() == ".png" else self.svg.encode()
        try:
            with whole_file(target) as file:
                file.write(data)
        except OSError as error:
            raise DataError(Diagnostic("target-unwritable", f"{target}: {error.strerror}")) from None

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


def take_picture(shot: Shot, backdrop: Backdrop, half: float | None, width: int) -> Picture:
    """A picture of a frame.

    Args:
        shot: The frame, and what is said of it.
        backdrop: The map.
        half: Metres from the ego to the edges, 1 to 1,000; chosen if None.
        width: In pixels, 50 to 10,000.

    Raises:
        DataError: option-invalid.
    """
    size = None if half is None else read_option("half", HALF, half)
    pixels = read_option("width", WIDTH, width)

    drawn = partial(draw, shot, backdrop, half=size, pixels=pixels)
    return Picture(drawn(style="adaptive"), partial(drawn, style="light"))
