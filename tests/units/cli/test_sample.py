"""`scenicq sample` and what `scenicq check` prints of a forest."""

from __future__ import annotations

import json
import math
import re

import pytest


def test_the_same_seed_gives_the_same_scenes(run, scenarios):
    program = scenarios / "02_crossing_cars.scenic"
    first, again, other = (run("sample", program, "-n", 3, "--seed", seed) for seed in (1, 1, 2))
    assert first.exit_code == 0, first.stderr
    assert first.stdout == again.stdout != other.stdout
    labels = [json.loads(line) for line in first.stdout.splitlines()]
    assert [{each["id"] for each in label["objects"]} for label in labels] == [{"leftward", "rightward"}] * 3


def test_drawn_scenes_can_be_ingested_and_all_match(run, scenarios, crossroads, tmp_path):
    for name in ("01_pedestrian_facing_ego", "02_crossing_cars", "04_two_lane_traffic"):
        program = scenarios / f"{name}.scenic"
        drawn = run("sample", program, crossroads, "-n", 10, "-o", tmp_path / name)
        assert drawn.exit_code == 0, drawn.stderr
        assert run("ingest", tmp_path / name, tmp_path / f"{name}-set").exit_code == 0
        found = run("match", program, tmp_path / f"{name}-set", "--format", "ids")
        assert len(found.stdout.splitlines()) == 10, found.stderr


@pytest.mark.slow
def test_the_installed_command_draws_what_it_finds_again(installed, scenarios, tmp_path):
    program = scenarios / "04_two_lane_traffic.scenic"
    drawn = installed("sample", program, "-n", 6, "--seed", 3, "-o", "scenes", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
    assert installed("ingest", "scenes", "set", cwd=tmp_path).returncode == 0
    found = installed("match", program, "set", "--enforce", "containment,collision", "--format", "ids", cwd=tmp_path)
    assert found.stdout.splitlines() == [f"scene-{number:04}" for number in range(6)], found.stderr


def test_a_label_has_sizes_classes_velocities_and_what_the_program_sets(run, tmp_path):
    program = tmp_path / "fast.scenic"
    program.write_text(
        "model scenic.domains.driving.model\nparam weather = Uniform('rain', 'fog')\nego = new Car with speed 3\n"
        "new Pedestrian on road, with length Range(1, 2), with height 1.7, with clothes 'red', "
        "with regionContainedIn None\n"
    )
    found = run("sample", program, "-n", 4)
    assert found.exit_code == 0, found.stderr
    for label in map(json.loads, found.stdout.splitlines()):
        (walker,) = label["objects"]
        assert math.hypot(*label["ego"]["velocity"]) == pytest.approx(3)
        assert (label["ego"]["class"], label["ego"]["width"], label["ego"]["length"]) == ("Car", 2, 4.5)
        assert (walker["class"], walker["height"], walker["attributes"]) == ("Pedestrian", 1.7, {"clothes": "red"})
        assert 1 <= walker["length"] <= 2
        assert label["params"]["weather"] in ("rain", "fog")


def test_a_hopeless_program_ends_with_the_requirement_that_rejects_most(run, tmp_path):
    program = tmp_path / "hopeless.scenic"
    program.write_text(
        "ego = new Object at (Range(0, 1), 0)\nrequire ego.position.x > 0.2\nrequire ego.position.x > 0.9999999\n"
    )
    found = run("sample", program)
    assert found.exit_code == 2
    assert "impossible-requirement" in found.stderr
    assert "hopeless.scenic:3" in found.stderr
    assert "no scene came up on map `street` in 20,000 attempts" in found.stderr
    assert re.search(r"`require ego.position.x > 0.9999999` failed in 1[0-9],[0-9]{3} of them", found.stderr)
    assert re.search(r"`require ego.position.x > 0.2` failed [34],[0-9]{3} times", found.stderr)


def test_a_built_in_requirement_can_be_waived(run, tmp_path):
    program = tmp_path / "overlapping.scenic"
    program.write_text("ego = new Object at (0, 0)\nnew Object at (0.5, 0)\n")
    found = run("sample", program)
    assert found.exit_code == 2
    assert "`--waive collision`" in found.stderr
    assert run("sample", program, "--waive", "collision").exit_code == 0
    wrong = run("sample", program, "--waive", "gravity")
    assert wrong.exit_code == 2
    assert "option-invalid" in wrong.stderr


def test_an_existing_folder_is_left_alone(run, scenarios, tmp_path):
    found = run("sample", scenarios / "02_crossing_cars.scenic", "-o", tmp_path)
    assert found.exit_code == 2
    assert "target-exists" in found.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_forest_and_its_groups_are_shown(run, tmp_path):
    program = tmp_path / "joint.scenic"
    program.write_text(
        "ego = new Object at (0, 0)\ngap = Range(1, 2)\n"
        "left = new Object at (-3, gap), with requireVisible False\n"
        "right = new Object at (3, gap), with requireVisible False\n"
    )
    forest = run("check", program, "--forest").stdout
    assert "left.position = VectorOf(-3, #1:Range(1, 2))" in forest
    assert "right.position = VectorOf(3, #1" in forest
    groups = run("check", program, "--groups").stdout
    assert "left.position, right.position" in groups
    assert "1. ego.position" in groups


@pytest.mark.slow
def test_what_geometry_cannot_tell_is_said_not_counted_as_no_scene(run, tmp_path):
    program = tmp_path / "endless.scenic"
    program.write_text(
        "ego = new Object at (Range(0, 1), 0)\n"
        "here = everywhere.difference(everywhere.difference(CircularRegion(ego.position, 1)))\n"
        "there = everywhere.difference(everywhere.difference(CircularRegion((9, 9), 1)))\n"
        "require here.intersects(there)\n"
    )
    found = run("sample", program)
    assert found.exit_code == 2
    assert "it cannot be told whether" in found.stderr
    assert "internal error" not in found.stderr


def test_boxes_are_told_to_be_in_regions_of_every_kind(run, tmp_path):
    program = tmp_path / "regions.scenic"
    program.write_text(
        "ego = new Object at (Range(-3, 3), Range(-3, 3))\n"
        "require ego in SectorRegion((0, 0), 4, 0, 90 deg)\n"
        "require not (ego in nowhere)\n"
        "require ego in CircularRegion((0, 0), 5).difference(CircularRegion((0, 2), 0.2))\n"
    )
    found = run("sample", program, "-n", 20)
    assert found.exit_code == 0, found.stderr
    places = [json.loads(line)["ego"]["position"] for line in found.stdout.splitlines()]
    assert all(y > 1.0 and abs(x) < y for x, y in places)
    assert all(max(abs(x), abs(y - 2)) > 0.5 for x, y in places)


@pytest.mark.parametrize(
    "line",
    [
        "require ego.position.x > 1.5 or ego.position.x * ego.position.x > 2",
        "new Object on CircularRegion((0, 0), 1).intersect(CircularRegion((ego.position.x + 1.9999, 0), 1))",
    ],
)
def test_a_scene_that_takes_long_ends_by_name(run, tmp_path, line):
    program = tmp_path / "long.scenic"
    program.write_text(f"ego = new Object at (Range(0, 1), 0)\n{line}\n")
    found = run("sample", program, "--timeout", "1e-9")
    assert found.exit_code == 2
    assert "error[deadline-passed]" in found.stderr
    assert "no scene came up on map `street` in 1e-09 s" in found.stderr
    assert "`--timeout`" in found.stderr
