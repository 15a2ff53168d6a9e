"""Standard output holds results alone, whatever libraries print: in C or in Python, in any process of a command.

The oracle is the same command where no library prints: its bytes are compared.
"""

from __future__ import annotations

import ast
import contextlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenicq_cli import main

SAMPLES = Path(__file__).parents[3] / "sample_data"

# Linear programs decide frames of this program and, where it is asked for, a solver does.
PROGRAM = """
model scenic.domains.driving.model
x = Range(-30, 30)
ego = new Car
other = new Car offset by (x, Range(-40, 40)), facing Range(0, 360) deg
third = new Car offset by (x + Range(-10, 10), Range(-40, 40)), facing Range(0, 360) deg
"""

# Prints in each process that loads one of some modules: past every buffer, through that of C, and in Python. Solvers
# start without `site`, so their start is prefixed with the same.
NOISE = """
import ctypes, os, subprocess, sys
class Noise:
    def find_spec(self, name, path=None, target=None):
        if name in {modules!r}:
            library = ctypes.CDLL(None)
            library.write(1, b"written by C\\n", 13)
            library.puts(b"put by C")
            print("printed by Python")
            with open({log!r}, "a") as log:
                log.write(f"{{os.getpid()}} {{name}}\\n")
sys.meta_path.insert(0, Noise())
"""
SITE = """
noise = {noise!r}
exec(noise)
started = subprocess.Popen.__init__
def start(self, words, *more, **options):
    bare = isinstance(words, list) and "-S" in words
    started(self, [*words[:-1], noise + words[-1]] if bare else words, *more, **options)
subprocess.Popen.__init__ = start
"""
NOISES = {"written by C", "put by C", "printed by Python"}
MODULES = {"scenicq.refusals", "shapely", "highspy", "scenicq.match.matcher", "scenicq.smt.worker"}

# What dReal's package has, as far as it is asked for; no question has a solution.
DOUBLE = """
__version__ = "0"
class Variable:
    def __init__(self, *_): pass
class Expression(Variable): pass
class Formula(Variable):
    TRUE = FALSE = staticmethod(lambda: Formula())
def made(*_): return Expression()
for name in "add sub mul truediv neg abs le lt eq".split(): setattr(Expression, f"__{name}__", made)
Min = Max = sqrt = sin = cos = tan = atan = pow = exp = log = logical_and = logical_or = made
def CheckSatisfiability(*_): return None
"""

ENGINES = {
    "one process": (("--jobs", "1"), 1),
    "workers": (("--jobs", "2"), 2),
    "solvers": (("--jobs", "1", "--method", "smt", "--solver", "dreal"), 2),
    "dask": (("--jobs", "2", "--engine", "dask"), 2),
}
"""Options, and how many processes print at least."""
FORMATS = ("jsonl", "csv", "ids", "parquet")


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    file = tmp_path_factory.mktemp("program") / "between.scenic"
    file.write_text(PROGRAM)
    return file


@pytest.fixture
def noisy(tmp_path, double):
    """The surroundings in which libraries print, and the file that says which processes have."""
    log = tmp_path / "noise.log"
    site = tmp_path / "site"
    site.mkdir()
    noise = NOISE.format(modules=MODULES, log=str(log))
    (site / "sitecustomize.py").write_text(SITE.format(noise=noise))
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(site), str(double)))}, log


@pytest.fixture
def double(tmp_path):
    """A folder with something that is called dReal."""
    folder = tmp_path / "double"
    folder.mkdir()
    (folder / "dreal.py").write_text(DOUBLE)
    return folder


def outcome(words, env=None, cwd=None):
    done = subprocess.run(list(map(str, words)), capture_output=True, env=env, cwd=cwd, timeout=280, check=False)
    return done.returncode, done.stdout, done.stderr.decode()


@pytest.fixture(scope="module")
def quiet(command, program, crossroads):
    """The bytes of results where no library prints."""
    found = {
        name: outcome([command, "match", program, crossroads, "--limit", 5, "--exit-zero", "--format", name])
        for name in FORMATS
    }
    assert all(code == 0 and data and not told for code, data, told in found.values()), found
    return {name: data for name, (_, data, _) in found.items()}


@pytest.mark.slow
def test_a_linear_program_prints_nothing(quiet):
    """HiGHS writes its name to descriptor 1 as soon as it is made; see `quiet` for the command."""
    lines = quiet["jsonl"].decode().splitlines()
    assert len(lines) > 3
    assert all(line.startswith('{"frame"') for line in lines)


