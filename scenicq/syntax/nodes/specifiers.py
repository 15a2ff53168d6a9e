"""Instances, and the phrases of Scenic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

from scenicq.errors import Span
from scenicq.syntax.nodes.base import SyntaxNode
from scenicq.syntax.phrases import PhraseRow

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression, Specifier

__all__ = ["New", "Phrase", "WithSpecifier", "is_phrase"]


@dataclass(frozen=True, slots=True, eq=False)
class New(SyntaxNode):
    """An instance: `new Car at (1, 2)` (3), `Car at 1 @ 2` (1 and 2: `keyword` is false, at least one specifier)."""

    cls: Expression
    specifiers: tuple[Specifier, ...]
    keyword: bool


@dataclass(frozen=True, slots=True, eq=False)
class WithSpecifier(SyntaxNode):
    """`with property value`."""

    property: str
    property_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Phrase(SyntaxNode):
    """A specifier or an operator of Scenic: a row of `phrases`.

    Attributes:
        row: The row.
        operands: What stands in its places; None for what is left out.
    """

    row: PhraseRow
    operands: tuple[Expression | None, ...]

    @property
    def given(self) -> list[Expression]:
        """The operands that are there."""
        return [value for value in self.operands if value is not None]

    def of_kind(self, *kinds: str) -> list[Expression]:
        """The operands of these kinds that are there."""
        pairs = zip(self.row.operands, self.operands, strict=True)
        return [value for operand, value in pairs if value is not None and operand.kind in kinds]


def is_phrase(node: object, *rows: PhraseRow) -> TypeGuard[Phrase]:
    """Whether something is a phrase of one of these rows."""
    return isinstance(node, Phrase) and node.row in rows
