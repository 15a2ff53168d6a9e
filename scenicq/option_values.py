"""Options: how they are declared, and the values that people, scripts and programs hand over.

A typed dictionary declares options once: the types are for Python, and each is annotated with an `Option`. The command
line and its help, variables of the environment, arguments of functions and the words of reports are made from that. A
kind reads a text or a value of Python, so that what one of them takes, the others take, and what one refuses, the
others refuse in the same words.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any, Literal, Protocol, cast, get_args, get_type_hints

from scenicq.errors import DataError, Diagnostic, similar

__all__ = [
    "FURTHEST_M",
    "HALF",
    "LONGEST_S",
    "MARGIN_OPTION",
    "SCORE",
    "SEED",
    "WIDTH",
    "Amount",
    "Count",
    "Distances",
    "FileName",
    "Flag",
    "OneOf",
    "Option",
    "OptionKind",
    "Parameters",
    "Text",
    "declared_options",
    "read_option",
    "read_values",
]  # fmt: skip

LONGEST_S = 2_000_000.0
"""Seconds that an option may say: more than three weeks, and what system calls can wait for."""
_MANY = 10**12
"""A whole number beyond all that is counted."""
FURTHEST_M = 1e6
"""Metres that an option may say: more than any map."""

_UNITS: Mapping[str, Mapping[str, float]] = {
    "s": {"ms": 1e-3, "min": 60.0, "h": 3600.0, "s": 1.0},
    "m": {"mm": 1e-3, "cm": 1e-2, "km": 1e3, "m": 1.0},
    "": {},
}
"""Units that a text may end with, longer ones first, in the option's own."""
_EXAMPLES = {
    "s": "a time in seconds, such as 10, 90s or 5min,",
    "m": "a length in metres, such as 30 or 30m,",
    "": "a number",
}


class OptionKind(Protocol):
    """What values an option has."""

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        ...

    def read(self, value: Any) -> Any:
        """The value.

        Raises:
            ValueError: It is none of the kind.
        """
        ...


@dataclass(frozen=True, slots=True)
class Parameters:
    """Global parameters of a program by name, each a number or a text; a text that is a number stands for it."""

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        return "names with a number or a text each"

    def read(self, value: Any) -> tuple[tuple[str, float | str], ...]:
        """The parameters, in the order of their names."""
        pairs: Iterable[Any] = cast("Mapping[Any, Any]", value).items() if isinstance(value, Mapping) else value
        if not isinstance(value, Mapping | list | tuple):
            raise ValueError
        found: dict[str, float | str] = {}
        for pair in pairs:
            if not isinstance(pair, list | tuple) or len(cast("list[Any]", pair)) != 2:
                raise ValueError
            name, given = cast("tuple[Any, Any]", pair)
            if not isinstance(name, str) or not name or not isinstance(given, str | int | float):
                raise ValueError
            found[name] = _number_or_text(given)
        return tuple(sorted(found.items()))


def _number_or_text(value: str | float) -> float | str:
    """A value as Scenic's `--param` takes it: a whole number, a number, else a text."""
    if not isinstance(value, str):
        if not math.isfinite(value):
            raise ValueError
        return value
    for kind in (int, float):
        try:
            number = kind(value)
        except (ValueError, OverflowError):
            continue
        if math.isfinite(number) and abs(number) < 1e300:
            return number
    return value


