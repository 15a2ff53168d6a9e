"""A reader of untrusted XML: it bounds size and depth, and refuses entities, which could grow when they are read."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import InvalidError

__all__ = ["attribute", "child", "number", "read_xml"]

_LARGEST_BYTES = 512 << 20
_DEEPEST = 100


def read_xml(path: Path) -> Element:
    """The root element of a file.

    Raises:
        DataError: `file-missing`, or `file-invalid` for what is no XML, is nested too deeply or declares entities.
    """
    builder = TreeBuilder()
    depth = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise InvalidError("it is nested too deeply")
        builder.start(name, attributes)

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(name)

    def refuse(*declaration: object) -> None:
        raise InvalidError("it declares entities, which no dataset needs")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise InvalidError("it is too large")
        with path.open("rb") as file:
            parser.ParseFile(file)
        return builder.close()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from error
    except (expat.ExpatError, InvalidError, ValueError, LookupError) as error:
        raise DataError(Diagnostic("file-invalid", f"{path} is not sound XML: {error}")) from error


def child(element: Element, *names: str) -> Element:
    """The element at a path of names.

    Raises:
        InvalidError: It is not there.
    """
    for name in names:
        found = element.find(name)
        if found is None:
            raise InvalidError(f"`{name}` is missing in `{element.tag}`")
        element = found
    return element


def number(element: Element, *names: str) -> float:
    """The finite number at a path of names.

    Raises:
        InvalidError: The element is missing, or its text is no number below 1e9 in size.
    """
    found = child(element, *names)
    try:
        value = float(found.text or "")
    except ValueError as error:
        raise InvalidError(f"`{found.tag}` is not a number") from error
    if not abs(value) < 1e9:
        raise InvalidError(f"`{found.tag}` is not finite")
    return value


def attribute(element: Element, name: str) -> str:
    """An attribute.

    Raises:
        InvalidError: It is not there or is empty.
    """
    value = element.get(name)
    if not value:
        raise InvalidError(f"`{element.tag}` has no `{name}`")
    return value
