"""Conditions on what a label does not observe: between what surely holds and what may hold lies what is unknown.

How an object moves (`MOTION`) is only ever observed, as no default of a class says it, and so are attributes that a
program reads of labels without giving its objects any. A condition that reads what is
not observed is replaced by two that do not: one that holds only where the condition surely does, one that holds
wherever it may (Kleene's logic).

How far something is along a course is known up to two ends, which mostly are equal (`CourseCoordinate`): a condition on
it is one on the ends (`course_ends`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.course_ends import Truths, has_ends, join, opposite, truths_by_ends
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    CLOCK,
    MIRRORED,
    PAST,
    WHO,
    Among,
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    Feature,
    Logic,
    LogicOp,
    Node,
    Normal,
    Select,
    VectorOf,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.value_numbers import ValueNumbers, is_total, without_negation
from scenicq.forest.walk import children, postorder, transform
from scenicq.limits import LIMITS

__all__ = ["MOTION", "certain_and_possible", "is_only_observed", "is_open", "with_any_value"]

MOTION = frozenset({"speed", "velocity", "acceleration", "angularSpeed"})
"""Properties that say how an object moves."""


def is_only_observed(scenario: Scenario, index: int, name: str) -> bool:
    """Whether labels alone tell a property of an object: how it moves, or what the program does not say of it."""
    if name in MOTION:
        return True
    if index < 0 or name in (*WHO, CLOCK) or name.startswith(PAST):
        return False
    return name not in scenario.every_object[index].properties


def is_open(node: Node, unobserved: Callable[[Feature | Among], bool]) -> bool:
    """Whether a node is no one value that is known; arguments as of `certain_and_possible`."""
    return (isinstance(node, Feature | Among) and unobserved(node)) or has_ends(node)


def certain_and_possible(root: Node, unobserved: Callable[[Feature | Among], bool]) -> Truths:
    """What a condition is known to be without what is not observed.

    Args:
        root: The condition.
        unobserved: Whether a feature is not observed, or what holds of label objects is not known.

    Returns:
        The condition itself twice where it reads nothing unobserved.
    """
    # each condition that is told apart doubles what is left
    return _Reader(unobserved).apart(root, LIMITS.unobserved_choices // 2)


def with_any_value(root: Node, unobserved: Callable[[Feature], bool]) -> Node:
    """An expression that may come out as whatever it does for some values of what is not observed."""
    any_value: dict[tuple[int, str], Node] = {}

    def number() -> Node:
        # any real number
        return Normal(build.constant(0.0), build.constant(1.0))

    def step(node: Node) -> Node:
        if has_ends(node):
            return number()
        if not (isinstance(node, Feature) and unobserved(node)):
            return node
        made = VectorOf(number(), number()) if node.kind == "vector" else number()
        return any_value.setdefault((node.object, node.property), made)

    return transform(root, step)


_FALSE, _TRUE = build.constant(False), build.constant(True)


class _Reader:
    def __init__(self, unobserved: Callable[[Feature | Among], bool]) -> None:
        self._unobserved = unobserved
        self._numbers = ValueNumbers()
        self._known: dict[int, int] = {}
        self._alive: list[Node] = []  # as numbers are known by ids

    def _number(self, node: Node) -> int:
        self._alive.append(node)
        return self._numbers.expression(node, known=self._known)

    def apart(self, root: Node, splits: int) -> Truths:
        """As `certain_and_possible`: what is asked for several times comes out the same each time."""
        base = self._repeated(root) if splits else None
        if base is None:
            return self.truths(root, LIMITS.unobserved_choices)
        number = self._number(base)
        self._alive.append(root)
        certain, possible = self.truths(base, LIMITS.unobserved_choices)
        cases: list[Truths] = []
        for value in (True, False):

            def given(node: Node, value: bool = value) -> Node:
                if kind_of(node) != "boolean":
                    return node
                own, positive = without_negation(node)
                known = value if self._number(own) == number else self._follows(base, own, value=value)
                return node if known is None else build.constant(known == positive)

            cases.append(self.apart(transform(root, given), splits - 1))
        (sure, may), (sure_not, may_not) = cases
        either = build.connect(LogicOp.AND, [
            build.connect(LogicOp.OR, [build.opposite(possible), sure]), build.connect(LogicOp.OR, [certain, sure_not]),
        ])  # fmt: skip
        some = build.connect(LogicOp.OR, [
            build.connect(LogicOp.AND, [possible, may]), build.connect(LogicOp.AND, [build.opposite(certain), may_not]),
        ])  # fmt: skip
        return either, some

    def _repeated(self, root: Node) -> Node | None:
        """A condition on what is not observed that is asked for at several places; None if there is none."""
        reading: set[int] = set()
        seen: set[int] = set()
        for node in postorder((root,)):
            below = children(node)
            if is_open(node, self._unobserved) or any(id(each) in reading for each in below):
                reading.add(id(node))
            if isinstance(node, Logic) and node.op is LogicOp.NOT:
                continue  # it counts as what it negates, where it is asked for
            for each in below:
                if id(each) in reading and kind_of(each) == "boolean":
                    base, _ = without_negation(each)
                    bound = self._bound(base)
                    asked = self._number(base) if bound is None else bound[0]
                    if asked in seen and all(map(is_total, postorder((base,)))):
                        return base
                    seen.add(asked)
        return None

    def _bound(self, base: Node) -> tuple[int, bool, float] | None:
        """The number of what a comparison bounds, whether from above, and the bound, if that is a known number."""
        match base:
            case Compare(op=CompareOp.LT, left=left, right=Constant(value=float() as bound)):
                return self._number(left), True, bound
            case Compare(op=CompareOp.LT, left=Constant(value=float() as bound), right=right):
                return self._number(right), False, bound
            case _:
                return None

    def _follows(self, base: Node, other: Node, *, value: bool) -> bool | None:
        """What another comparison comes out as where a first one does so, None if that does not tell."""
        mine, theirs = self._bound(base), self._bound(other)
        if mine is None or theirs is None or mine[0] != theirs[0]:
            return None
        (_, above, bound), (_, upper, limit) = mine, theirs
        if above == value:  # less than the bound, or at most so much
            inside, beyond = bound < limit or (bound == limit and above), bound <= limit
            return (True if inside else None) if upper else (False if beyond else None)
        inside, beyond = bound > limit or (bound == limit and not above), bound >= limit
        return (False if beyond else None) if upper else (True if inside else None)

    def truths(self, root: Node, selects: int) -> Truths:
        """As `certain_and_possible`; at most so many choices inside one comparison are told apart."""
        reading: set[int] = set()
        found: dict[int, Truths] = {}
        for node in postorder((root,)):
            below = children(node)
            if is_open(node, self._unobserved) or any(id(each) in reading for each in below):
                reading.add(id(node))
            if kind_of(node) == "boolean" or node is root:
                reads = id(node) in reading
                found[id(node)] = self._one(node, found, reading, selects) if reads else (node, node)
        return found[id(root)]

    def _one(self, node: Node, found: dict[int, Truths], reading: set[int], selects: int) -> Truths:
        """The truths of a node that reads what is not observed, from those of the nodes below it."""
        match node:
            case Among(kind="boolean") if self._unobserved(node) and not all(
                isinstance(each, Constant) for each in node.inputs
            ):
                return replace(node, unknown=False), replace(node, unknown=True)
            case Logic(op=LogicOp.NOT, args=(arg,)) if id(arg) in found:
                return opposite(found[id(arg)])
            case Logic() if node.op is not LogicOp.NOT and all(id(arg) in found for arg in node.args):
                return join(node.op, *(found[id(arg)] for arg in node.args))
            case Select() if all(id(option) in found for option in node.options):
                return _chosen(node, found, index_known=id(node.index) not in reading)
            case Compare(op=CompareOp.EQ | CompareOp.NE) if kind_of(node.left) == kind_of(node.right) == "boolean":
                one, other = found[id(node.left)], found[id(node.right)]
                same = join(LogicOp.OR, join(LogicOp.AND, one, other),
                               join(LogicOp.AND, opposite(one), opposite(other)))  # fmt: skip
                return same if node.op is CompareOp.EQ else opposite(same)
            case Compare(left=Arithmetic(op=ArithmeticOp.MIN | ArithmeticOp.MAX) as extreme):
                return self._of_extreme(node.op, extreme, node.right, node.span, selects)
            case Compare(right=Arithmetic(op=ArithmeticOp.MIN | ArithmeticOp.MAX) as extreme):
                return self._of_extreme(MIRRORED.get(node.op, node.op), extreme, node.left, node.span, selects)
            case _:
                return self._atom(node, reading, selects)

    def _of_extreme(
        self, op: CompareOp, extreme: Arithmetic, bound: Node, span: Span | None, selects: int
    ) -> Truths:  # fmt: skip
        """The truths of `min(a, b) < c` and its like: one operand, or each, is beyond; `==` is both ways."""
        if op not in MIRRORED:
            sides = (self._of_extreme(each, extreme, bound, span, selects) for each in (CompareOp.LE, CompareOp.GE))
            same = join(LogicOp.AND, *sides)
            return same if op is CompareOp.EQ else opposite(same)
        least, below = extreme.op is ArithmeticOp.MIN, op in (CompareOp.LT, CompareOp.LE)
        parts = [self.truths(build.compare(op, arg, bound, span), selects) for arg in extreme.args]
        return join(LogicOp.OR if least is below else LogicOp.AND, *parts)

    def _is_unknown(self, node: Node) -> bool:
        """Whether nothing will be known of a node; label objects may tell more once what is asked of them is given."""
        given = isinstance(node, Among) and all(isinstance(each, Constant) for each in node.inputs)
        return (isinstance(node, Feature) or (isinstance(node, Among) and given)) and self._unobserved(node)

    def _atom(self, node: Node, reading: set[int], selects: int) -> Truths:
        """The truths of a condition on values: what is equal for all outcomes of a choice inside is known."""
        inside = (each for each in postorder((node,)) if isinstance(each, Select) and each is not node)
        choice = next((each for each in inside if id(each) in reading), None)
        if choice is None or selects == 0:
            if any(map(self._is_unknown, postorder((node,)))):
                return _of_speed(node, reading)
            return truths_by_ends(node)
        outcomes: list[Node] = []
        for number in range(len(choice.options)):

            def outcome(each: Node, number: int = number, choice: Select = choice) -> Node:
                return each.options[number] if isinstance(each, Select) and each.index is choice.index else each

            outcomes.append(transform(node, outcome))
        return self.truths(Select(choice.index, tuple(outcomes), span=node.span), selects - 1)


def _chosen(node: Select, found: dict[int, Truths], *, index_known: bool) -> Truths:
    """A choice between conditions; where its index is not known, what all its options agree on."""
    options = [found[id(option)] for option in node.options]
    if index_known:
        certain, possible = (tuple(option[place] for option in options) for place in (0, 1))
        return Select(node.index, certain, span=node.span), Select(node.index, possible, span=node.span)
    every, some = join(LogicOp.AND, *options)[0], join(LogicOp.OR, *options)[1]
    if id(node.index) not in found:
        return every, some
    index, (no, yes) = found[id(node.index)], options
    chosen = join(LogicOp.OR, join(LogicOp.AND, index, yes), join(LogicOp.AND, opposite(index), no))
    return join(LogicOp.OR, chosen, (every, every))[0], chosen[1]


def _of_speed(node: Node, reading: set[int]) -> Truths:
    """The truths of a comparison with a speed, which is never negative; nothing is known of anything else."""
    match node:
        case Compare(left=Feature(property="speed") as speed, right=bound) if id(bound) not in reading:
            op = node.op
        case Compare(left=bound, right=Feature(property="speed") as speed) if id(bound) not in reading:
            op = MIRRORED.get(node.op, node.op)
        case _:
            return _FALSE, _TRUE
    if id(speed) not in reading or kind_of(bound) != "scalar":
        return _FALSE, _TRUE
    zero = build.constant(0.0)
    match op:
        case CompareOp.GT | CompareOp.NE:
            return build.compare(CompareOp.LT, bound, zero, node.span), _TRUE
        case CompareOp.GE:
            return build.compare(CompareOp.LE, bound, zero, node.span), _TRUE
        case CompareOp.LT:
            return _FALSE, build.compare(CompareOp.GT, bound, zero, node.span)
        case CompareOp.LE | CompareOp.EQ:
            return _FALSE, build.compare(CompareOp.GE, bound, zero, node.span)
