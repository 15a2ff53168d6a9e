"""Every option of every command, as click declares it: bad values, variables of the environment, words of Python."""

from __future__ import annotations

import itertools
import math
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

import scenicq
from scenicq.errors import ScenicqError
from scenicq.evaluate.evaluation_options import EVALUATION_OPTIONS
from scenicq.option_values import Amount, Count, Flag, OneOf, OptionKind, Text, read_option
from scenicq.query.execution.option_texts import QUERY_OPTIONS, read_options
from scenicq.query.execution.run import QueryOptions
from scenicq_cli.main import COMMANDS, cli
from scenicq_cli.manual import variable_of
from scenicq_cli.option_type import OptionType

BAD_NUMBERS = [
    "nan", "NaN", "inf", "-inf", "Infinity", "1e308", "-1e308", "1e400", "-1", "-0.5", "-7s", "", " ", "x", "0x10",
    "1,5", "1/2", "ten", "5 parsecs", "5mm2", "9" * 30, "9" * 5000, "5m5", "s", "m", "min", "1;2", "\u0661x", "1e",
    "--", "None", "True", "[]", "1 2", "5 min s", "1s s",
]  # fmt: skip
"""Texts none of which every number takes."""
NEEDED = {"predictions": "missing.json"}
FITTING = {
    "shard": "1/2", "engine": "dask", "export": "paths out", "enforce": "none", "waive": "collision", "sensors": ".",
    "maps": "a.geojson", "params": "weather rain", "drawing": "modes.svg",
    "tolerance": "0.3", "margin": "0.1", "distance_m": "1", "program": "ego = new Car", "format_": "nuscenes",
}  # fmt: skip
"""Values of options whose kind is not told by their type."""


def options() -> Iterator[tuple[str, click.Command, click.Option]]:
    """Every option of every command."""
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        for each in command.params:
            if isinstance(each, click.Option):
                yield name, command, each


ALL = [pytest.param(*each, id=f"{each[0]}-{each[2].name}") for each in options()]
TYPED = [each for each in ALL if isinstance(each.values[2].type, OptionType | click.Choice)]


def texts_of(option: click.Option) -> list[str]:
    """Texts that an option does not take."""
    assert isinstance(option.type, OptionType | click.Choice)
    if isinstance(option.type, click.Choice):
        return [
            each for each in (*BAD_NUMBERS, "bogus", f"{option.type.choices[0]}x") if each not in option.type.choices
        ]
    found: list[str] = []
    for text in BAD_NUMBERS:
        try:
            value = option.type.kind.read(text)
        except (ValueError, OverflowError):
            found.append(text)
        else:
            assert math.isfinite(value), text
    return found


def words(command: click.Command, option: click.Option | None, value: list[str]) -> list[str]:
    """A command line that is whole but for what an option is given."""
    required = [
        each for each in command.params if isinstance(each, click.Option) and each.required and each is not option
    ]
    given = [word for each in required for word in (each.opts[0], NEEDED[each.name or ""])]
    names = [each.name for each in command.params if isinstance(each, click.Argument)]
    return [*given, *([option.opts[-1], *value] if option else []), "--", *(f"no-{name}" for name in names)]


