"""Attributes of labels as SQL: what conditions read of them, as features that have columns.

A text is only ever compared: whether it is a certain one becomes a truth value of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from scenicq.forest import build
from scenicq.forest.nodes import Compare, CompareOp, Constant, Feature, Node
from scenicq.forest.unobserved import MOTION
from scenicq.forest.walk import postorder, transform
from scenicq.store.sql import sql_text

__all__ = ["in_said_truths", "said_columns"]

_IS = " is "


def in_said_truths(root: Node) -> Node:
    """An expression with a truth value for each question whether an attribute is a certain text."""

    def step(node: Node) -> Node:
        match node:
            case (
                Compare(
                    op=CompareOp.EQ | CompareOp.NE as op,
                    left=Feature(kind="other") as said,
                    right=Constant(value=str(text)),
                )
                | Compare(
                    op=CompareOp.EQ | CompareOp.NE as op,
                    left=Constant(value=str(text)),
                    right=Feature(kind="other") as said,
                )
            ):
                same = Feature(said.object, f"{said.property}{_IS}{text}", "boolean", said.current, span=node.span)
                return same if op is CompareOp.EQ else build.opposite(same)
            case _:
                return node

    return transform(root, step)


def said_columns(
    roots: Iterable[Node], attributes: Mapping[int, str], columned: Iterable[tuple[int, str]]
) -> Mapping[tuple[int, str], str]:
    """SQL of each attribute that expressions read, null where a label lacks it.

    Args:
        roots: The expressions, after `in_said_truths`.
        attributes: The column of attributes of each object that alone tells what is not known otherwise.
        columned: The properties that have columns of their own, or are said by the program.
    """
    known, found = {*columned}, dict[tuple[int, str], str]()
    for node in postorder(tuple(roots)):
        if not isinstance(node, Feature) or node.object not in attributes:
            continue
        key = node.object, node.property
        name, compared, text = node.property.partition(_IS)
        if (node.object, name) in known or name in MOTION or not name.isidentifier():
            continue
        path = f'$."{name}"'
        value = f"json_extract_string({attributes[node.object]}, {sql_text(path)})"
        if compared:
            # a text like `12` is no number
            kind = f"json_type({attributes[node.object]}, {sql_text(path)})"
            found[key] = f"({value} = {sql_text(text)} AND {kind} = 'VARCHAR')"
        elif node.kind == "scalar":
            found[key] = f"TRY_CAST({value} AS DOUBLE)"
        elif node.kind == "boolean":
            found[key] = f"({value} = 'true')"
    return found
