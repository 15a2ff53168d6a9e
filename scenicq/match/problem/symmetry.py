"""Structure of groups: which of them ask the same question about other objects.

Forty-eight pedestrians made in a loop have forty-eight groups of one shape. What is decided for one of them, on the
same label objects, holds for all; and objects that can be swapped need be tried in one order only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass

from scenicq.forest.groups import PARAMS, Comparison, Group
from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    Arithmetic,
    Compare,
    Constant,
    Coordinate,
    CourseCoordinate,
    Feature,
    Identity,
    Index,
    LaneCourse,
    Logic,
    Measure,
    Node,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import (
    And,
    Atom,
    Dynamics,
    End,
    Formula,
    Or,
    ProcessStep,
    Reject,
    Terminate,
    Test,
    Wait,
    operands,
)  # fmt: skip
from scenicq.forest.value_numbers import ValueNumbers, parts_of
from scenicq.forest.walk import children, features, is_leaf, leaves, postorder
from scenicq.match.tolerance import Tolerance

__all__ = ["GroupShape", "classes_of_twins", "interchangeable", "shape_of", "sort_interchangeable"]


@dataclass(frozen=True, slots=True)
class GroupShape:
    """A group up to the names of its objects and random variables.

    Attributes:
        key: Equal for groups that ask the same question of their roles.
        roles: The objects of this group in the order in which the question speaks of them, the ego left out.
    """

    key: Hashable
    roles: tuple[int, ...]


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
                own = (type(node.value).__name__, parts_of(node.value))
            case Feature():
                own = (role(node.object), node.property)
            case Arithmetic() | Compare() | Logic():
                own = node.op
            case Coordinate():
                own = node.axis
            case Among():
                # the body stands for itself: others that look alike are asked anew
                own = (id(node.body), node.op, node.category, node.number, node.excluded)
            case CourseCoordinate():
                own = node.axis, node.end
            case Measure():
                own = node.measure, node.seconds, node.end
            case LaneCourse():
                own = id(node.network), node.gap_s
            case AheadInLanes():
                own = id(node.network)
            case _ if is_leaf(node):
                number = leaves.setdefault(node.identity, len(leaves))  # type: ignore[union-attr]
                own = (number, node.weights if isinstance(node, Index) else ())
            case _:
                pass
        return (type(node).__name__, own, below)

    items = (*group.constraints, *group.certain, *group.doubtful)
    for node in postorder([item.expression for item in items]):
        numbers[id(node)] = len(rows)
        rows.append(row(node))
    heads: list[Hashable] = []
    for item in items:
        about = (
            (role(item.object), item.property, tolerance.scope(item.object, item.property))
            if isinstance(item, Comparison)
            else None
        )
        heads.append((about, numbers[id(item.expression)]))
    return GroupShape((tuple(rows), tuple(heads), len(group.doubtful)), tuple(roles))


def interchangeable(
    scenario: Scenario, groups: Sequence[Group], shapes: Sequence[GroupShape], tolerance: Tolerance,
    used: Sequence[frozenset[str]] = (),
) -> Mapping[int, int]:  # fmt: skip
    """Interchangeable objects: for each, the one before it that swapping with changes nothing.

    Two objects are interchangeable if they are of one class and swapping them leaves some groups, and what the
    scenario says about time, as they are, and maps the shapes of all other groups onto themselves.

    Args:
        scenario: The scenario.
        groups: What is asked of a label.
        shapes: Shapes of the groups.
        tolerance: Per feature.
        used: For each object the properties that matter, where what the program says of them must be alike, too.
    """
    involved: dict[int, list[int]] = {}
    for number, shape in enumerate(shapes):
        for index in shape.roles:
            involved.setdefault(index, []).append(number)
    swaps = _Swaps(scenario, groups, shapes, tolerance, used)
    last: dict[Hashable, int] = {}
    found: dict[int, int] = {}
    for owner in scenario.objects:
        if owner.index == scenario.ego:
            continue
        own = involved.get(owner.index, [])
        key = (owner.category, frozenset(shapes[number].key for number in own), len(own))
        earlier = last.get(key)
        if earlier is not None and swaps.possible(owner.index, earlier, {*own, *involved.get(earlier, [])}):
            found[owner.index] = earlier
        last[key] = owner.index
    return found


def classes_of_twins(twins: Mapping[int, int]) -> list[list[int]]:
    """Objects that are interchangeable with each other.

    Args:
        twins: For an object, an earlier one that is interchangeable with it.
    """
    found: dict[int, list[int]] = {}
    first: dict[int, int] = {}
    for index, earlier in sorted(twins.items()):
        head = first.get(earlier, earlier)
        first[index] = head
        found.setdefault(head, [head]).append(index)
    return list(found.values())


def sort_interchangeable(assignment: Mapping[int, int], twins: Mapping[int, int]) -> frozenset[tuple[int, int]]:
    """An assignment in which interchangeable objects have label objects in ascending order.

    Args:
        assignment: The number of the label object of each object.
        twins: For an object, an earlier one that is interchangeable with it.
    """
    found = dict(assignment)
    for alike in classes_of_twins(twins):
        found.update(zip(sorted(alike), sorted(assignment[index] for index in alike), strict=True))
    return frozenset(found.items())


@dataclass(frozen=True, slots=True)
class _Swaps:
    """Tells which objects may be swapped."""

    scenario: Scenario
    groups: Sequence[Group]
    shapes: Sequence[GroupShape]
    tolerance: Tolerance
    used: Sequence[frozenset[str]]

    def possible(self, one: int, other: int, about: Collection[int]) -> bool:
        """Whether two objects may be swapped, which some groups are about."""
        forms, swap = _Forms(), {one: other, other: one}
        left = [number for number in about if not self._is_unchanged(self.groups[number], forms, swap)]
        plain = Counter((self.shapes[number].key, self.shapes[number].roles) for number in left)
        swapped = Counter(
            (self.shapes[number].key, tuple(swap.get(index, index) for index in self.shapes[number].roles))
            for number in left
        )
        if plain != swapped or not self._said_alike(one, other, forms, swap):
            return False
        dynamics = self.scenario.dynamics
        if dynamics is None:
            return True
        # with the groups that are left, their random variables are swapped, too
        moved = {leaf.identity for number in left for leaf in self.groups[number].variables}
        if any(leaf.identity in moved for leaf in leaves(*dynamics.conditions)):
            return False
        return forms.over_time(dynamics, {}) == forms.over_time(dynamics, swap)

    def _said_alike(self, one: int, other: int, forms: _Forms, swap: Mapping[int, int]) -> bool:
        """Whether the program says the same of what it reads of two objects and no group compares."""
        if not self.used:
            return True
        read = () if self.scenario.dynamics is None else features(*self.scenario.dynamics.conditions)
        names = {name for index, name in read if index in swap} | self.used[one] | self.used[other]
        owners = self.scenario.objects[one], self.scenario.objects[other]
        given = [[owner.properties.get(name) for owner in owners] for name in sorted(names - {"position", "heading"})]
        for mine, theirs in given:
            if (mine is None) != (theirs is None):
                return False
            if mine is None or theirs is None or (mine.explicit and theirs.explicit):
                continue
            if mine.explicit != theirs.explicit:
                return False
            if forms.expression(mine.value, swap) != forms.expression(theirs.value, {}):
                return False
        return True

    def _is_unchanged(self, group: Group, forms: _Forms, swap: Mapping[int, int]) -> bool:
        return self._form(group, forms, {}) == self._form(group, forms, swap)

    def _form(self, group: Group, forms: _Forms, swap: Mapping[int, int]) -> Hashable:
        items: Counter[Hashable] = Counter()
        for item in (*group.constraints, *group.doubtful):
            about: Hashable = None
            if isinstance(item, Comparison):
                scope = self.tolerance.scope(item.object, item.property)
                about = (swap.get(item.object, item.object), item.property, scope)
            items[about, forms.expression(item.expression, swap)] += 1
        return frozenset(items.items())


class _Forms(ValueNumbers):
    """Gives what is said about time numbers, too."""

    __slots__ = ()

    def over_time(self, dynamics: Dynamics, swap: Mapping[int, int]) -> Hashable:
        """All that is said about time, with some objects put for others."""
        atoms = [self.expression(condition, swap) for condition in dynamics.conditions]
        if dynamics.scenarios:
            # scenarios that run one after the other tell their objects apart
            return tuple(atoms), tuple(sorted(swap.items()))
        said: Counter[Hashable] = Counter()
        for requirement in dynamics.requirements:
            said["require", self._formula(requirement.formula, atoms)] += 1
        for each in dynamics.terminations:
            atom = None if each.condition is None else atoms[each.condition.number]
            said["terminate", atom, each.after_s, each.simulation] += 1
        # behaviors run one after the other: where one may end the run before another one loses it, their order counts
        ordered = any(each.object is not None and each.terminates for each in dynamics.processes)
        for number, process in enumerate(dynamics.processes):
            steps = tuple(_step(step, atoms) for step in process.steps)
            owner = None if process.object is None else swap.get(process.object, process.object)
            said["process", owner, steps, number if ordered and owner is not None else None] += 1
        return frozenset(said.items())

    def _formula(self, root: Formula, atoms: Sequence[int]) -> int:
        order: list[Formula] = []
        stack = [root]
        while stack:
            order.append(stack.pop())
            stack.extend(operands(order[-1]))
        numbers: dict[int, int] = {}
        for node in reversed(order):
            below = [numbers[id(part)] for part in operands(node)]
            if isinstance(node, And | Or):
                below.sort()
            own = atoms[node.number] if isinstance(node, Atom) else None
            numbers[id(node)] = self.number((type(node).__name__, own, tuple(below)))
        return numbers[id(root)]


def _step(step: ProcessStep, atoms: Sequence[int]) -> Hashable:
    match step:
        case Test():
            return "test", atoms[step.condition.number], step.then, step.otherwise
        case Terminate() | Reject() | End():
            return type(step).__name__
        case Wait():
            # where the program says it makes no difference
            return "wait", step.then, step.timers
        case _:
            return step
