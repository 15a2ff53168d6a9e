"""Exit codes never lie, and names that a stranger has chosen show as what they are."""

import csv
import errno
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pytest

from scenicq.query.execution.records import FrameRecord
from scenicq.refusals import refused_by_system
from scenicq_cli.formats import make_writer

PROGRAM = Path(__file__).parents[3] / "sample_data/scenarios/02_crossing_cars.scenic"
EVIL = "=cmd|' /C calc'!A0\nother\x1b[31m\u202e"


def _raise(error: BaseException):
    raise error


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MemoryError(), "memory"),
        (pa.ArrowMemoryError("malloc of size 64 failed"), "memory"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "memory"),
        (OSError(errno.EMFILE, "Too many open files"), "files"),
        (RuntimeError("can't start new thread"), "processes"),
        (ImportError("libx.so: failed to map segment from shared object"), "memory"),
    ],
)
def test_what_the_system_refuses_is_told_and_no_mistake_of_ours(error, told, run, crossroads, monkeypatch):
    monkeypatch.setattr("scenicq_cli.match.open_checked", lambda _: _raise(error))
    result = run("match", PROGRAM, crossroads)
    assert result.exit_code == 2
    assert result.stderr.startswith("error[resources-exhausted]")
    assert told in result.stderr


def test_what_is_behind_an_error_counts():
    error = ValueError("cannot be read")
    error.__cause__ = MemoryError()
    assert refused_by_system(error) == "there is not enough memory"
    assert refused_by_system(ValueError("cannot be read")) is None


@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space are those of Linux")
@pytest.mark.parametrize("what", ["match", "gather", "ingest"])
def test_too_little_memory_never_means_that_nothing_matched(what, command, crossroads, tmp_path):
    code = (
        "import os, resource, sys; resource.setrlimit(resource.RLIMIT_AS, (256_000_000, 256_000_000)); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    rest = {
        "match": [PROGRAM, crossroads],
        "gather": [tmp_path / "pieces"],
        "ingest": [PROGRAM.parents[1] / "crossroads", tmp_path / "made"],
    }
    words = [sys.executable, "-c", code, command, what, *map(str, rest[what])]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert "resources-exhausted" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="limits of open files are those of Linux")
@pytest.mark.parametrize("files", [6, 8, 12])
@pytest.mark.one_in(3)
def test_too_few_files_never_mean_that_nothing_matched(command, tmp_path, files):
    code = (
        f"import os, resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, ({files}, {files})); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    source = PROGRAM.parents[1] / "crossroads"
    words = [sys.executable, "-c", code, command, "ingest", str(source), str(tmp_path / "made"), "-q"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 2), done.stderr
    assert done.stderr.startswith("error[") == (done.returncode == 2)
    assert (tmp_path / "made").exists() == (done.returncode == 0)
    assert "internal error" not in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="limits of open files are those of Linux")
@pytest.mark.parametrize("files", [6, 8, 12, 16])
@pytest.mark.one_in(4)
def test_a_query_with_too_few_files_never_says_that_nothing_matched(command, crossroads, files):
    code = (
        f"import os, resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, ({files}, {files})); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    words = [sys.executable, "-c", code, command, "match", str(PROGRAM), str(crossroads), "--format", "ids"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 2), done.stderr
    assert "internal error" not in done.stderr
    assert bool(done.stdout) == (done.returncode == 0)


WAYS = {
    "match": ("match", PROGRAM, "DATASET", "--limit", "1", "--format", "ids", "--exit-zero"),
    "workers": ("match", PROGRAM, "DATASET", "--limit", "1", "--format", "ids", "--jobs", "2", "--exit-zero"),
    "solver": (
        "match",
        PROGRAM,
        "DATASET",
        "--limit",
        "1",
        "--format",
        "ids",
        "--method",
        "smt",
        "--solver",
        "portable",
        "--exit-zero",
    ),
    "ingest": ("ingest", PROGRAM.parents[1] / "crossroads", "made", "-q"),
    "info": ("info", "DATASET", "--verify"),
}


def _limited(limits, words, folder, dataset):
    """A command, run with limits of the system's."""
    code = (
        "import os, resource, sys\n"
        f"for name, most in {limits}: resource.setrlimit(getattr(resource, name), (most, most))\n"
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    line = [sys.executable, "-c", code, *(str(dataset if word == "DATASET" else word) for word in words)]
    if os.geteuid() == 0 and any(name == "RLIMIT_NPROC" for name, _ in limits):
        # the number of processes is no limit for root, nor for who may change limits
        rights = "-all,+dac_override,+dac_read_search"
        mine = [f"--{kind}={rights}" for kind in ("inh-caps", "ambient-caps", "bounding-set")]
        line = ["setpriv", "--reuid", "54321", "--regid", "54321", "--clear-groups", *mine, *line]
    return subprocess.run(line, capture_output=True, text=True, check=False, cwd=folder)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space are those of Linux")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.one_in(8)
def test_two_gigabytes_of_address_space_are_enough(way, command, crossroads, tmp_path):
    """As `scenicq/docs/limits.md` says."""
    done = _limited([("RLIMIT_AS", 2 * 10**9)], [command, *WAYS[way]], tmp_path, crossroads)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="limits of processes are those of Linux")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("limit", "most", "letter"), [
    ("RLIMIT_NPROC", 1, "u"), ("RLIMIT_NPROC", 4, "u"), ("RLIMIT_NPROC", 8, "u"), ("RLIMIT_NOFILE", 8, "n"),
])  # fmt: skip
@pytest.mark.one_in(16)
def test_what_runs_out_is_named_with_its_limit(limit, most, letter, way, command, crossroads):
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        folder.chmod(0o777)  # for whoever the command runs as
        shutil.copytree(crossroads, folder / "dataset")  # what has been checked before is not checked again
        done = _limited([(limit, most)], [command, *WAYS[way]], folder, folder / "dataset")
    if done.returncode != 0:
        *noise, last = done.stderr.splitlines()
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        assert last.startswith("error[resources-exhausted]")
        assert last.endswith(f"(`ulimit -{letter}` is {most})")
        assert all(line.startswith("<jemalloc>") for line in noise)  # Arrow's, before anybody can prevent it
    # eight processes are enough where there are few cores
    assert done.returncode in ((0, 2) if way == "ingest" or (limit, most) == ("RLIMIT_NPROC", 8) else (2,))


