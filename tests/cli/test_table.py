"""The table of results: it fits the terminal, breaks no word, and names frames as other commands take them."""

import io
import itertools
import re

import click
import pytest

from scenicq.errors import DataError
from scenicq.store.dataset import open_dataset
from scenicq_cli.main import cli
from scenicq_cli.report import moment
from scenicq_cli.table import Table, TextStream, fitted

UUIDS = ("7fab2350-7eaf-3b7e-a39d-6937a4c1bede", "7fab9911-0510-35b0-a2fa-b4cea13a6d76")


def rows(count=12):
    for number in range(count):
        log = UUIDS[number % 2]
        yield (
            f"{log}/{315966253660357000 + number * 1000:018}", log, f"{315966253.66 + number:.2f} s",
            "no_match: would match with position=2.544,heading=50.91deg" if number % 3 else "match",
            f"leftward=1046f1{number:02}-152a-4e82-b61b-7546 rightward=f6964{number:02}a-b84b-4c1e-afcf-9023",
            f"val/{log}/sensors/lidar/{number}.feather",
        )  # fmt: skip


def dated(count=12):
    for number in range(count):
        yield (
            f"{number:032x}", f"scene-{number:04}", f"2018-09-18 17:43:{number:02}.41", "match",
            f"other={number + 7:08x}ac5adad2e28e23c6", "samples/CAM_FRONT/n008.jpg",
        )  # fmt: skip


@pytest.mark.parametrize(("width", "made"), list(itertools.product((80, 120), (rows, dated))))
def test_it_is_no_wider_than_the_terminal_and_breaks_no_word(width, made):
    table = list(made())
    lines = fitted(
        table, width, lambda frame: "/".join(part[-24:] if "/" not in frame else part[:8] for part in frame.split("/"))
    )
    assert max(map(len, lines)) <= width
    words = {word for line in lines for word in line.split()}
    for row in table:
        assert set(row[3].split()) <= words
    shown = [word for word in words if word.startswith(("leftward=", "rightward=", "other="))]
    # ids are cut, and still differ
    assert len(shown) == len({part for row in table for part in row[4].split()})


def tokens(count=4):
    for number in range(count):
        yield (
            f"{number * 7919:032x}", "scene-0553", f"2018-08-28 20:48:2{number}.44", "match",
            f"walker={number * 104729:032x}", "samples/CAM_FRONT/n008.jpg",
        )  # fmt: skip


@pytest.mark.parametrize("width", [80, 120])
def test_tables_look_so(width, golden):
    """Names of frames and of objects as nuScenes and Argoverse have them."""
    tables = []
    for made in (rows, dated, tokens):
        table = list(made(4))
        beginnings = {
            row[0]: "/".join(part[:10] if "/" in row[0] else part[-6:] for part in row[0].split("/")) for row in table
        }
        tables.append("\n".join(fitted(table, width, beginnings.__getitem__)))
    golden("\n\n".join(tables) + "\n")


def test_what_fits_is_not_left_out():
    assert "20:48:20.44" in fitted(list(tokens()), 85, lambda frame: frame[-6:])[1]


def test_a_date_that_all_share_stands_in_the_head():
    lines = fitted(list(dated()), 80, lambda frame: frame[-6:])
    assert "2018-09-18" in lines[0]
    assert not any("2018-09-18" in line for line in lines[1:])