@pytest.mark.parametrize(("name", "command", "option"), TYPED)
@pytest.mark.one_in(3)
def test_a_bad_value_is_one_line_and_nothing_is_done(name, command, option, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for text in texts_of(option):
        if text.startswith("-"):
            continue  # click takes it for an option where it is a word of its own
        done = run(name, *words(command, option, [text]))
        assert done.exit_code == 2, (text, done.output)
        last = done.stderr.splitlines()[-1]
        assert last.startswith("Error: Invalid value for "), (text, done.stderr)
        assert f"'{option.opts[-1]}'" in last
        assert done.stdout == ""
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "command", "option"), TYPED)
@pytest.mark.one_in(3)
def test_a_bad_value_of_a_variable_is_refused_likewise(name, command, option, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bad = [text for text in texts_of(option) if text.strip()]  # an empty variable is none
    assert bad
    for text in bad:
        done = run(name, *words(command, None, []), env={variable_of(command, option): text})
        assert done.exit_code == 2, (text, done.output)
        assert done.stderr.splitlines()[-1].startswith("Error: Invalid value for "), (text, done.stderr)
    assert not any(tmp_path.iterdir())


def test_all_numbers_are_read_by_one_table():
    of_click = (click.types.IntParamType, click.types.FloatParamType)
    assert [each.id for each in ALL if isinstance(each.values[2].type, of_click)] == []


@pytest.mark.parametrize(("name", "command", "option"), ALL)
def test_every_option_has_a_variable_with_the_name_that_people_write(name, command, option, monkeypatch):
    if option.name == "help":
        return
    long = next((each for each in option.opts if each.startswith("--")), f"--{option.name}")
    variable = f"SCENICQ_{name}_{long.removeprefix('--')}".upper().replace("-", "_")
    kind = option.type
    if option.is_flag:
        value = "0" if option.default is True else "1"
    elif isinstance(kind, click.Choice):
        value = kind.choices[-1]
    else:
        value = FITTING.get(option.name, "60" if isinstance(kind, OptionType) else "some-name")
    monkeypatch.setenv(variable, value)
    given = words(command, None, [])
    if option.required:
        given = [each for each in given if each not in (option.opts[0], NEEDED[option.name])]
    context = command.make_context(name, given, parent=click.Context(cli, **cli.context_settings))
    assert context.get_parameter_source(option.name) is click.core.ParameterSource.ENVIRONMENT, variable


@pytest.mark.parametrize("variable", ["SCENICQ_VERSION", "SCENICQ_HELP", "SCENICQ_INFO_HELP"])
def test_no_variable_asks_for_help(variable, run, crossroads):
    assert run("info", crossroads, env={variable: "1"}).stdout == run("info", crossroads).stdout


class Odd:
    """A value of no kind."""


@pytest.mark.parametrize(
    ("command", "declared"), [("match", QUERY_OPTIONS), ("evaluate", EVALUATION_OPTIONS)], ids=["match", "evaluate"]
)
def test_what_is_declared_is_an_option_of_the_command_with_its_words(command, declared):
    found = {each.name: each for _, mine, each in options() if mine.name == command}
    for name, option in declared.items():
        if not option.help:
            assert name not in found
            continue
        assert found[name].help == option.help
        assert set(option.flags or (f"--{name.replace('_', '-')}",)) <= set(found[name].opts)
        if option.default is not None:  # what the help says is what Python takes where nothing is said
            assert found[name].default == option.default
            option.kind.read(option.default)


def test_the_defaults_of_the_command_are_those_of_python():
    command = cli.get_command(click.Context(cli), "match")
    texts = {each.name: each.default for each in command.params if each.name in QUERY_OPTIONS}
    texts = {name: value for name, value in texts.items() if value not in (None, ()) and not callable(value)}
    assert len(texts) > 10
    assert read_options(**texts) == read_options() == QueryOptions()


BAD_VALUES: list[Any] = [
    None, Odd(), [], {}, b"5", object, math.nan, math.inf, -math.inf, 1e308, -1, -1.0, 10**40, "nan", "bogus", "", (1,),
]  # fmt: skip


@pytest.mark.parametrize(("name", "kind"), [(name, each.kind) for name, each in QUERY_OPTIONS.items()])
@pytest.mark.one_in(3)
def test_python_refuses_what_the_command_refuses(
    name: str, kind: OptionKind, crossroads, scenarios, tmp_path, monkeypatch
):
    folder = shutil.copytree(crossroads, tmp_path / "dataset")
    before = sorted(folder.rglob("*"))
    dataset = scenicq.open(folder)
    refused = 0
    for value in BAD_VALUES:
        try:
            kind.read(value)
        except (ValueError, OverflowError):
            pass
        else:
            continue
        if value is None:
            continue  # the default of many
        refused += 1
        with pytest.raises(ScenicqError) as error:
            dataset.match(scenarios / "02_crossing_cars.scenic", **{name: value})
        assert f"`{name}`" in str(error.value)
    assert refused >= 5
    assert sorted(folder.rglob("*")) == before


def test_what_stands_for_no_value_is_refused_where_there_is_a_default(crossroads, scenarios):
    for name in ("timeout", "budget", "gap", "classes", "exact", "solver", "prefilter"):
        with pytest.raises(ScenicqError, match=f"`{name}`"):
            list(scenicq.open(crossroads).match(scenarios / "02_crossing_cars.scenic", **{name: None}))


@pytest.mark.parametrize(
    ("option", "text", "value"),
    [
        (("timeout", Amount("s")), "5min", 300.0), (("timeout", Amount("s")), "2h", 7200.0),
        (("timeout", Amount("s")), "250ms", 0.25), (("timeout", Amount("s")), " 1 s", 1.0),
        (("timeout", Amount("s")), 3, 3.0),
        (("radius", Amount("m")), "30m", 30.0), (("radius", Amount("m")), "0.5km", 500.0),
        (("radius", Amount("m")), "120cm", 1.2), (("limit", Count()), "7", 7), (("exact", Flag()), True, True),
        (("ego", OneOf(("label", "any"))), "any", "any"), (("tolerance", Text(numeric=True)), 0.25, "0.25"),
    ],
)  # fmt: skip
def test_a_number_is_read_with_its_unit(option: tuple[str, OptionKind], text: Any, value: Any):
    assert read_option(*option, text) == pytest.approx(value)


def test_the_same_question_in_words_and_in_numbers(run, crossroads, scenarios):
    program = scenarios / "02_crossing_cars.scenic"
    asked = run(
        "match", program, crossroads, "--format", "ids", "--radius", "0.05km", "--timeout", "1min"
    ).stdout.split()
    found = scenicq.open(crossroads).match(program, radius=50, timeout=60.0, tolerance=None)
    assert asked == [each.frame for each in found]
    assert asked


PYTHON = [
    lambda dataset: dataset.match(None), lambda dataset: dataset.match(5), lambda dataset: dataset[0],
    lambda dataset: dataset[None], lambda dataset: scenicq.open(None), lambda dataset: scenicq.open(7),
    lambda dataset: dataset.match("ego = new Car", limt=3),
    lambda dataset: dataset.match("ego = new Car", solver="bogus"),
    lambda dataset: dataset.match("ego = new Car").evaluate("p.json", seed=-1),
    lambda dataset: dataset.match("ego = new Car").evaluate("p.json", missing="bogus"),
    lambda dataset: dataset.match("ego = new Car").evaluate("p.json", least_score=math.nan),
    lambda dataset: dataset.match("ego = new Car").evaluate("p.json", distance_m=3),
    *(
        lambda dataset, name=name, value=value: next(iter(dataset)).show(**{name: value})
        for name, value in itertools.product(("half", "width"), (0, -1, math.nan, math.inf, 1e308, "x", []))
    ),
    lambda dataset: next(iter(dataset)).show().save("frame.jpg"),
    lambda dataset: next(iter(dataset)).show().save(os.path.join("no", "such", "folder", "frame.svg")),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(PYTHON)))
