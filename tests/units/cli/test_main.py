"""The command as a whole: start, help, errors, interrupts and closed pipes."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import click
import pytest

import scenicq_cli.info
from scenicq_cli.main import COMMANDS, cli

HEAVY = {"duckdb", "pyarrow", "numpy", "shapely", "highspy", "dreal", "tqdm"}


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version_import_nothing_heavy(option):
    program = (
        "import sys; from scenicq_cli.main import cli\n"
        f"try: cli([{option!r}], prog_name='scenicq')\n"
        "finally: print(*sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "scenicq" in done.stdout
    assert HEAVY.isdisjoint(done.stderr.split())


def test_an_ingest_loads_nothing_that_only_queries_need():
    program = "import sys, scenicq_cli.ingest; print(*{name.partition('.')[0] for name in sys.modules})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert {"duckdb", "highspy", "dreal", "tqdm"}.isdisjoint(done.stdout.split())


def test_names_that_sql_decides_load_no_matcher(crossroads):
    text = "ego = new Car; other = new Car ahead of ego by Range(0, 40)"
    program = (
        "import sys; from scenicq_cli.main import main\n"
        f"sys.argv = ['scenicq', 'match', '-e', {text!r}, {str(crossroads)!r}, '--format', 'ids']\n"
        "try: main()\n"
        "finally: print(*sorted(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout
    loaded = done.stderr.split()
    assert "scenicq.query.prefilter.decision" in loaded
    assert {"scenicq.match.matcher", "multiprocessing", "tqdm"}.isdisjoint(loaded)


def test_the_list_of_commands_is_what_their_own_help_says():
    context = click.Context(cli)
    for name, summary in COMMANDS.items():
        command = cli.get_command(context, name)
        assert command.name == name
        assert command.help.splitlines()[0] == summary


def test_an_unknown_command_names_a_near_one(run):
    result = run("macth")
    assert result.exit_code == 2
    assert "Did you mean 'match'?" in result.stderr
    assert "Did you mean" not in run("qqqq").stderr


@pytest.mark.parametrize("args", [["match"], ["match", "--nope", "a", "b"], ["ingest", "a", "b", "--jobs", "0"], []])
def test_usage_errors_exit_with_2_and_print_no_result(run, args):
    result = run(*args)
    assert result.exit_code == 2
    assert "Usage: scenicq" in result.stderr
    assert result.stdout == ""


def test_our_own_mistakes_become_one_line_and_a_file(run, crossroads, monkeypatch, tmp_path):
    def broken(_):
        raise ZeroDivisionError("a mistake of ours")

    monkeypatch.setattr(scenicq_cli.info, "open_checked", broken)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    result = run("info", crossroads)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    (file,) = tmp_path.iterdir()
    assert line.startswith("internal error:")
    assert line.endswith(str(file))
    assert "ZeroDivisionError: a mistake of ours" in file.read_text()


def test_options_come_from_the_environment(run, crossroads, scenarios):
    args = ("match", scenarios / "02_crossing_cars.scenic", crossroads)
    assert len(run(*args, env={"SCENICQ_MATCH_LIMIT": "2"}).stdout.splitlines()) == 2
    assert run(*args, env={"SCENICQ_MATCH_LIMIT": "none"}).exit_code == 2


def test_a_closed_pipe_is_silent(command, crossroads, scenarios, tmp_path):
    words = [command, "match", str(scenarios / "01_pedestrian_facing_ego.scenic"), str(crossroads), "--all"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as process:
        first = process.stdout.readline()
        process.stdout.close()
        noise = process.stderr.read()
        assert process.wait(60) == 0
    assert json.loads(first)["frame"] == "01-quiet-street/00"
    assert noise == b""


@pytest.mark.parametrize(
    "more",
    [["--limit", "1", "--exit-zero"], ["--report", "pages", "--near", "2", "-o", "found.jsonl"], ["--jobs", "2"]],
)
@pytest.mark.one_in(3)
def test_no_library_complains_when_the_process_ends(command, crossroads, scenarios, tmp_path, more):
    """What is kept until the end, such as a connection of DuckDB's, is told of on standard error as leaked."""
    line = [command, "match", str(scenarios / "02_crossing_cars.scenic"), str(crossroads), *more]
    done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.parametrize("buffered", ["", "1"])
