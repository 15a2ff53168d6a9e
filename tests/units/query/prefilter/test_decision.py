"""What SQL says surely matches does: the matcher finds a proof for every such frame."""

from __future__ import annotations

import itertools
import math
import random
import sys
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.scenario import BuiltIn
from scenicq.geometry.membership import contains
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.prefilter.decision import decided_frames
from scenicq.query.prefilter.executor import blocks, extents, run_prefilter
from scenicq.query.prefilter.plan import LABELS, Plan, make_plan
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2] / "match"))
from made_up import RANDOM, TIED, made_up
from nudged_scenes import STREET, dataset_of
from programs import HEADER, PROGRAMS

OPTIONS = {
    "default": MatchOptions(),
    "exact": MatchOptions(tolerance=EXACT),
    "box": MatchOptions(tolerance=Tolerance(x=0.5, y=0.25, heading=math.radians(10)), classes="coarse", radius=25.0),
    "wide": MatchOptions(tolerance=Tolerance(position=3.0, heading=math.radians(60))),
}
SINGLE: dict[str, str] = {
    "range": "other = new Car offset by (Range(-6, 6), Range(4, 12))",
    "ahead": "other = new Car ahead of ego by Range(1, 10)",
    "twice": "gap = Range(1, 6)\nother = new Car offset by (gap, 2 * gap)",
    "cancels": "gap = Range(1, 6)\nother = new Car offset by (gap - gap, 8)",
    "turned": "turn = Range(10, 40) deg\nother = new Car offset by (Range(-6, 6), Range(4, 12)),\n"
    "    facing turn - turn relative to ego.heading",
    "shared": "gap = Range(1, 6)\nother = new Car offset by (gap, 9), facing gap * 10 deg relative to ego.heading",
    "options": "other = new Car offset by (Uniform(-1, 1) * Range(3, 5), Uniform(4, 8, Range(10, 12)))",
    "steps": "other = new Car offset by (DiscreteRange(-3, 3), 8)",
    "walker": "other = new Pedestrian on road, facing Range(-90, 90) deg\nrequire (distance to other) < 20",
    "view": "other = new Car on visible road\nrequire (distance to other) < 12",
    "slow": "other = new Car on road, with speed Range(0, 2)",
    "size": "other = new Car ahead of ego by Range(1, 10), with width Range(1.5, 2)",
    "or": "other = new Car\nrequire (distance to other) < 8 or other.position.x < 0",
    "hidden": "far = Range(5, 8)\nother = new Car\nrequire (distance to other) < far",
    "none": "far = Range(8, 5)\nother = new Car offset by (0, far)",
    "two": "first = new Car on road\nsecond = new Car on road\nthird = new Car on road",
    "crossing": "first = new Car on road\nsecond = new Car on road\nrequire (distance from first to second) < 9",
}
SINGLE = {name: f"ego = new Car\n{text}" for name, text in SINGLE.items()}
SINGLE["seen"] = (
    "ego = new Car with visibleDistance 15, with viewAngle 200 deg\nother = new Pedestrian on visible road, facing 3"
)
SINGLE["around"] = (
    "ego = new Car with visibleDistance 15, with viewAngle 360 deg\nother = new Pedestrian on visible road"
)


