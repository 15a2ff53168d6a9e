"""Compiling and drawing from small programs, and the language paper's vocabulary in plain mathematics."""

from __future__ import annotations

import math
import random
from functools import cache

from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.improvise import Scene
from scenicq.forest.scenario import Scenario
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network

Vector = tuple[float, float]
EGO = (
    "ego = new Object at (3, -4), facing 40 deg, with width 2, with length 5, with visibleDistance 30, "
    "with viewAngle 80 deg\n"
)
EGO_POSITION, EGO_HEADING = (3.0, -4.0), math.radians(40)


@cache
def network() -> Network:
    return street()


def compiled(text: str, version: int | None = None, **options) -> Scenario:
    return compile_scenario(Source("test.scenic", text), network(), version=version, **options)


def refused(text: str, version: int | None = None, **options) -> tuple[str, str]:
    """The code of the first error and the text that it points at."""
    try:
        compiled(text, version, **options)
    except ScenarioError as error:
        first = error.diagnostics[0]
        assert first.span is not None
        return first.code, first.span.text
    raise AssertionError("nothing is wrong")


def drawn(text: str, seed: int = 0, version: int | None = None) -> tuple[Scenario, Scene]:
    scenario = compiled(text, version)
    scene = draw_scene(scenario, random.Random(seed))
    assert scene is not None
    return scenario, scene


def last(text: str, seed: int = 0, version: int | None = None) -> tuple[Vector, float]:
    """Position and heading of the last object of a drawn scene."""
    scenario, scene = drawn(text, seed, version)
    number = len(scenario.objects) - 1
    return scene.values[number, "position"], scene.values[number, "heading"]  # type: ignore[return-value]


def value(expression: str, before: str = EGO) -> object:
    """The value of an expression, by way of a parameter of the scene."""
    _, scene = drawn(f"{before}param answer = {expression}\n")
    return scene.params["answer"]


# --- figure 26


def rotate(vector: Vector, angle: float) -> Vector:
    x, y = vector
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)


def plus(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1]


def minus(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1]


def arctan(vector: Vector) -> float:
    """The heading of a vector: 0 is north, counter-clockwise."""
    return math.atan2(-vector[0], vector[1])


def offset_local(position: Vector, heading: float, by: Vector) -> Vector:
    return plus(position, rotate(by, heading))


def same_angle(one: float, other: float) -> bool:
    return abs(math.remainder(one - other, math.tau)) < 1e-9