def test_nor_does_one_in_a_process_of_somebody_else(program, crossroads):
    code = (
        "import sys, scenicq\n"
        "found = scenicq.open(sys.argv[1]).match(open(sys.argv[2]).read())\n"
        "print(*[each.frame for each in found], sep='\\n', flush=True)\n"
        "assert 'highspy' in sys.modules\n"
        "import os; os.write(1, b'mine\\n')"
    )
    status, data, told = outcome([sys.executable, "-c", code, crossroads, program])
    assert (status, told) == (0, "")
    *frames, last = data.decode().splitlines()
    assert last == "mine"
    assert len(frames) > 3
    assert all("/" in frame for frame in frames)


@pytest.mark.parametrize(("engine", "form"), list(itertools.product(ENGINES, FORMATS)))
@pytest.mark.one_in(16)
def test_results_are_the_same_bytes_where_libraries_print(
    engine, form, command, program, crossroads, quiet, noisy, double
):
    if engine == "dask":
        pytest.importorskip("distributed")
    env, log = noisy
    options, least = ENGINES[engine]
    words = [command, "match", program, crossroads, "--limit", 5, "--exit-zero", "--format", form, *options]
    plain = {**os.environ, "PYTHONPATH": str(double)}
    expected = quiet[form] if engine != "solvers" else outcome(words, plain)[1]
    status, data, told = outcome(words, env)
    assert (status, data) == (0, expected)
    # of what matches nowhere there is advice, which hangs on the time
    assert engine == "solvers" or set(told.splitlines()) <= NOISES
    assert "printed by Python" in told
    assert told.count("written by C") >= 1
    printed = [line.split() for line in log.read_text().splitlines()]
    assert len({process for process, _ in printed}) >= least
    if engine == "solvers":
        assert "scenicq.smt.worker" in {name for _, name in printed}


COMMANDS = {
    "match a file": "match PROGRAM DATASET --summary -o out.jsonl",
    "match, a table": "match PROGRAM DATASET --format table",
    "shard": "match PROGRAM DATASET --shard 1/1 -o pieces",
    "gather": "gather pieces",
    "ingest": "ingest SOURCE made --jobs 2 --force",
    "check": "check PROGRAM DATASET --forest",
    "check as json": "check PROGRAM DATASET --format json",
    "sample": "sample PROGRAM DATASET --seed 1 -n 2",
    "explain": "explain PROGRAM DATASET 03-busy-intersection/10 --exit-zero",
    "show": "show DATASET 03-busy-intersection/10",
    "report": "report out.jsonl out.jsonl",
    "info": "info DATASET --format json",
    "codes": "codes unknown-name",
    "completion": "completion bash",
    "help": "match --help",
}


@pytest.mark.timeout(1200)
@pytest.mark.slow
def test_every_command_prints_its_results_alone(command, program, crossroads, noisy, tmp_path):
    env, _ = noisy
    named = {"PROGRAM": program, "DATASET": crossroads, "SOURCE": SAMPLES / "crossroads"}
    folders = tmp_path / "quiet", tmp_path / "noisy"
    for folder in folders:
        folder.mkdir()
    for what, line in COMMANDS.items():
        words = [command, *(named.get(word, word) for word in line.split())]
        first, second = (outcome(words, e, f) for e, f in zip((None, env), folders, strict=True))
        assert second[:2] == first[:2], what
        assert second[0] in (0, 1), (what, second)
    assert (folders[0] / "out.jsonl").read_bytes() == (folders[1] / "out.jsonl").read_bytes()


ALL_COMMANDS = {
    **COMMANDS,
    "no command": "",
    "version": "--version",
    "help of all": "--help",
    "match nothing": "match PROGRAM DATASET --limit 1 --where heading>100 --format ids",
    "wrong": "match nothing.scenic DATASET",
    "index": "index made --force",
    "doctor": "doctor",
    "evaluate": "evaluate out.jsonl DATASET --predictions predictions.jsonl",
}
STREAMS = {
    "stdout": ("closed", "full", "for reading", "without a reader", "stuck"),
    "stderr": ("closed", "full", "for reading", "without a reader", "stuck"),
    "stdin": ("closed", "for writing"),
}
ODD = [(name, kind) for name, kinds in STREAMS.items() for kind in kinds]
ODD_STREAMS = [
    (what, *odd)
    for row, what in enumerate(ALL_COMMANDS)
    for column, odd in enumerate(ODD)
    if row % 3 == column % 3  # each command with a third of them, each of them with a third of the commands
]


def odd_stream(kind, folder):
    """A descriptor of a stream that is not as it should be; None for one that is closed."""
    match kind:
        case "full":
            return os.open("/dev/full", os.O_WRONLY)
        case "for reading":
            (folder / "odd").write_bytes(b"")
            return os.open(folder / "odd", os.O_RDONLY)
        case "for writing":
            return os.open(folder / "odd", os.O_WRONLY | os.O_CREAT)
        case "without a reader":
            reader, writer = os.pipe()
            os.close(reader)
            return writer
        case "stuck":
            _, writer = os.pipe()
            os.set_blocking(writer, False)
            with contextlib.suppress(BlockingIOError):
                while True:
                    os.write(writer, b"." * 4096)
            return writer
        case _:
            return None