ON_COURSE = (
    "from scenicq.labels import along, beside\nego = new Car\nother = new Car\n"
    "require -20 < along(ego, other) < 20 and abs(beside(ego, other)) < 6"
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """Scenes of programs, as they are and nudged."""
    chosen = SINGLE | TIED | {name: PROGRAMS[name] for name in sorted(PROGRAMS)[::3]} | dict(list(RANDOM.items())[:8])
    return dataset_of(chosen, tmp_path_factory.mktemp("decision"))


def plan_of(text: str, options: MatchOptions) -> tuple[Plan, Matcher]:
    scenario = prepare_scenario(compile_scenario(Source("test.scenic", HEADER + text), STREET))
    options = replace(options, timeout_s=20.0)
    return make_plan(scenario, STREET, options, deciding=True), Matcher(scenario, options)


def sure_frames(dataset: Dataset, plan: Plan) -> tuple[list[str], int]:
    """The frames that surely match, and how many others are left."""
    with closing(dataset.connect()) as connection:
        (block,) = blocks(extents(dataset, connection), "street")
        if not (run_prefilter(dataset, connection, plan, block) < 0).any():
            return [], 0
        rows = decided_frames(connection, plan.decision, LABELS, plan.left)
    return [frame for _, sure, frame, *_ in rows if sure], sum(not sure for _, sure, *_ in rows)


def check(dataset: Dataset, text: str, options: MatchOptions) -> tuple[int, int]:
    """How many frames surely match, each of which the matcher proves, and how many are left open."""
    try:
        plan, matcher = plan_of(text, options)
    except ScenarioError:
        return 0, 0  # a random program may be wrong
    if not plan.decision:
        return 0, 0
    sure, left = sure_frames(dataset, plan)
    for label in dataset.labels(sure):
        assert isinstance(matcher.match(label), Match), label.frame
    return len(sure), left


@pytest.mark.parametrize("options", list(OPTIONS))
@pytest.mark.parametrize("name", list(SINGLE | TIED))
@pytest.mark.one_in(16)
def test_what_sql_decides_has_a_proof(dataset, name, options):
    check(dataset, (SINGLE | TIED)[name], OPTIONS[options])


@pytest.mark.slow
@pytest.mark.parametrize("options", list(OPTIONS))
@pytest.mark.parametrize("name", list(PROGRAMS))
def test_what_sql_decides_of_programs_has_a_proof(dataset, name, options):
    check(dataset, PROGRAMS[name], OPTIONS[options])


@pytest.mark.parametrize("first", [0, pytest.param(12, marks=pytest.mark.slow)])
def test_what_sql_decides_of_random_programs_has_a_proof(dataset, first):
    decided = 0
    for seed in range(first, 12 if not first else 300):
        decided += check(dataset, made_up(seed), list(OPTIONS.values())[seed % len(OPTIONS)])[0]
    assert decided


@pytest.mark.parametrize(
    "name",
    ["range", "ahead", "options", "steps", "walker", "view", "seen", "around", "or", "two", "crossing"],
)
def test_sql_decides_what_it_can(dataset, name):
    sure, left = check(dataset, SINGLE[name], OPTIONS["default"])
    assert 2 * sure > left, (sure, left)


@pytest.mark.parametrize("options", ["default", "exact", "box"])
def test_sql_decides_what_may_lie_anywhere(dataset, options):
    text = "ego = new Car\nother = new Car in everywhere, facing Range(0, 360) deg\nrequire (distance to other) < 20"
    sure, left = check(dataset, text, OPTIONS[options])
    assert 2 * sure > left, (sure, left)


@pytest.mark.parametrize("options", ["default", "exact", "box"])
def test_sql_decides_who_is_on_the_course_of_the_ego(dataset, options):
    sure, left = check(dataset, ON_COURSE, OPTIONS[options])
    assert 2 * sure > left, (sure, left)


TO_A_ROLE = {
    "nearest": "other is nearest(Car)",
    "nearest ahead": "other is nearest(Car, ahead=True)",
    "nearest within": "other is nearest(Car, within=CircularRegion(ego, 30))",
    "nobody near it": "not any((distance from c to other) < 4 for c in others(Car))",
    "somebody near it": "any((distance from c to other) < 40 for c in others(Car))",
    "all farther": "all([(distance to c) > (distance to other) for c in others(Car)])",
    "hardly east": "len([c for c in others(Car) if c.position.x < other.position.x + 50]) >= 1",
}


ODD = [
    "any(c is other for c in others(Car))",
    "any(c is other and (distance to c) < 40 for c in others(Car))",
    "not any(c is other for c in others(Car))",
    "any((distance from c to other) < globalParameters.far for c in others(Car))",
    "not any(c is not other and (distance to c) < (distance to other) for c in others(Object))",
    "other is not nearest(Car)",
    "other is nearest(Car) or (distance to other) > 20",
]


@pytest.mark.parametrize("condition", ODD)
@pytest.mark.one_in(3)
def test_without_proofs_odd_conditions_on_a_role_find_the_same_frames(dataset, condition):
    text = (
        "from scenicq.labels import nearest, others\nparam far = 9\nego = new Car\n"
        f"other = new Car in everywhere, facing Range(0, 360) deg\nrequire {condition}"
    )
    options = MatchOptions(ignore_params=frozenset({"far"}))
    found = [
        [each.frame for each in Query(dataset, Source("t", HEADER + text), QueryOptions(options, **how)).results()
         if isinstance(each.verdict, Match)]
        for how in ({"proofs": False}, {"prefilter": False})
    ]  # fmt: skip
    assert found[0] == found[1]


@pytest.mark.parametrize("name", list(TO_A_ROLE))
@pytest.mark.one_in(4)
def test_sql_decides_what_others_are_to_a_role(dataset, name):
    """Each frame that SQL decides has a proof, and none that it rules out matches."""
    text = (
        "from scenicq.labels import nearest, others\nego = new Car\n"
        f"other = new Car in everywhere, facing Range(0, 360) deg\nrequire {TO_A_ROLE[name]}"
    )
    sure, left = check(dataset, text, OPTIONS["default"])
    assert sure > left, (sure, left)
    source = Source("test.scenic", HEADER + text)
    ids = [
        {each.frame for each in Query(dataset, source, QueryOptions(prefilter=there, proofs=False)).results()}
        for there in (True, False)
    ]
    assert ids[0] == ids[1]


@pytest.mark.parametrize("name", ["twice", "cancels", "turned", "shared"])
def test_a_variable_that_is_used_twice_is_left_to_the_matcher(name):
    assert not plan_of(SINGLE[name], OPTIONS["default"])[0].decision


CAR = "ego = new Car\nother = new Car ahead of ego by Range(1, 10)"
LEFT: dict[str, tuple[str, str, MatchOptions]] = {
    # what is not decided by SQL, with a text that is
    "mutated": (f"{CAR}\nmutate other", CAR, MatchOptions()),
    "any ego": (CAR, CAR, MatchOptions(ego="any")),
    "exact": (CAR, CAR, MatchOptions(exact=True)),
    "solver": (CAR, CAR, MatchOptions(method="smt")),
    "boxes": (CAR, CAR, MatchOptions(enforce=frozenset({BuiltIn.COLLISION}))),
    "filter over what a choice leads to": (
        "lane = Uniform(*network.lanes)\nego = new Car\n"
        "turn = Uniform(*filter(lambda each: each.type is ManeuverType.STRAIGHT, lane.maneuvers))\n"
        "other = new Car on turn.endLane",
        "lane = Uniform(*Uniform(*network.roads).lanes)\nego = new Car\nother = new Car on lane, facing 30 deg",
        MatchOptions(),
    ),
    "three in a group": (
        "gap = Range(1, 9)\nego = new Car\na = new Car ahead of ego by gap\nb = new Car behind ego by gap\n"
        "c = new Car left of ego by gap",
        "ego = new Car\na = new Car ahead of ego by Range(1, 9)\nb = new Car behind ego by Range(1, 9)\n"
        "c = new Car left of ego by Range(1, 9)",
        MatchOptions(),
    ),
    "four roles tied together": (
        "ego = new Car\na = new Car\nb = new Car\nc = new Car\nd = new Car\n"
        "require (distance from a to b) < 9\nrequire (distance from c to d) < 9",
        "ego = new Car\na = new Car\nb = new Car\nc = new Car\nrequire (distance from a to b) < 9",
        MatchOptions(),
    ),
}


@pytest.mark.parametrize("why", LEFT)
def test_what_sql_cannot_decide_is_left_to_the_matcher(why):
    text, other, options = LEFT[why]
    assert plan_of(other, MatchOptions())[0].decision
    assert not plan_of(text, options)[0].decision


def test_what_a_label_lacks_and_what_is_among_its_attributes_proves_nothing(tmp_path):
    text = f"{CAR}, with speed Range(0, 2), with width 2, with parked True"
    ego = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)
    ahead = LabelObject("a", "Car", "car", 1.75, 60.0, 0.0, 2.0, 4.5, velocity=(0.0, 1.0))
    objects = {"all": ahead, "no speed": replace(ahead, velocity=None), "no width": replace(ahead, width=None)}
    objects["attribute"] = replace(ahead, attributes={"parked": True})
    labels = [Label(name, "r", at, "street", ego, (each,)) for at, (name, each) in enumerate(objects.items())]
    write_dataset(tmp_path / "d", [Recording("r", "street", tuple(labels))], {"street": STREET.features}, name="d")
    plan, matcher = plan_of(text, OPTIONS["default"])
    assert all(isinstance(matcher.match(label), Match) for label in labels)
    assert sure_frames(open_dataset(tmp_path / "d"), plan) == (["all"], 3)


