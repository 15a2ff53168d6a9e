"""JSON objects that nobody has checked, as structs of msgspec: each field is what its struct declares, or told.

What is wrong is told with its JSON path within the object. A field that no struct declares is counted as the
specification of its format says. Structs forbid unknown fields, and have `Raw` for what means nothing here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Generic, TypeAlias, TypeVar

from msgspec import DecodeError, Meta, Raw, Struct, ValidationError, defstruct
from msgspec.json import Decoder, decode

from scenicq.importers.fields import LONGEST_TEXT, InvalidError, parse_json, replace_non_finite
from scenicq.importers.report import Report
from scenicq.importers.specification import Specification

__all__ = ["ABSENT", "FullText", "Length", "NoJsonError", "RowError", "RowType", "Words", "plain_values"]

T = TypeVar("T", bound=Struct)
FullText: TypeAlias = Annotated[str, Meta(min_length=1, max_length=LONGEST_TEXT)]
"""A text that is not empty."""
Words: TypeAlias = Annotated[str, Meta(max_length=LONGEST_TEXT)]
Length: TypeAlias = Annotated[float, Meta(gt=0)]
ABSENT = Raw(b"")
"""A field that is not there."""

_MARK = b"\xef\xbb\xbf"
"""What some programs begin a text with."""
_FIELDS = Decoder(dict[str, Raw])
_NAME = Decoder(FullText)
_VALUE = Decoder(bool | int | float | str | None)
_WRONG = re.compile(r"Expected `(\w+)[^`]*`(?:, got `(\w+)`| of length (>=|<=)? ?(\d+)| (>|>=|<=) \S+)?")
_KINDS = {
    "object": "an object",
    "array": "a list",
    "str": "a text",
    "int": "a number",
    "float": "a number",
    "bool": "a boolean",
    "null": "null",
}


class NoJsonError(InvalidError):
    """A text is no JSON, or none that a file can hold."""


class RowError(InvalidError):
    """An object is not what it must be.

    Attributes:
        name: What it is called; None where it does not say.
    """

    def __init__(self, message: str, name: str | None) -> None:
        """Take what is wrong."""
        super().__init__(message)
        self.name = name


class RowType(Generic[T]):
    """Objects of one kind.

    Attributes:
        at: Their path in the specification.
        many: Decodes a list of them that are as they must be, in one go.
    """

    def __init__(
        self, kind: type[T], known: Specification, at: str, key: str = "id", *, unread: str | None = None
    ) -> None:
        """Take the struct, which must forbid unknown fields, the specification of its format and its path there.

        Args:
            kind: The struct.
            known: The specification.
            at: The path.
            key: The field by which messages name an object.
            unread: A field of the struct that may be anything here; it is `Raw`, or `ABSENT`.
        """
        if unread is not None:
            kind = defstruct(kind.__name__, [(unread, Raw, ABSENT)], bases=(kind,), kw_only=True)  # pyright: ignore[reportAssignmentType]
        self.at = at
        self._key = key
        self._known = known
        self._names = frozenset(kind.__struct_encode_fields__)
        # the same fields, beside which there may be others
        others: Any = defstruct(kind.__name__, (), bases=(kind,), forbid_unknown_fields=False)
        self.many: Decoder[list[T]] = Decoder(list[kind])
        self._decode: Callable[[bytes | Raw], T] = Decoder(kind).decode
        self._decode_others: Callable[[bytes | Raw], T] = Decoder(others).decode

    def decode(self, text: bytes | Raw, report: Report) -> T:
        """An object.

        Args:
            text: What it is in JSON, in UTF-8; NaN and infinities, which are none but often written, are no finite
                numbers.
            report: Takes the counts of fields that are not read.

        Raises:
            NoJsonError: It is no JSON.
            RowError: It is no object, or a field is not what it must be.
        """
        try:
            try:
                return self._decode(text)
            except ValidationError:  # for a field that is not declared, or for what is told now
                others = {name: _value(raw) for name, raw in _FIELDS.decode(text).items() if name not in self._names}
                self._known.count_rows((others,), report, self.at)
                return self._decode_others(text)
        except ValidationError as error:
            raise RowError(_explained(error), self._name(text)) from error
        except (DecodeError, RecursionError) as error:
            return self.decode(_plain(bytes(text), error), report)

    def _name(self, text: bytes | Raw) -> str | None:
        try:
            return _NAME.decode(_FIELDS.decode(text)[self._key])
        except (ValidationError, KeyError):
            return None


def plain_values(values: Mapping[str, Raw] | None, key: str, on_problem: Callable[[str], None]) -> dict[str, Any]:
    """The texts, numbers and booleans among the values of a field; null is absent, others are told and left out."""
    sound: dict[str, Any] = {}
    for name, raw in (values or {}).items():
        try:
            if (value := _VALUE.decode(raw)) is not None:
                sound[name] = value
        except ValidationError as error:
            found = _WRONG.match(str(error))
            kind = f"is {_KINDS[found[2]]}, not a text, a number or a boolean" if found else "is not finite"
            on_problem(f"`{name}` of `{key}` {kind}")
    return sound


def _plain(text: bytes, error: Exception) -> bytes:
    """A text that msgspec takes for no JSON, written as JSON.

    Raises:
        NoJsonError: It cannot be.
    """
    if isinstance(error, RecursionError):
        raise NoJsonError("not JSON: nested too deeply") from error
    plain = replace_non_finite(text.removeprefix(_MARK), b"1e999")
    if plain != text:
        return plain
    try:
        parse_json(text)  # which says in words why it is none
    except InvalidError as why:
        raise NoJsonError(str(why)) from why
    raise NoJsonError(f"not JSON: {error}") from error


def _value(raw: Raw) -> object:
    """The value of a field, to see whether it says anything."""
    try:
        return decode(raw)
    except (DecodeError, RecursionError):
        return True


def _explained(error: ValidationError) -> str:
    """What msgspec found, in words, with the JSON path where it did."""
    said, _, at = str(error).partition(" - at `$")
    path = at.removesuffix("`").removeprefix(".")
    if missing := re.search(r"missing required field `(.*)`", said):
        return f"`{path + '.' if path else ''}{missing[1]}` is missing"
    what = f"`{path}`" if path else "it"
    if (found := _WRONG.match(said)) is None:
        return f"{what} is not finite" if "out of range" in said else f"{what}: {said}"
    expected, got, bound, length, _ = found.groups()
    if got == "null" and path and not path.endswith("]"):
        return f"{what} is missing"
    if got is not None:
        return f"{what} is not {_KINDS.get(expected, expected)} but {_KINDS.get(got, got)}"
    if length is None:
        return f"{what} is {'not positive' if expected == 'float' else 'out of range'}"
    if expected == "str":
        return f"{what} is {'empty' if bound == '>=' else f'longer than {length} characters'}"
    return f"{what} does not have {length} elements"
