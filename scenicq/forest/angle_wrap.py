"""Headings as numbers: an angle and the same one with full turns more point the same way, but differ when compared."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scenicq.forest import build
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Constant, DirectionAt, Feature, Node
from scenicq.forest.walk import rebuild

__all__ = ["any_turn", "one_turn"]


def one_turn(heading: Node) -> Node:
    """A heading as the number in (-pi, pi] that Scenic 3 reads it as."""
    low, high = scalar_bounds(heading)
    within = isinstance(heading, Feature | DirectionAt) or (-math.pi < low and high <= math.pi)
    return heading if within else build.arithmetic(ArithmeticOp.WRAP, heading, span=heading.span)


def any_turn(heading: Node) -> Node:
    """Undo what `one_turn` does to the parts of a heading, which changes by full turns; what is shared stays shared."""
    known: dict[int, Node] = {}
    todo = [heading]
    while todo:
        node = todo[-1]
        terms = _terms(node)
        missing = [term for term in terms if id(term) not in known]
        if missing:
            todo += reversed(missing)
            continue
        todo.pop()
        known[id(node)] = _of_terms(node, [known[id(term)] for term in terms])
    return known[id(heading)]


def _terms(heading: Node) -> tuple[Node, ...]:
    """What of a heading may be off by full turns: then it is off by full turns too."""
    match heading:
        case Arithmetic(op=ArithmeticOp.WRAP | ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG, args=parts):
            return parts
        case Arithmetic(op=ArithmeticOp.MUL, args=(turned, Constant(value=float() as times))) if times.is_integer():
            return (turned,)
        case Arithmetic(op=ArithmeticOp.MUL, args=(Constant(value=float() as times), turned)) if times.is_integer():
            return (turned,)
        case _:
            return ()


def _of_terms(heading: Node, terms: Sequence[Node]) -> Node:
    """The heading with other terms, and without the one full turn that it may be cut to."""
    if not terms:
        return heading
    assert isinstance(heading, Arithmetic)
    if heading.op is ArithmeticOp.WRAP:
        return terms[0]
    changed = dict(zip(map(id, _terms(heading)), terms, strict=True))
    return rebuild(heading, tuple(changed.get(id(part), part) for part in heading.args))