TRIPLE = (
    "ego = new Car\na = new Car\nb = new Car\nc = new Car\n"
    "require (distance from a to b) < 9\nrequire (distance from b to c) < 9"
)


@pytest.mark.parametrize(
    ("text", "decided"),
    [
        (TRIPLE, True),
        (f"{TRIPLE}\nrequire (distance from a to b) + (distance from b to c) < 20", False),
        (f"{TRIPLE}\nd = new Car\nrequire (distance from c to d) < 9", False),
        ("ego = new Car\na = new Car at ego offset by 3 @ (Range(-5, 5) / 2)", True),
        ("ego = new Car\na = new Car at ego offset by 3 @ (Range(-5, 5) * -2)", True),
        ("ego = new Car\na = new Car at ego offset by 3 @ (Range(-5, 5) - Range(0, 2))", True),
        ("ego = new Car\na = new Car at ego offset by 3 @ -Range(-5, 5)", True),
        ("ego = new Car\na = new Car at ego offset by 3 @ (Range(-5, 5) * Range(0, 2))", False),
        ("ego = new Car\na = new Car at ego offset by 3 @ sin(Range(-5, 5))", False),
        ("ego = new Car\nmutate ego", False),
    ],
)
def test_sql_decides_only_what_it_can_say(text, decided):
    assert bool(plan_of(text, OPTIONS["default"])[0].decision) == decided


