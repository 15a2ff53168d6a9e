"""What users have met, through the installed command: ids, hints, streams, clocks, locales, and every format whole."""

import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "importers"))

from full_sources import FORMATS, entries, full

from scenicq_cli.user_folders import user_cache

SAMPLES = Path(__file__).parents[3] / "sample_data"
A = "in everywhere, facing Range(0, 360) deg"
MODEL = "model scenic.domains.driving.model\n"
CARS = f"{MODEL}ego = new Car {A}\nc = new Car {A}\n"
FRAMES = 4


@pytest.fixture(scope="module")
def asked(command, tmp_path_factory):
    """Run the installed command on a program and the dataset of recordings with odd names."""
    folder = tmp_path_factory.mktemp("odd")
    source = folder / "source"
    source.mkdir()
    header = {"name": "odd\x9b\u202e", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    (source / "maps").mkdir()
    shutil.copyfile(SAMPLES / "crossroads/maps/crossroads.geojson", source / "maps/straße.geojson")
    labels = []
    for name in ("-a", "=b", "@c", "長い" * 60):
        for number in range(FRAMES):
            seen = {"id": f"-{number}", "class": "Car", "track": "t", "position": [3.0, 5.0 + number], "heading": 0.0}
            label = {"id": f"{name}-{number}", "recording": name, "timestamp_us": 100_000 * number, "map": "straße"}
            labels.append(label | {"ego": {"position": [0.0, number], "heading": 0.0}, "objects": [seen]})
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))

    def run(text, *words, env=None, shell=None):
        (folder / "p.scenic").write_text(text)
        line = [word.format(dataset=folder / "d", program=folder / "p.scenic") for word in map(str, words)]
        line = ["sh", "-c", shell, "sh", command, folder / "p.scenic", folder / "d"] if shell else [command, *line]
        return subprocess.run(
            line, capture_output=True, text=True, check=False, cwd=folder, env={**os.environ, **(env or {})}
        )

    assert run("", "ingest", source, "d", "-q").returncode == 0
    return run


@pytest.mark.slow
def test_ids_are_handed_from_command_to_command_whatever_they_begin_with(asked):
    done = asked(
        CARS, shell='"$1" match "$2" "$3" --format ids | head -5 | xargs -n 1 -d "\\n" "$1" explain "$2" "$3" --'
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("match") >= 5
    refused = asked(CARS, "explain", "{program}", "{dataset}", "-a-0")
    assert refused.returncode == 2
    assert "stands after '--'" in refused.stderr


@pytest.mark.slow
def test_cells_are_no_formulas_for_spreadsheets_and_come_back_from_csv(asked):
    rows = {}
    for form in ("csv", "spreadsheet"):
        done = asked(CARS, "match", "{program}", "{dataset}", "--format", form)
        rows[form] = list(csv.DictReader(io.StringIO(done.stdout.removeprefix("\ufeff"))))
        assert done.returncode == 0
    assert {row["recording"] for row in rows["csv"]} == {"-a", "=b", "@c", "長い" * 60}
    assert not any(cell[:1] in ("=", "+", "-", "@") for row in rows["spreadsheet"] for cell in row.values())
    done = asked(
        CARS, shell='"$1" match "$2" "$3" -o a.csv; "$1" match "$2" "$3" -o a.jsonl; "$1" report a.csv a.jsonl'
    )
    assert re.search(r"^= +16 ", done.stdout, re.MULTILINE), done.stdout


def test_json_moves_no_cursor(asked):
    done = asked("", "info", "{dataset}", "--format", "json")
    assert json.loads(done.stdout)["name"] == "odd\x9b\u202e"
    assert done.stdout.replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("c on road", "X.position in R"),
        ("c ahead of ego", "along(ego, X) > 0"),
        ("c left of ego", "beside(ego, X) > 0"),
    ],
)
@pytest.mark.one_in(3)
def test_who_asks_with_a_specifier_is_told_what_to_write(asked, line, hint):
    done = asked(f"{CARS}require {line}\n", "match", "{program}", "{dataset}")
    assert (done.returncode, done.stdout) == (2, "")
    assert hint in done.stderr
    assert "--scenic" not in done.stderr


@pytest.mark.slow
def test_what_cannot_be_shown_is_said(asked):
    done = asked(f"{CARS}require (distance to c) > 5000\n", "match", "{program}", "{dataset}", "--near", "3")
    assert done.returncode == 1
    assert "--near shows nothing" in done.stderr
    assert "`--near 3`" not in done.stderr
    ranked = asked(f"{CARS}require eventually (distance to c) < 20\n", "match", "{program}", "{dataset}", "--rank")
    assert "internal error" not in ranked.stderr
    assert ranked.returncode in (0, 2)


