"""Conditioning: put what the label observes into an expression and fold what has become known.

Line 11 of algorithm 1 of the query paper. What is left over holds random variables only. A vector field that allows
several headings at a known point becomes a choice, an `Index` of its own: which of them a generator would have picked
is an accident, so any will do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import cast

from scenicq.forest.among import LABEL_OBJECTS, LabelElements, among_column
from scenicq.forest.columns import UNDEFINED, UNKNOWN, constant_column, value_reader
from scenicq.forest.compute import compute, directions
from scenicq.forest.evaluate import Observation
from scenicq.forest.kinds import as_kind
from scenicq.forest.nodes import (
    Among,
    Constant,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Select,
    Undefined,
    Value,
)
from scenicq.forest.walk import children, is_leaf, transform

__all__ = ["condition", "expand"]


def expand(root: Node, definition: Callable[[Feature], Node | None]) -> Node:
    """Replace features by their expressions, again and again, until only those without one are left.

    Args:
        root: The expression.
        definition: The expression of a feature that is not observed, None for one that is.
    """
    pending = True

    def step(node: Node) -> Node:
        nonlocal pending
        found = definition(node) if isinstance(node, Feature) else None
        if found is None:
            return node
        pending = True
        return found

    while pending:
        pending = False
        root = transform(root, step)
    return root


def condition(
    root: Node,
    observed: Observation,
    assignment: Mapping[Identity, Value] | None = None,
    memo: dict[int, Node] | None = None,
) -> Node:
    """The expression given observed features and, possibly, values of some random variables.

    Args:
        root: The expression.
        observed: Values of features.
        assignment: Values of random variables to put in.
        memo: Results by the id of the original node, to share between expressions of one constraint.
    """
    given = assignment or {}

    def step(node: Node) -> Node:
        if is_leaf(node):
            leaf = cast(Leaf, node)
            if leaf.identity in given:
                return Constant(given[leaf.identity], span=node.span)
            # a distribution over what is not there has no value either
            return next((part for part in children(leaf) if _is_undefined(part)), node)
        if isinstance(node, Constant):
            return node
        if isinstance(node, Among):
            return _fold_among(node, observed)
        if isinstance(node, Feature):
            key = (node.object, node.property)
            return Constant(as_kind(node, observed[key]), span=node.span) if key in observed else node
        return _fold(node)

    return transform(root, step, memo)


def _fold(node: Node) -> Node:
    below = children(node)
    if isinstance(node, Select) and isinstance(node.index, Constant):
        picked = node.index.value
        return Constant(picked) if isinstance(picked, Undefined) else node.options[int(cast(float, picked))]
    if isinstance(node, Select) and isinstance(node.index, Index) and _all_same(node.options):
        return node.options[0]
    if isinstance(node, Logic) and node.op is not LogicOp.NOT:
        return _fold_logic(node)
    if not all(isinstance(child, Constant) for child in below):
        return node
    args = tuple(cast(Constant, child).value for child in below)
    if isinstance(node, DirectionAt):
        return _fold_direction(node, args)
    return Constant(compute(node, args), span=node.span)


def _fold_among(node: Among, observed: Observation) -> Node:
    """What is known of label objects; where that is not known, the node with what is."""
    elements = cast(object, observed.get(LABEL_OBJECTS)) or node.elements
    if not isinstance(elements, LabelElements):
        return node
    if not all(isinstance(child, Constant) for child in node.inputs):
        return node if node.elements is elements else replace(node, elements=elements)
    found = among_column(node, [constant_column(cast(Constant, child).value) for child in node.inputs], elements)
    if found.status.max() == UNKNOWN:
        return node if node.unknown is None else Constant(node.unknown, span=node.span)
    if found.status.max() == UNDEFINED:
        return Constant(Undefined(f"the label has no {node.category} that counts"), span=node.span)
    return Constant(value_reader(found.data, (1,))(0), span=node.span)


def _is_undefined(node: Node) -> bool:
    return isinstance(node, Constant) and isinstance(node.value, Undefined)


def _all_same(options: tuple[Node, ...]) -> bool:
    first = options[0]
    if not isinstance(first, Constant):
        return all(option is first for option in options)
    kind, value = type(first.value), first.value
    return all(
        option is first or (isinstance(option, Constant) and type(option.value) is kind and option.value == value)
        for option in options
    )


def _fold_logic(node: Logic) -> Node:
    decisive = node.op is LogicOp.OR
    left: list[Node] = []
    undefined: Node | None = None
    for arg in node.args:
        if not isinstance(arg, Constant):
            left.append(arg)
        elif isinstance(arg.value, Undefined):
            undefined = arg
        elif bool(arg.value) == decisive:
            return Constant(decisive, span=node.span)
    if undefined is not None:
        if not left or not decisive:
            return undefined
        left.append(Constant(False, span=node.span))
    if not left:
        return Constant(not decisive, span=node.span)
    return Logic(node.op, tuple(left), span=node.span)


def _fold_direction(node: DirectionAt, args: tuple[Value, ...]) -> Node:
    allowed = directions(*args)
    if isinstance(allowed, Undefined):
        return Constant(allowed, span=node.span)
    if len(allowed) == 1:
        return Constant(allowed[0], span=node.span)
    index = Index((1.0,) * len(allowed), span=node.span)
    return Select(index, tuple(Constant(heading, span=node.span) for heading in allowed), span=node.span)