@pytest.mark.skipif(sys.platform != "linux", reason="limits of address space are those of Linux")
def test_linear_algebra_takes_its_memory_before_it_can_end_the_process_with_1():
    code = (
        "import resource, scenicq_cli.start as start\n"
        "start._save_memory()\n"
        "import numpy as np\n"
        "square, product = np.ones((900, 900)), np.ones((900, 900))\n"
        "taken = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (taken + 2_000_000, taken + 2_000_000))\n"
        "np.matmul(square, square, out=product)\n"
        "print(product[0, 0])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "900.0\n"), done.stderr


@pytest.mark.parametrize("module", ["scenicq.refusals", "scenicq_cli.main"])
def test_a_program_that_cannot_be_loaded_ends_with_2(module):
    code = (
        "import sys, scenicq_cli.start\n"
        f"sys.modules['{module}'] = None\n"
        "sys.argv = ['scenicq', '--version']\n"
        "scenicq_cli.start.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "internal error" in done.stderr


def test_a_closed_standard_error_changes_no_exit_code(command, crossroads):
    words = f'exec "{command}" match "{PROGRAM}" "{crossroads}" --format ids --summary 2>&-'
    done = subprocess.run(["sh", "-c", words], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stdout


def _written(form: str) -> str:
    sink = io.BytesIO()
    writer = make_writer(form, sink, tuple)
    record = FrameRecord(frame=EVIL, recording=EVIL, verdict="match", correspondence={"a": EVIL})
    writer.write(record)
    writer.finish()
    return sink.getvalue().decode()


def test_an_id_is_one_line_whatever_it_is():
    assert _written("ids") == "=cmd|' /C calc'!A0\\nother\\x1b[31m\\u202e\n"


@pytest.mark.parametrize("form", ["csv", "spreadsheet"])
def test_a_cell_is_no_formula_and_moves_no_cursor(form):
    text = _written(form)
    assert text.startswith("\ufeff") == (form == "spreadsheet")
    assert "\x1b" not in text
    assert "\u202e" not in text
    row = next(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))
    assert row["frame"].startswith("'=cmd")
    assert row["timestamp_us"] == "0"


def test_json_lines_say_the_same_without_control_characters():
    text = _written("jsonl")
    assert json.loads(text)["frame"] == EVIL
    assert text.isprintable() or text.rstrip("\n").isprintable()


def test_a_table_shows_what_a_name_is():
    text = _written("table")
    assert "\u202e" not in text
    assert len(text.splitlines()) == 2


def test_no_command_writes_json_that_moves_a_cursor(run, tmp_path):
    name = "a\x9b\u202e"
    source = tmp_path / "source"
    source.mkdir()
    (source / "dataset.json").write_text(
        json.dumps({"name": name, "interchange": 1, "angle": "heading", "classes": "scenic"})
    )
    box = {"id": name, "class": "Car", "position": [0.0, 0.0], "heading": 0.0, "length": 4.0, "width": 2.0}
    label = {
        "id": name,
        "recording": name,
        "timestamp_us": 0,
        "map": name,
        "ego": box | {"id": "ego"},
        "objects": [box],
    }
    (source / "labels.jsonl").write_text(json.dumps(label) + "\n")
    assert run("ingest", source, tmp_path / "d").exit_code == 0
    program = "ego = new Object at (0, 0), facing 0 deg"
    for words in (
        ("info", tmp_path / "d", "--format", "json"),
        ("match", "-e", program, tmp_path / "d", "--format", "jsonl", "--all"),
        ("sample", "-e", f"{program}, with name '{name}'", "-n", "1"),
    ):
        done = run(*words)
        assert done.exit_code == 0, done.stderr
        assert not {"\x9b", "\u202e"} & set(done.stdout), words
        assert words[0] == "sample" or "\\u009b\\u202e" in done.stdout