@pytest.mark.parametrize("text", ["require (always X) and (eventually X)", "require not (always X)", "require next X"])
@pytest.mark.one_in(2)
def test_nobody_is_warned_of_what_depends_on_time(asked, text):
    program = CARS + text.replace("X", "((distance to c) < 20)") + "\n"
    done = asked(program, "check", "{program}", "--strict")
    assert (done.returncode, "requirement-always" in done.stderr) == (0, False), done.stderr


@pytest.mark.parametrize("env", [{"TERM": "dumb"}, {"NO_COLOR": "1"}])
@pytest.mark.skipif(sys.platform == "win32", reason="terminals are those of POSIX")
def test_a_terminal_without_colours_gets_none(env, command):
    import pty

    def said(more):
        reader, writer = pty.openpty()
        environment = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "TERM")}
        line = [command, "info", "nowhere"]
        subprocess.run(line, stdout=writer, stderr=writer, stdin=writer, env={**environment, **more}, check=False)
        os.close(writer)
        return os.read(reader, 10_000)

    assert b"\x1b[31m" in said({"TERM": "xterm"})
    assert b"\x1b" not in said(env)


JUMPING = """
import time
wall, jumps = time.time, iter(range(10**9))
time.time = lambda: wall() + {hours} * 3600 * next(jumps)
"""


@pytest.mark.parametrize("hours", [1, -1])
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_a_clock_that_is_set_ends_no_run_and_keeps_none_alive(hours, asked, tmp_path):
    """The wall's clock jumps an hour whenever it is read."""
    (tmp_path / "sitecustomize.py").write_text(JUMPING.format(hours=hours))
    env = {"PYTHONPATH": str(tmp_path)}
    words = ("match", "{program}", "{dataset}", "--format", "ids", "--deadline")
    for jobs in ("1", "2"):
        done = asked(CARS, *words, "300", "--jobs", jobs, env=env)
        assert (done.returncode, len(done.stdout.splitlines())) == (0, 4 * FRAMES), done.stderr
        over = asked(CARS, *words, "0.000001", "--jobs", jobs, env=env)
        assert (over.returncode, over.stdout) == (3, "")
        assert "warning[deadline-passed]" in over.stderr


ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}


@pytest.mark.parametrize("form", ["openlabel", "interchange", "paths"])
@pytest.mark.parametrize("env", [{}, ASCII], ids=["usual", "ascii"])
@pytest.mark.one_in(3)
def test_long_names_in_any_script_are_exported_or_refused_once(form, env, asked, tmp_path):
    done = asked(CARS, "match", "{program}", "{dataset}", "--export", form, tmp_path / "out", env=env)
    if env and form == "interchange":  # its files are called as its maps are
        assert done.returncode == 2
        assert done.stderr.count("error[target-unwritable]") == done.stderr.count("error[") == 1
        assert list(tmp_path.iterdir()) == []
    else:
        assert done.returncode == 0, done.stderr
        assert any((tmp_path / "out").iterdir())


@pytest.mark.parametrize("words", [
    ("sample", "{program}", "{dataset}", "--map", "straße", "-n", "1", "-o"),
    ("match", "{program}", "{dataset}", "--report"), ("show", "{dataset}", "@c-0", "-o"),
])  # fmt: skip
@pytest.mark.one_in(3)
def test_whoever_writes_works_or_refuses_once_in_any_locale(words, asked, tmp_path):
    done = asked(CARS, *words, tmp_path / "out.svg", env=ASCII)
    assert "internal error" not in done.stderr
    assert done.stderr.count("error[") == (done.returncode == 2), done.stderr
    assert any(tmp_path.iterdir()) == (done.returncode == 0)


@pytest.mark.parametrize("format_", FORMATS)
@pytest.mark.one_in(6)
def test_every_format_whole(format_, command, tmp_path, monkeypatch):
    """What holds all that its specification lists is ingested; what is left out of it is told by its name."""
    source = tmp_path / "source"
    source.mkdir()
    FORMATS[format_].write(full(format_), source)
    for name in ("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    if format_ == "opendrive":
        FORMATS[format_].keep_recorded(source, user_cache() / "maps")
    maps = [word for file in source.glob("*.xodr") for word in ("--map", file)]
    words = [command, "ingest", source, tmp_path / "d", "--format", FORMATS[format_].importer, *maps]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = subprocess.run(
        [command, "info", tmp_path / "d", "--verify", "--format", "json"], capture_output=True, text=True, check=False
    )
    assert told.returncode == 0, told.stderr
    listed = {
        path for name in FORMATS[format_].lists for path, fate in entries(name).items() if fate.startswith("left")
    }
    counted = {each["name"] for each in json.loads(told.stdout)["left_out"] if each["code"] == "not-read"}
    assert {path.partition("/")[0] if path.startswith("way_of_no_lanelet") else path for path in counted} >= listed
