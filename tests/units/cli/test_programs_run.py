"""`--scenario` and `--param`: which scenario of a program runs, and values of its parameters."""

import json

import pytest

import scenicq

PROGRAM = """
param gap = 3, what = 'car'
scenario Near():
    setup:
        ego = new Object at (0, globalParameters.gap)
scenario Far():
    setup:
        ego = new Object at (0, 10 * globalParameters.gap)
        param word = globalParameters.what
"""
TAKES = ("check", "sample")


@pytest.fixture
def program(tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(PROGRAM, encoding="utf-8")
    return file


def place(done):
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout.splitlines()[0])["ego"]["position"][1]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--scenario", "Near"), 3),
        (("--scenario", "Far"), 30),
        (("--scenario", "Near", "-p", "gap", "5"), 5),
        (("--scenario", "Far", "--param", "gap", "0.5", "-p", "what", "van"), 5),
    ],
)
def test_what_runs_and_with_what(words, expected, program, run):
    assert place(run("sample", program, *words, "--waive", "visibility,containment")) == expected


def test_a_text_is_a_number_where_it_is_one(program, run):
    for text, shown in (("van", '"van"'), ("7", "7"), ("1e3", "1000"), ("nan", '"nan"')):
        done = run("check", program, "--scenario", "Far", "-p", "what", text, "--forest")
        assert done.exit_code == 0, done.stderr
        assert shown in done.stdout or shown.strip('"') in done.stdout, done.stdout


@pytest.mark.parametrize("command", TAKES)
def test_it_must_be_clear_which_scenario_runs(command, program, run):
    done = run(command, program)
    assert done.exit_code == 2
    assert "it is not clear which scenario runs" in done.stderr
    done = run(command, program, "--scenario", "Nearer")
    assert done.exit_code == 2
    assert "has no scenario `Nearer`" in done.stderr
    assert "`Near`" in done.stderr


def test_match_explain_and_python_take_the_same(crossroads, run, tmp_path):
    file = tmp_path / "p.scenic"
    text = "\n".join([
        "model scenic.domains.driving.model", "param most = 5", "scenario Any():", "    ego = new Car",
        "scenario Two():", "    ego = new Car",
        "    other = new Car",
        "    require (distance from ego to other) < globalParameters.most",
    ])  # fmt: skip
    file.write_text(f"{text}\n", encoding="utf-8")
    words = ("--scenario", "Two", "-p", "most", "30")
    ids = run("match", file, crossroads, *words, "--format", "ids").stdout.split()
    fewer = run("match", file, crossroads, "--scenario", "Two", "--format", "ids", "--exit-zero").stdout.split()
    assert set(fewer) < set(ids)
    found = scenicq.open(crossroads).match(file, run_scenario="Two", params={"most": 30})
    assert [each.frame for each in found] == ids
    first = next(each for each in ids if each not in fewer)
    assert run("explain", file, crossroads, first, *words).exit_code == 0
    assert run("explain", file, crossroads, first, "--scenario", "Two").exit_code == 1
