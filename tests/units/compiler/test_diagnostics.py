"""Every refusal names the construct, points at the smallest text, and says what to do."""

import pytest

from scenicq.compiler.coroutines import LibraryName
from scenicq.compiler.values import describe
from scenicq.errors import ScenarioError

from .scenes import compiled, refused

CASES = {
    "x = new Car\nego = x\n": ("unknown-name", "Car"),
    "ego = Object\nnew Object\n": ("wrong-type", "ego"),
    "new Object\n": ("no-ego", "n"),
    "new Object offset by (1, 2)\n": ("no-ego", "offset by (1, 2)"),
    "ego = 3\n": ("wrong-type", "ego"),
    "ego = new Object at (1, 2), at (3, 4)\n": ("specifier-conflict", "at (3, 4)"),
    "ego = new Object left of (0, 0), facing toward (1, 1)\n": ("specifier-cycle", "facing toward (1, 1)"),
    "ego = new Object with pitch 3\n": ("unsupported-construct", "with pitch 3"),
    "p = new Point on (1, 2, 3)\nego = new Object\n": ("unsupported-construct", "on (1, 2, 3)"),
    "ego = new Object using f()\n": ("unknown-name", "f"),
    "ego = new Object\nnew Object above ego by 1\n": ("unsupported-construct", "above ego by 1"),
    "ego = new Object\nrequire 1 > 2\n": ("impossible-requirement", "require 1 > 2"),
    "ego = new Object\nrequire always 1 > 2\n": ("unsupported-construct", "always 1 > 2"),
    "ego = new Object with positionStdDev (1, 2, 0)\nmutate\n": (
        "unsupported-construct",
        "with positionStdDev (1, 2, 0)",
    ),
    "class A(Object, Point):\n    pass\nego = new A\n": ("unsupported-construct", "Point"),
    "class A:\n    def __init__(self):\n        pass\nego = new A\n": ("unsupported-construct", "__init__"),
    "class A:\n    pitch: 3\nego = new A\n": ("unsupported-construct", "pitch"),
    "class A[1]:\n    pass\nego = new A\n": ("parse-error", "["),
    "import numpy\nego = new Object\n": ("unknown-model", "numpy"),
    "from scenic.domains.driving.roads import Lame\nego = new Object\n": ("unknown-name", "Lame"),
    "behavior B():\n    wait\nego = new Object\n": ("unsupported-construct", "behavior B():"),
    "x = Uniform()\nego = new Object\n": ("map-lacks", "Uniform()"),
    "for i in range(Range(1, 2)):\n    pass\nego = new Object\n": ("random-branch", "range(Range(1, 2))"),
}


@pytest.mark.parametrize("text", CASES)
def test_a_refusal_points_at_its_cause(text: str) -> None:
    assert refused(text, 3) == CASES[text]


