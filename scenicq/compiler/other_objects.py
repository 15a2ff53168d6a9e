"""`others`, `count` and `nearest` of the module `scenicq.labels`: label objects that need not play a role.

A condition on each of them is evaluated once, over an *element*: an object that stands for any of them. The result
becomes an `Among` node (`forest/among`) where `any`, `all`, `len` or a function here says what is asked of all.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, cast

from scenicq.compiler import operators
from scenicq.compiler.coerce import OBSERVABLE, observed_property, property_node, to_boolean
from scenicq.compiler.road_courses import along
from scenicq.compiler.values import Instance, LabelObjects, ModelValue, Nearest, OtherList, ScenicClass, describe, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.course_ends import has_ends
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import (
    ELEMENT,
    GIVEN,
    IDENTITY,
    OPEN,
    RANK,
    TRACK,
    Among,
    AmongOp,
    Body,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    Feature,
    Index,
    Kind,
    LogicOp,
    Node,
    Select,
)
from scenicq.forest.unobserved import certain_and_possible
from scenicq.forest.walk import children, conjuncts, is_leaf, leaves, postorder, rebuild

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = [
    "count",
    "count_others",
    "is_element",
    "is_nearest",
    "list_elements",
    "nearest",
    "of_nearest",
    "others",
    "same_object",
    "truth_of_list",
]

_FIRST_ELEMENT = -1000
_numbers = itertools.count(_FIRST_ELEMENT, -1)


def _element(objects: LabelObjects, span: Span) -> Instance:
    """Make the element of some label objects."""
    made = Instance(objects.cls, next(_numbers), span)
    made.properties.update(dict.fromkeys(OBSERVABLE))
    return made


def others(run: Interpreter, span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
    """`others(C)`: the label objects of a class that play no role."""
    cls = _class(run, span, "others", args, named, ())
    return LabelObjects(cls, tuple(_feature(each, TRACK, span) for each in run.objects))


def count(run: Interpreter, span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
    """`count(C, within=R, ahead=True)`: how many label objects of a class there are, besides the ego."""
    if args and isinstance(args[0], OtherList) and len(args) == 1 and not named:
        return count_others(args[0], span)
    cls = _class(run, span, "count", args, named, _FILTERS)
    every = _all_but_ego(run, cls, span)
    element = _element(every, span)
    return _among(AmongOp.COUNT, every, element, _filter(run, named, span)(element), span)


def nearest(run: Interpreter, span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
    """`nearest(C, within=R, ahead=True)`: the label object of a class that is nearest to the ego."""
    cls = _class(run, span, "nearest", args, named, _FILTERS)
    every, counts, ego = _all_but_ego(run, cls, span), _filter(run, named, span), run.ego(span)
    made = Nearest(cls, None, span, objects=every, counts=counts, ego=ego)
    made.properties.update({name: of_nearest(made, name, kind, span) for name, kind in OBSERVABLE.items()})
    return made


def of_nearest(near: Nearest, name: str, kind: Kind, span: Span) -> Node:
    """A property of the nearest object, which labels tell."""
    assert near.objects is not None
    assert near.counts is not None
    element = _element(near.objects, span)
    away = operators.distance_to(element, near.ego, span)
    value = observed_property(element, name, kind, span)
    counts = near.counts(element)
    return _among(AmongOp.NEAREST, near.objects, element, counts, span, distance=away, value=value)


def is_nearest(one: Instance, other: Nearest, span: Span) -> Node:
    """Whether an object is the nearest one: it counts, and no other object that counts comes before it."""
    assert other.objects is not None
    assert other.counts is not None
    if one.index is None:
        raise fail("wrong-type", "only an object can be the nearest", span, f"this is {describe(one)}")
    objects, element = other.objects, _element(other.objects, span)
    counts, ego = other.counts(element), other.ego
    same = _compare("==", _feature(element, IDENTITY, span), _feature(one, IDENTITY, span), span)
    away, least = operators.distance_to(element, ego, span), operators.distance_to(one, ego, span)
    ranks = _compare("<", _feature(element, RANK, span), _feature(one, RANK, span), span)
    before = build.logic(
        LogicOp.OR,
        _compare("<", away, least, span),
        _all_of((_compare("==", away, least, span), ranks), span=span),
        span=span,
    )
    is_there = _among(AmongOp.AT_LEAST, objects, element, _all_of((same, counts), span=span), span)
    someone = _among(
        AmongOp.AT_LEAST,
        objects,
        element,
        _all_of((build.opposite(same), counts, before), span=span),
        span,
    )
    # where it is not seen, nothing is known of it, also where nobody is
    seen = Compare(CompareOp.EQ, _feature(one, IDENTITY, span), _feature(one, IDENTITY, span), span=span)
    return Select(
        seen,
        (build.constant(False), _all_of((is_there, build.opposite(someone)), span=span)),
        span=span,
    )


def list_elements(
    objects: LabelObjects, span: Span, visit: Callable[[Instance], tuple[tuple[Node, ...], ModelValue]]
) -> OtherList:
    """A list comprehension over some label objects.

    Args:
        objects: The label objects.
        span: Where the list is made.
        visit: Evaluates the filters and the item of the comprehension, from the element.
    """
    element = _element(objects, span)
    return OtherList(objects, element, *visit(element))


def is_element(value: ModelValue) -> bool:
    """Whether a value is an element, which stands for any of some label objects."""
    return isinstance(value, Instance) and value.index is not None and value.index <= _FIRST_ELEMENT


def same_object(one: Instance, other: Instance, span: Span) -> ModelValue:
    """Whether an element and an object, or two elements, are one label object."""
    if one is other or one.index is None or other.index is None:
        return one is other
    return _compare("==", _feature(one, IDENTITY, span), _feature(other, IDENTITY, span), span)


def truth_of_list(op: str, items: OtherList, span: Span) -> Node:
    """`any` ("or") or `all` ("and") of a list."""
    wanted = to_boolean(items.value, span)
    if op == "or":
        body = _all_of((*items.conditions, wanted), span=span)
        return _among(AmongOp.AT_LEAST, items.objects, items.element, body, span)
    if items.conditions:
        left_out = build.opposite(_all_of(items.conditions, span))
        wanted = build.logic(LogicOp.OR, left_out, wanted, span=span)
    return _among(AmongOp.EVERY, items.objects, items.element, wanted, span)


def count_others(items: OtherList | LabelObjects, span: Span) -> Node:
    """`len` of a list comprehension over other label objects, or of all of them."""
    if isinstance(items, LabelObjects):
        return _among(AmongOp.COUNT, items, _element(items, span), build.constant(True), span)
    return _among(AmongOp.COUNT, items.objects, items.element, _all_of(items.conditions, span), span)


_FILTERS = ("within", "ahead")


def _class(
    run: Interpreter, span: Span, name: str, args: tuple[ModelValue, ...], named: Mapping[str, ModelValue],
    filters: tuple[str, ...],
) -> ScenicClass:  # fmt: skip
    """Read the arguments of a function, which stands in a condition: one class, and filters."""
    if run.course is None:
        raise fail("unsupported-construct", f"`{name}` can be asked in conditions only", span, "not in a condition",
                   ("ask it in `require`, `terminate when`, a monitor, or `record` it",))  # fmt: skip
    unknown = [each for each in named if each not in filters]
    if unknown:
        given = f"`{name}` takes a class{''.join(f' and `{each}=`' for each in filters)}"
        raise fail("wrong-arity", f"`{name}` has no `{unknown[0]}=`", span, "given here", (given,))
    if len(args) != 1:
        raise fail("wrong-arity", f"`{name}` takes one class", span, f"{len(args)} values are given")
    if not isinstance(args[0], ScenicClass) or not args[0].derives_from("Object"):
        raise fail("wrong-type", f"`{name}` needs a class of objects", span, f"this is {describe(args[0])}",
                   (f"write `{name}(Car)`",))  # fmt: skip
    return args[0]


def _all_but_ego(run: Interpreter, cls: ScenicClass, span: Span) -> LabelObjects:
    """The label objects of a class besides the ego."""
    return LabelObjects(cls, (_feature(run.ego(span), TRACK, span),))


def _feature(each: Instance, name: str, span: Span) -> Feature:
    return Feature(cast(int, each.index), name, "scalar", True, span=span)


def _filter(run: Interpreter, named: Mapping[str, ModelValue], span: Span) -> Callable[[Instance], Node]:
    ahead = named.get("ahead", False)
    if not isinstance(ahead, bool):
        raise fail("wrong-type", "`ahead=` is True or False", span, f"this is {describe(ahead)}")

    def counts(element: Instance) -> Node:
        # by its centre, as a point in the region and on the course
        place, asked = property_node(element, "position", span), list[Node]()
        if "within" in named:
            asked.append(operators.within(place, named["within"], span))
        if ahead:
            far = along(run, span, run.ego(span), place)
            asked.append(Compare(CompareOp.GT, far, build.constant(0.0), span=span))
        return _all_of(tuple(asked), span=span) if asked else build.constant(True)

    return counts


def _by_ends(condition: Node, element: Instance) -> Node:
    """A condition on numbers that are known up to two ends: unknown where the ends do not decide it."""

    def known(part: Node) -> Node:
        if not any(map(has_ends, postorder((part,)))):
            return part
        certain, possible = certain_and_possible(part, lambda _: False)
        unknown = Feature(cast(int, element.index), OPEN, "boolean", True, span=part.span)
        return build.connect(LogicOp.OR, [certain, build.connect(LogicOp.AND, [possible, unknown])])

    return build.connect(LogicOp.AND, list(map(known, conjuncts(condition))))


_all_of = partial(build.connect, LogicOp.AND)
"""The conjunction of conditions."""


def _compare(op: str, left: Node, right: Node, span: Span) -> Node:
    return cast(Node, operators.compare(op, left, right, span))


def _among(
    op: AmongOp, objects: LabelObjects, element: Instance, condition: Node, span: Span, *,
    distance: Node | None = None, value: Node | None = None,
) -> Node:  # fmt: skip
    """Ask something about some label objects; other values that the condition reads become inputs.

    Raises:
        ScenarioError: unsupported-construct, where the condition depends on a random value or a direction.
    """
    given: dict[int, Node] = {}
    excluded, condition = objects.excluded, _by_ends(condition, element)
    asked = [each for each in (condition, distance, value) if each is not None]
    closed = iter([_close_over(each, cast(int, element.index), given, span) for each in asked])
    body = Body(next(closed), *(None if each is None else next(closed) for each in (distance, value)))
    inputs = (*excluded, *given.values())
    chance = next((each for each in leaves(*inputs) if not isinstance(each, Index)), None)
    if chance is not None:
        raise fail("unsupported-construct", "a condition on other label objects depends on a random value", span,
                   "random here", ("compare only with what labels observe",))  # fmt: skip
    kind = kind_of(value) if value is not None else "scalar" if op is AmongOp.COUNT else "boolean"
    return Among(op, objects.cls.category, body, kind, 1, len(excluded), inputs, span=span)


def _close_over(root: Node, element: int, given: dict[int, Node], span: Span) -> Node:
    """Rewrite an expression over an element to the body of an `Among`; what it reads of others is added to the inputs.

    Raises:
        ScenarioError: unsupported-construct, for directions and choices at the place of the element.
    """
    depends: set[int] = set()
    made: dict[int, Node] = {}

    def part(node: Node) -> Node:
        if id(node) in depends or isinstance(node, Constant):
            return made.get(id(node), node)
        if isinstance(node, Index):
            raise fail("unsupported-construct", "a condition cannot ask which lanes other label objects are in",
                       span, "at their places", ("ask whether they are in a region",))  # fmt: skip
        given.setdefault(id(node), node)
        number = list(given).index(id(node))
        return Feature(GIVEN, str(number), kind_of(node), True, span=node.span)

    for node in postorder((root,)):
        below = children(node)
        if isinstance(node, Feature) and node.object == element:
            made[id(node)] = Feature(ELEMENT, node.property, node.kind, True, span=node.span)
        elif any(id(each) in depends for each in below):
            if isinstance(node, DirectionAt) or is_leaf(node):
                what = "a direction" if isinstance(node, DirectionAt) else "a random value"
                raise fail(
                    "unsupported-construct", f"a condition cannot ask for {what} where other label objects are", span
                )
            made[id(node)] = rebuild(node, tuple(map(part, below)))
        else:
            continue
        depends.add(id(node))
    return part(root)
