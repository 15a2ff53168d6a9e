"""World models: what `model scenic.domains.driving.model` and its like bring in, over one map.

The classes are written in Scenic (`library/*.scenic`) and read by the same front end as users' programs; the road
network comes from the dataset. A simulator's model has the classes and sizes that Scenic's has; what a simulator adds
over time has no meaning at one instant. The driving domain itself has CARLA's classes too: datasets label them.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from importlib import resources

from scenicq.compiler.builtins import mathematics
from scenicq.compiler.elements import MANEUVER_TYPES
from scenicq.compiler.label_questions import LABELS
from scenicq.compiler.values import Builtin, ModelValue, Module, fail
from scenicq.errors import ScenarioError, Source, Span, similar
from scenicq.forest import build
from scenicq.geometry.elements import (
    Intersection,
    Lane,
    LaneGroup,
    LaneSection,
    Maneuver,
    NetworkElement,
    PedestrianCrossing,
    Road,
    Shoulder,
    Sidewalk,
)
from scenicq.geometry.network import Network
from scenicq.geometry.regions import union
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

__all__ = [
    "default_library",
    "is_anywhere",
    "is_dynamic",
    "is_package",
    "libraries_of",
    "library_text",
    "library_texts",
    "members_of",
    "network_names",
    "plain_module",
    "unsupported_module",
]

_LIBRARIES: dict[str, tuple[str, ...]] = {
    "scenic.domains.driving.model": ("colors", "driving", "traffic"),
    "scenic.simulators.carla.model": ("colors", "driving", "traffic", "carla"),
    "scenic.simulators.lgsvl.model": ("colors", "driving", "traffic", "lgsvl"),
    "scenic.simulators.metadrive.model": ("colors", "driving", "traffic"),
    "scenic.simulators.newtonian.model": ("colors", "driving", "traffic", "newtonian"),
    "scenic.simulators.newtonian.driving_model": ("colors", "driving", "traffic", "newtonian"),
    "scenic.simulators.gta.model": ("colors", "gta"),
    "scenic.simulators.webots.road.model": ("colors", "webots_road"),
    "scenic.simulators.webots.mars.model": ("mars",),
    "scenic.simulators.webots.model": ("webots",),
    "carla": ("colors", "driving", "traffic", "carla"),
    "gta": ("colors", "gta"),
    "gtaLib": ("colors", "gta"),
    "mars": ("mars",),
}
_NO_MAP = frozenset({"mars", "webots"})
_ROADS = "scenic.domains.driving.roads"
_MAPS = frozenset({
    "scenic.simulators.gta.map", "scenic.simulators.carla.map", "scenic.simulators.webots.road.world",
})  # fmt: skip
_WITHOUT_CLASSES = (_ROADS, *_MAPS)
_IN_SPACE = frozenset({"trimesh", "scenic.core.shapes"})
"""Modules that are about shapes in space."""
_DYNAMIC = frozenset({"actions", "behaviors", "monitors", "simulator", "simulators", "controllers", "sensors"})
_MAP_FILES = {"setLocalMap", "setMapPath", "mapPath", "setLocalWorld", "worldPath"}
_ELEMENTS = (
    Intersection, Lane, LaneGroup, LaneSection, Maneuver, Network, NetworkElement, PedestrianCrossing, Road, Shoulder,
    Sidewalk,
)  # fmt: skip


_ROAD_TYPES: dict[str, ModelValue] = {"ManeuverType": MANEUVER_TYPES, **{cls.__name__: cls for cls in _ELEMENTS}}


_ANYWHERE = {"position": "new Point in everywhere", "heading": "Range(0, 360) deg", "regionContainedIn": "everywhere"}
"""The defaults of places and directions where no map has any."""


@cache
def _anywhere() -> dict[str, ast.Expression]:
    text = "\n".join(["class Anywhere:", *(f"    {name}: {value}" for name, value in _ANYWHERE.items())])
    (definition,) = parse(Source("<anywhere>", text), 3).body
    assert isinstance(definition, ast.ClassDef)
    return {each.name: each.value for each in definition.body if isinstance(each, ast.PropertyDefault)}


def is_anywhere(default: ast.Expression | None) -> bool:
    """Whether the default of a property is one that stands for what the map lacks."""
    return any(default is each for each in _anywhere().values())


@cache
def library_text(name: str, *, map_defaults: bool = True) -> ast.Program:
    """The syntax of one of the library's files.

    Args:
        name: The file.
        map_defaults: Whether classes place and turn their objects as the map has it; else they may be anywhere and
            head anywhere.
    """
    text = resources.files("scenicq.compiler").joinpath("library", f"{name}.scenic").read_text(encoding="utf-8")
    program = parse(Source(f"<{name}.scenic>", text), 3)
    return program if map_defaults else replace(program, body=tuple(map(_without_map, program.body)))


def _without_map(statement: ast.Statement) -> ast.Statement:
    """A statement of a library in which no class asks anything of the map."""
    if not isinstance(statement, ast.ClassDef):
        return statement
    anywhere, of_map = _anywhere(), network_names(Network("none", ()), "webots_road").keys()
    body = (
        replace(each, value=anywhere[each.name])
        if isinstance(each, ast.PropertyDefault) and each.name in anywhere and _names_of(each.value) & of_map
        else each
        for each in statement.body
    )
    return replace(statement, body=tuple(body))


def _names_of(expression: ast.Expression) -> set[str]:
    return {each.id for each in walk(expression) if isinstance(each, ast.Name)}


def libraries_of(name: str) -> tuple[str, ...]:
    """The library files that a model stands for; empty for what is not a model."""
    return _LIBRARIES.get(name, ())


_GTA_ONLY = frozenset({"EgoCar", "CarModel", "CarColor", "createPlatoonAt", "carAheadOfCar", "BUS", "Compact"})


def default_library(version: int, used: frozenset[str]) -> str:
    """The model of a program that names none, as the papers print theirs: the line that imports it is left out.

    Args:
        version: The version of Scenic, 1 or 2.
        used: The names that the program uses.
    """
    return "gtaLib" if version == 1 or used & _GTA_ONLY else "scenic.domains.driving.model"


def is_dynamic(name: str) -> bool:
    """Whether a module of Scenic's holds only what happens over time."""
    return name.startswith("scenic.") and name.rsplit(".", 1)[-1] in _DYNAMIC