def test_a_size_that_a_label_lacks_is_not_what_it_happens_to_be_in_sql(tmp_path):
    """The greatest of null and 1 is 1 in SQL; the matcher takes the size that the class gives."""
    text = f"{CAR}\nrequire max(other.width, 1) < 1.5"
    ego = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)
    narrow = LabelObject("a", "Car", "car", 1.75, 60.0, 0.0, 1.2, 4.5)
    labels = tuple(
        Label(name, "r", at, "street", ego, (replace(narrow, width=width),))
        for at, (name, width) in enumerate([("narrow", 1.2), ("unknown", None)])
    )
    write_dataset(tmp_path / "d", [Recording("r", "street", labels)], {"street": STREET.features}, name="d")
    plan, matcher = plan_of(text, OPTIONS["default"])
    assert [type(matcher.match(label)) for label in labels] == [Match, NoMatch]
    assert sure_frames(open_dataset(tmp_path / "d"), plan)[0] == ["narrow"]


@pytest.mark.parametrize(("further", "expected"), [(1.0, Match), (-0.05, NoMatch)])
def test_in_an_intersection_of_regions_lies_the_place_itself(tmp_path, further, expected):
    """Beside the road and just in view, where within tolerance the road is not in view any more."""
    edge = next(x for x in range(4, 40) if not contains(STREET.drivableRegion, x + 0.01, 50.0))
    ego = LabelObject("ego", "Car", "car", edge + 20.0, 50.0, math.pi / 2, 2.0, 4.5)
    other = LabelObject("a", "Car", "car", edge + 0.1, 50.0, 0.0, 2.0, 4.5)
    label = Label("frame", "r", 0, "street", ego, (other,))
    text = f"ego = new Car at {ego.x} @ 50, facing 90 deg, with visibleDistance {20 + further}\n"
    text += "other = new Car on visible road, facing 0"
    write_dataset(tmp_path / "d", [Recording("r", "street", (label,))], {"street": STREET.features}, name="d")
    plan, matcher = plan_of(text, OPTIONS["default"])
    assert plan.decision
    assert isinstance(matcher.match(label), expected)
    assert sure_frames(open_dataset(tmp_path / "d"), plan)[0] == []