def outcome_with(stream, kind, words, folder):
    """Exit code, standard output and messages of a command one of whose streams is odd."""
    odd = odd_stream(kind, folder.parent)
    number = {"stdin": 0, "stdout": 1, "stderr": 2}[stream]
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    if odd is None:
        words = ["sh", "-c", f'exec "$@" {number}>&-', "sh", *words]
    else:
        streams[stream] = odd
    done = subprocess.run(list(map(str, words)), **streams, cwd=folder, timeout=280, check=False)
    if odd is not None:
        os.close(odd)
    return done.returncode, done.stdout, None if done.stderr is None else done.stderr.decode()


def contents(folder):
    return sorted(str(each.relative_to(folder)) for each in folder.rglob("*"))


@pytest.fixture(scope="module")
def usual(command, program, crossroads, tmp_path_factory):
    """What makes the folder that a command is run in, and what it does there with streams as they should be."""
    start = tmp_path_factory.mktemp("start")
    named = {"PROGRAM": program, "DATASET": crossroads, "SOURCE": SAMPLES / "crossroads"}

    def words(what):
        return [command, *(named.get(word, word) for word in ALL_COMMANDS[what].split())]

    for what in ("match a file", "shard"):
        assert outcome(words(what), cwd=start)[0] == 0
    shutil.copytree(crossroads, start / "made")
    labels = map(json.loads, (SAMPLES / "crossroads" / "labels.jsonl").read_text().splitlines())
    lines = ({**each, "objects": [{**one, "score": 0.5} for one in each["objects"]]} for each in labels)
    (start / "predictions.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    known = {}

    def run(what):
        if what not in known:
            folder = start.with_name(f"usual-{len(known)}")
            shutil.copytree(start, folder)
            known[what] = (*outcome(words(what), cwd=folder), contents(folder))
        return known[what]

    return start, words, run


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("what", "stream", "kind"), ODD_STREAMS)
@pytest.mark.slow
def test_an_odd_stream_is_told_or_makes_no_difference(what, stream, kind, usual, tmp_path):
    start, words, run = usual
    code, data, told, files = run(what)
    folder = tmp_path / "folder"
    shutil.copytree(start, folder)
    ended, given, said = outcome_with(stream, kind, words(what), folder)
    assert contents(folder) == files
    assert "Traceback" not in (said or "")
    if stream != "stdout" or not data or kind == "closed":
        assert ended == code
    elif kind == "without a reader":
        assert ended == 0
    else:
        assert ended == 2
        assert "error[target-unwritable]: standard output cannot be written" in said
    if stream == "stderr":
        assert given == data
    elif stream == "stdin":
        assert (given, re.sub(r"in [0-9.]+ s", "", said)) == (data, re.sub(r"in [0-9.]+ s", "", told))


@pytest.mark.parametrize("kind", STREAMS["stdin"])
@pytest.mark.parametrize("line", ["match - DATASET", "check -", "explain - DATASET f", "sample - -o made"])
@pytest.mark.one_in(4)
def test_a_program_is_not_read_from_what_cannot_be_read(line, kind, command, crossroads, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    words = [command, *(crossroads if word == "DATASET" else word for word in line.split())]
    ended, given, said = outcome_with("stdin", kind, words, folder)
    assert (ended, given, contents(folder)) == (2, b"", [])
    assert re.fullmatch(r"error\[file-(missing|invalid)\]: standard input (is closed|cannot be read: .*)\n", said), said


def test_every_command_is_among_those_with_odd_streams():
    assert {line.split()[0] for line in ALL_COMMANDS.values() if line} >= set(main.COMMANDS)


def test_commands_write_to_standard_output_in_one_way():
    """Each writes with `say`, or to `destination`; only messages are written otherwise."""
    cli = Path(__file__).parents[3] / "cli"
    found: set[str] = set()
    for file in cli.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            match node:
                case ast.Attribute(value=ast.Name(id="sys"), attr="stdout" | "__stdout__"):
                    found.add(f"{file.name}: sys.stdout")
                case ast.Call(func=ast.Attribute(attr="echo" | "secho"), keywords=given) if not {
                    each.arg for each in given
                } & {"err", "file"}:
                    found.add(f"{file.name}: echo")
                case ast.Call(func=ast.Name(id="print")):
                    found.add(f"{file.name}: print")
                case _:
                    pass
    assert found == {"main.py: sys.stdout", "start.py: sys.stdout", "streams.py: sys.stdout"}
