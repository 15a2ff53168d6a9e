"""The children of a node are all nodes among its fields, in order, and `rebuild` puts others in their very places."""

from dataclasses import fields, is_dataclass

import pytest

from scenicq.forest import nodes
from scenicq.forest.nodes import Constant
from scenicq.forest.walk import children, is_leaf, rebuild

KINDS = [each for each in vars(nodes).values()
         if isinstance(each, type) and is_dataclass(each) and issubclass(each, nodes._Node)
         and not each.__name__.startswith("_")]  # fmt: skip


def _values(kind, start):
    """A value for each field that must be given, nodes told apart by numbers; and these nodes in order."""
    values, inner = {}, []
    for each in fields(kind):
        if each.kw_only:
            continue
        if each.type in ("Node", "tuple[Node, ...]"):
            made = [Constant(float(start + len(inner) + more)) for more in range(1 if each.type == "Node" else 3)]
            inner += made
            values[each.name] = made[0] if each.type == "Node" else tuple(made)
        else:
            values[each.name] = (0.5, 0.5) if each.name == "weights" else 0
    return values, tuple(inner)


def test_there_are_all_kinds_of_nodes():
    assert len(KINDS) > 25


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_children_come_and_go_in_their_places(kind):
    (before, inner), (after, others) = _values(kind, 0), _values(kind, 100)
    node = kind(**before)
    assert children(node) == inner
    assert rebuild(node, inner) is node
    rebuilt = rebuild(node, others)
    assert {name: getattr(rebuilt, name) for name in before} == (after if inner else before)
    assert children(rebuilt) == others
    assert not is_leaf(node) or rebuilt.identity is node.identity
