"""The programs of both papers compile as printed and have scenes; the three spellings mean the same."""

import math
import random
import re
import runpy
from pathlib import Path

import pytest
from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.scenario import Scenario
from scenicq.forest.show import show

from .scenes import compiled, network, refused

PROGRAMS = runpy.run_path(str(Path(__file__).parents[1] / "syntax" / "paper_programs.py"))["PROGRAMS"]
# what the papers print is a fragment in some places: the line that they leave to the reader
BEFORE = {
    "car left of spot": "ego = Car\nspot = OrientedPoint on curb\n",
    "soft requirement": "ego = Car\ncar2 = Car\n",
}
OBJECTS = {"simplest": 2, "mars": 11, "four cars": 5, "platoon": 6, "bumper to bumper": 13, "overlapping cars": 3}


def paper_program(name: str) -> str:
    text = PROGRAMS[name][0]
    whole = re.search(r"^ego *=", text, re.MULTILINE)
    return BEFORE.get(name, "" if whole else "ego = Car\n") + text


@pytest.mark.parametrize("name", [name for name in PROGRAMS if name != "plain constructor"])
def test_a_paper_program_compiles_as_printed_and_has_scenes(name: str) -> None:
    scenario = compiled(paper_program(name))
    assert len(scenario.objects) == OBJECTS.get(name, len(scenario.objects))
    assert draw_scene(scenario, random.Random(3)) is not None


def test_the_plain_constructor_that_the_paper_argues_against_is_refused() -> None:
    assert refused("import gtaLib\nego = Car\nCar(ego.position, model=BUS)\n", version=1) == (
        "wrong-type",
        "Car(ego.position, model=BUS)",
    )


def test_a_model_that_is_not_named_is_told() -> None:
    (warning,) = compiled("ego = Car\nCar visible\n").warnings
    assert warning.code == "unknown-model"
    assert warning.span is not None
    assert warning.span.text == "Car"
    assert compiled("import gtaLib\nego = Car\nCar visible\n").warnings == ()


def test_an_interval_of_the_first_version_is_one_random_variable() -> None:
    scenario = compiled("x = (0, 1)\nego = Object at x @ x\n")
    assert scenario.version == 1
    scene = draw_scene(scenario, random.Random(1))
    assert scene is not None
    x, y = scene.values[0, "position"]  # type: ignore[misc]
    assert x == y
    assert 0 < x < 1


def test_height_is_the_first_versions_length() -> None:
    scenario = compiled(
        "import mars\nego = Rover at 0 @ 0\nPipe at 0 @ 1, with height (1, 2)\nx = ego.height\nRock at x @ 1\n"
    )
    assert "Range" in show(scenario.objects[1].properties["length"].value)
    assert scenario.objects[0].properties["length"].value.value == 0.7  # type: ignore[union-attr]


SPELLINGS = {
    1: "import gtaLib\nego = Object at (1, 2) @ 3, facing (5, 10) deg\n"
    "Object left of ego by (1, 2), with requireVisible False\n",
    2: "ego = Object at Range(1, 2) @ 3, facing Range(5, 10) deg\n"
    "Object left of ego by Range(1, 2), with requireVisible False\n",
    3: "ego = new Object at (Range(1, 2), 3), facing Range(5, 10) deg\nnew Object left of ego by Range(1, 2)\n",
}


def forest(scenario: Scenario) -> list[str]:
    numbers: dict = {}
    kept = ("position", "heading", "width", "length")
    return [show(thing.properties[name].value, None, numbers) for thing in scenario.objects for name in kept]


def test_three_spellings_make_the_same_forest() -> None:
    found = {version: compiled(text) for version, text in SPELLINGS.items()}
    assert {version: scenario.version for version, scenario in found.items()} == {1: 1, 2: 2, 3: 3}
    assert forest(found[1]) == forest(found[2]) == forest(found[3])
    assert "Range(1, 2)" in forest(found[3])[0]


@pytest.mark.parametrize(
    "model",
    [
        "scenic.domains.driving.model",
        "scenic.simulators.carla.model",
        "scenic.simulators.gta.model",
        "scenic.simulators.lgsvl.model",
        "scenic.simulators.metadrive.model",
        "scenic.simulators.newtonian.driving_model",
        "scenic.simulators.webots.road.model",
    ],
)
def test_every_model_has_cars_on_the_road(model: str) -> None:
    scenario = compiled(f"model {model}\nego = new Car\n")
    assert scenario.objects[0].category == "Car"
    scene = draw_scene(scenario, random.Random(2))
    assert scene is not None
    assert math.isfinite(scene.values[0, "heading"])  # type: ignore[arg-type]


def test_a_library_class_that_no_taxonomy_knows_counts_as_its_base() -> None:
    text = "model scenic.simulators.carla.model\nego = new NPCCar\nnew PropDebris\nnew ATM\nnew Bicycle\n"
    assert [thing.category for thing in compiled(text).objects] == ["Car", "Debris", "ATM", "Bicycle"]
    assert compiled("class Rock:\n    pass\nego = new Rock\n").objects[0].category == "Object"


def test_a_map_without_what_is_asked_for_is_named() -> None:
    bare = type(network())("bare", [each for each in network().features if each.kind != "sidewalk"])
    text = "model scenic.domains.driving.model\nego = new Car\nnew Pedestrian on sidewalk\n"
    with pytest.raises(Exception, match="map `bare` has nothing for `sidewalk`") as caught:
        compile_scenario(Source("test.scenic", text), bare)
    assert caught.value.diagnostics[0].code == "map-lacks"  # type: ignore[attr-defined]


def test_curbs_are_the_right_edges_of_the_outermost_lanes_where_the_map_has_none() -> None:
    bare = type(network())("bare", [each for each in network().features if each.kind != "curb"])
    lines = bare.curbRegion.lines
    assert len(lines) == 12
    assert list(lines[0].coords) == [(7.0, 10.0), (7.0, 110.0)]
    for line in lines:
        (x, y), (u, v) = line.coords[0], line.coords[-1]
        (direction,) = bare.roadDirection.values((x + u) / 2, (y + v) / 2)
        assert math.hypot(u - x, v - y) in (pytest.approx(100), pytest.approx(50))
        assert abs(math.remainder(math.atan2(x - u, v - y) - direction, math.tau)) < 1e-9


def test_maneuvers_have_types() -> None:
    text = (
        "from scenic.domains.driving.roads import ManeuverType\nx = ManeuverType.LEFT_TURN\n"
        "param same = x is ManeuverType.LEFT_TURN\nego = new Object\n"
    )
    scene = draw_scene(compiled(text), random.Random(0))
    assert scene is not None
    assert scene.params["same"] is True
