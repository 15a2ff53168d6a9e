"""What the commands say of first drafts, word for word, over the sample data."""

from __future__ import annotations

import re

import pytest

CROSSING = "02_crossing_cars.scenic"
SLIPS = """model scenic.domains.driving.model
ego = new Car
other = new Car facing 90
lorry = new Truck with width 9, with length 300
spare = 3
new Bicycle ahead of ego by Range(10, 5)
require lorry in road
require other.speed == 0
require (distance from ego to other) >= 0
require ego.position.x > 100000
require abs(relative heading of other) < 30
new Car with spede 3
"""
NEVER = """model scenic.domains.driving.model
ego = new Car on road
other = new Car on road, with spede Range(50, 60), with passengers 2, with speed Range(0, 20)
"""
EMPTY = """model scenic.domains.driving.model
roadway = network.laneRegion.union(network.intersectionRegion)
ego = new Car on roadway
walker = new Pedestrian on sidewalk, facing Range(0, 360) deg
require (distance to walker) < 2
"""
BOTH = """model scenic.domains.driving.model
ego = new Car on road
other = new Car ahead of ego by Range(4, 10), facing Range(40, 60) deg relative to ego.heading
"""
BESIDE = """model scenic.domains.driving.model
ego = new Car on road
bike = new Bicycle right of ego by Range(0, 2)
require bike.speed > 5
"""


@pytest.fixture
def said(run, crossroads, scenarios, tmp_path, monkeypatch):
    """What a command says of a program that stands in the working folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / CROSSING).write_text((scenarios / CROSSING).read_text())

    def ask(command, program, *args, text=""):
        if text:
            (tmp_path / program).write_text(text)
        done = run(command, program, crossroads, *args)
        told = re.sub(r"in [\d.]+ s$", "in ... s", f"{done.stderr}{done.stdout}", flags=re.MULTILINE)
        return f"$ {' '.join(('scenicq', command, program, 'town', *args))}\n{told}exit code {done.exit_code}\n\n"

    return ask


def test_what_is_never_compared(said, golden):
    """Matching, explaining and checking name it; with `--strict` it is an error."""
    match = ("match", "never.scenic", "--format", "ids", "--limit", "3")
    golden(
        said(*match, text=NEVER)
        + said(*match, "--strict")
        + said("check", "never.scenic")
        + said("explain", "never.scenic", "05-two-lane-traffic/00")
    )


def test_tolerances_in_the_summary(said, golden):
    """The default, one of the programs' own scopes, and that of generated labels."""
    match = ("match", CROSSING, "--format", "ids", "--summary", "--jobs", "1")
    scoped = "leftward.position=0.5,Car.heading=15deg,speed=0.5"
    golden(said(*match) + said(*match, "--tolerance", scoped) + said(*match, "--tolerance", "exact"))


@pytest.mark.slow
def test_separate_minima(said, golden):
    """The least tolerance of a frame; of two conditions what each alone needs, and both together."""
    golden(
        said("explain", CROSSING, "03-busy-intersection/08")
        + said("explain", CROSSING, "03-busy-intersection/05")
        + said("match", CROSSING, "--near", "3", "--format", "table")
    )


@pytest.mark.parametrize("frame", ["05", "08", "14", "16"])
@pytest.mark.parametrize("asked", ["position=0.25,heading=5deg", "exact"])
@pytest.mark.one_in(4)
def test_the_advised_tolerance_alone_is_enough(said, frame, asked):
    """What `explain` advises for a frame lets it in, of position alone, and a little less does not."""
    told = said("explain", CROSSING, f"03-busy-intersection/{frame}", "--tolerance", asked)
    advised = re.search(r"--tolerance position=([\d.]+)(,heading=0.06deg)?\n", told)
    assert advised
    assert (advised[2] is None) is (asked != "exact")
    for size, enough in ((float(advised[1]), True), (float(advised[1]) - 0.002, False)):
        tolerance = f"position={size:.3f}{advised[2] or ''}"
        found = said("match", CROSSING, "--format", "ids", "--tolerance", tolerance)
        assert (f"03-busy-intersection/{frame}\n" in found) is enough