@pytest.mark.parametrize("name", ["ahead", "view", "crossing", "range"])
def test_without_proofs_the_same_frames_match(dataset, name):
    text = HEADER + SINGLE[name]
    frames: list[list[str]] = []
    for proofs in (True, False):
        query = Query(dataset, Source("test.scenic", text), QueryOptions(MatchOptions(), proofs=proofs))
        frames.append([each.frame for each in query.results() if isinstance(each.verdict, Match)])
        assert query.funnel.matches == len(frames[-1])
    assert frames[0] == frames[1] != []


@pytest.mark.slow
def test_of_what_a_label_lacks_nothing_is_known(tmp_path):
    """Whatever is required of numbers that some labels have and others do not."""
    lacking = list(itertools.product([0.0, 1.5, None], [1.2, 2.4, None], [0.0, 3.0, None]))
    labels = []
    for at, (speed, width, own) in enumerate(lacking):
        ego = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5, velocity=None if own is None else (0.0, own))
        other = LabelObject(
            "a", "Car", "car", 1.75, 60.0, 0.0, width, 4.5, velocity=None if speed is None else (0.0, speed)
        )
        # in a recording of its own, so that no motion follows from the others
        labels.append(Label(f"{at}", f"r{at:02}", at, "street", ego, (other,)))
    recordings = [Recording(label.recording, "street", (label,)) for label in labels]
    write_dataset(tmp_path / "d", recordings, {"street": STREET.features}, name="d")
    dataset, decided = open_dataset(tmp_path / "d"), Counter()
    for seed in range(30):
        rng = random.Random(seed)

        def number(depth, rng=rng):
            if not depth or rng.random() < 0.3:
                return rng.choice(["other.speed", "other.width", "ego.speed", "(distance to other)", "0", "1", "2"])
            one, two = number(depth - 1), number(depth - 1)
            ways = [f"({one} + {two})", f"({one} - {two})", f"({one} * {two})", f"max({one}, {two})", f"abs({one})"]
            return rng.choice([*ways, f"min({one}, {two})"])

        def truth(depth, rng=rng, number=number):
            if not depth:
                return f"({number(2)} {rng.choice('<>')} {number(1)})"
            one, two = truth(depth - 1), truth(depth - 1)
            return rng.choice([f"({one} and {two})", f"({one} or {two})", f"(not {one})"])

        try:
            speed = rng.choice(["", ", with speed Range(0, 2)"])
            plan, matcher = plan_of(f"{CAR}{speed}\nrequire {truth(2)}", OPTIONS["default"])
        except ScenarioError:
            continue  # it never or always holds
        sure = set(sure_frames(dataset, plan)[0]) if plan.decision else set()
        for label, lacks in zip(labels, lacking, strict=True):
            if label.frame in sure:
                assert isinstance(matcher.match(label), Match), (plan.decision, label)
                decided[None in lacks] += 1
    assert decided[False] > 40
    assert decided[True] > 40
