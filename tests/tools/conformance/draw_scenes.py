"""Draws scenes with the original Scenic, 3.1.1 in its 2D mode or 2.1.0. Runs in an environment of its own, which has
`scenic` and not `scenicq`.

Usage: python draw_scenes.py MAP.xodr OUT [--as-decided]

Writes OUT/map.geojson (Scenic's own network of the map, as interchange features), then answers requests, one JSON
object a line on standard input and standard output: {"text": program, "count": scenes, "seed": number, "seconds":
limit}, or "file" with a path in place of the text, with {"scenes": [...]}, each with its objects (the ego first,
headings in Scenic's convention) and parameters, or with {"error": text} where Scenic refuses the program. No scenes at
all means that none was found in time, nor the first one in "first" seconds, where that is given. {"text": program,
"witness": values, "labels": objects, "seconds": limit} asks whether the program allows them, see `replay_witness`.
{"points": how many, "seed": number} and {"elements": points of each, "seed": number} ask the network, see
`map_answers`. With --as-decided Scenic does what scenicq means to do otherwise, so that all that hangs on it can be
compared: there is a direction of traffic off the road, views wider than 120 degrees are whole, the ends of a random
line are known to be oriented points, and what is required of mutated objects is so before the noise.
"""

from __future__ import annotations

import functools
import importlib.metadata
import inspect
import json
import math
import random
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import scenic
import scenic.syntax.translator
import shapely
from map_answers import at_points, of_elements
from network_features import features_of
from patience import OutOfPatienceError, patience
from scenic.core import object_types
from scenic.core.distributions import AttributeDistribution, RejectionException, distributionFunction
from scenic.core.errors import InvalidScenarioError
from scenic.core.regions import SectorRegion
from scenic.core.type_support import toVector
from scenic.core.vectors import VectorField, vectorDistributionMethod
from scenic.domains.driving.roads import Network

MOST_ATTEMPTS = 20_000
CARLA = "0.9.16"
"""Its version for the blueprints of objects, where it is not installed: the last that has bicycles."""
INSTALLED = importlib.metadata.version
MODE = {} if INSTALLED("scenic").startswith("2.") else {"mode2D": True}


def thing(thing: Any) -> dict[str, Any]:
    """An object of a scene as plain numbers, with the names of its classes, most derived first."""
    return {
        "classes": [cls.__name__ for cls in type(thing).__mro__],
        "x": float(thing.position.x),
        "y": float(thing.position.y),
        "heading": float(thing.heading),
        "width": float(thing.width),
        "length": float(thing.length),
    }


REACH = 20.0
"""Metres within which the nearest lane gives the direction of traffic off the road, as scenicq has it."""
FOLLOWED: list[Any] = []
"""Where the field that is being followed was entered."""


@functools.cache
def lanes_of(network: Any) -> shapely.STRtree:
    """The areas of its lanes."""
    return shapely.STRtree([lane.polygons for lane in network.lanes])


def _road_direction(self: Any, point: Any) -> Any:
    """As Scenic's own default, but off the road, where that gives 0, the direction of the nearest lane.

    Where a field is followed, all steps but the first go on as Scenic's.
    """
    point = toVector(point)
    element = self.findPointIn(point, self._nominalDirElems, reject=False)
    if element is not None:
        return element.orientation[point]
    if FOLLOWED and FOLLOWED[-1] != point:
        return 0
    near = lanes_of(self).query_nearest(shapely.Point(point.x, point.y), max_distance=REACH)
    if not len(near):
        raise RejectionException("no direction of traffic")
    return self.lanes[min(near)].orientation[point]


@vectorDistributionMethod
def _follow(self: Any, pos: Any, *arguments: Any, **options: Any) -> Any:
    """As Scenic's own, but told where it starts."""
    FOLLOWED.append(pos)
    try:
        return FOLLOW(self, pos, *arguments, **options)
    finally:
        FOLLOWED.pop()


FOLLOW = inspect.unwrap(VectorField.followFrom)


def _sector(center: Any, radius: float, heading: float, angle: float, resolution: int) -> Any:
    """The area of a sector, also of a wide one."""
    circle = shapely.Point(center.x, center.y).buffer(radius, quad_segs=resolution)
    if angle >= math.tau - 0.001:
        return circle
    rim = [center.offsetRadially(2 * radius, heading + turn) for turn in np.linspace(-angle / 2, angle / 2, 33)]
    return circle & shapely.Polygon([(each.x, each.y) for each in (center, *rim)])


TYPE_OF_ATTRIBUTE = AttributeDistribution.inferType


def _type_of_attribute(owner: Any, attribute: str) -> Any:
    """As Scenic's own, which does not know what the ends of lines are."""
    found = TYPE_OF_ATTRIBUTE(owner, attribute)
    return object_types.OrientedPoint if found in (object, None) and attribute in ("start", "end") else found


NOISE: dict[type, Any] = {}
"""What mutators do after a scene is found, rather than while it is drawn."""


def _mutate_later() -> None:
    """Requirements see objects without their noise."""
    for mutator in (object_types.PositionMutator, object_types.OrientationMutator):
        NOISE[mutator] = mutator.appliedTo
        mutator.appliedTo = lambda self, thing: (thing, True)


