"""`scenicq check`."""

import json
from xml.etree import ElementTree

import pytest


@pytest.fixture
def mistake(tmp_path):
    file = tmp_path / "mistake.scenic"
    file.write_text("model scenic.domains.driving.model\nego = new Car facing roadDirecton\n")
    return file


def test_every_sample_is_sound_on_every_map(run, scenarios, crossroads):
    town = scenarios.parent / "crossroads" / "maps" / "crossroads.geojson"
    for file in sorted(scenarios.glob("*.scenic")):
        for extra in ([], [crossroads], ["--map", town]):
            result = run("check", file, *extra)
            assert (result.exit_code, result.stderr) == (0, "")
            assert result.stdout.startswith("ok on map ")


def test_it_says_how_the_scenario_is_read(run, scenarios, crossroads):
    told = run("check", scenarios / "02_crossing_cars.scenic", crossroads).stdout
    assert told == (
        "ok on map crossroads: 3 objects (ego: Car, leftward: Car, rightward: Car), 2 requirements, read as Scenic 3\n"
    )


def test_requirements_over_time_are_counted(run, crossroads):
    program = "ego = new Car; other = new Car; require always other.speed > 3; require ego.speed > 1"
    told = run("check", "-e", f"{program}; require eventually other.speed > 5", crossroads).stdout
    assert "1 requirement and 2 over time" in told


def test_a_mistake_is_shown_once(run, mistake, crossroads):
    result = run("check", mistake, crossroads)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("error[unknown-name]")
    assert result.stderr.count("error[") == 1


def test_json_gives_place_and_hints(run, mistake):
    result = run("check", mistake, "--format", "json")
    (found,) = json.loads(result.stdout)
    assert (result.exit_code, result.stderr) == (2, "")
    assert list(found) == [
        "code", "message", "severity", "file", "line", "column", "end_line", "end_column", "label", "notes", "hints",
    ]  # fmt: skip
    place = [found[key] for key in ("code", "severity", "file", "line", "column", "end_line", "end_column")]
    assert place == ["unknown-name", "error", str(mistake), 2, 22, 2, 34]
    assert any("roadDirection" in hint for hint in found["hints"])


def test_json_without_problems_is_an_empty_list(run, scenarios):
    assert json.loads(run("check", scenarios / "01_pedestrian_facing_ego.scenic", "--format", "json").stdout) == []


def test_a_version_that_does_not_fit_is_an_error(run, scenarios):
    file = scenarios / "01_pedestrian_facing_ego.scenic"
    result = run("check", file, "--scenic", "2")
    assert (result.exit_code, result.stderr.partition("\n")[0].partition(":")[0]) == (2, "error[parse-error]")
    assert run("check", file, "--scenic", "3").exit_code == 0
    assert run("check", file, "--scenic", "4").stderr.startswith("Usage:")


@pytest.mark.parametrize(
    ("args", "code"),
    [
        (["no.scenic"], "file-missing"),
        (["SCENARIO", "nowhere"], "store-missing"),
        (["SCENARIO", "--map", "no.geojson"], "file-missing"),
        (["SCENARIO", "--map", "SCENARIO"], "file-invalid"),
        (["SCENARIO", "DATASET", "--map", "SCENARIO"], "option-invalid"),
    ],
)
def test_bad_input_gives_one_diagnostic(run, scenarios, crossroads, args, code):
    names = {"SCENARIO": scenarios / "01_pedestrian_facing_ego.scenic", "DATASET": crossroads}
    words = [names.get(arg, arg) for arg in args]
    result = run("check", *words)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error[{code}]: ")
    (found,) = json.loads(run("check", *words, "--format", "json").stdout)
    assert (found["code"], found["line"]) == (code, None)


DRIVES = """model scenic.domains.driving.model
behavior Drives():
    while self.speed < 5:
        wait
    take SetBrakeAction(1)
    terminate
ego = new Car with behavior Drives()
"""


def test_modes_are_drawn(run, tmp_path):
    program, picture = tmp_path / "drives.scenic", tmp_path / "modes.svg"
    program.write_text(DRIVES, encoding="utf-8")
    told = run("check", program, "--modes", "--draw-modes", picture)
    assert told.exit_code == 0, told.output
    root = ElementTree.fromstring(picture.read_text(encoding="utf-8"))
    space = "{http://www.w3.org/2000/svg}"
    boxes = [each for each in root.iter(f"{space}rect") if each.get("class") == "box"]
    texts = ["".join(each.itertext()) for each in root.iter(f"{space}text")]
    # a box for each mode of the table, a row and a line for each way to a mode
    rows = [line for line in told.stdout.splitlines() if " -> " in line]
    assert len(boxes) == len(rows) == 3
    assert [each for each in texts if "[line" in each and each[0].isdigit()] == [
        "1  wait [line 4]", "2  take SetBrakeAction(1) [line 5]",
    ]  # fmt: skip
    ways = [way for row in rows for way in row.split(" -> ")[1].split("; ")]
    assert [text.removeprefix("\N{RIGHTWARDS ARROW} ") for text in texts if text[0] == "\N{RIGHTWARDS ARROW}"] == ways
    lines = [each for each in root.iter(f"{space}path") if each.get("class") == "way"]
    assert len(lines) == sum(way[0].isdigit() for way in ways)


def test_modes_are_drawn_as_svg_alone(run, tmp_path):
    done = run("check", "-e", "ego = new Object", "--draw-modes", tmp_path / "modes.png")
    assert done.exit_code == 2
    assert "modes are drawn as SVG" in done.stderr
    assert not list(tmp_path.iterdir())