def test_in_a_pipe_nothing_is_cut(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    sink = io.BytesIO()
    table = Table(TextStream(sink), lambda: str.upper)
    record = {
        "frame": "f" * 100, "recording": "r" * 100, "timestamp_us": 0, "verdict": "match",
        "correspondence": {"ego": "ego"}, "sensors": {},
    }  # fmt: skip
    table.write(record)
    table.finish()
    assert "f" * 100 in sink.getvalue().decode()


class Terminal(io.BytesIO):
    """What is written to a terminal."""

    def isatty(self):
        return True


def test_on_a_terminal_it_fits_and_names_frames_as_other_commands_take_them(crossroads, monkeypatch):
    monkeypatch.setenv("COLUMNS", "70")
    dataset = open_dataset(crossroads)
    sink = Terminal()
    table = Table(TextStream(sink), dataset.short_frames)
    labels = list(itertools.islice(dataset.labels(), 120))
    for label in labels:
        table.write({
            "frame": label.frame, "recording": label.recording, "timestamp_us": label.timestamp_us, "verdict": "match",
            "correspondence": {"leftward": label.objects[0].id if label.objects else "ego"}, "sensors": {},
        })  # fmt: skip
    table.finish()
    lines = [re.sub("\x1b\\[[0-9;]*m", "", line) for line in sink.getvalue().decode().splitlines()]
    assert max(map(len, lines)) <= 70
    names = [line.split()[0] for line in lines if line[:1] not in ("F", " ")]
    assert len(names) == len(labels)
    assert [dataset.label(name).frame for name in names[::40]] == [label.frame for label in labels[::40]]


def test_frames_are_found_by_beginnings_that_no_other_has(crossroads):
    dataset = open_dataset(crossroads)
    assert dataset.label("03-busy-intersection/09").frame == "03-busy-intersection/09"
    assert dataset.label("03-b/09").frame == "03-busy-intersection/09"
    cut = dataset.short_frames()
    for label in itertools.islice(dataset.labels(), 0, None, 39):
        assert dataset.label(cut(label.frame)) == label
    with pytest.raises(DataError, match="several frames begin with `03-b`"):
        dataset.label("03-b")
    for absent in ("04-b/.*", "nope", "%"):
        with pytest.raises(DataError, match="has no frame"):
            dataset.label(absent)


_NAMED = {
    ("explain", "frame"): (["03_against_traffic.scenic", "{dataset}", "{name}", "--exit-zero"], "frames"),
    ("explain", "recording"): (["02_cut_in.scenic", "{dataset}", "{name}", "--exit-zero"], "recordings"),
    ("explain", "moment"): (["02_cut_in.scenic", "{dataset}", "{name}@0.5s", "--exit-zero"], "recordings"),
    ("show", "frame"): (["{dataset}", "{name}"], "frames"),
    ("show with a program", "frame"): (["{dataset}", "{name}", "--scenario", "03_against_traffic.scenic"], "frames"),
}
"""Every command that takes the name of a frame or recording: its other arguments, and what is named."""


@pytest.mark.parametrize("case", _NAMED, ids=" ".join)
def test_every_command_takes_beginnings_that_no_other_has(run, crossroads, scenarios, case):
    words, kind = _NAMED[case]
    full, cut, several = {
        "frames": ("04-against-traffic/03", "04-a/03", "04-a"),
        "recordings": ("06-cut-in", "06", "0"),
    }[kind]
    places = {each.name: str(each) for each in (*scenarios.glob("*"), *(scenarios.parent / "over_time").glob("*"))}

    def ask(name):
        filled = (word.format(dataset=crossroads, name=name) for word in words)
        return run(case[0].split()[0], *(places.get(word, word) for word in filled))

    assert ask(full).exit_code == 0
    assert ask(cut).stdout == ask(full).stdout != ""
    told = ask(several)
    assert (told.exit_code, f"several {kind} begin with `{several}`" in told.stderr) == (2, True)


def test_all_commands_that_take_names_are_swept():
    context = click.Context(cli)
    commands = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    taking = {
        name
        for name, command in commands.items()
        for each in (command.params if command is not None else ())
        if isinstance(each, click.Argument) and (each.name or "") in ("frame", "recording", "scene", "interval")
    }
    assert taking == {name.split()[0] for name, _ in _NAMED}


def test_a_clock_without_a_date_shows_none():
    assert moment(315966253660357) == "315966253.66 s"
    assert moment(0) == "0.00 s"
    assert moment(-5_000_000) == "-5.00 s"
    assert moment(1537292630412404) == "2018-09-18 17:43:50.41"


def test_ids_say_what_they_leave_out(run, crossroads, scenarios):
    done = run("match", scenarios / "02_crossing_cars.scenic", crossroads, "--format", "ids", "--near", "3")
    assert len(done.stdout.splitlines()) == 5
    assert done.stderr == "`ids` lists frames that match: 3 other frames left out\n"


def test_a_witness_does_not_depend_on_the_folder(run, crossroads, scenarios, monkeypatch):
    name = "02_crossing_cars.scenic"
    first = run("match", scenarios / name, crossroads, "--limit", "1", "--format", "jsonl").stdout
    monkeypatch.chdir(scenarios)
    assert run("match", name, crossroads, "--limit", "1", "--format", "jsonl").stdout == first
    assert f'"{name}:6:15"' in first
