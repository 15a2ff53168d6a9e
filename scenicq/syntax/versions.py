"""Which version of Scenic a program is written in, told by its syntax."""

from __future__ import annotations

import re

from scenicq.errors import Diagnostic, Note, ScenarioError, Source, Span
from scenicq.syntax import ast, phrases
from scenicq.syntax.hints import condition_hint
from scenicq.syntax.phrases import VERSIONS
from scenicq.syntax.walk import walk

__all__ = ["choose_version", "find_evidence"]

_OLD = frozenset((1, 2))
_RECENT = frozenset((2, 3))
_NEW = frozenset((3,))
_FIRST = frozenset((1,))


def find_evidence(source: Source, body: tuple[ast.Statement, ...], defined: set[str]) -> tuple[ast.Evidence, ...]:
    """The constructs that not every version has, in the order of the text.

    Args:
        source: The text.
        body: Its statements.
        defined: Names that the program itself defines.
    """
    found = [evidence for node in walk(*body) if (evidence := _evidence(source, node, defined)) is not None]
    return tuple(sorted(found, key=lambda evidence: evidence.span.start))


def _evidence(source: Source, node: ast.SyntaxNode, defined: set[str]) -> ast.Evidence | None:
    match node:
        case ast.New(keyword=True):
            return ast.Evidence(Span(source, node.span.start, node.cls.span.end), "an instance with `new`", _NEW)
        case ast.New():
            return ast.Evidence(node.cls.span, "an instance without `new`", _OLD)
        case ast.Call(function=ast.Name(id="Range" | "DiscreteRange" as name)) if name not in defined:
            return ast.Evidence(node.function.span, f"`{name}`", _RECENT)
        case ast.Phrase(row=phrases.DEG | phrases.VECTOR) if any(
            isinstance(each, ast.Tuple) and len(each.items) == 2 for each in node.operands
        ):
            return ast.Evidence(node.span, "a pair of numbers as an interval", _FIRST)
        case ast.Model():
            return ast.Evidence(node.span, "`model`", _RECENT)
        case (
            ast.DynamicStatement()
            | ast.DynamicDefinition()
            | ast.Override()
            | ast.Take()
            | ast.Do()
            | ast.TryInterrupt()
        ):
            return ast.Evidence(node.span, f"`{node.kind}`", _RECENT)
        case ast.Phrase(row=row) if row.construct:
            return ast.Evidence(node.span, row.construct, row.versions)
        case ast.RequireMonitor():
            return ast.Evidence(node.span, "`require monitor`", _NEW)
        case ast.PropertyDefault() if node.modifiers:
            return ast.Evidence(node.name_span, "a property with modifiers", _RECENT)
        case _:
            return None


def choose_version(evidence: tuple[ast.Evidence, ...], version: int | None) -> tuple[frozenset[int], int | None]:
    """The versions that are possible, and the one where there is only one.

    Args:
        evidence: What was found.
        version: The version that was asked for.

    Raises:
        ScenarioError: `mixed-versions` where no version has all the constructs, `parse-error` where the version that
            was asked for lacks one.
    """
    if version is not None:
        for item in evidence:
            if version not in item.versions:
                raise _refuse(item, version)
        return frozenset((version,)), version
    possible = VERSIONS
    for number, item in enumerate(evidence):
        if not possible & item.versions:
            other = next((e for e in evidence[:number] if not e.versions & item.versions), evidence[0])
            raise _mixed(item, other)
        possible &= item.versions
    return possible, next(iter(possible)) if len(possible) == 1 else None


def _names(versions: frozenset[int]) -> str:
    return "Scenic " + " and ".join(str(version) for version in sorted(versions))


def _refuse(item: ast.Evidence, version: int) -> ScenarioError:
    message = f"{item.construct} is not part of Scenic {version}"
    hints: tuple[str, ...] = (f"{_names(item.versions)} has it",)
    if version == 3 and item.versions == _OLD:
        hints = (f"write `new {item.span.text} ...`, or read the program as Scenic 2",)
    elif version < 3 and item.construct == "an instance with `new`":
        hints = ("leave `new` out, or read the program as Scenic 3",)
    return ScenarioError(Diagnostic("parse-error", message, item.span, hints=hints))


_ASKS = re.compile(r"\b(require|when|until|while|if|elif)\b")
"""Words after which a condition stands."""


def _as_condition(span: Span) -> str:
    """How to say what looks like an object where only a condition can stand."""
    before, after = span.source.text[: span.start].rpartition("\n")[2], span.source.text[span.end :].split(None, 1)
    return condition_hint(after[0]) if _ASKS.search(before) and after else ""


def _mixed(item: ast.Evidence, other: ast.Evidence) -> ScenarioError:
    message = f"{item.construct} is {_names(item.versions)}, but {other.construct} is {_names(other.versions)}"
    note = Note(other.span, f"this is {_names(other.versions)}")
    hints: tuple[str, ...] = ()
    for place in (item, other):
        if place.construct == "an instance without `new`":
            if hint := _as_condition(place.span):
                told = "a condition is needed here, not the description of an object"
                return ScenarioError(Diagnostic("parse-error", told, place.span, "not a condition", hints=(hint,)))
            name = place.span.text
            # classes begin with a capital letter; a region before a specifier lacks a comma
            comma = f"a comma separates specifiers: write `{name}, ...`"
            hints = (f"Scenic 3 writes `new {name} ...`" if name[:1].isupper() else comma,)
    label = f"this is {_names(item.versions)}"
    return ScenarioError(Diagnostic("mixed-versions", message, item.span, label, (note,), hints))
