"""From text to a scenario: parse, run, and read off the objects, requirements and parameters.

A scenario is compiled once per map: the road network is part of the program's world.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TypeVar, cast

from scenicq.budget import Exhausted, limited
from scenicq.compiler import operators
from scenicq.compiler.absent import check_directions, list_names
from scenicq.compiler.arithmetic import number_error
from scenicq.compiler.coerce import PARTIAL, to_node, to_region, to_scalar, to_vector
from scenicq.compiler.composition_graph import ComposedScenario
from scenicq.compiler.deviations import is_zero
from scenicq.compiler.element_lookups import LaneRule
from scenicq.compiler.environment import Environment
from scenicq.compiler.imported_files import Loader
from scenicq.compiler.imports import Modules
from scenicq.compiler.interpreter import Interpreter
from scenicq.compiler.label_attributes import LabelAttributes
from scenicq.compiler.models import default_library, is_anywhere
from scenicq.compiler.modular import run_program, top_scenario
from scenicq.compiler.recorded_values import recorded_values
from scenicq.compiler.requirements import RequireStatement
from scenicq.compiler.temporal import REACTION_S, Behaviors, TimedStatements
from scenicq.compiler.values import Choice, Instance, ModelValue, fail, is_node
from scenicq.compiler.variants import with_variants
from scenicq.compiler.version_detection import decide_version
from scenicq.errors import Diagnostic, ScenarioError, Source, Span
from scenicq.forest.compute import fold
from scenicq.forest.course_ends import has_ends
from scenicq.forest.nodes import COURSE, Constant, Encloses, Intersects, Node, Undefined
from scenicq.forest.scenario import BuiltIn, Property, Requirement, Scenario, ScenarioObject
from scenicq.forest.walk import postorder
from scenicq.geometry.driven_courses import GAP_S
from scenicq.geometry.elements import NetworkElement
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Everywhere
from scenicq.limits import LIMITS
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

__all__ = ["Loader", "compile_scenario"]


def compile_scenario(
    source: Source,
    network: Network,
    *,
    version: int | None = None,
    initial: bool = False,
    behaviors: Behaviors | None = None,
    reaction_s: float = REACTION_S,
    loader: Loader | None = None,
    model: str | None = None,
    map_defaults: bool = True,
    gap_s: float = GAP_S,
    lanes: LaneRule = "along",
    scenario: str | None = None,
    params: Mapping[str, float | str] | None = None,
    label_attributes: LabelAttributes | None = None,
) -> Scenario:
    """Compile a program against a map.

    Args:
        source: The program.
        network: The road network of the map.
        version: 1, 2 or 3; inferred from the spelling if not given.
        initial: Ignore dynamic parts instead of refusing them.
        behaviors: What becomes of behaviors, where the scenario is to be matched over time; None where it is about one
            instant, and all dynamic parts are refused or ignored.
        reaction_s: Seconds after which what an object does must be seen.
        loader: Reads files that the program imports.
        model: The world model of a program that imports none, as Scenic's `--model`.
        map_defaults: Whether the world model's classes place and turn their objects as the map has it, where nothing
            else does. Without a map they never do, and the scenario's warnings say so.
        gap_s: Seconds without a label at which the course of a track is cut.
        lanes: Which of several lanes that contain an object are its own: those that lead its way, or all.
        scenario: Which scenario of the program runs; `Main`, the only one, or the program itself if not given.
        params: Values of global parameters, whatever the program says.
        label_attributes: Gives the types of the values of each attribute that labels of the dataset have; asked where
            the program reads what it does not give its objects itself.

    Raises:
        ScenarioError: The program is wrong or uses what is not supported.
    """
    try:
        with limited(LIMITS.program_seconds):
            timed = None if initial or behaviors is None else TimedStatements(behaviors, reaction_s)
            return _compiled(
                source, network, version, initial=initial, timed=timed, loader=loader, model=model,
                map_defaults=map_defaults, gap_s=gap_s, lanes=lanes, wanted=scenario,
                params=params or {}, label_attributes=label_attributes,
            )  # fmt: skip
    except Exhausted:
        what = f"evaluating the program takes more than {LIMITS.program_seconds:g} s"
        raise fail("budget-exceeded", what, _start(source), "",
                   ("make loops shorter, and ask less of the map in them",)) from None  # fmt: skip


def _compiled(
    source: Source,
    network: Network,
    version: int | None,
    *,
    initial: bool,
    timed: TimedStatements | None,
    loader: Loader | None,
    model: str | None,
    map_defaults: bool,
    gap_s: float,
    lanes: LaneRule,
    wanted: str | None,
    params: Mapping[str, float | str],
    label_attributes: LabelAttributes | None,
) -> Scenario:
    module = parse(source, version)
    chosen = decide_version(module)
    world = Modules(network, chosen, initial, loader, map_defaults=map_defaults and bool(network.kinds))
    run = world.interpreter
    run.timed, run.gap_s, run.lanes, run.label_attributes = timed, gap_s, lanes, label_attributes
    run.params.update({name: (value, _start(source), False) for name, value in params.items()})
    run.given_params = frozenset(params)
    try:
        library = None if world.is_model_named(module) else model or _left_out(module, chosen)
        names = {} if library is None else dict(world.load(library, _start(source)).names)
        scope = Environment({}, Environment(names, world.base, library=True), user=True)
        run.run(module.body, scope)
        top = top_scenario(module, scope, wanted)
        if top is not None:
            run_program(run, top)
        if timed is not None:
            timed.follow(run)
        warnings = _borrowed(module, scope, names, library) if model is None else ()
        if map_defaults and not network.kinds:
            warnings += _anywhere(run.objects)
        return _scenario(run, module, chosen, network, warnings)
    except RecursionError:
        raise fail("budget-exceeded", "the program is nested too deeply", _start(source), "",
                   ("make expressions and calls flatter",)) from None  # fmt: skip
    except ScenarioError as error:
        raise _on_map(error, network) from None
    finally:
        # the interpreter stays in circles until Python looks for them: what it asks keeps a dataset open
        run.label_attributes = None


def _start(source: Source) -> Span:
    return Span(source, 0, min(1, len(source.text)))


def _left_out(module: ast.Program, version: int) -> str | None:
    """The library that an early program needs without importing any."""
    if version == 3:
        return None
    return default_library(version, frozenset(node.id for node in walk(*module.body) if isinstance(node, ast.Name)))


def _borrowed(
    module: ast.Program, scope: Environment, names: dict[str, ModelValue], library: str | None
) -> tuple[Diagnostic, ...]:
    """A warning where names come from a library that the program does not import."""
    for node in walk(*module.body):
        if isinstance(node, ast.Name) and node.id in names and node.id not in scope.names:
            message = f"the program imports no model: `{node.id}` is taken from `{library}`"
            line = f"import {library}" if library == "gtaLib" else f"model {library}"
            hints = (f"`{line}` makes this explicit",)
            return (Diagnostic("unknown-model", message, node.span, hints=hints, severity="warning"),)
    return ()


def _anywhere(objects: list[Instance]) -> tuple[Diagnostic, ...]:
    """A note where classes would place or turn their objects as the map has it, and there is none."""
    freed = [each for each in objects if _is_anywhere(each)]
    if not freed:
        return ()
    named = list_names(dict.fromkeys(each.cls.name for each in freed))
    message = f"there is no map: {named} may be anywhere and head anywhere, where the program says nothing else"
    return (Diagnostic("no-map", message, freed[0].span, severity="note"),)


def _is_anywhere(instance: Instance) -> bool:
    """Whether an object's place or direction is a default that stands for what the map lacks."""
    left = {"position", "heading"} - instance.explicit
    used = (definition for name in left if (definition := instance.cls.definition(name)) is not None)
    return any(is_anywhere(each.default) for each in used)


