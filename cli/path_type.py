"""Types of paths on the command line: on this machine only, or also elsewhere (`s3://...`)."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from scenicq.errors import DataError, Diagnostic
from scenicq.store.remote_path import AnyPath, any_path, is_address, local_path

__all__ = ["ANY_PATH", "LOCAL_PATH", "AnyPathType", "LocalPathType", "check_here", "chosen_file"]

_SEPARATOR = re.compile(rf"{re.escape(os.pathsep)}(?!//)")


class _PathType(click.Path):
    def split_envvar_value(self, rv: str) -> Sequence[str]:
        """The paths of a variable: the colon of an address separates none."""
        return _SEPARATOR.split(rv)


class AnyPathType(_PathType):
    """A file or folder that may lie elsewhere."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """What a text names.

        Raises:
            DataError: option-invalid.
        """
        if not isinstance(value, str):
            return value
        if value.startswith("memory://"):
            message = f"{value}: this is in the memory of the process, which ends with the command"
            raise DataError(Diagnostic("option-invalid", message, hints=("name a file, or an address as s3://...",)))
        return any_path(value)


class LocalPathType(_PathType):
    """A file or folder that is read or written on this machine only."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """What a text names.

        Raises:
            DataError: option-invalid, where that lies elsewhere.
        """
        if isinstance(value, str):
            check_here(value)
            value = local_path(value)
        return super().convert(value, param, ctx)


def check_here(path: str | Path) -> None:
    """Refuse an address of something elsewhere.

    Raises:
        DataError: option-invalid.
    """
    if is_address(str(path)):
        message = f"{path} lies elsewhere, and this is read and written on this machine only"
        hints = ("copy it to a folder of this machine, and name that",)
        raise DataError(Diagnostic("option-invalid", message, hints=hints))


def chosen_file(output: AnyPath | None) -> AnyPath | None:
    """The file to write; None for standard output, which `-` is, too."""
    return None if output is None or str(output) == "-" else output


ANY_PATH = AnyPathType()
LOCAL_PATH = LocalPathType(path_type=Path)
