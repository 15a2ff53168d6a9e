"""Pictures as PNG, by resvg: the extra `scenicq[png]`."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from scenicq.errors import DataError, Diagnostic

__all__ = ["can_make_png", "png"]


def can_make_png() -> bool:
    """Whether the converter is installed."""
    return find_spec("resvg_py") is not None


def png(svg: str) -> bytes:
    """Convert a picture to a PNG file.

    Args:
        svg: As `scenicq.report.picture.draw` gives it, in the light style.

    Raises:
        DataError: option-invalid: the converter is not installed.
    """
    if not can_make_png():
        hints = ("`pip install 'scenicq[png]'` adds what PNG needs", "SVG and HTML need nothing more")
        raise DataError(
            Diagnostic("option-invalid", "PNG needs the package resvg-py, which is not installed", hints=hints)
        )
    resvg: Any = import_module("resvg_py")
    return bytes(resvg.svg_to_bytes(svg_string=svg))