def _on_map(error: ScenarioError, network: Network) -> ScenarioError:
    """The error with the name of the map in it, where the map is what it is about."""
    told = [
        replace(each, message=each.message.replace("the map", f"the map `{network.name}`", 1))
        if each.code == "map-lacks" else each
        for each in error.diagnostics
    ]  # fmt: skip
    return ScenarioError(told)


_Result = TypeVar("_Result")


def _no_ego(run: Interpreter, module: ast.Program, version: int) -> ScenarioError:
    for found in run.ignored:
        if found.span is not None and found.span.text.startswith("compose"):
            return fail("no-ego", "the scenario that the program runs sets up no ego", found.span,
                        "objects that other scenarios make are not in the initial scene",
                        ("make the ego in the `setup` block",))  # fmt: skip
    example = "ego = new Car" if version == 3 else "ego = Car"
    return fail("no-ego", "the program defines no ego", _start(module.source), "no object is called `ego`",
                (f"name one object `ego`, as in `{example}`",))  # fmt: skip


def _scenario(
    run: Interpreter, module: ast.Program, version: int, network: Network, warnings: tuple[Diagnostic, ...]
) -> Scenario:
    if run.current_ego is None:
        raise _no_ego(run, module, version)
    ego = run.current_ego
    hard, soft = ([each for each in run.requirements if (each.probability < 1) == low] for low in (False, True))
    requirements = [
        _written(_at_the_end(requirement.condition, requirement.span), requirement.span) for requirement in hard
    ]
    dynamics, excluded = run.timed.dynamics(run) if run.timed is not None else (None, [])
    composition = None if run.timed is None else run.timed.composition
    requirements += [_written(condition, span) for condition, span in (*run.excluded.conditions(), *excluded)]
    owners: dict[int, int] = {}
    for each in () if composition is None else composition.scenarios:
        for written in _begun_with(each):
            owners[id(written)] = each.number
            requirements.append(written)
    requirements = [requirement for requirement in requirements if requirement is not None]
    if composition is None:
        requirements += _built_in(run, ego)
    ego.label = "ego"
    records = recorded_values(run)
    names = _names(run.objects)
    on_courses = any(COURSE in instance.properties for instance in run.objects)
    objects = tuple(
        _object(instance, names[number], on_courses=on_courses) for number, instance in enumerate(run.objects)
    )
    check_directions(objects, requirements)
    params = {
        name: Property(_at_the_end(partial(to_node, value, span), span), explicit=not library, span=span)
        for name, (value, span, library) in run.params.items()
        if value is not None and _is_feature(value)
    }
    assert ego.index is not None
    found = Scenario(
        module.source, version, network.name, objects, ego.index, tuple(requirements), params,
        tuple(number for number, each in enumerate(run.objects) if not _known(each, "allowCollisions")),
        tuple(
            Requirement(_soft_condition(each), each.span, probability=each.probability) for each in soft
        ),
        tuple(run.ignored), warnings,
        dynamics=dynamics,
        records=records,
    )  # fmt: skip
    if composition is None:
        return found
    return with_variants(
        found,
        composition,
        owners,
        [each.label for each in run.objects],
        lambda index: _built_in(run, run.objects[index]),
    )