def test_python_says_what_is_wrong(number: int, crossroads: Path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenicqError):
        PYTHON[number](scenicq.open(crossroads))
    assert not any(tmp_path.iterdir())


def test_a_picture_is_what_its_name_says(crossroads, tmp_path):
    picture = next(iter(scenicq.open(crossroads))).show(half="30m", width=200)
    picture.save(tmp_path / "frame.svg")
    assert (tmp_path / "frame.svg").read_text().startswith("<svg")
    pytest.importorskip("resvg_py")
    picture.save(tmp_path / "frame.png")
    assert (tmp_path / "frame.png").read_bytes().startswith(b"\x89PNG")


def test_python_says_what_cannot_be_meant(crossroads):
    (told,) = scenicq.open(crossroads).match("ego = new Car facing 90").warnings
    assert "angle-without-deg" in told


ODD_TEXTS = [
    "", " ", "nan", "-", "//", "\\", "a=b=c", "=1", "1,,2", "x" * 3000, "None", "{}", "\u202e", "caf\u00e9\u0301", "*",
    "'", "s3:", "s3://", "://", "~nobody/x",
]  # fmt: skip
TEXTS = [each for each in ALL if each not in TYPED and not each.values[2].is_flag]
FLAGS = [each for each in ALL if each.values[2].is_flag and each.values[2].name not in ("help", "version")]


@pytest.mark.parametrize(("name", "command", "option"), TEXTS)
@pytest.mark.one_in(4)
def test_an_odd_text_is_told_and_nothing_is_done(name, command, option, run, tmp_path, monkeypatch):
    """Where the other arguments are wrong too, one thing is told, and no text is too odd for that."""
    monkeypatch.chdir(tmp_path)
    for text in ODD_TEXTS:
        for value in ([text] * option.nargs, None):
            given = words(command, option, value) if value else words(command, None, [])
            surroundings = {} if value else {variable_of(command, option): " ".join([text] * option.nargs)}
            done = run(name, *given, env=surroundings)
            assert done.exit_code == 2, (text, done.output)
            assert done.stderr.count("error[") + done.stderr.count("Error: ") == 1, (text, done.stderr)
            assert "internal error" not in done.stderr, (text, done.stderr)
            assert done.stdout == ""
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "command", "option"), FLAGS)
@pytest.mark.one_in(4)
def test_a_flag_is_no_other_word(name, command, option, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for text in ("maybe", "2", "nan", "-1", "[]", "tru e"):
        done = run(name, *words(command, None, []), env={variable_of(command, option): text})
        assert done.exit_code == 2, (text, done.output)
        assert done.stderr.splitlines()[-1].startswith("Error: Invalid value for "), (text, done.stderr)
    assert not any(tmp_path.iterdir())
