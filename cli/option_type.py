"""The kinds of `scenicq.option_values` as types of click."""

from __future__ import annotations

from typing import Any

import click

from scenicq.option_values import OptionKind

__all__ = ["OptionType"]


class OptionType(click.ParamType):  # pyright: ignore[reportMissingTypeArgument] - click 8.1 has none
    """A type of click that reads values by a kind, so that messages are the same as in Python."""

    name = "value"

    def __init__(self, kind: OptionKind) -> None:
        """Take the kind of its values."""
        self.kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The value of a text, or of a default."""
        try:
            return self.kind.read(value)
        except (ValueError, OverflowError):
            self.fail(f"{value!r} is not {self.kind.expected}.", param, ctx)