def _begun_with(scenario: ComposedScenario) -> list[Requirement]:
    """What a scenario requires that makes objects, where it begins."""
    if not scenario.objects:
        return []
    said = [
        (_at_the_end(each.condition, each.span), each.span)
        for each in scenario.made.requirements
        if each.probability >= 1
    ]
    found = [_written(condition, span) for condition, span in (*said, *scenario.made.excluded)]
    return [each for each in found if each is not None]


def _soft_condition(requirement: RequireStatement) -> Node:
    """What a requirement says that need not hold; what the map lacks for it never holds, and excludes nothing."""
    try:
        return _at_the_end(requirement.condition, requirement.span)
    except ScenarioError as error:
        if any(each.code != "map-lacks" for each in error.diagnostics):
            raise
        return Constant(False, span=requirement.span)


def _at_the_end(work: Callable[[], _Result], span: Span | None) -> _Result:
    """What is worked out when the program has run: its numbers may still be too large."""
    try:
        return work()
    except ArithmeticError as error:
        raise number_error(error, span, "of this") from None


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


_SCALARS = frozenset({
    "heading", "width", "length", "height", "speed", "angularSpeed", "acceleration", "visibleDistance", "viewAngle",
    "mutationScale", "positionStdDev", "headingStdDev",
})  # fmt: skip


def _property(name: str, value: ModelValue, span: Span | None) -> Node | None:
    if name in ("position", "velocity"):
        return to_vector(value, span)
    if name in _SCALARS:
        return to_scalar(value, span)
    if name == "regionContainedIn" and value is not None:
        return to_region(value, span)
    return to_node(value, span) if _is_feature(value) else None


def _is_feature(value: ModelValue) -> bool:
    """Whether a property's value is one that a label could have too."""
    if isinstance(value, Choice):
        return all(_is_feature(option) for option in value.options)
    return is_node(value) or value is None or isinstance(value, str | int | float | bool | NetworkElement)


def _object(instance: Instance, name: str, *, on_courses: bool) -> ScenarioObject:
    """An object as it is matched.

    Args:
        instance: The object.
        name: What it is called.
        on_courses: Whether the program asks for courses.
    """
    properties: dict[str, Property] = {}
    uncomparable: dict[str, Span | None] = {}
    for key, value in instance.properties.items():
        if key in PARTIAL:
            continue
        span = instance.spans.get(key) or instance.span
        node = _at_the_end(partial(_property, key, value, span), span)
        if key in ("width", "length") and isinstance(node, Constant) and cast(float, node.value) <= 0:
            raise fail("wrong-value", f"the {key} of an object must be positive", span, "not positive")
        if node is not None:
            asked = next((each for each in postorder((node,)) if has_ends(each)), None) if on_courses else None
            if asked is not None:
                raise fail("unsupported-construct", "labels show courses, so a condition on them belongs in `require`",
                           asked.span or span, "not in a property",
                           ("place the object by another specifier, and require this of it",))  # fmt: skip
            properties[key] = Property(node, key in instance.explicit, span)
        elif key in instance.explicit and value is not None:
            uncomparable[key] = span
    if instance.mutation is not None:
        properties["mutationScale"] = Property(to_scalar(instance.mutation, instance.span), False, instance.span)
    assert instance.index is not None
    mutated = _mutated(instance)
    return ScenarioObject(instance.index, name, instance.cls.category, properties, mutated, instance.span, uncomparable)


def _mutated(instance: Instance) -> frozenset[str]:
    """The properties of an object to which noise is added."""
    scale = instance.mutation if instance.mutation is not None else instance.properties["mutationScale"]
    if is_zero(scale):
        return frozenset()
    return frozenset(name for name in ("position", "heading") if not is_zero(instance.properties[f"{name}StdDev"]))


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
    """Scenic's own requirements: visibility, containment (language paper, section 5.4); see `solid` for collisions."""
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
            place = instance.spans.get("regionContainedIn") or instance.span
            area = operators.existing(region, place) if author and region is not None else to_region(region, place)
            if isinstance(area, Constant) and isinstance(area.value, Everywhere):
                continue
            inside = fold(Encloses(area, box, span=place))
            found.append(Requirement(inside, place, None if author else BuiltIn.CONTAINMENT, (index,)))
    return found
