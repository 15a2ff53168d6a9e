"""What all nodes have."""

from __future__ import annotations

from dataclasses import dataclass

from scenicq.errors import Span

__all__ = ["SyntaxNode"]


@dataclass(frozen=True, slots=True, eq=False)
class SyntaxNode:
    """Base of all nodes.

    Attributes:
        span: The text of the construct, without surrounding parentheses.
    """

    span: Span
