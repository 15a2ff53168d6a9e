"""From text to a scenario: parse, run, and read off the objects, requirements and parameters.

A scenario is compiled once per map: the road network is part of the program's world.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import PurePosixPath

from scenicq.compiler import operators
from scenicq.compiler.builtins import language_names
from scenicq.compiler.coerce import to_node, to_region, to_scalar, to_vector
from scenicq.compiler.environment import Environment
from scenicq.compiler.interpreter import Interpreter
from scenicq.compiler.models import libraries_of, library_text, network_names, plain_module
from scenicq.compiler.roots import OBJECT, OBJECT_VISIBLE, ORIENTED_POINT, POINT
from scenicq.compiler.values import Choice, Instance, ModelValue, Module, fail, is_node
from scenicq.errors import Diagnostic, Note, ScenarioError, Source, Span
from scenicq.forest.compute import fold
from scenicq.forest.nodes import Constant, Encloses, Intersects, Node, Undefined
from scenicq.forest.scenario import BuiltIn, Property, Requirement, Scenario, ScenarioObject
from scenicq.forest.simplify import simplify
from scenicq.geometry.elements import NetworkElement
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Everywhere
from scenicq.syntax import ast
from scenicq.syntax.parser import parse

__all__ = ["Loader", "compile_scenario"]

Loader = Callable[[str], Source | None]
"""Gives the text of a file beside the program, by its name relative to the program's folder; None if there is none."""

_DEFAULT_VERSION = 3


def compile_scenario(
    source: Source,
    network: Network,
    *,
    version: int | None = None,
    initial: bool = False,
    loader: Loader | None = None,
) -> Scenario:
    """Compile a program against a map.

    Args:
        source: The program.
        network: The road network of the map.
        version: 1, 2 or 3; inferred from the spelling if not given.
        initial: Ignore dynamic parts instead of refusing them.
        loader: Reads files that the program imports.

    Raises:
        ScenarioError: The program is wrong or uses what is not supported.
    """
    module = parse(source, version)
    chosen = module.version or max(module.versions, default=_DEFAULT_VERSION)
    world = _World(network, chosen, initial, loader)
    run = world.interpreter
    run.run(module.body, Environment({}, world.base))
    return _scenario(run, module, chosen, network)


class _World:
    """The names and modules that a program sees, over one map."""

    def __init__(self, network: Network, version: int, initial: bool, loader: Loader | None) -> None:
        self.network = network
        self.loader = loader
        self.interpreter = Interpreter(version, initial, self.load)
        names = language_names() | {"Point": POINT, "OrientedPoint": ORIENTED_POINT}
        names["Object"] = OBJECT if version == 3 else OBJECT_VISIBLE
        self.base = Environment(names)
        self.modules: dict[str, Module] = {}
        self.loading: list[str] = []

    def load(self, name: str, level: int, span: Span) -> Module:
        """The module of an import or `model` statement."""
        if name not in self.modules:
            self.modules[name] = self._model(name) or self._file(name, level, span) or plain_module(name, span)
        return self.modules[name]

    def _model(self, name: str) -> Module | None:
        files = libraries_of(name)
        if not files:
            return None
        scope = Environment(dict(network_names(self.network)), self.base, library=True)
        version, self.interpreter.version = self.interpreter.version, 3
        for file in files:
            self.interpreter.run(library_text(file).body, scope)
        self.interpreter.version = version
        return Module(name, scope.names)

    def _file(self, name: str, level: int, span: Span) -> Module | None:
        path = str(PurePosixPath(*name.split("."))) + ".scenic"
        source = self.loader(path) if self.loader and level <= 1 else None
        if source is None:
            return None
        if name in self.loading:
            raise fail("unsupported-construct", f"`{name}` imports itself", span, "a circle of imports")
        self.loading.append(name)
        try:
            scope = Environment({}, self.base)
            self.interpreter.run(parse(source, self.interpreter.version).body, scope)
        except ScenarioError as error:
            first = error.diagnostics[0]
            note = Note(span, "imported here")
            raise ScenarioError(
                Diagnostic(first.code, first.message, first.span, first.label, (*first.notes, note), first.hints)
            ) from None
        finally:
            self.loading.pop()
        return Module(name, scope.names)


