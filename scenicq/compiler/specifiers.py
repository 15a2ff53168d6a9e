"""Specifiers, and how an object is built from them (language paper, section 5.2, algorithm 1 and appendix B.3).

A specifier gives properties, some of them only if nothing else does (optionally), and needs others. `construct` puts
explicit specifiers, optional ones and class defaults in an order in which everything needed is there, and evaluates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from scenicq.compiler.coerce import to_node
from scenicq.compiler.random_values import make_choice
from scenicq.compiler.values import Instance, ModelValue, PropertyDefinition, ScenicClass, fail
from scenicq.errors import Diagnostic, Note, ScenarioError, Span
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Constant, DirectionAt, Feature, Index, Node

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["BoundSpecifier", "construct"]


@dataclass(frozen=True, slots=True, eq=False)
class BoundSpecifier:
    """A specifier whose arguments are evaluated.

    Attributes:
        gives: Properties that it specifies.
        optionally: Properties that it specifies unless another specifier does.
        needs: Properties of the object that it needs.
        evaluate: Values of the properties, given the object so far.
        span: The specifier in the program.
        explicit: Whether the user's program rather than a library says it.
        rank: The lowest rank counts among several optional specifiers of a property (Scenic 3's priorities).
        modifies: A property that it gives only if no other specifier does; if one does, it adds a condition instead.
        condition: The condition: requires something of the finished object.
        perhaps: Whether Scenic may take what it gives optionally or the class's default, as it happens.
    """

    gives: frozenset[str]
    optionally: frozenset[str]
    needs: frozenset[str]
    evaluate: Callable[[Instance], Mapping[str, ModelValue]]
    span: Span | None
    explicit: bool = True
    rank: int = 3
    modifies: str = ""
    condition: Callable[[Instance], Node] | None = None
    perhaps: bool = False


def _default_specifier(name: str, chain: list[PropertyDefinition], evaluator: Interpreter) -> BoundSpecifier:
    first = chain[0]
    additive = "additive" in first.modifiers
    used = chain if additive else chain[:1]

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        values = [evaluator.default(definition, instance) for definition in used]
        return {name: tuple(values) if additive else values[0]}

    needs = frozenset[str]().union(*(definition.needs for definition in used))
    return BoundSpecifier(frozenset({name}), frozenset(), needs, evaluate, first.span, not first.library)


def _definitions(cls: ScenicClass) -> dict[str, list[PropertyDefinition]]:
    found: dict[str, list[PropertyDefinition]] = {}
    for ancestor in cls.ancestry():
        for name, definition in ancestor.definitions.items():
            found.setdefault(name, []).append(definition)
    return found


def _conflict(name: str, first: BoundSpecifier, second: BoundSpecifier) -> Exception:
    shown = "heading" if name == "parentOrientation" else name
    notes = (Note(first.span, f"specifies `{shown}` first"),) if first.span else ()
    return fail(
        "specifier-conflict",
        f"`{shown}` is specified twice",
        second.span,
        f"also specifies `{shown}`",
        ("keep one of the two specifiers",),
        notes,
    )


def _choose(specifiers: Iterable[BoundSpecifier]) -> dict[str, BoundSpecifier]:
    """Which specifier gives each property: the outright one, else the optional one of the lowest rank."""
    specifiers = sorted(specifiers, key=lambda specifier: bool(specifier.modifies))
    chosen: dict[str, BoundSpecifier] = {}
    for specifier in specifiers:
        for name in sorted(specifier.gives):
            if name not in chosen:
                chosen[name] = specifier
            elif specifier.modifies != name or chosen[name].modifies:
                raise _conflict(name, chosen[name], specifier)
    optional: dict[str, BoundSpecifier] = {}
    for specifier in specifiers:
        for name in sorted(specifier.optionally - chosen.keys()):
            if name in optional and optional[name].rank == specifier.rank:
                raise _conflict(name, optional[name], specifier)
            if name not in optional or specifier.rank < optional[name].rank:
                optional[name] = specifier
    return chosen | optional


def construct(
    instance: Instance,
    specifiers: tuple[BoundSpecifier, ...],
    evaluator: Interpreter,
) -> None:
    """Fill an instance's properties (language paper, algorithm 1).

    Args:
        instance: The instance, without properties.
        specifiers: What the program says, in order.
        evaluator: Evaluates class defaults.

    Raises:
        ScenarioError: specifier-conflict, specifier-missing or specifier-cycle.
    """
    definitions = _definitions(instance.cls)
    chosen = _choose(specifiers)
    for name, specifier in chosen.items():
        final = next((d for d in definitions.get(name, ()) if "final" in d.modifiers), None)
        if final is not None:
            raise fail("specifier-conflict", f"`{name}` is final in `{instance.cls.name}`", specifier.span,
                       "cannot be specified", ("remove this specifier",))  # fmt: skip
    for name, chain in definitions.items():
        default = _default_specifier(name, chain, evaluator)
        if name not in chosen:
            chosen[name] = default
        elif chosen[name].perhaps and name in chosen[name].optionally:
            chosen[name] = _either(name, chosen[name], default)
    for name in _order(chosen, instance):
        specifier = chosen[name]
        if name in instance.properties:
            continue
        try:
            values = specifier.evaluate(instance)
        except ScenarioError as error:
            raise error if specifier.explicit or instance.span is None else _by_default(error, instance, name) from None
        for given, value in values.items():
            if chosen.get(given) is specifier:
                instance.properties[given] = value
                instance.spans[given] = specifier.span
                if specifier.explicit:
                    instance.explicit.add(given)
    for specifier in specifiers:
        replaced = specifier.modifies and chosen[specifier.modifies] is not specifier
        if specifier.condition is not None and specifier.span is not None and (replaced or not specifier.modifies):
            evaluator.demand(partial(specifier.condition, instance), specifier.span)


_FREELY = {"position": "in everywhere, facing Range(0, 360) deg", "heading": "facing Range(0, 360) deg"}
"""What a program writes for a property that may have any value."""


def _by_default(error: ScenarioError, instance: Instance, name: str) -> ScenarioError:
    """What the map lacks for a class's default, told where the program makes the object."""
    told: list[Diagnostic] = []
    for each in error.diagnostics:
        if each.code == "map-lacks":
            notes = (*each.notes, Note(each.span, "the default")) if each.span is not None else each.notes
            label = f"the default `{name}` of `{instance.cls.name}` needs it"
            anything = (
                f"`{_FREELY[name]}` needs nothing from the map" if name in _FREELY else f"`with {name} ...` sets it"
            )
            each = replace(each, span=instance.span, label=label, hints=(anything,), notes=notes)  # noqa: PLW2901
        told.append(each)
    return ScenarioError(told)


def _either(name: str, given: BoundSpecifier, default: BoundSpecifier) -> BoundSpecifier:
    """A property as a specifier gives it or as the class does."""

    def evaluate(instance: Instance) -> Mapping[str, ModelValue]:
        options = [specifier.evaluate(instance)[name] for specifier in (given, default)]
        one, other = (to_node(option, given.span) for option in options)
        return {name: one if _is_same(one, other) else make_choice(Index((1.0, 1.0)), [one, other], given.span)}

    needs = given.needs | default.needs
    return BoundSpecifier(frozenset({name}), frozenset(), needs, evaluate, given.span, given.explicit)


def _is_same(one: Node, other: Node) -> bool:
    """Whether two headings are the same direction at the same place, as on a road; the second may have 0 added."""
    match other:
        case Arithmetic(op=ArithmeticOp.ADD, args=(DirectionAt() as field, Constant(value=0.0))):
            other = field
        case _:
            pass
    if not (isinstance(one, DirectionAt) and isinstance(other, DirectionAt)):
        return False
    fields = [field.value if isinstance(field, Constant) else field for field in (one.field, other.field)]
    places = [
        (place.object, place.property) if isinstance(place, Feature) else place for place in (one.point, other.point)
    ]
    return fields[0] is fields[1] and places[0] == places[1]


def _order(chosen: Mapping[str, BoundSpecifier], instance: Instance) -> list[str]:
    """Properties in an order in which each comes after what its specifier needs."""
    order: list[str] = []
    state: dict[str, int] = {}
    path: list[str] = []
    stack: list[tuple[str, bool]] = [(name, False) for name in sorted(chosen, reverse=True)]
    while stack:
        name, leaving = stack.pop()
        if leaving:
            state[name] = 2
            path.pop()
            order.append(name)
            continue
        if state.get(name) == 2:
            continue
        if state.get(name) == 1:
            circle = [*path[path.index(name) :], name]
            shown = " -> ".join(f"`{step}`" for step in circle)
            raise fail("specifier-cycle", f"specifiers depend on each other: {shown}", chosen[name].span,
                       f"`{name}` is needed to compute itself",
                       (f"give `{name}` a value that does not depend on the others",))  # fmt: skip
        state[name] = 1
        path.append(name)
        stack.append((name, True))
        for needed in sorted(chosen[name].needs, reverse=True):
            if needed not in chosen:
                raise fail("specifier-missing", f"`{instance.cls.name}` has no `{needed}`, which is needed here",
                           chosen[name].span, f"needs `{needed}`")  # fmt: skip
            if state.get(needed) != 2:
                stack.append((needed, False))
    return order