@pytest.mark.parametrize("words", ["match SCENARIO DATASET", "info DATASET", "--version"])
@pytest.mark.one_in(4)
def test_a_full_disk_is_told(command, crossroads, scenarios, words, buffered):
    named = {"SCENARIO": str(scenarios / "02_crossing_cars.scenic"), "DATASET": str(crossroads)}
    line = [command, *(named.get(word, word) for word in words.split())]
    # Python writes without a buffer where this variable has a value
    surroundings = {**os.environ, "PYTHONUNBUFFERED": buffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(line, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=surroundings)
    assert done.returncode == 2
    assert done.stderr.startswith("error[target-unwritable]: standard output cannot be written")


@pytest.fixture(scope="module")
def big_source(tmp_path_factory):
    """The sample recordings many times over, so that an ingest takes seconds."""
    samples = Path(__file__).parents[3] / "sample_data" / "crossroads"
    source = tmp_path_factory.mktemp("big") / "source"
    (source / "maps").mkdir(parents=True)
    for name in ("dataset.json", "maps/crossroads.geojson"):
        (source / name).write_bytes((samples / name).read_bytes())
    lines = (samples / "labels.jsonl").read_text().splitlines()
    with (source / "labels.jsonl").open("w") as file:
        for copy in range(150):
            for line in lines:
                label = json.loads(line)
                label |= {"id": f"{copy:03}-{label['id']}", "recording": f"{copy:03}-{label['recording']}"}
                file.write(json.dumps(label) + "\n")
    return source


def _heed_interrupts() -> None:
    """A job in the background of a shell ignores interrupts, and so would what it starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


PIPES = {
    "stdout": subprocess.PIPE,
    "stderr": subprocess.PIPE,
    "text": True,
    "preexec_fn": None if os.name == "nt" else _heed_interrupts,
}


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.one_in(3)
def test_an_interrupted_ingest_leaves_nothing(command, big_source, tmp_path, number):
    words = [command, "ingest", str(big_source), str(tmp_path / "dataset"), "-q"]
    with subprocess.Popen(words, **PIPES) as process:
        # it has begun as soon as something is written beside the target
        deadline = time.monotonic() + 60
        while not any(tmp_path.iterdir()) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert process.poll() is None
        process.send_signal(number)
        out, told = process.communicate(timeout=60)
    assert (process.returncode, out, told) == (130, "", "interrupted\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_match_leaves_no_file(command, crossroads, scenarios, tmp_path, number):
    file = tmp_path / "matches.jsonl"
    slow = ("--no-prefilter", "--method", "smt", "--solver", "sleep 60", "--timeout", "60", "--all")
    words = [command, "match", str(scenarios / "04_two_lane_traffic.scenic"), str(crossroads), "-o", str(file), *slow]
    with subprocess.Popen(words, **PIPES) as process:
        deadline = time.monotonic() + 60
        while not any(tmp_path.iterdir()) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert process.poll() is None
        process.send_signal(number)
        _, told = process.communicate(timeout=60)
    assert (process.returncode, told.splitlines()[0]) == (130, "interrupted")
    assert "--resume" in told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.one_in(2)
def test_an_interrupted_shard_leaves_no_file(command, crossroads, scenarios, tmp_path, number):
    solver, begun, pieces = tmp_path / "solver.sh", tmp_path / "begun", tmp_path / "pieces"
    solver.write_text(f"touch {begun}\nsleep 60\n")
    slow = ("--no-prefilter", "--method", "smt", "--solver", f"sh {solver}", "--timeout", "60", "--shard", "1/2")
    words = [command, "match", str(scenarios / "04_two_lane_traffic.scenic"), str(crossroads), "-o", str(pieces), *slow]
    with subprocess.Popen(words, **PIPES) as process:
        assert _soon(lambda: begun.exists() or process.poll() is not None)
        assert process.poll() is None
        process.send_signal(number)
        _, told = process.communicate(timeout=60)
    assert (process.returncode, told.splitlines()[0]) == (130, "interrupted")
    assert not pieces.exists() or list(pieces.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_an_interrupted_match_without_a_file_says_what_can_be_resumed(command, crossroads, scenarios, tmp_path):
    solver, begun = tmp_path / "solver.sh", tmp_path / "begun"
    solver.write_text(f"touch {begun}\nsleep 60\n")
    slow = ("--no-prefilter", "--method", "smt", "--solver", f"sh {solver}", "--timeout", "60", "--jobs", "1")
    words = [command, "match", str(scenarios / "04_two_lane_traffic.scenic"), str(crossroads), *slow]
    with subprocess.Popen(words, **PIPES) as process:
        assert _soon(lambda: begun.exists() or process.poll() is not None)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
    hint = "  = hint: with `-o FILE`, `--resume` keeps what is done until it stops"
    assert (process.returncode, told.splitlines()) == (130, ["interrupted", hint])


@pytest.mark.skipif(sys.platform == "win32", reason="process groups and a shell are needed")
@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.one_in(6)
@pytest.mark.slow
def test_no_solver_outlives_a_command_that_ends(command, crossroads, scenarios, tmp_path, number, jobs):
    solver, beats = tmp_path / "solver.sh", tmp_path / "beats"
    solver.write_text(f"while :; do echo >> {beats}; sleep 0.05; done\n")
    slow = ("--no-prefilter", "--method", "smt", "--solver", f"sh {solver}", "--timeout", "60", "--jobs", jobs)
    words = [command, "match", str(scenarios / "04_two_lane_traffic.scenic"), str(crossroads), *slow]
    with subprocess.Popen(words, **PIPES) as process:
        assert _soon(lambda: beats.exists() or process.poll() is not None)
        assert process.poll() is None
        process.send_signal(number)
        process.communicate(timeout=60)
    assert _soon(lambda: not _grows(beats))


def _grows(file) -> bool:
    before = file.stat().st_size
    time.sleep(1)
    return file.stat().st_size > before


def _soon(happened) -> bool:
    deadline = time.monotonic() + 60
    while not (done := happened()) and time.monotonic() < deadline:
        time.sleep(0.01)
    return done


@pytest.mark.parametrize("solver", ["nope", "nope -in", "'"])
def test_a_solver_that_is_not_there_is_told_at_once(run, crossroads, scenarios, solver):
    result = run("match", scenarios / "02_crossing_cars.scenic", crossroads, "--solver", solver)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "error[solver-missing]" in result.stderr
