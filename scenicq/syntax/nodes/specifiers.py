"""Specifiers and the other phrases of Scenic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenicq.errors import Span
from scenicq.syntax.nodes.base import SyntaxNode
from scenicq.syntax.phrases import PhraseRow

if TYPE_CHECKING:
    from scenicq.syntax.ast import Expression

__all__ = ["Phrase", "WithSpecifier"]


@dataclass(frozen=True, slots=True, eq=False)
class WithSpecifier(SyntaxNode):
    """`with property value`."""

    property: str
    property_span: Span
    value: Expression


@dataclass(frozen=True, slots=True, eq=False)
class Phrase(SyntaxNode):
    """A specifier of a row of `phrases`.

    Attributes:
        row: The row.
        operands: What stands in its places; None for what is left out.
    """

    row: PhraseRow
    operands: tuple[Expression | None, ...]

    def of_kind(self, *kinds: str) -> list[Expression]:
        """The operands of these kinds that are there."""
        pairs = zip(self.row.operands, self.operands, strict=True)
        return [value for operand, value in pairs if value is not None and operand.kind in kinds]
