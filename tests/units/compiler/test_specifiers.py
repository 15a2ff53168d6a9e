"""Every specifier of the language paper's appendix B against its formula, computed here by plain mathematics."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from . import scenes
from .scenes import EGO, EGO_HEADING, EGO_POSITION, arctan, last, minus, offset_local, plus, rotate, same_angle

D = math.radians
P, A = (10.0, 20.0), D(70)
POINT = "p = new OrientedPoint at (10, 20), facing 70 deg\n"
SIZE = "with width 1.6, with length 4"

# specifier, position, heading (None: the default, 0)
PLACES = {
    "at (7, 8)": ((7, 8), None),
    "offset by (2, 5)": (offset_local(EGO_POSITION, EGO_HEADING, (2, 5)), EGO_HEADING),
    "offset along 20 deg by (2, 5)": (plus(EGO_POSITION, rotate((2, 5), D(20))), EGO_HEADING),
    "left of p": (offset_local(P, A, (-0.8, 0)), A),
    "right of p by 3": (offset_local(P, A, (3.8, 0)), A),
    "ahead of p by 3": (offset_local(P, A, (0, 5)), A),
    "behind p": (offset_local(P, A, (0, -2)), A),
    "left of ego by 1": (offset_local(EGO_POSITION, EGO_HEADING, (-1 - 0.8 - 1, 0)), EGO_HEADING),
    "right of ego": (offset_local(EGO_POSITION, EGO_HEADING, (1.8, 0)), EGO_HEADING),
    "ahead of ego by 2": (offset_local(EGO_POSITION, EGO_HEADING, (0, 2.5 + 2 + 2)), EGO_HEADING),
    "behind ego by 2": (offset_local(EGO_POSITION, EGO_HEADING, (0, -2.5 - 2 - 2)), EGO_HEADING),
    "left of ego by (1, 2)": (offset_local(EGO_POSITION, EGO_HEADING, (-1 - 0.8 - 1, 2)), EGO_HEADING),
    "behind ego by (1, 2)": (offset_local(EGO_POSITION, EGO_HEADING, (1, -2.5 - 2 - 2)), EGO_HEADING),
    "left of (10, 20) by 3, facing 25 deg": (plus(P, rotate((-0.8 - 3, 0), D(25))), D(25)),
    "ahead of (10, 20) by 3, facing 25 deg": (plus(P, rotate((0, 2 + 3), D(25))), D(25)),
    "beyond p by (1, 4)": (plus(P, rotate((1, 4), arctan(minus(P, EGO_POSITION)))), EGO_HEADING),
    "beyond p by 4 from (1, 1)": (plus(P, rotate((0, 4), arctan(minus(P, (1, 1))))), None),
    "at (7, 8), facing toward p": ((7, 8), arctan(minus(P, (7, 8)))),
    "at (7, 8), facing away from p": ((7, 8), arctan(minus((7, 8), P))),
    "at (7, 8), facing directly toward p": ((7, 8), arctan(minus(P, (7, 8)))),
    "at (7, 8), apparently facing 30 deg": ((7, 8), D(30) + arctan(minus((7, 8), EGO_POSITION))),
    "at (7, 8), apparently facing 30 deg from p": ((7, 8), D(30) + arctan(minus((7, 8), P))),
    "at (7, 8), facing 30 deg relative to p": ((7, 8), D(30) + A),
    "offset by (2, 5), with yaw 10 deg": (offset_local(EGO_POSITION, EGO_HEADING, (2, 5)), EGO_HEADING + D(10)),
}


@pytest.mark.parametrize("specifier", PLACES)
def test_a_place_is_what_the_paper_says(specifier: str) -> None:
    position, heading = last(f"{EGO}{POINT}new Object {SIZE}, {specifier}\n")
    wanted, turned = PLACES[specifier]
    assert position == pytest.approx(wanted)
    assert same_angle(heading, turned or 0.0)


def test_up_to_scenic_2_an_offset_leaves_the_heading_alone() -> None:
    old = "ego = Object at 3 @ -4, facing 40 deg\n"
    assert last(f"{old}Object offset by 2 @ 5, with requireVisible False\n", version=2)[1] == 0.0
    assert last(f"{old}Object beyond 9 @ 9 by 2 @ 5, with requireVisible False\n", version=2)[1] == 0.0


def test_following_a_field_takes_four_steps_and_then_one_each_five_metres() -> None:
    ego = "model scenic.domains.driving.model\nego = new Car at (1.75, 40)\n"
    assert last(f"{ego}new Car following roadDirection for 12\n") == (pytest.approx((1.75, 52)), 0.0)
    _, scene = scenes.drawn(
        "import gtaLib\nego = Car at 1.75 @ 40\nx = follow roadDirection for 12\nCar at x\n", version=1
    )
    assert scene.values[1, "position"] == pytest.approx((1.75, 52))


@pytest.mark.parametrize("seed", range(5))
def test_a_point_in_a_region_lies_there_and_takes_its_orientation(seed: int) -> None:
    position, heading = last("model scenic.domains.driving.model\nego = new Car at (1, 40)\nnew Car on road\n", seed)
    assert scenes.network().drivableRegion.polygons
    assert any(same_angle(heading, each) for each in scenes.network().roadDirection.values(*position))


@pytest.mark.parametrize("seed", range(5))
def test_visible_means_within_the_sector(seed: int) -> None:
    position, _ = last(f"{EGO}new Object visible\n", seed)
    line = minus(position, EGO_POSITION)
    assert math.hypot(*line) <= 30
    assert abs(math.remainder(arctan(line) - EGO_HEADING, math.tau)) <= D(40) + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_not_visible_in_scenic_3_hides_all_of_the_object(seed: int) -> None:
    place = "in RectangularRegion((3, 20), 0, 40, 30), with width 8, with length 8, not visible"
    position, _ = last(f"{EGO}new Object {place}\nrequire (distance to (3, 20)) < 60\n", seed)
    scenario, _ = scenes.drawn(f"{EGO}new Object {place}\n", seed)
    assert len(scenario.requirements) == 1
    line = minus(position, EGO_POSITION)
    assert math.hypot(*line) > 30 or abs(math.remainder(arctan(line) - EGO_HEADING, math.tau)) > D(40)


def test_on_a_region_modifies_a_position_given_otherwise() -> None:
    text = (
        "model scenic.domains.driving.model\nego = new Car at (-30, 1.75)\n"
        "new Car ahead of ego by Range(0, 200), on road\n"
    )
    for seed in range(5):
        (x, y), heading = last(text, seed)
        assert y == pytest.approx(1.75)
        assert x >= -110
        assert same_angle(heading, math.pi / 2)
    assert scenes.refused(f"{EGO}new Object at (1, 2), in CircularRegion((0, 0), 5)\n")[0] == "specifier-conflict"


def test_contained_in_is_the_authors_requirement() -> None:
    scenario = scenes.compiled(f"{EGO}new Object contained in CircularRegion((0, 0), 5)\n")
    assert [each.built_in for each in scenario.requirements] == [None]


def test_a_place_beside_a_random_object_follows_the_object() -> None:
    text = (
        f"{EGO}a = new Object at (50, 0), with width 4\nb = new Object at (90, 0), with width 8\n"
        "new Object left of Uniform(a, b)\n"
    )
    places = {round(last(text, seed)[0][0], 6) for seed in range(20)}
    assert places == {50 - 2 - 0.5, 90 - 4 - 0.5}


def test_a_place_beside_a_random_thing_takes_what_all_outcomes_have_in_common() -> None:
    beside = f"{EGO}p = new OrientedPoint at (10, 0), facing 90 deg\na = new Object at (50, 0), with width 4\n"
    # no box counts beside an oriented point, which faces west; beside a place the own heading counts
    for thing, places in {
        "Uniform(p, a)": {10, 50 - 4 - 0.5},
        "Uniform(a, (10, 0))": {10 - 4 - 0.5, 50 - 4 - 0.5},
        "Uniform(Uniform(a, a), a)": {50 - 4 - 2 - 0.5},
    }.items():
        text = f"{beside}new Object left of {thing} by 4, facing 0 deg\n"
        assert {round(last(text, seed)[0][0], 6) for seed in range(20)} == places
    behind = f"{beside}new Object behind Uniform(p, (30, 0)) by 4, facing 0 deg\n"
    assert {last(behind, seed)[0] for seed in range(20)} == {(10, -4.5), (30, -4.5)}


def test_facing_toward_its_own_place_is_relative_to_the_parent() -> None:
    for away in ("toward", "away from", "directly toward"):
        text = f"{EGO}p = new OrientedPoint at (10, 0), facing 30 deg\nnew Object at p, facing {away} p\n"
        assert same_angle(last(text, 0)[1], math.radians(-90))
        held = text.replace(f"at p, facing {away} p", f"at p, facing {away} p, with parentOrientation 30 deg")
        assert same_angle(last(held, 0)[1], math.radians(30 - 90))


numbers = st.floats(-50, 50).map(lambda x: round(x, 3))


@settings(deadline=None, max_examples=60)
@given(
    st.tuples(numbers, numbers),
    numbers,
    st.lists(
        st.tuples(st.sampled_from(["left", "right", "ahead", "behind", "offset", "beyond"]), numbers, numbers),
        min_size=1,
        max_size=5,
    ),
)
def test_chains_of_places_agree_with_the_formulas(start, turn, steps) -> None:
    text = f"ego = new Object at {start}, facing {turn} deg\n"
    position, heading = start, D(turn)
    for number, (kind, x, y) in enumerate(steps):
        before = "ego" if number == 0 else f"o{number - 1}"
        if kind == "offset":
            place = f"({before} offset by ({x}, {y}))"
            text += f"o{number} = new OrientedPoint at {place}, facing {y} deg relative to {before}\n"
            position, heading = offset_local(position, heading, (x, y)), heading + D(y)
        elif kind == "beyond":
            text += f"o{number} = new OrientedPoint beyond {before} by ({x}, {y}) from (99, 99), facing {x} deg\n"
            position, heading = plus(position, rotate((x, y), arctan(minus(position, (99, 99))))), D(x)
        else:
            half = 0.5 if number == 0 else 0.0
            away = {
                "left": (-abs(x) - half, 0),
                "right": (abs(x) + half, 0),
                "ahead": (0, abs(x) + half),
                "behind": (0, -abs(x) - half),
            }
            word = f"{kind} of" if kind != "behind" else "behind"
            text += f"o{number} = new OrientedPoint {word} {before} by {abs(x)}\n"
            position = offset_local(position, heading, away[kind])
    found, turned = last(f"{text}new Object at o{len(steps) - 1}, facing o{len(steps) - 1}.heading\n")
    assert found == pytest.approx(position, abs=1e-6)
    assert same_angle(turned, heading)
