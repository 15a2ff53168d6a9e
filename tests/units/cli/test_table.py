"""The table of results: it fits the terminal, breaks no word, and names frames as other commands take them."""

import fcntl
import io
import itertools
import json
import os
import pty
import re
import shutil
import struct
import subprocess
import termios
import uuid
from pathlib import Path

import click
import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.query.execution.records import FrameRecord
from scenicq.store.dataset import open_dataset
from scenicq.store.frame_names import ShortNames, find_recording
from scenicq_cli.main import cli
from scenicq_cli.report import moment
from scenicq_cli.table import Table, TextStream, table_lines

UUIDS = ("7fab2350-7eaf-3b7e-a39d-6937a4c1bede", "7fab9911-0510-35b0-a2fa-b4cea13a6d76")


TAIL = ShortNames(lambda frame: frame[-6:], str)
ROOT = Path(__file__).parents[3]
CROSSING = ROOT / "sample_data" / "scenarios" / "02_crossing_cars.scenic"
OVER_TIME = ROOT / "sample_data" / "over_time"


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
    short = ShortNames(
        lambda frame: "/".join(part[-24:] if "/" not in frame else part[:8] for part in frame.split("/")), str
    )
    lines = table_lines(table, width, short)
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
        tables.append("\n".join(table_lines(table, width, ShortNames(beginnings.__getitem__, str))))
    golden("\n\n".join(tables) + "\n")


def test_what_fits_is_not_left_out():
    assert "20:48:20.44" in table_lines(list(tokens()), 85, TAIL)[1]


def test_a_date_that_all_share_stands_in_the_head():
    lines = table_lines(list(dated()), 80, TAIL)
    assert "2018-09-18" in lines[0]
    assert not any("2018-09-18" in line for line in lines[1:])


def test_in_a_pipe_nothing_is_cut(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    sink = io.BytesIO()
    table = Table(TextStream(sink), lambda: str.upper)
    table.write(FrameRecord(frame="f" * 100, recording="r" * 100, verdict="match", correspondence={"ego": "ego"}))
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
    table = Table(TextStream(sink), dataset.short_names)
    labels = list(itertools.islice(dataset.labels(), 120))
    for label in labels:
        roles = {"leftward": label.objects[0].id if label.objects else "ego"}
        table.write(
            FrameRecord(
                frame=label.frame, recording=label.recording, timestamp_us=label.timestamp_us, verdict="match",
                correspondence=roles,
            )
        )  # fmt: skip
    table.finish()
    lines = [re.sub("\x1b\\[[0-9;]*m", "", line) for line in sink.getvalue().decode().splitlines()]
    assert max(map(len, lines)) <= 70
    names = [line.split()[0] for line in lines if line[:1] not in ("F", " ")]
    assert len(names) == len(labels)
    assert [dataset.label(name).frame for name in names[::40]] == [label.frame for label in labels[::40]]


@pytest.fixture(scope="module")
def named_by_uuids(tmp_path_factory):
    """The sample with names of recordings, frames and tracks as Argoverse has them, and its clock without a date."""
    source = Path(shutil.copytree(ROOT / "sample_data" / "crossroads", tmp_path_factory.mktemp("uuids") / "source"))

    def name(text):
        return str(uuid.uuid5(uuid.NAMESPACE_OID, text))

    labels = [json.loads(line) for line in (source / "labels.jsonl").read_text().splitlines()]
    for label in labels:
        label["recording"] = name(label["recording"])
        label["timestamp_us"] -= 1_700_000_000_000_000 - 315_966_253_660_357
        label["id"] = f"{label['recording']}/{label['timestamp_us']}000"
        for each in label["objects"]:
            each["id"] = name(each["id"])
            each["track"] = name(each["track"])
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    target = source.with_name("town")
    ingest(source, target)
    return target


def on_a_terminal(width, *words):
    """What a command writes to a terminal of a width, without colours."""
    outer, inner = pty.openpty()
    fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    environment = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    running = subprocess.Popen(words, stdin=inner, stdout=inner, stderr=subprocess.DEVNULL, env=environment)
    os.close(inner)
    written = b""
    try:
        while block := os.read(outer, 65536):
            written += block
    except OSError:  # how a terminal ends on Linux
        pass
    os.close(outer)
    assert running.wait() == 0
    return re.sub("\x1b\\[[0-9;]*m", "", written.decode()).splitlines()


@pytest.mark.parametrize(
    ("program", "width", "head"),
    [
        (CROSSING, 80, "FRAME TIME VERDICT OBJECTS"),
        (CROSSING, 120, "FRAME TIME VERDICT OBJECTS"),
        (OVER_TIME / "02_cut_in.scenic", 80, "RECORDING START SECONDS VERDICT OBJECTS FRAMES"),
        (OVER_TIME / "02_cut_in.scenic", 120, "RECORDING START SECONDS VERDICT OBJECTS FRAMES"),
    ],
    ids=lambda value: value.stem if isinstance(value, Path) else None,
)
@pytest.mark.one_in(4)
@pytest.mark.slow
def test_uuids_fit_a_terminal(command, named_by_uuids, program, width, head):
    """With the installed command: no line is wider, every row is shown, and its names are found again."""
    lines = on_a_terminal(width, command, "match", program, named_by_uuids, "--near", "3")
    assert lines[0].split() == head.split()
    assert max(map(len, lines)) <= width
    done = subprocess.run([command, "match", program, named_by_uuids, "--near", "3"], capture_output=True, check=True)
    results = [json.loads(line) for line in done.stdout.splitlines()]
    shown = [line.split() for line in lines[1:] if not line.startswith(" ")]
    assert len(shown) == len(results)
    dataset = open_dataset(named_by_uuids)
    recordings = {label.recording for label in dataset.labels()}
    over_time = head.startswith("RECORDING")
    text = "\n".join(lines)
    for words, result in zip(shown, results, strict=True):
        if over_time:
            assert find_recording(recordings, words[0]) == result["recording"]
        else:
            assert dataset.label(words[0]).frame == result["frame"]
        objects = {role: name for role, name in result["correspondence"].items() if role != "ego"}
        assert all(re.search(f"{role}={name[:6]}", text) for role, name in objects.items())


def test_frames_are_found_by_beginnings_that_no_other_has(crossroads):
    dataset = open_dataset(crossroads)
    assert dataset.label("03-busy-intersection/09").frame == "03-busy-intersection/09"
    assert dataset.label("03-b/09").frame == "03-busy-intersection/09"
    cut = dataset.short_names().frame
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
@pytest.mark.one_in(3)
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
