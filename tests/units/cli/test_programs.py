"""Programs that are no file: standard input, and text on the command line."""

import json

import pytest
from click.testing import CliRunner

from scenicq_cli.main import cli

PEDESTRIAN = "ego = new Car; new Pedestrian at ego offset by Range(-10, 10) @ Range(0, 20)"


def fed(text, *arguments):
    return CliRunner().invoke(cli, [str(argument) for argument in arguments], input=text)


def test_standard_input_is_a_program_for_every_command(run, crossroads, scenarios):
    file = scenarios / "02_crossing_cars.scenic"
    text = file.read_text(encoding="utf-8")
    frame = "03-busy-intersection/09"
    for before, after in (
        (["match"], [crossroads, "--format", "ids"]),
        (["check"], [crossroads]),
        (["explain"], [crossroads, frame]),
        (["sample"], [crossroads, "-n", "2"]),
        (["show", crossroads, frame, "--scenario"], []),
    ):
        expected = run(*before, file, *after)
        found = fed(text, *before, "-", *after)
        assert (found.exit_code, found.stderr) == (expected.exit_code, expected.stderr), before
        assert found.stdout.replace("<stdin>", str(file)).split() == expected.stdout.split(), before


def test_a_mistake_on_standard_input_has_its_place(crossroads):
    found = fed("model scenic.domains.driving.model\nego = new Caar\n", "match", "-", crossroads)
    assert found.exit_code == 2
    assert "--> <stdin>:2:11" in found.stderr
    assert fed(b"\xff\xfe", "match", "-", crossroads).stderr.startswith("error[file-invalid]")


def test_a_program_on_the_command_line_has_the_driving_model(run, crossroads, tmp_path):
    file = tmp_path / "same.scenic"
    file.write_text("model scenic.domains.driving.model\n" + PEDESTRIAN.replace("; ", "\n") + "\n")
    found = run("match", "-e", PEDESTRIAN, crossroads, "--tolerance", "position=1")
    expected = run("match", file, crossroads, "--tolerance", "position=1")
    frames = [json.loads(line)["frame"] for line in found.stdout.splitlines()]
    assert frames == [json.loads(line)["frame"] for line in expected.stdout.splitlines()]
    assert frames


def test_every_command_takes_a_program_on_the_command_line(run, crossroads, tmp_path):
    file, frame = tmp_path / "same.scenic", "03-busy-intersection/09"
    text = f"model scenic.domains.driving.model; {PEDESTRIAN}"
    file.write_text(text)
    for command, *others in (
        ("match", crossroads, "--format", "ids"),
        ("check",),
        ("check", crossroads),
        ("explain", crossroads, frame, "--exit-zero"),
        ("sample", "-n", "2"),
        ("sample", crossroads, "-n", "2"),
    ):
        expected, found = run(command, file, *others), run(command, "-e", text, *others)
        assert (found.exit_code, found.stderr) == (expected.exit_code, expected.stderr), command
        assert found.stdout.replace("<program>", str(file)).split() == expected.stdout.split(), command
        modelled = run(command, "-e", PEDESTRIAN, *others)
        assert (modelled.exit_code, modelled.stderr) == (expected.exit_code, expected.stderr), command


@pytest.mark.parametrize("line", ["from math import sin", "import math", "import math as m", "from math import *"])
@pytest.mark.one_in(2)
def test_modules_of_python_bring_no_model(run, crossroads, line):
    """The driving model stays for what imports only them, in every command."""
    for command, *others in (
        ("match", crossroads, "--format", "ids"),
        ("check",),
        ("explain", crossroads, "03-busy-intersection/09", "--exit-zero"),
        ("sample", "-n", "2"),
    ):
        expected = run(command, "-e", f"model scenic.domains.driving.model\n{PEDESTRIAN}", *others)
        found = run(command, "-e", f"{line}\n{PEDESTRIAN}", *others)
        assert (found.exit_code, found.stderr) == (expected.exit_code, expected.stderr), command
        assert found.stdout.replace(line, "model scenic.domains.driving.model") == expected.stdout, command


def test_what_cannot_be_meant_is_told_whole_of_a_program_that_is_no_file(run, crossroads, tmp_path):
    """No other command can be given it, so that none is advised."""
    text = "ego = new Car; new Pedestrian ahead of ego by Range(9, 5)"
    for found in (
        run("match", "-e", text, crossroads),
        fed(f"model scenic.domains.driving.model\n{text}\n", "match", "-", crossroads),
    ):
        assert "warning[range-reversed]: this `Range` ends before it starts\n" in found.stderr
        assert "  = hint: write `5, 9`\n" in found.stderr
        assert "scenicq check" not in found.stderr
    file = tmp_path / "p.scenic"
    file.write_text(f"model scenic.domains.driving.model\n{text}\n")
    assert f"  = hint: `scenicq check {file}` says what to write\n" in run("match", file, crossroads).stderr


def test_a_model_of_its_own_is_not_replaced(run, crossroads):
    found = run("match", "-e", "model scenic.simulators.carla.model; ego = new Car", crossroads)
    assert found.exit_code == 0
    assert run("match", "-e", "import nowhere; ego = new Car", crossroads).stderr.startswith("error[unknown-model]")


def test_shards_and_resumed_runs_take_it_too(run, crossroads, tmp_path):
    alone = run("match", "-e", PEDESTRIAN, crossroads, "--tolerance", "position=1")
    for number in (1, 2):
        shard = run("match", "-e", PEDESTRIAN, crossroads, "--tolerance", "position=1", "--shard", f"{number}/2", "-o",
                    tmp_path / "pieces", "--exit-zero")  # fmt: skip
        assert shard.exit_code == 0, shard.stderr
    assert run("gather", tmp_path / "pieces").stdout == alone.stdout
    resumed = run("match", "-e", PEDESTRIAN, crossroads, "--tolerance", "position=1", "--resume", "-o",
                  tmp_path / "all.jsonl")  # fmt: skip
    assert resumed.exit_code == 0
    assert (tmp_path / "all.jsonl").read_text(encoding="utf-8") == alone.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["match", "-e", "ego = new Car", "one", "two"], "`one` is one argument too many"),
        (["match", "-e", "ego = new Car"], "Missing argument 'DATASET'"),
        (["match", "only.scenic"], "Missing argument 'DATASET'"),
        (["match"], "Missing argument 'SCENARIO'"),
        (["check", "-e", "ego = new Car", "one", "two"], "`one` is one argument too many"),
        (["check"], "Missing argument 'SCENARIO'"),
        (["sample"], "Missing argument 'SCENARIO'"),
        (["explain", "-e", "ego = new Car", "one", "two", "three"], "`one` is one argument too many"),
        (["explain", "-e", "ego = new Car", "one"], "Missing argument 'FRAME'"),
        (["explain", "one.scenic", "two"], "Missing argument 'FRAME'"),
        (["explain", "one.scenic"], "Missing argument 'DATASET'"),
    ],
)
def test_missing_and_superfluous_arguments_are_told(run, arguments, message):
    found = run(*arguments)
    assert found.exit_code == 2
    assert message in found.stderr
