"""Conditions on the scene take all their courses; what one course lacks excludes the scenes that take it alone."""

import random

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.condition import condition
from scenicq.forest.nodes import Constant
from scenicq.forest.walk import features
from scenicq.geometry.default_street import street

HEAD = """model scenic.domains.driving.model
ego = new Car in everywhere, facing Range(0, 360) deg
cars = [ego] + [new Car in everywhere, facing Range(0, 360) deg for number in range(2)]
def slowest(cars):
    best = cars[0]
    for o in cars:
        if o.speed < best.speed:
            best = o
    return best
"""


def compiled(text: str):
    return compile_scenario(Source("courses.scenic", HEAD + text), street())


def own(scenario):
    """The requirements that the program states."""
    return [each for each in scenario.requirements if each.built_in is None]


def holds(scenario, given) -> bool:
    """Whether all requirements hold of what is given of objects."""
    found = [condition(each.condition, given) for each in own(scenario)]
    assert all(isinstance(each, Constant) for each in found)
    return all(each.value is True for each in found)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("len([o for o in cars if o.speed > 3]) == 2", lambda speeds: sum(each > 3 for each in speeds) == 2),
        ("sorted(cars, key=lambda o: o.speed)[1].speed > 3", lambda speeds: sorted(speeds)[1] > 3),
        ("max(cars, key=lambda o: -o.speed).speed < 2", lambda speeds: min(speeds) < 2),
        ("slowest(cars) is cars[1]", lambda speeds: speeds.index(min(speeds)) == 1),
        ("slowest(cars).speed == sorted([o.speed for o in cars])[0]", lambda speeds: True),
        (
            "(n := len([o for o in cars if o.speed > 3])) > 0 and n < 3",
            lambda speeds: 0 < sum(s > 3 for s in speeds) < 3,
        ),
        ("int(cars[1].speed) == round(cars[2].speed)", lambda speeds: int(speeds[1]) == round(speeds[2])),
        ("{True: 2, False: 5}[cars[0].speed > 3] < cars[1].speed", lambda s: (2 if s[0] > 3 else 5) < s[1]),
        ("cars[0].speed and cars[1].speed > 2", lambda speeds: bool(speeds[0]) and speeds[1] > 2),
        ("any([o.speed > 4 for o in cars if o.speed < 5])", lambda speeds: any(4 < each < 5 for each in speeds)),
    ],
)
def test_conditions_mean_what_python_means(text, plain):
    scenario, chance = compiled(f"require ({text})\n"), random.Random(text)
    for _ in range(60):
        speeds = [chance.choice((0.0, 1.0, 2.5, 3.0, 3.5, 4.5, 6.0)) for _ in range(3)]
        given = {(number, "speed"): speed for number, speed in enumerate(speeds)}
        assert holds(scenario, given) is plain(speeds), speeds


def test_what_a_condition_goes_through_keeps_its_name():
    scenario = compiled("require len([o for o in cars if o.speed > 3]) == 0\n")
    assert [each.name for each in scenario.objects] == ["ego", "Car#2", "Car#3"]


def test_what_one_course_lacks_excludes_it_alone():
    scenario = compiled("require (cars[1].position.x > 0) if cars[1].speed > 3 else [1, 2][5] == 1\n")
    read = {name for each in own(scenario) for _, name in features(each.condition)}
    assert read == {"speed", "position"}
    for speed, x, expected in ((4.0, 1.0, True), (4.0, -1.0, False), (2.0, 1.0, False)):
        assert holds(scenario, {(1, "speed"): speed, (1, "position"): (x, 0.0)}) is expected
    with pytest.raises(ScenarioError, match="there is no item"):
        compiled("require [1, 2][5] == 1 if cars[1].speed > 3 else [1, 2][6] == 1\n")


@pytest.mark.slow
def test_too_many_courses_are_refused():
    with pytest.raises(ScenarioError) as error:
        compiled("many = cars * 6\nrequire sorted(many, key=lambda o: o.speed)[0].speed > 1\n")
    assert error.value.diagnostics[0].code == "budget-exceeded"


@pytest.mark.parametrize("text", ["if ego.speed < 1:\n    pass\n", "len([o for o in cars if o.speed > 3])\n"])
def test_the_program_itself_knows_no_speed_that_it_does_not_set(text):
    with pytest.raises(ScenarioError) as error:
        compiled(text)
    assert error.value.diagnostics[0].code == "random-branch"


def test_the_program_itself_knows_what_it_sets():
    text = HEAD.replace("ego = new Car in everywhere", "ego = new Car with speed 5, in everywhere")
    scenario = compile_scenario(
        Source("set.scenic", text + "if ego.speed < 1:\n    new Car in everywhere, facing 0 deg\n"), street()
    )
    assert len(scenario.objects) == 3