def _with_noise(thing: Any) -> Any:
    """An object of a scene, with the noise that was left out."""
    if NOISE and thing.mutationScale:
        for mutator in filter(None, thing.mutator):
            NOISE[type(mutator)](mutator, thing)
        thing._recomputeDynamicFinals()
    return thing


PARSE, COMPILE = scenic.syntax.translator.parse_string, scenic.syntax.translator.compileScenicAST
parse_file = functools.cache(PARSE)
compile_tree = functools.cache(COMPILE)


def _parse(source: str, mode: str, filename: str = "<string>") -> Any:
    """As Scenic's own, but files, such as the world model that all programs import, are parsed once."""
    parse = PARSE if filename == "<string>" else parse_file
    return parse(source, mode, filename=filename)


def _compile(tree: Any, filename: str = "<string>") -> Any:
    """As Scenic's own, which changes the tree: each is compiled once."""
    compile_it = COMPILE if filename == "<string>" else compile_tree
    return compile_it(tree, filename=filename)


def plain(scene: Any) -> dict[str, Any]:
    """A scene as plain data."""
    values = {name: value for name, value in scene.params.items() if isinstance(value, str | int | float | bool)}
    return {
        "objects": [thing(_with_noise(each)) for each in scene.objects],
        "params": {name: value for name, value in values.items() if name != "map"},
    }


def compiled(request: dict[str, Any], chart: Path) -> Any:
    """The program of a request, on the map whatever map it names."""
    params = {"map": str(chart)}
    if "file" in request:
        return scenic.scenarioFromFile(request["file"], params={**params, "carla_map": chart.stem}, **MODE)
    return scenic.scenarioFromString(request["text"], params=params, **MODE)


def draw(request: dict[str, Any], chart: Path) -> dict[str, Any]:
    """Scenes of a program, or why there are none."""
    random.seed(request["seed"])
    np.random.seed(request["seed"])
    scenes: list[dict[str, Any]] = []
    started = time.process_time()
    try:
        with patience(request.get("first", request["seconds"])):
            scenario = compiled(request, chart)
            if request["count"]:
                scenes.append(plain(scenario.generate(maxIterations=MOST_ATTEMPTS)[0]))
        with patience(max(0.001, request["seconds"] - (time.process_time() - started))):
            while len(scenes) < request["count"]:
                scenes.append(plain(scenario.generate(maxIterations=MOST_ATTEMPTS)[0]))
    except (OutOfPatienceError, RejectionException, InvalidScenarioError) as end:
        return {"scenes": scenes, "ended": f"{type(end).__name__}: {end}"}
    except Exception as error:  # whatever Scenic says of the program is its answer
        return {"error": f"{type(error).__name__}: {error}"}
    return {"scenes": scenes}


def replayed(request: dict[str, Any], chart: Path) -> dict[str, str]:
    """Whether Scenic allows what is said to match, see `replay_witness`."""
    from replay_witness import places, replay  # 2.1.0 has nothing of it

    found: dict[tuple[int, int], list[Any]] = {}
    try:
        with patience(request["seconds"]):
            with places(found):
                scenario = compiled(request, chart)
            return replay(scenario, found, request)
    except (OutOfPatienceError, RejectionException) as end:
        return {"replay": "open", "why": f"{type(end).__name__}: {end}"}
    except Exception as error:  # a replay that Scenic is not made for
        return {"replay": "open", "why": f"{type(error).__name__}: {error}"}


def main(arguments: list[str]) -> None:
    """Write the map, then answer requests."""
    chart, out = Path(arguments[0]), Path(arguments[1])
    importlib.metadata.version = lambda name: CARLA if name == "carla" else INSTALLED(name)
    if MODE:
        scenic.syntax.translator.parse_string = _parse
        scenic.syntax.translator.compileScenicAST = _compile
    if "--as-decided" in arguments:
        Network._defaultRoadDirection = _road_direction
        VectorField.followFrom = _follow
        AttributeDistribution.inferType = staticmethod(_type_of_attribute)
        _mutate_later()
        SectorRegion._makePolygons = staticmethod(distributionFunction(_sector))
    Network.fromFile = functools.cache(Network.fromFile)  # one map for all programs
    network = Network.fromFile(str(chart))
    collection = {"type": "FeatureCollection", "features": features_of(network)}
    (out / "map.geojson").write_text(json.dumps(collection), encoding="utf-8")
    answers, sys.stdout = sys.stdout, sys.stderr  # programs may print
    for line in sys.stdin:
        print(json.dumps(_answer(json.loads(line), chart, network)), file=answers, flush=True)


def _answer(request: dict[str, Any], chart: Path, network: Any) -> dict[str, Any]:
    if "witness" in request:
        return replayed(request, chart)
    if "points" in request:
        return {"points": at_points(network, request["points"], request["seed"])}
    if "elements" in request:
        return {"elements": of_elements(network, request["elements"], request["seed"])}
    return draw(request, chart)


if __name__ == "__main__":
    main(sys.argv[1:])