def _scenario(run: Interpreter, module: ast.Module, version: int, network: Network) -> Scenario:
    whole = Span(module.source, 0, min(1, len(module.source.text)))
    if run.current_ego is None:
        raise fail("no-ego", "the program defines no ego", whole, "no object is called `ego`",
                   ("name one object `ego`, as in `ego = new Car`",))  # fmt: skip
    ego = run.current_ego
    requirements = [_written(requirement.condition(), requirement.span) for requirement in run.requirements]
    requirements = [requirement for requirement in requirements if requirement is not None]
    requirements += _built_in(run, ego)
    names = _names(run.objects)
    objects = tuple(_object(instance, names[number]) for number, instance in enumerate(run.objects))
    params = {
        name: Property(to_node(value, span), explicit=not library, span=span)
        for name, (value, span, library) in run.params.items()
        if is_node(value) or isinstance(value, Choice | str | int | float | bool)
    }
    assert ego.index is not None
    scenario = Scenario(
        module.source, version, network.name, objects, ego.index, tuple(requirements), params,
        tuple(number for number, each in enumerate(run.objects) if not _known(each, "allowCollisions")),
        tuple(run.soft), tuple(run.ignored),
    )  # fmt: skip
    return simplify(scenario)


def _names(objects: list[Instance]) -> list[str]:
    """A name for each object: its variable where that is its alone, else its class and a number."""
    labels = [instance.label for instance in objects]
    counts: dict[str, int] = {}
    names: list[str] = []
    for instance, label in zip(objects, labels, strict=True):
        counts[instance.cls.name] = counts.get(instance.cls.name, 0) + 1
        alone = label and labels.count(label) == 1
        names.append(label if alone else f"{instance.cls.name}#{counts[instance.cls.name]}")
    return names


def _property(name: str, value: ModelValue, span: Span | None) -> Node | None:
    if name in ("position", "velocity"):
        return to_vector(value, span)
    if name in ("heading", "width", "length", "height", "speed", "visibleDistance", "viewAngle"):
        return to_scalar(value, span)
    if name == "regionContainedIn" and value is not None:
        return to_region(value, span)
    plain = isinstance(value, str | int | float | bool) or value is None
    return to_node(value, span) if plain or is_node(value) or isinstance(value, Choice | NetworkElement) else None


def _object(instance: Instance, name: str) -> ScenarioObject:
    properties: dict[str, Property] = {}
    for key, value in instance.properties.items():
        span = instance.spans.get(key) or instance.span
        node = _property(key, value, span)
        if node is not None:
            properties[key] = Property(node, key in instance.explicit, span)
    assert instance.index is not None
    return ScenarioObject(
        instance.index, name, instance.cls.category, properties, instance.mutation is not None, instance.span
    )


def _written(condition: Node, span: Span) -> Requirement | None:
    if isinstance(condition, Constant):
        if isinstance(condition.value, Undefined) or not condition.value:
            raise fail("impossible-requirement", "no scene satisfies this requirement", span, "always false")
        return None
    return Requirement(condition, span)


def _known(instance: Instance, name: str) -> bool:
    """A yes-or-no property that must not be random."""
    value = instance.properties[name]
    if is_node(value) and isinstance(value, Constant):
        value = value.value
    if not isinstance(value, bool):
        raise fail("unsupported-construct", f"`{name}` must be known", instance.spans.get(name) or instance.span)
    return value


def _built_in(run: Interpreter, ego: Instance) -> list[Requirement]:
    """Scenic's own requirements: visibility and containment (language paper, section 5.4); see `solid` for collisions."""
    found: list[Requirement] = []
    for instance in run.objects:
        span = instance.spans.get("requireVisible") or instance.span
        index = instance.index
        assert index is not None
        box = operators.object_box(instance, span)
        if instance is not ego and _known(instance, "requireVisible"):
            seen = operators.visible_region(ego, span)
            found.append(Requirement(fold(Intersects(seen, box, span=span)), span, BuiltIn.VISIBILITY, (index,)))
        explicit = "regionContainedIn" in instance.explicit
        for region, author in ((instance.properties["regionContainedIn"], explicit), (run.workspace, False)):
            area = to_region(region, span)
            if isinstance(area, Constant) and isinstance(area.value, Everywhere):
                continue
            place = instance.spans.get("regionContainedIn") or instance.span
            inside = fold(Encloses(area, box, span=place))
            found.append(Requirement(inside, place, None if author else BuiltIn.CONTAINMENT, (index,)))
    return found