@dataclass(frozen=True, slots=True)
class Flag:
    """True or False."""

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        return "True or False"

    def read(self, value: Any) -> bool:
        """The value."""
        if not isinstance(value, bool):
            raise ValueError
        return value


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of some texts."""

    texts: tuple[str, ...]

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        *first, last = self.texts
        return f"{', '.join(first)} or {last}" if first else last

    def read(self, value: Any) -> str:
        """The value."""
        if not isinstance(value, str) or value not in self.texts:
            raise ValueError
        return value


@dataclass(frozen=True, slots=True)
class Count:
    """A whole number."""

    least: int = 1
    most: int = _MANY

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        bounds = [f"from {self.least:,}"] if self.least > -_MANY else []
        bounds += [f"up to {self.most:,}"] if self.most < _MANY else []
        return f"a whole number {' and '.join(bounds)}".rstrip()

    def read(self, value: Any) -> int:
        """The value."""
        if isinstance(value, bool) or not isinstance(value, str | numbers.Integral):
            raise ValueError
        number = int(value)
        if not self.least <= number <= self.most:
            raise ValueError
        return number


@dataclass(frozen=True, slots=True)
class Amount:
    """A number, in a text with or without its unit.

    Attributes:
        unit: The unit of the value.
        least: The least value.
        most: The greatest one.
        above: Whether the value is above the least.
    """

    unit: Literal["s", "m", ""]
    least: float = 0.0
    most: float = LONGEST_S
    above: bool = False

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        bounds = (
            [f"over {self.least:g}" if self.above else f"from {self.least:,.12g}"] if math.isfinite(self.least) else []
        )
        bounds += [f"up to {self.most:,.12g}"] if math.isfinite(self.most) else []
        return f"{_EXAMPLES[self.unit]} {' and '.join(bounds)}".rstrip()

    def read(self, value: Any) -> float:
        """The value."""
        if isinstance(value, bool) or not isinstance(value, str | numbers.Real):
            raise ValueError
        size = 1.0
        if isinstance(value, str):
            unit = next((unit for unit in _UNITS[self.unit] if value.endswith(unit)), "")
            value, size = value.removesuffix(unit).rstrip(), _UNITS[self.unit].get(unit, 1.0)
        number = float(value) * size
        if not math.isfinite(number) or not self.least <= number <= self.most or (self.above and number == self.least):
            raise ValueError
        return number


@dataclass(frozen=True, slots=True)
class Text:
    """A text, which is read elsewhere; also a number where it stands for the text of it."""

    what: str = "a text"
    numeric: bool = False

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        return self.what

    def read(self, value: Any) -> str:
        """The value."""
        if isinstance(value, bool) or not isinstance(value, (str, numbers.Real) if self.numeric else str):
            raise ValueError
        return value if isinstance(value, str) else repr(float(value))


@dataclass(frozen=True, slots=True)
class FileName:
    """A file of this machine."""

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        return "the name of a file"

    def read(self, value: Any) -> Path:
        """The value."""
        if not isinstance(value, str | Path):
            raise ValueError
        return Path(value)


@dataclass(frozen=True, slots=True)
class Distances:
    """One of some distances, and others for some names: `2`, `2,pedestrian=0.5` or, in Python, `{"": 2}`.

    Attributes:
        known: The distances, metres.
    """

    known: tuple[float, ...]

    @property
    def expected(self) -> str:
        """What is expected, for people."""
        *first, last = (f"{each:g}" for each in self.known)
        return f"{', '.join(first)} or {last} metres, and others for classes, such as {last},pedestrian={first[0]}"

    def read(self, value: Any) -> dict[str, float]:
        """The distance of each class that is named; that of the others, if one is said, under no name."""
        given: dict[Any, Any] = {"": value}
        if isinstance(value, Mapping):
            given = dict(cast("Mapping[Any, Any]", value))
        elif isinstance(value, str):
            parts = [each.rpartition("=") for each in value.split(",")]
            given = {name.strip(): text for name, _, text in parts}
            if len(given) < len(parts):
                raise ValueError
        amount = Amount("m")
        found = {str(name): amount.read(text) for name, text in given.items()}
        if not found or not set(found.values()) <= set(self.known):
            raise ValueError
        return found


HALF = Amount("m", 1.0, 1000.0)
"""From the middle of a picture to its edges."""
WIDTH = Count(50, 10_000)
"""Pixels of a picture."""
SEED = Count(0)
"""A seed of random numbers."""
SCORE = Amount("", -math.inf, math.inf)
"""The score of a prediction."""
MARGIN_OPTION = Amount("", 0.0, 1.0, above=True)
"""A share of objects that counts as none."""


def read_option(name: str, kind: OptionKind, value: Any) -> Any:
    """The value of an option.

    Args:
        name: The name of the option.
        kind: What values it has.
        value: What somebody has written.

    Raises:
        DataError: option-invalid.
    """
    try:
        return kind.read(value)
    except (ValueError, OverflowError):
        shown = repr(value) if len(repr(value)) <= 80 else f"{repr(value)[:80]}..."
        raise DataError(Diagnostic("option-invalid", f"`{name}` is {kind.expected}, not {shown}")) from None


def _same(value: Any) -> Any:
    return value


@dataclass(frozen=True, slots=True)
class Option:
    """An option, in the annotation of a typed dictionary's key, which is its name in Python.

    Attributes:
        kind: What values it has.
        metavar: What stands for its value in the help of the command line.
        help: What the help says of it; "" where the command line does not have it.
        topic: The heading that it stands under there.
        flags: What people write, where that is not `--` and the name.
        about: What it is about: what matches at one instant, what an interval is, or what is done with all of these.
        field: Where its value goes, such as `match.radius`, in the object that has all of them; its name by default.
        meaning: Makes the value of what the kind has read, or of None.
        default: The default of the command line.
        optional: Whether None stands for the default; so it is where the type of Python has None.
    """

    kind: OptionKind
    metavar: str | None = None
    help: str = ""
    topic: str = ""
    flags: tuple[str, ...] = ()
    about: Literal["label", "interval", "all"] = "all"
    field: str = ""
    meaning: Callable[[Any], Any] = _same
    default: Any = None
    optional: bool = False


def declared_options(declaration: type, defaults: object = None) -> Mapping[str, Option]:
    """The options that a typed dictionary declares, by name.

    Args:
        declaration: The typed dictionary.
        defaults: The object that has all defaults, if there is one: those of the command line come from it.
    """
    found: dict[str, Option] = {}
    for name, annotated in get_type_hints(declaration, include_extras=True).items():
        kind, option = cast("tuple[Any, Option]", get_args(annotated))
        optional, field = type(None) in get_args(kind), option.field or name
        default = option.default
        if defaults is not None and not optional:
            default = reduce(getattr, field.split("."), defaults)
        found[name] = replace(option, field=field, default=default, optional=optional)
    return found


def read_values(options: Mapping[str, Option], given: Mapping[str, Any]) -> dict[str, Any]:
    """The values of options that are given.

    Args:
        options: All options that there are.
        given: What somebody has written, by the name of the option.

    Returns:
        The values; None where that stands for the default, and has no other meaning.

    Raises:
        DataError: option-invalid.
    """
    for name in given:
        if name not in options:
            close = similar(name, options)
            hint = f"did you mean `{close}`?" if close else f"known are {', '.join(options)}"
            raise DataError(Diagnostic("option-invalid", f"there is no option `{name}`", hints=(hint,)))
    read = {
        name: None if value is None and options[name].optional else read_option(name, options[name].kind, value)
        for name, value in given.items()
    }
    return {name: options[name].meaning(value) for name, value in read.items()}
