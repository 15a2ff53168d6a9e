"""What the commands advise is enough, and what they list can be written."""

from __future__ import annotations

import re

import pytest

CROSSING = "02_crossing_cars.scenic"
BOTH = """model scenic.domains.driving.model
ego = new Car on road
other = new Car ahead of ego by Range(4, 10), facing Range(40, 60) deg relative to ego.heading
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


def test_classes_that_datasets_list_can_be_written(said):
    """Each class of the tree is one of the driving model's."""
    names = "Adult Child ConstructionWorker PoliceOfficer Stroller Wheelchair PersonalMobility ConstructionVehicle"
    for name in f"{names} EmergencyVehicle Ambulance PoliceCar FireEngine PushablePullable BicycleRack Animal".split():
        text = f"model scenic.domains.driving.model\nego = new Car\nother = new {name}\n"
        assert f"other: {name})" in said("check", "one.scenic", text=text)
