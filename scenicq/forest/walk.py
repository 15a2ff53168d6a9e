"""Walking the forest: children, rebuilding, order. Iterative throughout: depth is no limit."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from operator import attrgetter
from typing import cast, get_args

from scenicq.forest.nodes import Constant, Feature, Leaf, Logic, LogicOp, Node, Select

__all__ = [
    "children",
    "conjuncts",
    "deciding_first",
    "features",
    "is_leaf",
    "leaves",
    "postorder",
    "rebuild",
    "transform",
]


def is_leaf(node: Node) -> bool:
    """Whether a node is a random variable."""
    return isinstance(node, _LEAF_TYPES)


def children(node: Node) -> tuple[Node, ...]:
    """The nodes that a node's value depends on; for a random variable the parameters of its distribution."""
    return _CHILDREN[type(node)](node)


def rebuild(node: Node, parts: tuple[Node, ...]) -> Node:
    """The same node over other children; the very node if none differs."""
    if all(new is old for new, old in zip(parts, children(node), strict=True)):
        return node
    single, several = _FIELDS[type(node)]
    changed: dict[str, object] = dict(zip(single, parts, strict=False))
    if several is not None:
        changed[several] = parts[len(single) :]
    return replace(node, **changed)


def _fields(kind: type) -> tuple[tuple[str, ...], str | None]:
    """The fields of a class of nodes that are one node each, and the one that is a tuple of them, which comes last."""
    named = [(each.name, str(each.type)) for each in fields(kind) if "Node" in str(each.type)]
    single = tuple(name for name, type_ in named if type_ == "Node")
    several = [name for name, type_ in named if type_ == "tuple[Node, ...]"]
    if named[len(single) :] != [(name, "tuple[Node, ...]") for name in several[:1]]:
        raise TypeError(f"{kind.__name__}: children are fields `Node`, then at most one `tuple[Node, ...]`")
    return single, several[0] if several else None


def _reader(kind: type) -> Callable[[Node], tuple[Node, ...]]:
    """What gives the children of the nodes of a class."""
    single, several = _FIELDS[kind]
    if several is not None:
        first = [attrgetter(name) for name in single]
        rest = attrgetter(several)
        return (lambda node: (*[get(node) for get in first], *rest(node))) if first else rest
    if len(single) == 1:
        only = attrgetter(single[0])
        return lambda node: (only(node),)
    return attrgetter(*single) if single else lambda _node: ()


_NODE_TYPES: tuple[type[Node], ...] = get_args(Node)
_LEAF_TYPES: tuple[type[Leaf], ...] = get_args(Leaf)
_FIELDS = {kind: _fields(kind) for kind in _NODE_TYPES}
_CHILDREN = {kind: _reader(kind) for kind in _NODE_TYPES}


def postorder(roots: Iterable[Node], *, beyond: Container[int] = ()) -> Iterator[Node]:
    """Every node under the roots once, children before parents, in the order of the roots.

    Args:
        roots: The roots.
        beyond: The ids of nodes that are left out, with what is only under them.
    """
    done: set[int] = set()
    for root in roots:
        stack: list[tuple[Node, bool]] = [(root, False)]
        while stack:
            node, expanded = stack.pop()
            if id(node) in done or id(node) in beyond:
                continue
            below = () if expanded else children(node)
            if below:
                stack.append((node, True))
                stack.extend([(child, False) for child in reversed(below)])
            else:
                done.add(id(node))
                yield node


def transform(root: Node, step: Callable[[Node], Node], memo: dict[int, Node] | None = None) -> Node:
    """Rebuild an expression bottom-up, applying `step` to each node over its transformed children.

    Only the options in question are visited where the index of a choice is known, or one of a few known numbers.

    Args:
        root: The expression.
        step: Called once a node, with children already transformed.
        memo: Results by the id of the original node; share it between calls to keep shared nodes shared. The caller
            keeps the original nodes alive as long as the memo.
    """
    memo = {} if memo is None else memo
    stack: list[tuple[Node, bool]] = [(root, False)]
    while stack:
        node, expanded = stack.pop()
        if id(node) in memo:
            continue
        if isinstance(node, Select):
            if id(node.index) not in memo:
                stack += [(node, True), (node.index, False)]
                continue
            index = memo[id(node.index)]
            numbers = _known_numbers(index)
            wanted = node.options if numbers is None else tuple(node.options[number] for number in numbers)
            missing = [(option, False) for option in wanted if id(option) not in memo]
            if missing:
                stack += [(node, True), *missing]
                continue
            chosen = tuple(memo[id(option)] for option in wanted)
            if numbers is None:
                memo[id(node)] = step(rebuild(node, (index, *chosen)))
            elif isinstance(index, Select):
                memo[id(node)] = step(Select(index.index, chosen, span=node.span))
            else:
                memo[id(node)] = chosen[0]
            continue
        below = children(node)
        if not expanded and below:
            stack.append((node, True))
            stack.extend((child, False) for child in below if id(child) not in memo)
        else:
            memo[id(node)] = step(rebuild(node, tuple(memo[id(child)] for child in below)))
    return memo[id(root)]


def _known_numbers(index: Node) -> list[int] | None:
    """The numbers that the index of a choice may have, where these are all known and one variable says which."""
    options = index.options if isinstance(index, Select) else (index,)
    numbers = [option.value for option in options if isinstance(option, Constant)]
    if len(numbers) < len(options) or not all(isinstance(number, float) for number in numbers):
        return None
    return [int(number) for number in numbers if isinstance(number, float)]


def conjuncts(root: Node) -> Iterator[Node]:
    """The parts of a conjunction in their order; of anything else, it alone."""
    todo = [root]
    while todo:
        part = todo.pop()
        if isinstance(part, Logic) and part.op is LogicOp.AND:
            todo += reversed(part.args)
        else:
            yield part


def leaves(*roots: Node) -> tuple[Leaf, ...]:
    """The random variables under the roots, each once, in order of first use."""
    return tuple(node for node in postorder(roots) if is_leaf(node))  # type: ignore[misc]


def deciding_first(roots: Sequence[Node]) -> Iterator[Leaf]:
    """The random variables under the roots; those that decide which others matter before these."""
    seen: set[int] = set()
    todo: deque[Node] = deque(roots)
    while todo:
        node = todo.popleft()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if is_leaf(node):
            yield cast(Leaf, node)
        below = list(children(node))
        if isinstance(node, Select):
            todo.appendleft(below[0])
            todo.extend(below[1:])
        else:
            todo.extendleft(reversed(below))


def features(*roots: Node) -> frozenset[tuple[int, str]]:
    """The (object, property) pairs that expressions refer to."""
    return frozenset((node.object, node.property) for node in postorder(roots) if isinstance(node, Feature))
