"""Structure of groups: which of them ask the same question about other objects.

Forty-eight pedestrians made in a loop have forty-eight groups of one shape. What is decided for one of them, on the
same label objects, holds for all; and objects that can be swapped need be tried in one order only.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

from scenicq.forest.groups import PARAMS, Comparison, Group
from scenicq.forest.nodes import Arithmetic, Compare, Constant, Coordinate, Feature, Identity, Index, Logic, Node
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.match.tolerance import Tolerance

__all__ = ["GroupShape", "interchangeable", "shape_of"]


@dataclass(frozen=True, slots=True)
class GroupShape:
    """A group up to the names of its objects and random variables.

    Attributes:
        key: Equal for groups that ask the same question of their roles.
        roles: The objects of this group in the order in which the question speaks of them, the ego left out.
        symmetric: Whether the roles may be permuted.
    """

    key: Hashable
    roles: tuple[int, ...]
    symmetric: bool = False


def shape_of(group: Group, ego: int, tolerance: Tolerance) -> GroupShape:
    """The shape of a group; the ego plays itself in every group, and what is compared more or less strictly differs."""
    roles: dict[int, int] = {}
    leaves: dict[Identity, int] = {}
    numbers: dict[int, int] = {}
    rows: list[Hashable] = []

    def role(index: int) -> int:
        return -1 if index == ego else -2 if index == PARAMS else roles.setdefault(index, len(roles))

    def row(node: Node) -> Hashable:
        below = tuple(numbers[id(child)] for child in children(node))
        own: Hashable = None
        match node:
            case Constant():
                # regions and fields hash by identity, which is what tells them apart
                own = (type(node.value).__name__, node.value)
            case Feature():
                own = (role(node.object), node.property)
            case Arithmetic() | Compare() | Logic():
                own = node.op
            case Coordinate():
                own = node.axis
            case _ if is_leaf(node):
                number = leaves.setdefault(node.identity, len(leaves))  # type: ignore[union-attr]
                own = (number, node.weights if isinstance(node, Index) else ())
            case _:
                pass
        return (type(node).__name__, own, below)

    for node in postorder([item.expression for item in group.constraints]):
        numbers[id(node)] = len(rows)
        rows.append(row(node))
    heads: list[Hashable] = []
    for item in group.constraints:
        about = (
            (role(item.object), item.property, tolerance.scope(item.object, item.property))
            if isinstance(item, Comparison)
            else None
        )
        heads.append((about, numbers[id(item.expression)]))
    symmetric = all(
        not isinstance(item, Comparison) and item.requirement.built_in is BuiltIn.COLLISION
        for item in group.constraints
    )
    return GroupShape((tuple(rows), tuple(heads)), tuple(roles), symmetric)


def _signed(shape: GroupShape, swap: Mapping[int, int]) -> tuple[Hashable, tuple[int, ...]]:
    roles = tuple(swap.get(index, index) for index in shape.roles)
    return shape.key, tuple(sorted(roles)) if shape.symmetric else roles


def interchangeable(scenario: Scenario, shapes: Sequence[GroupShape]) -> Mapping[int, int]:
    """Interchangeable objects: for each, the one before it that swapping with changes nothing.

    Two objects are interchangeable if they are of one class and swapping them maps the shapes of all groups onto
    themselves.
    """
    involved: dict[int, list[GroupShape]] = {}
    for shape in shapes:
        for index in shape.roles:
            involved.setdefault(index, []).append(shape)
    last: dict[Hashable, int] = {}
    found: dict[int, int] = {}
    for owner in scenario.objects:
        if owner.index == scenario.ego:
            continue
        own = involved.get(owner.index, [])
        key = (owner.category, frozenset(shape.key for shape in own), len(own))
        earlier = last.get(key)
        if earlier is not None and _swappable(owner.index, earlier, [*own, *involved.get(earlier, [])]):
            found[owner.index] = earlier
        last[key] = owner.index
    return found


def _swappable(one: int, other: int, shapes: Sequence[GroupShape]) -> bool:
    plain = sorted(map(hash, (_signed(shape, {}) for shape in shapes)))
    swapped = [_signed(shape, {one: other, other: one}) for shape in shapes]
    if plain != sorted(map(hash, swapped)):
        return False
    rest = [_signed(shape, {}) for shape in shapes]
    for each in swapped:
        if each not in rest:
            return False
        rest.remove(each)
    return True
