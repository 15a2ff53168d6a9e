"""Values of local variables in behaviors: when two are the same, and what is left of them at later samples.

What a variable got from the first sample stays: it is read there, whatever the sample. What it got at a later one is
not kept: then it is unknown, and each variable has unknown values of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import cast

from scenicq.compiler.contracts import Contract
from scenicq.compiler.coroutines import CoroutineCall, DelayedCall, LibraryCall, ScenarioCall
from scenicq.compiler.unread import NoValue
from scenicq.compiler.values import Choice, Function, Instance, LabelObjects, ModelValue, OtherList, fail, is_node
from scenicq.errors import Span
from scenicq.forest.condition import condition as conditioned
from scenicq.forest.kinds import kind_of
from scenicq.forest.nodes import PAST, Constant, Feature, Identity, Index, Leaf, Node
from scenicq.forest.value_numbers import ValueNumbers
from scenicq.forest.walk import is_leaf, leaves, postorder, transform

__all__ = ["HERE", "LocalValues", "VariableValue"]


HERE = "here"
"""What stands for the environment of a function that is defined where its variable is."""


@dataclass(frozen=True, slots=True)
class VariableValue:
    """The value of a variable.

    Attributes:
        key: Equal where the values are the same.
        value: It.
    """

    key: Hashable
    value: ModelValue = field(compare=False, repr=False)


@dataclass(eq=False)
class LocalValues:
    """The values of the variables of one process.

    Attributes:
        process: Its number.
        drawn_after: Random variables that are made later than this are drawn by the process.
        ranks: Which of several elements of the map that lie at a place is meant, by look-up and place: here the first
            one, as in Scenic.
        of_scene: Those made in these stretches of identities are the scene's all the same: scenarios drew them that
            began with it.
        numbers: Tells expressions apart.
    """

    process: int
    drawn_after: int
    ranks: Mapping[tuple[object, ...], Index]
    of_scene: list[range] = field(default_factory=list[range])
    numbers: ValueNumbers = field(default_factory=ValueNumbers)
    _keys: dict[int, tuple[object, Hashable]] = field(default_factory=dict["int", "tuple[object, Hashable]"])
    _aged: dict[tuple[int, str, bool], tuple[object, VariableValue]] = field(
        default_factory=dict["tuple[int, str, bool]", "tuple[object, VariableValue]"]
    )

    def hold(self, value: ModelValue) -> VariableValue:
        """A value."""
        # what may change is looked at again
        if isinstance(value, list | dict | set):
            return VariableValue(self._key(value), value)
        if id(value) not in self._keys:
            self._keys[id(value)] = value, self._key(value)
        return VariableValue(self._keys[id(value)][1], value)

    def hold_contract(self, contract: Contract) -> VariableValue:
        """A contract: it is the same where it asks for the same."""
        shows = None if contract.shows is None else self.numbers.expression(contract.shows)
        return VariableValue(("contract", contract.name, shows, contract.settles_s), contract)

    def _key(self, value: ModelValue) -> Hashable:
        match value:
            case None | bool() | int() | float() | str():
                return type(value).__name__, value
            case Choice():
                return "choice", self.numbers.expression(value.index), *map(self._key, value.options)
            case list() | tuple():
                return type(value).__name__, *map(self._key, cast("list[ModelValue]", value))
            case dict():
                items = cast("dict[ModelValue, ModelValue]", value).items()
                return "dict", *((self._key(key), self._key(each)) for key, each in items)
            case Instance() if value.index is None and type(value) is Instance:
                return "point", id(value.cls), *((key, self._key(each)) for key, each in value.properties.items())
            case DelayedCall():
                return "delayed", value.call.span
            case ScenarioCall():
                given = ((key, self._key(each)) for key, each in value.given.items())
                return "scenario", id(value.of), value.span, *given
            case CoroutineCall():
                return "call", id(value.of), *((key, self._key(each)) for key, each in value.given.items())
            case LibraryCall():
                named = ((key, self._key(each)) for key, each in value.named.items())
                return "library", value.of.name, *map(self._key, value.positional), *named
            case Function(environment="here"):
                defaults = ((key, self._key(each)) for key, each in value.defaults.items())
                return "function", id(value.body), *defaults
            case _ if is_node(value):
                return "node", self.numbers.expression(cast(Node, value))
            case _:
                self._keys.setdefault(id(value), (value, ("id", id(value))))
                return "id", id(value)

    def copy_value(self, value: ModelValue) -> ModelValue:
        """A value whose lists and dictionaries may be changed."""
        match value:
            case list():
                return [self.copy_value(each) for each in cast("list[ModelValue]", value)]
            case dict():
                return {key: self.copy_value(each) for key, each in cast("dict[ModelValue, ModelValue]", value).items()}
            case _:
                return value

    def age_value(self, held: VariableValue, place: str, *, first: bool) -> VariableValue:
        """A value at the next sample.

        Args:
            held: The value.
            place: Where it is, in words that are no other variable's.
            first: Whether the sample is the first one, which is kept.
        """
        asked = id(held.value), place, first
        if asked not in self._aged or isinstance(held.value, list | dict | set):
            self._aged[asked] = held.value, self._made_old(held, place, first=first)
        return self._aged[asked][1]

    def at_begin(self, value: ModelValue, place: str, *, first: bool) -> ModelValue:
        """A value as a scenario gets it that begins: what is read at this sample is read once.

        Args:
            value: The value.
            place: Where it is, in words that are no other variable's.
            first: Whether the sample is the first one, which is kept; at others nothing is known of that.
        """

        def step(node: Node) -> Node:
            if not isinstance(node, Feature) or node.property.startswith(PAST):
                return node
            if node.current or first:
                return replace(node, current=False)
            return replace(
                node, property=f"{PAST}{place} in {self.process}: {node.object} {node.property}", current=True
            )

        if isinstance(value, Instance) and value.index is not None:
            return value
        return self._mapped(value, step)

    def forgotten(self, value: ModelValue, place: str) -> ModelValue:
        """A value of which nothing is known any more that was read at a sample, or drawn.

        Args:
            value: The value.
            place: Where it is, in words that are no other variable's.
        """

        def step(node: Node) -> Node:
            if isinstance(node, Feature) and not node.property.startswith(PAST) and not node.current:
                name = f"{PAST}{place} in {self.process}: {node.object} {node.property}"
                return replace(node, property=name, current=True)
            return node

        if isinstance(value, Instance) and value.index is not None:
            return value
        return self._mapped(value, step)

    def reads_samples(self, value: ModelValue) -> bool:
        """Whether something of a value is read at each sample."""
        return any(map(_is_current, postorder(self.nodes(value))))

    def _made_old(self, held: VariableValue, place: str, *, first: bool) -> VariableValue:
        if not self.reads_samples(held.value):
            return held

        def step(node: Node) -> Node:
            if not _is_current(node):
                return node
            feature = cast(Feature, node)
            if first:
                return replace(feature, current=False)
            name = f"{PAST}{place} in {self.process}: {feature.object} {feature.property}"
            return replace(feature, property=name)

        return self.hold(self._mapped(held.value, step))

    def drawn_variables(self, value: ModelValue) -> list[Leaf]:
        """The random variables that a value was made of that are not those of the scene."""
        found = leaves(*self.nodes(value))
        ranks = self._current_ranks() if found else ()
        return [leaf for leaf in found if self._is_drawn(leaf.identity) or leaf.identity in ranks]

    def _is_drawn(self, identity: Identity) -> bool:
        """Whether the process has drawn a random variable."""
        return identity.order > self.drawn_after and not any(identity.order in each for each in self.of_scene)

    def outcomes_of(self, value: ModelValue, leaf: Index) -> list[ModelValue]:
        """A value for each way in which a choice that is drawn may come out."""
        count = 1 if leaf.identity in self._current_ranks() else len(leaf.weights)
        return [self.settle_choice(value, leaf, option) for option in range(count)]

    def _current_ranks(self) -> set[Identity]:
        """The ranks at places that are read at each sample."""
        return {
            rank.identity
            for (_, where, *_), rank in self.ranks.items()
            if self._is_drawn(rank.identity) or (isinstance(where, tuple) and where[-1] is True)
        }

    def without(self, value: ModelValue, leaf: Leaf, put: Node) -> ModelValue:
        """A value with an expression put for a random variable."""

        def step(node: Node) -> Node:
            return put if is_leaf(node) and cast(Leaf, node).identity is leaf.identity else node

        return self._mapped(value, step)

    def settle_choice(self, value: ModelValue, leaf: Index, option: int) -> ModelValue:
        """A value where a choice comes out as an option."""
        given = {leaf.identity: float(option)}

        def known(each: ModelValue) -> ModelValue:
            if isinstance(each, Choice):
                index = conditioned(each.index, {}, given)
                if isinstance(index, Constant):
                    return known(each.options[int(cast(float, index.value))])
                return Choice(index, tuple(map(known, each.options)), each.size)
            return conditioned(cast(Node, each), {}, given) if is_node(each) else each

        return self._rebuilt(value, known)

    def unknown(self, leaf: Leaf, agent: int, place: str) -> Feature:
        """What stands for a number that is drawn at a place in the program, of which nothing is known."""
        return Feature(agent, f"{PAST}draw at {place} in {self.process}", kind_of(leaf), current=True)

    def nodes(self, value: ModelValue) -> list[Node]:
        """The expressions that a value holds."""
        match value:
            case Choice():
                return [value.index, *(node for each in value.options for node in self.nodes(each))]
            case list() | tuple() | set():
                return [node for each in cast("list[ModelValue]", value) for node in self.nodes(each)]
            case dict():
                return self.nodes(list(cast("dict[ModelValue, ModelValue]", value).values()))
            case Instance() if value.index is None:
                return self.nodes(list(value.properties.values()))
            case CoroutineCall():
                return self.nodes(list(value.given.values()))
            case LibraryCall():
                return self.nodes([*value.positional, *value.named.values()])
            case LabelObjects():
                return list(value.excluded)
            case OtherList():
                return [*value.objects.excluded, *value.conditions, *self.nodes(value.value)]
            case _:
                return [cast(Node, value)] if is_node(value) else []

    def _mapped(self, value: ModelValue, step: Callable[[Node], Node]) -> ModelValue:
        """A value with its expressions rebuilt."""

        def known(each: ModelValue) -> ModelValue:
            if isinstance(each, Choice):
                return Choice(transform(each.index, step), tuple(map(inner, each.options)), each.size)
            if is_node(each):
                return transform(cast(Node, each), step)
            if any(step(node) is not node for node in postorder(self.nodes(each))):
                return NoValue(fail("unsupported-construct", "this cannot be read at a later sample", _place(each),
                                    "says what was there", ("write it again where it is read",)))  # fmt: skip
            return each

        def inner(each: ModelValue) -> ModelValue:
            return self._rebuilt(each, known)

        return inner(value)

    def _rebuilt(self, value: ModelValue, known: Callable[[ModelValue], ModelValue]) -> ModelValue:
        """A value with others put for the choices, expressions and what else it holds."""

        def inner(each: ModelValue) -> ModelValue:
            return self._rebuilt(each, known)

        def all_of(each: Mapping[str, ModelValue]) -> dict[str, ModelValue]:
            return {key: inner(one) for key, one in each.items()}

        match value:
            case list():
                return [inner(each) for each in cast("list[ModelValue]", value)]
            case tuple():
                return tuple(inner(each) for each in cast("tuple[ModelValue, ...]", value))
            case dict():
                return all_of(cast("dict[str, ModelValue]", value))
            case Instance() if value.index is None and type(value) is Instance:
                return replace(value, properties=all_of(value.properties))
            case CoroutineCall():
                return replace(value, given=all_of(value.given))
            case LibraryCall():
                return replace(value, positional=tuple(map(inner, value.positional)), named=all_of(value.named))
            case _:
                return known(value)


def _place(value: ModelValue) -> Span | None:
    return value.span if isinstance(value, Instance | Function) else None


def _is_current(node: Node) -> bool:
    """Whether it is something that is read at each sample."""
    return isinstance(node, Feature) and node.current and not node.property.startswith(PAST)
