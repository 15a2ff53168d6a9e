"""Coverage by mutation: small changes of `match/`, `query/prefilter` and `forest/`, and whether fast tests notice them.

A survey comes first: all tests that may notice are run once without a change, and which fast one runs which line is
kept. Each change is then made in a copy of the package, and the tests that run its line are run against it, the
cheapest first, as many as cost half a minute without a change. A run that takes much longer than without a change
counts as noticed, for a change may make a loop endless. Survivors are printed to be read. In the end the tests that
have noticed something are run without a change once more: they must pass.
"""

import argparse
import ast
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import coverage
import pytest

ROOT = Path(__file__).parents[2]
CHANGED = ("match", "query/prefilter", "forest")
"""The folders of the package that are changed."""
TESTS = ("tests/forest", "tests/match", "tests/query", "tests/compiler")
"""The tests that may notice."""
_ENOUGH_S = 30.0
"""So many CPU seconds of tests are run against a change."""
_SLOWEST_S = 3.0
"""A test that takes more CPU seconds than that is not fast: it is ended in the survey, and left out."""
_PRELOADED = ("numpy", "pyarrow.parquet", "duckdb", "shapely", "click", "tqdm", "highspy", "msgspec")
"""Libraries that every run needs, loaded once."""
_SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}  # fmt: skip


def mutants(tree: ast.Module) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Changes that can be made: each makes the change in the tree, is handed out, and takes it back."""
    for node in ast.walk(tree):
        match node:
            case ast.Compare(ops=ops):
                for place, op in enumerate(ops):
                    if type(op) in _SWAPS:
                        ops[place] = _SWAPS[type(op)]()
                        yield node, f"{type(op).__name__} -> {type(ops[place]).__name__}"
                        ops[place] = op
            case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in _SWAPS:
                node.op = _SWAPS[type(op)]()
                yield node, f"{type(op).__name__} -> {type(node.op).__name__}"
                node.op = op
            case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
                node.test = ast.UnaryOp(ast.Not(), test)
                yield node, "condition inverted"
                node.test = test
            case ast.Constant(value=bool() as value):
                node.value = not value
                yield node, f"{value} -> {not value}"
                node.value = value
            case ast.Constant(value=int() as value):
                node.value = value + 1
                yield node, f"{value} -> {value + 1}"
                node.value = value
            case ast.Return(value=ast.expr() as value):
                node.value = ast.Constant(None)
                yield node, "returns None"
                node.value = value
            case _:
                pass


class Survey:
    """Which tests run which lines without a change, and what each test costs.

    Args:
        told: For each test its CPU seconds, and the lines of each file that it runs.
    """

    def __init__(self, told: dict[str, Any]) -> None:
        self.cost: dict[str, float] = told["cost"]
        self._tests: dict[str, dict[str, list[str]]] = told["tests"]

    def tests(self, file: str, lines: range) -> list[str]:
        """The tests to run against a change of some lines, the cheapest first.

        Where no test runs them, for they are run when the module is loaded, those that run anything of the file.
        """
        of_line = self._tests.get(file, {})
        found = {test for line in lines for test in of_line.get(str(line), [])}
        found = found or {test for tests in of_line.values() for test in tests}
        chosen: list[str] = []
        spent = 0.0
        for test in sorted(found, key=lambda test: (self.cost[test], test)):
            spent += self.cost[test]
            if spent > _ENOUGH_S:
                break
            chosen.append(test)
        return chosen


class _Failure:
    """A plugin of pytest that writes down which test has failed."""

    def __init__(self, told: Path) -> None:
        self.told = told

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.told.write_text(report.nodeid)


class _Watch:
    """A plugin of pytest that says to the measurement which test is run, and counts its CPU seconds."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self.measured = measured
        self.cost: dict[str, float] = {}
        self.failed: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Iterator[None]:
        def end(*_: object) -> None:
            pytest.fail("is not fast")

        signal.signal(signal.SIGVTALRM, end)
        signal.setitimer(signal.ITIMER_VIRTUAL, _SLOWEST_S)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.measured.switch_context(item.nodeid)
        before = _cpu_seconds()
        done = yield
        self.cost[item.nodeid] = _cpu_seconds() - before
        self.measured.switch_context("")
        return done