def test_of_two_parts_that_are_needed_neither_is_wider_than_it_must_be(said):
    """Both are told, with what is least about them, and what each condition needs; with less of either it is none."""
    frame = "05-two-lane-traffic/00"
    told = said("explain", "both.scenic", frame, text=BOTH)
    assert "^ 3.60 m off\n" in told
    assert "allowed: 40.0 deg to 60.0 deg; 40.0 deg off\n" in told
    assert "it would match with --tolerance position=3.601,heading=40.01deg\n" in told
    assert "(no part of it is enough alone; of all that are, it has the least widest part, 20 deg being 1 m)\n" in told
    for tolerance, enough in (
        ("position=3.601,heading=40.01deg", True),
        ("position=3.598,heading=40.01deg", False),
        ("position=3.601,heading=39.98deg", False),
    ):
        found = said("match", "both.scenic", "--format", "ids", "--tolerance", tolerance)
        assert (f"\n{frame}\n" in found) is enough


@pytest.mark.slow
def test_advice(said, golden):
    """Single changes, two where none helps, and a line that was meant as an area."""
    golden(
        said("match", "empty.scenic", "--advise", text=EMPTY) + said("match", "beside.scenic", "--advise", text=BESIDE)
    )


def test_what_cannot_be_meant(said, golden):
    """Every warning of a program's text and of what it is on a map; coarse classes; missing commas."""
    comma = "model scenic.domains.driving.model\nego = new Car on road facing 5 deg\n"
    golden(
        said("check", "slips.scenic", text=SLIPS)
        + said("check", "slips.scenic", "--classes", "coarse")
        + said("check", "comma.scenic", text=comma)
    )


def test_an_explained_match(said, golden):
    """Every feature and requirement of a match with its values and what is to spare."""
    golden(said("explain", CROSSING, "03-busy-intersection/11"))


FIRST_DRAFTS = {
    "crosswalk": "new Pedestrian on crosswalk",
    "in front of": "other = new Car\nrequire other in front of ego",
    "lane beside": "new Car on ego.lane.leftLane",
    "absence": "require all([(distance from ego to each) > 20 for each in vehicles])",
    "velocity": "other = new Car\nrequire other.velocity > 5",
    "with above": "other = new Car with speed > 10",
    "no model": "",
    "beside": "other = new Car\nrequire (other is left of ego)",
    "function": "other = new Car\nrequire distance(ego, other) < 10",
    "turning": "other = new Car\nrequire other.yawRate > 0.2",
    "bicyclist": "new Bicyclist on road",
    "bike lane": "new Bicycle on bikeLane",
    "stop sign": "new StopSign",
    "parked": "other = new Car\nrequire other is parked",
    "self": "other = new Car facing (angle from self to ego)",
}


def test_names_that_people_expect(said, golden):
    """What is not Scenic's, with what is."""
    told = ""
    for name, lines in FIRST_DRAFTS.items():
        model = "model scenic.domains.driving.model\n" if lines else ""
        told += said("check", f"{name.replace(' ', '_')}.scenic", text=f"{model}ego = new Car on road\n{lines}\n")
    golden(told)


def test_classes_that_datasets_list_can_be_written(said):
    """Each class of the tree is one of the driving model's."""
    names = "Adult Child ConstructionWorker PoliceOfficer Stroller Wheelchair PersonalMobility ConstructionVehicle"
    for name in f"{names} EmergencyVehicle Ambulance PoliceCar FireEngine PushablePullable BicycleRack Animal".split():
        text = f"model scenic.domains.driving.model\nego = new Car\nother = new {name}\n"
        assert f"other: {name})" in said("check", "one.scenic", text=text)