def is_package(name: str) -> bool:
    """Whether modules that are known here lie in a package of this name."""
    return bool(members_of(name))


def members_of(package: str) -> set[str]:
    """The modules and packages in a package that are known here, by the names that they have there."""
    start = f"{package}."
    inside = (known for known in (*_LIBRARIES, *_WITHOUT_CLASSES, LABELS) if known.startswith(start))
    return {known.removeprefix(start).partition(".")[0] for known in inside}


def network_names(network: Network, library: str) -> dict[str, ModelValue]:
    """The names that a model gives to the parts of the map."""
    if library in _NO_MAP:
        return {}
    drivable, walkable = network.drivableRegion, network.walkableRegion
    regions = {
        "road": drivable,
        "curb": network.curbRegion,
        "sidewalk": network.sidewalkRegion,
        "shoulder": network.shoulderRegion,
        "crossing": network.crossingRegion,
        "roadOrShoulder": drivable if (shoulder := network.region("shoulder")) is None else union(drivable, shoulder),
        "intersection": network.intersectionRegion,
        "roadDirection": network.roadDirection,
    }
    if library == "webots_road":
        regions |= {"nonIntersection": network.roadRegion, "walkway": walkable}
    names: dict[str, ModelValue] = {name: build.constant(value) for name, value in regions.items()}
    return names | _ROAD_TYPES | {"network": network}


def _ignored(span: Span, *_: ModelValue, **__: ModelValue) -> ModelValue:
    return None


def unsupported_module(name: str, span: Span) -> ScenarioError | None:
    """What is said of the names of a module of Python that programs cannot use; None for any other module."""
    if name in _OF_PYTHON or name.partition(".")[0] not in sys.stdlib_module_names:
        return None
    return fail("unsupported-construct", f"Python's module `{name}` is not supported", span, "not imported",
                ("`math` is the only Python module that is known: write the rest in Scenic",))  # fmt: skip


_OF_PYTHON = frozenset({"math", "sys"})


def plain_module(name: str, span: Span) -> Module:
    """A module that does not depend on the map.

    Raises:
        ScenarioError: unknown-model; unsupported-construct, for modules of shapes in space.
    """
    match name:
        case "math":
            return Module("math", mathematics())
        case "sys":
            # programs put the folders of simulators there; what is imported does not depend on it
            return Module("sys", {"path": []})
        case _ if name == _ROADS:
            return Module(name, dict(_ROAD_TYPES))
        case _ if name in _MAPS:
            # the map comes from the dataset
            return Module(name, {each: Builtin(each, _ignored) for each in _MAP_FILES})
        case _ if name in _IN_SPACE:
            raise fail("unsupported-construct", f"`{name}` is not supported: labels are matched in 2D", span,
                       "shapes in space", ("give objects a `width` and a `length` instead of a shape",))  # fmt: skip
        case _:
            close = similar(name, (*_LIBRARIES, LABELS))
            nearest = (f"`{close}` is the nearest that is known",) if close else ()
            raise fail("unknown-model", f"`{name}` is not a model or module known here", span, "not found",
                       (*nearest,
                        "known are `scenic.domains.driving.model`, the models of Scenic's driving simulators, "
                        f"`{LABELS}` and `math`",
                        "a scenario imports Scenic files of its own folder, never Python code"))  # fmt: skip


def library_texts() -> tuple[ast.Program, ...]:
    """The syntax of all of the library's files."""
    return tuple(library_text(name) for name in dict.fromkeys(file for files in _LIBRARIES.values() for file in files))