def _cpu_seconds() -> float:
    used = (resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def _survey(work: Path, told: Path) -> int:
    """Run all tests in the copy, and write which lines each runs; runs in a process of its own."""
    measured = coverage.Coverage(data_file=None, source=[str(work / "scenicq" / folder) for folder in CHANGED])
    watch = _Watch(measured)
    measured.start()
    _pytest([*TESTS, "--maxfail=1000", "--tb=line"], watch)
    measured.stop()
    for test in watch.failed:
        print(f"left out: {test}")
    data = measured.get_data()
    tests: dict[str, dict[int, list[str]]] = {}
    for file in data.measured_files():
        lines = data.contexts_by_lineno(file).items()
        found = {line: [test for test in set(contexts) - {*watch.failed} if test] for line, contexts in lines}
        tests[str(Path(file).relative_to(work))] = {line: names for line, names in found.items() if names}
    told.write_text(json.dumps({"cost": watch.cost, "tests": tests}))
    return 0


def _pytest(tests: list[str], *plugins: object) -> int:
    words = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow", "-o", "timeout=3600", *tests]
    return int(pytest.main(words, list(plugins)))


def _apart(work: Path, cpu_seconds: int | None, run: Callable[[], int]) -> int:
    """Run something in a process of its own that sees the copy; its result, below zero where it was ended."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            if cpu_seconds is not None:
                resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds))
                nothing = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nothing, 1)
                os.dup2(nothing, 2)
            os.chdir(work)
            sys.path.insert(0, str(work))
            code = run()
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _lines(tree: ast.Module, node: ast.expr | ast.stmt) -> range:
    """The lines of a change: from the start of its statement to its own end."""
    starts = [each.lineno for each in ast.walk(tree) if isinstance(each, ast.stmt) and each.lineno <= node.lineno]
    return range(max(starts), (node.end_lineno or node.lineno) + 1)


def main() -> None:
    """Make changes, run tests, count; exits with 1 where less than nine in ten are noticed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--skip", type=int, default=0, help="how many of the chosen changes were tried before")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--survey", type=Path, help="a file that keeps the survey; it is made where it is missing")
    options = parser.parse_args()
    files = [file for folder in CHANGED for file in sorted((ROOT / "scenicq" / folder).rglob("*.py"))]
    every = [(file, number) for file in files for number, _ in enumerate(mutants(ast.parse(file.read_text())))]
    random.Random(options.seed).shuffle(every)
    outcomes: defaultdict[str, Counter[str]] = defaultdict(Counter)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for part in ("scenicq", "cli", "tests", "sample_data", "pyproject.toml", "README.md"):
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
            copy(ROOT / part, work / part)
        (work / "scenicq_cli").symlink_to("cli")
        os.environ.update(PYTHONPATH=str(work), PYTHONDONTWRITEBYTECODE="1")
        for library in _PRELOADED:
            importlib.import_module(library)
        kept = options.survey or work / "survey.json"
        if not kept.exists() and _apart(work, None, partial(_survey, work, kept.absolute())):
            kept.unlink(missing_ok=True)
            raise SystemExit("the survey has failed")
        survey, failed = Survey(json.loads(kept.read_text())), work / "failed.txt"
        useful: set[str] = set()
        for file, number in every[options.skip : options.skip + options.count]:
            folder = next(each for each in CHANGED if file.is_relative_to(ROOT / "scenicq" / each))
            began = time.monotonic()
            failed.unlink(missing_ok=True)
            what, noticed = _attempt(work, file, number, survey, failed)
            if failed.exists():
                useful.add(failed.read_text())
            outcomes[folder]["noticed" if noticed else "survived"] += 1
            took = time.monotonic() - began
            print(f"{'noticed' if noticed else 'SURVIVED'} ({took:.0f} s): {what}", flush=True)
        if useful and _apart(work, None, partial(_pytest, sorted(useful))):
            raise SystemExit("tests that have noticed something fail without a change")
    for folder, counts in outcomes.items():
        print(f"{folder}: {counts['noticed']} of {counts.total()} changes noticed")
    total = sum(outcomes.values(), Counter[str]())
    print(f"{total['noticed']} of {total.total()} changes noticed")
    sys.exit(total["noticed"] < 0.9 * total.total())


def _attempt(work: Path, file: Path, number: int, survey: Survey, failed: Path) -> tuple[str, bool]:
    """Make one change, and run tests against it: what it is, and whether they notice it."""
    inside = file.relative_to(ROOT)
    tree = ast.parse(file.read_text())
    for place, (node, what) in enumerate(mutants(tree)):
        if place == number:
            tests = survey.tests(str(inside), _lines(tree, node))
            limit = 30 + int(3 * sum(survey.cost[test] for test in tests))
            (work / inside).write_text(ast.unparse(tree))
            noticed = bool(tests) and _apart(work, limit, partial(_pytest, tests, _Failure(failed))) != 0
            shutil.copy(file, work / inside)
            return f"{inside}:{node.lineno} {what} ({len(tests)} tests)", noticed
    raise AssertionError("there are as many changes as before")


if __name__ == "__main__":
    main()
