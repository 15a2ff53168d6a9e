"""`scenicq sample` and what `scenicq check` prints of a forest."""

from __future__ import annotations

import json


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


def test_a_hopeless_program_ends_with_a_reason(run, tmp_path):
    program = tmp_path / "hopeless.scenic"
    program.write_text("ego = new Object at (Range(0, 1), 0)\nrequire ego.position.x > 0.9999999\n")
    found = run("sample", program)
    assert found.exit_code == 2
    assert "impossible-requirement" in found.stderr
    assert "hopeless.scenic:2" in found.stderr


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