@pytest.mark.parametrize("text", [text for text in CASES if CASES[text][0] == "unsupported-construct"])
def test_what_is_not_supported_says_what_to_do(text: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        compiled(text, 3)
    assert caught.value.diagnostics[0].hints


def test_dynamic_parts_are_ignored_on_request() -> None:
    text = (
        "from scenic.domains.driving.behaviors import FollowLaneBehavior\nmodel scenic.domains.driving.model\n"
        "behavior B():\n    wait\nego = new Car with behavior B()\nnew Car with behavior FollowLaneBehavior(3)\n"
        "require always ego in road\nrequire eventually ego in curb\nterminate after 5 seconds\n"
    )
    assert refused(text)[0] == "unsupported-construct"
    scenario = compiled(text, initial=True)
    assert len(scenario.ignored) == 7
    assert len([each for each in scenario.requirements if each.built_in is None]) == 1


def test_objects_in_the_setup_of_a_scenario_are_not_lost_in_silence() -> None:
    text = "scenario Main():\n    setup:\n        ego = new Object\n        other = new Object at (0, 5)\n"
    assert [thing.name for thing in compiled(text, initial=True).objects] == ["ego", "other"]


def test_an_ego_set_in_a_function_is_the_ego() -> None:
    text = "def make(x):\n    ego = new Object at (x, 0)\n    return ego\nfirst = make(1)\nmake(2)\n"
    scenario = compiled(text)
    assert scenario.ego == 1
    assert [thing.name for thing in scenario.objects] == ["first", "ego"]


def test_a_method_gets_its_object() -> None:
    scenario = compiled(
        "class A:\n    size: 3\n    def twice(self, n):\n        return self.size * n\n"
        "ego = new A\nparam x = ego.twice(2)\n"
    )
    assert scenario.params["x"].value.value == 6.0  # type: ignore[union-attr]


def test_files_beside_the_program_can_be_imported() -> None:
    from scenicq.errors import Source

    files = {"lib.scenic": "width = 3\ndef place(x):\n    return new Object at (x, 0), with width width\n"}

    def loader(name: str) -> Source | None:
        return Source(name, files[name]) if name in files else None

    scenario = compiled("from lib import place\nego = place(1)\nplace(2)\n", 3, loader=loader)
    assert [thing.properties["width"].value.value for thing in scenario.objects] == [3.0, 3.0]  # type: ignore[union-attr]


@pytest.mark.parametrize(("name", "known"), [("crosswalk", "crossing"), ("junction", "intersection"), ("kerb", "curb")])
def test_what_people_call_it_names_what_scenic_calls_it(name, known):
    with pytest.raises(ScenarioError, match=f"`{known}` is what Scenic calls it"):
        compiled(f"model scenic.domains.driving.model\nego = new Car\nother = new Object on {name}\n")


def test_a_comma_after_the_class_is_told():
    with pytest.raises(ScenarioError, match="no comma stands between the class and its first specifier"):
        compiled("ego = new Object, with width 1\n")


@pytest.mark.parametrize(("tried", "told"), [("near ego", "distance from a to b"), ("off road", "not .a.position in")])
def test_what_is_no_specifier_is_said_as_a_requirement(tried, told):
    with pytest.raises(ScenarioError, match=told):
        compiled(f"model scenic.domains.driving.model\nego = new Car\nother = new Car {tried}\n")


def hints_of(text):
    with pytest.raises(ScenarioError) as caught:
        compiled(f"model scenic.domains.driving.model\nego = new Car\nother = new Car\n{text}\n")
    (found,) = caught.value.diagnostics
    return found.message, found.label, " ".join(found.hints)


@pytest.mark.parametrize(
    ("tried", "told"),
    [
        ("require intersects(other, ego)", "`X intersects Y`"),
        ("which = random.choice([1, 2])", "`Uniform(a, b)`"),
        ("third = new Car at Offset(1, 2) relative to ego", "`at X offset by 2 @ 5`"),
        ("third = new Car facing west", "`90 deg`"),
        ("third = new Junction", "`on intersection`"),
        ("third = new Pedestrian on network.sidewalks", "`Uniform(*elements)`"),
        (
            "require (distance from ego to [network.lanes[0], network.lanes[1], Uniform(*network.lanes)]) < 5",
            "chooses one",
        ),
        ("third = new Car with brand 'a' at ego offset by 2 @ 3", "a comma separates specifiers"),
        ("zebras = network.crosswalks", "`crossings` is what Scenic calls them"),
        ("long = [each for each in network.roads if each.extent > 3]", "`centerline`"),
        ("bends = network.lanes[0].curvature", "`orientation`"),
    ],
)
def test_invented_words_name_what_there_is(tried, told):
    assert told in hints_of(tried)[2]


def test_a_parameter_that_is_not_set_is_no_attribute_of_a_module():
    message, _, hints = hints_of("param town = 'a'\nx = globalParameters.towns")
    assert message == "the program has no parameter `towns`"
    assert "`town`" in hints


@pytest.mark.parametrize("value", ["ego.position", "ego.speed", "Range(1, 2)", "ego can see other"])
def test_values_are_called_by_no_name_of_the_code(value):
    """What is no class is said in words, whatever the class is called that holds it."""
    said = hints_of(f"x = isinstance(1, {value})")[1]
    assert said.startswith("this is a ")
    assert said.islower()


def test_what_the_compiler_alone_knows_is_called_by_words():
    assert describe(LibraryName("WalkBehavior", is_action=False)) == "a library name"
