"""Every option and argument that takes a path, as click declares it, given an address: it is used or refused.

`s3://bucket/x` was a folder named `s3:` on this machine, without a word.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

from scenicq.importers.ingest import ingest
from scenicq_cli.main import COMMANDS, cli
from scenicq_cli.manual import variable_of

pytest.importorskip("s3fs", reason="scenicq[s3] is not installed")

ROOT = Path(__file__).parents[3]
SAMPLES = ROOT / "sample_data"
PROGRAM = SAMPLES / "scenarios" / "02_crossing_cars.scenic"
FRAME = "03-busy-intersection/09"
PLACE = "s3://fleet/paths"

BASE: dict[str, tuple[object, ...]] = {
    "match": (PROGRAM, "TOWN"),
    "gather": ("PIECES",),
    "explain": (PROGRAM, "TOWN", FRAME),
    "show": ("TOWN", FRAME),
    "sample": (PROGRAM,),
    "check": (PROGRAM, "TOWN"),
    "evaluate": ("RESULTS", "STREET", "--predictions", SAMPLES / "parked" / "predictions.jsonl"),
    "report": ("RESULTS", "RESULTS"),
    "ingest": (SAMPLES / "crossroads", "new"),
    "info": ("TOWN",),
    "index": ("TOWN",),
}
"""Arguments with which each command succeeds."""
ENDINGS = {("match", "output"): "found.jsonl", ("gather", "output"): "found.csv", ("show", "output"): "frame.svg",
           ("evaluate", "output"): "figures.json", ("report", "output"): "changes.html"}  # fmt: skip
WRITTEN = {
    "match-output", "match-export", "match-report", "gather-output", "gather-export", "gather-report",
    "explain-smt2", "show-output", "sample-output", "evaluate-output", "evaluate-report", "report-output",
    "ingest-dataset",
}  # fmt: skip
"""What is written elsewhere; all else reads."""
READ = {
    "match-dataset", "gather-folder", "explain-dataset", "show-dataset", "sample-dataset", "check-dataset",
    "evaluate-results", "evaluate-dataset", "report-before", "report-after", "info-dataset",
}  # fmt: skip
"""What is read elsewhere: only what lacks there is told."""


def paths() -> Iterator[tuple[str, click.Command, click.Parameter]]:
    """Every option and argument whose type or metavariable says that it is a path."""
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        for each in command.params:
            kinds = each.type.types if isinstance(each.type, click.Tuple) else [each.type]
            words = set((each.metavar or "").replace("[", " ").replace("]", " ").replace(".", " ").split())
            if any(kind.name in ("path", "file", "directory") for kind in kinds) or words & {"FILE", "DIR", "FOLDER"}:
                yield name, command, each


ALL = [pytest.param(*each, id=f"{each[0]}-{each[2].name}") for each in paths()]


def test_the_lists_name_what_there_is() -> None:
    assert {each.id for each in ALL} >= WRITTEN | READ
    assert not WRITTEN & READ
    assert {each.values[0] for each in ALL} == BASE.keys()


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory, crossroads: Path) -> dict[str, Path]:
    """What `BASE` names."""
    from click.testing import CliRunner

    folder = tmp_path_factory.mktemp("given")
    shutil.copytree(crossroads, folder / "town")
    ingest(SAMPLES / "parked", folder / "street")
    parked = ["match", str(SAMPLES / "parked" / "parked_car.scenic"), str(folder / "street"), "--all-matches"]
    crossing = ["match", str(PROGRAM), str(folder / "town"), "--exit-zero"]
    assert CliRunner().invoke(cli, [*parked, "-o", str(folder / "r.jsonl")]).exit_code == 0
    assert CliRunner().invoke(cli, [*crossing, "--shard", "1/1", "-o", str(folder / "pieces")]).exit_code == 0
    return {"TOWN": folder / "town", "STREET": folder / "street", "PIECES": folder / "pieces",
            "RESULTS": folder / "r.jsonl"}  # fmt: skip


def word_of(name: str, parameter: click.Parameter) -> str:
    return f"{PLACE}/{ENDINGS.get((name, str(parameter.name)), 'x y')}"


@pytest.mark.parametrize("by_variable", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "command", "parameter"), ALL)
def test_an_address_is_used_or_refused(
    name: str, command: click.Command, parameter: click.Parameter, by_variable: bool, given: dict[str, Path],
    bucket: Any, run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    words = [given.get(str(each), each) for each in BASE[name]]
    address, environment = word_of(name, parameter), None
    if isinstance(parameter, click.Argument):
        if by_variable:
            pytest.skip("arguments have no variables")
        arguments = [each for each in command.params if isinstance(each, click.Argument)]
        place = arguments.index(parameter)
        words[place : place + 1] = [address]
    else:
        if parameter.opts[0] in words:
            place = words.index(parameter.opts[0])
            del words[place : place + 2]
        value = ["paths", address] if isinstance(parameter.type, click.Tuple) else [address]
        if by_variable:
            environment = {variable_of(command, parameter): " ".join(value).replace("x y", "xy")}
            address = address.replace("x y", "xy")
        else:
            words += [parameter.opts[-1], *value]
    done = run(name, *words, *(["--exit-zero"] if name == "match" else []), env=environment)
    label = f"{name}-{parameter.name}"
    bucket.invalidate_cache()
    found = bucket.find("fleet/paths")
    if label in WRITTEN:
        assert done.exit_code == 0, done.output
        below = address.removeprefix("s3://")
        assert [each for each in found if each == below or each.startswith(f"{below}/")]
    else:
        assert done.exit_code == 2, done.output
        assert done.stdout == ""
        last = done.stderr.splitlines()[-1]
        assert done.stderr.count("error[") + last.startswith("Error: ") == 1, done.stderr
        assert address in done.stderr
        assert not found
        if label not in READ | {"index-dataset"}:
            assert "lies elsewhere" in done.stderr
            assert "copy it to a folder of this machine" in done.stderr
    for each in found:
        bucket.rm_file(each)
    assert not [each for each in tmp_path.rglob("*") if ":" in each.name]


def test_python_writes_elsewhere_too(given: dict[str, Path], bucket: Any, tmp_path: Path, monkeypatch: Any) -> None:
    import scenicq
    from scenicq.errors import DataError

    monkeypatch.chdir(tmp_path)
    found = scenicq.open(given["TOWN"]).match(PROGRAM)
    found.report(f"{PLACE}/report")
    found.show(FRAME).save(f"{PLACE}/frame.svg")
    bucket.invalidate_cache()
    assert {"fleet/paths/frame.svg", "fleet/paths/report/index.html"} <= {*bucket.find("fleet/paths")}
    for each in (f"{PLACE}/town", "s3:/fleet/town"):
        with pytest.raises(DataError, match="begins as an address does") as error:
            ingest(SAMPLES / "crossroads", each)
        assert error.value.diagnostics[0].code == "target-unwritable"
    assert not list(tmp_path.iterdir())
