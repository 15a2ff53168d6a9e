"""Coverage by mutation: small changes of `match/`, `query/prefilter` and `forest/`, and whether fast tests notice them.

A survey comes first: tests that may notice are run once without a change, and which fast one runs which line is kept.
Each change is then made in a forked process, whose functions get the changed code, and the tests that run its line are
run there, one of each kind before the next of any, as many as cost some seconds without a change; what is outside of
functions is changed in a copy of the package. A run that takes much longer than without a change counts as noticed, for
a change may make a loop endless. Survivors are printed to be read, and can be tried again with more tests (`--only`).
In the end the tests that have noticed something are run without a change once more: they must pass.
"""

import argparse
import ast
import gc
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import coverage
import pytest

ROOT = Path(__file__).parents[3]
CHANGED = ("match", "query/prefilter", "forest")
"""The folders of the package that are changed."""
TESTS = (
    "tests/units/forest", "tests/units/match", "tests/units/query", "tests/units/compiler", "tests/units/temporal",
    "tests/units/smt", "tests/units/cli", "tests/oracles", "tests/contracts", "tests/test_language.py",
    "tests/test_cookbook.py",
)  # fmt: skip
"""The tests that may notice."""
_SLOWEST_S = 3.0
"""A test that takes more CPU seconds than that is not fast: it is ended in the survey, and left out."""
_SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}  # fmt: skip


def mutants(tree: ast.Module) -> Iterator[tuple[ast.expr | ast.stmt, str]]:
    """Changes that can be made: each makes the change in the tree, is handed out, and takes it back.

    What no test can notice is left alone (`_unnoticeable`).
    """
    left_alone = {id(part) for node in ast.walk(tree) for each in _unnoticeable(node) for part in ast.walk(each)}
    for node in ast.walk(tree):
        if id(node) in left_alone:
            continue
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
            case ast.Return(value=ast.expr() as value) if not (isinstance(value, ast.Constant) and value.value is None):
                node.value = ast.Constant(None)
                yield node, "returns None"
                node.value = value
            case _:
                pass


def _unnoticeable(node: ast.AST) -> list[ast.expr]:
    """What changes no value.

    Annotations, which nobody evaluates; how much is stored, and how; guards of our own mistakes, as that nothing is
    lost in a `zip`, or that nobody assigns a field of what is frozen (where equality makes it hashable, that counts).
    """
    match node:
        case ast.arg(annotation=ast.expr() as found) | ast.AnnAssign(annotation=found):
            return [found]
        case ast.FunctionDef(returns=ast.expr() as found):
            return [found]
        case ast.keyword(arg="slots" | "maxsize" | "repr", value=found):
            return [found]
        case ast.keyword(arg="strict", value=ast.Constant(value=True) as found):
            return [found]
        case ast.Call(func=ast.Name(id="dataclass"), keywords=given):
            match {each.arg: each.value for each in given}:
                case {"eq": ast.Constant(value=False), "frozen": found}:
                    return [found]
                case _:
                    return []
        case _:
            return []


class Survey:
    """Which tests run which lines without a change, and what each test costs.

    Args:
        told: For each test its CPU seconds, and for each file the lines that it runs, as the bits of a number in hex.
        enough_s: So many CPU seconds of tests are run against a change.
    """

    def __init__(self, told: dict[str, Any], enough_s: float) -> None:
        self._enough_s = enough_s
        self.cost: dict[str, float] = {test: known["cost"] for test, known in told.items()}
        self._lines: defaultdict[str, dict[str, int]] = defaultdict(dict)
        for test, known in told.items():
            for file, bits in known["lines"].items():
                self._lines[file][test] = int(bits, 16)

    def tests(self, file: str, lines: range) -> list[str]:
        """The tests to run against a change of some lines: one of each function, the cheapest, then another of each.

        Where no test runs them, for they are run when the module is loaded, those that run anything of the file; any
        where there is nothing else in it.
        """
        changed = sum(1 << line for line in lines)
        found = [test for test, ran in self._lines[file].items() if ran & changed]
        found = found or [*self._lines[file]] or [*self.cost]
        rounds: Counter[str] = Counter()
        order: list[tuple[int, float, str]] = []
        for test in sorted(found, key=lambda test: (self.cost[test], test)):
            order.append((rounds[test.split("[")[0]], self.cost[test], test))
            rounds[test.split("[")[0]] += 1
        chosen: list[str] = []
        spent = 0.0
        for _, cost, test in sorted(order):
            if spent + cost <= self._enough_s:
                spent += cost
                chosen.append(test)
        return chosen


class _Mutation:
    """A plugin of pytest that, instead of running the tests, has changes run against them.

    Args:
        options: Of the command line.
        work: A folder of its own.
    """

    def __init__(self, options: argparse.Namespace, work: Path) -> None:
        self.options = options
        self.work = work
        self.failed = work / "failed.txt"
        self.measuring = False
        self.noticed_all = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Write down which test has failed."""
        if report.failed:
            with self.failed.open("a") as file:
                file.write(f"{report.nodeid}\n")

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Iterator[None]:
        """End tests that are not fast while the survey is made."""
        signal.setitimer(signal.ITIMER_VIRTUAL, _SLOWEST_S if self.measuring else 0)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Make the survey and the changes, once the tests are known."""
        items = {item.nodeid: item for item in session.items}
        kept = self.options.survey or self.work / "survey.json"
        if not kept.exists():
            kept.write_text("{}")
        known = json.loads(kept.read_text())
        if items.keys() - known.keys() and _apart(None, partial(self._survey, items, known, kept)):
            raise SystemExit("the survey has failed")
        survey = Survey(json.loads(kept.read_text()), self.options.enough)
        outcomes: defaultdict[str, Counter[str]] = defaultdict(Counter)
        useful: set[str] = set()
        for folder, file, number in self._chosen():
            self.failed.unlink(missing_ok=True)
            before = _cpu_seconds()
            what, noticed = self._attempt(file, number, survey, items)
            useful.update(self.failed.read_text().split("\n")[:1] if self.failed.exists() else ())
            outcomes[folder]["noticed" if noticed else "survived"] += 1
            print(f"{'noticed' if noticed else 'SURVIVED'} ({_cpu_seconds() - before:.0f} s): {what}", flush=True)
        if _apart(None, partial(self._run, [items[name] for name in useful if name in items])):
            raise SystemExit("tests that have noticed something fail without a change")
        for folder, counts in outcomes.items():
            print(f"{folder}: {counts['noticed']} of {counts.total()} changes noticed")
        total = sum(outcomes.values(), Counter[str]())
        print(f"{total['noticed']} of {total.total()} changes noticed, in {_cpu_seconds():.0f} CPU s", flush=True)
        self.noticed_all = total["noticed"] >= 0.9 * total.total()
        return True

    def _chosen(self) -> list[tuple[str, Path, int]]:
        """The changes to be made: a folder, a file in it, and which of its changes."""
        every = [
            (folder, file, number, _named(file, node, what))
            for folder in CHANGED
            for file in sorted((ROOT / "scenicq" / folder).rglob("*.py"))
            for number, (node, what) in enumerate(mutants(ast.parse(file.read_text())))
        ]
        if self.options.only:
            again = {*_SURVIVED.findall(self.options.only.read_text())}
            return [(folder, file, number) for folder, file, number, name in every if name in again]
        random.Random(self.options.seed).shuffle(every)
        some = every[self.options.skip : self.options.skip + self.options.count]
        return [(folder, file, number) for folder, file, number, _ in some]

    def _survey(self, items: dict[str, pytest.Item], known: dict[str, Any], told: Path) -> int:
        """Run tests that are not known in random order, and add which lines each runs; in a process of its own."""
        measured = coverage.Coverage(data_file=None, source=[str(ROOT / "scenicq" / folder) for folder in CHANGED])
        cost: dict[str, float] = {}
        order = sorted(items.keys() - known.keys())
        random.Random(0).shuffle(order)
        measured.start()
        began = _cpu_seconds()
        signal.signal(signal.SIGVTALRM, _end_slow_test)
        self.measuring = True
        for name, following in zip(order, [*order[1:], None], strict=False):
            before = _cpu_seconds()
            if before - began > self.options.survey_seconds:
                break
            measured.switch_context(name)
            items[name].config.hook.pytest_runtest_protocol(item=items[name], nextitem=following and items[following])
            cost[name] = _cpu_seconds() - before
        measured.stop()
        left_out = {*self.failed.read_text().split("\n")} if self.failed.exists() else set[str]()
        known |= {test: {"cost": seconds, "lines": {}} for test, seconds in cost.items()}
        data = measured.get_data()
        for file in data.measured_files():
            ran: Counter[str] = Counter()
            for line, contexts in data.contexts_by_lineno(file).items():
                ran.update(dict.fromkeys({*contexts} & cost.keys() - left_out, 1 << line))
            for test, bits in ran.items():
                known[test]["lines"][str(Path(file).relative_to(ROOT))] = f"{bits:x}"
        told.write_text(json.dumps(known))
        print(f"{len(known)} of {len(items)} tests in the survey, {len(left_out & {*cost})} left out", flush=True)
        return 0

    def _run(self, items: list[pytest.Item]) -> int:
        """Run tests until one fails; 1 if one does."""
        before = self.failed.stat().st_size if self.failed.exists() else 0
        for item, following in zip(items, [*items[1:], None], strict=False):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failed.exists() and self.failed.stat().st_size > before:
                return 1
        return 0

    def _attempt(self, file: Path, number: int, survey: Survey, items: dict[str, pytest.Item]) -> tuple[str, bool]:
        """Make one change, and run tests against it: what it is, and whether they notice it."""
        inside = file.relative_to(ROOT)
        tree = ast.parse(file.read_text())
        for place, (node, what) in enumerate(mutants(tree)):
            if place == number:
                tests = [name for name in survey.tests(str(inside), _lines(tree, node)) if name in items]
                limit = 5 + int(2 * sum(survey.cost[test] for test in tests))
                ast.fix_missing_locations(tree)
                if _in_function(tree, node):
                    code = compile(tree, str(file), "exec")
                    run = partial(self._run_changed, code, [items[test] for test in tests])
                    noticed = bool(tests) and _apart(limit, run) != 0
                else:
                    noticed = bool(tests) and self._in_copy(inside, ast.unparse(tree), tests, limit)
                return f"{_named(file, node, what)} ({len(tests)} tests)", noticed
        raise AssertionError("there are as many changes as before")

    def _run_changed(self, code: CodeType, items: list[pytest.Item]) -> int:
        exchange(code)
        return self._run(items)

    def _in_copy(self, inside: Path, text: str, tests: list[str], limit: int) -> bool:
        """Whether tests of a copy with a changed file notice it."""
        copy = self.work / "copy"
        if not copy.exists():
            for part in ("scenicq", "cli", "tests", "sample_data", "pyproject.toml", "README.md"):
                copied = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
                copy.mkdir(exist_ok=True)
                copied(ROOT / part, copy / part)
            (copy / "scenicq_cli").symlink_to("cli")
        (copy / inside).write_text(text)
        words = [sys.executable, "-m", "pytest", "-x", *_OPTIONS, "-p", "no:terminal", *tests]
        done = subprocess.run(
            words,
            cwd=copy,
            env={**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            check=False,
            preexec_fn=partial(resource.setrlimit, resource.RLIMIT_CPU, (limit + 10, limit + 10)),
        )
        shutil.copy(ROOT / inside, copy / inside)
        return done.returncode != 0


_SURVIVED = re.compile(r"^SURVIVED \([^)]*\): (.*) \(\d+ tests\)$", re.MULTILINE)
_OPTIONS = ("-p", "no:cacheprovider", "-m", "not slow", "-o", "timeout=3600")


def exchange(code: CodeType) -> None:
    """Give all functions of a file the code that they have in another version of it, line by line the same.

    Args:
        code: Of the other version, as a module.
    """
    new = {(each.co_qualname, each.co_firstlineno): each for each in _within(code)}
    for function in gc.get_objects():
        if isinstance(function, FunctionType) and function.__code__.co_filename == code.co_filename:
            other = new.get((function.__code__.co_qualname, function.__code__.co_firstlineno))
            if other is not None and other != function.__code__:
                function.__code__ = other


def _within(code: CodeType) -> Iterator[CodeType]:
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield constant
            yield from _within(constant)


def _named(file: Path, node: ast.expr | ast.stmt, what: str) -> str:
    """A change by its place and what it is."""
    return f"{file.relative_to(ROOT)}:{node.lineno}:{node.col_offset} {what}"


def _in_function(tree: ast.Module, node: ast.expr | ast.stmt) -> bool:
    """Whether something is in the body of a function, and so part of its code."""
    functions = (each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef))
    return any(inner is node for each in functions for line in each.body for inner in ast.walk(line))


def _cpu_seconds() -> float:
    used = (resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def _apart(cpu_seconds: int | None, run: Callable[[], int]) -> int:
    """Run something in a forked process; its result, below zero where it was ended.

    Args:
        cpu_seconds: After which it is ended, and what it says is not shown; without a limit it is.
        run: What to run.
    """
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            if cpu_seconds is not None:
                resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds))
                nothing = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nothing, 1)
                os.dup2(nothing, 2)
            code = run()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


class _NotFast(BaseException):
    """Ends a test: nothing that looks for failing examples takes it for a failure."""


def _end_slow_test(_: int, frame: FrameType | None) -> None:
    if frame is not None and Path(frame.f_code.co_filename).is_relative_to(Path(coverage.__file__).parent):
        # it holds a lock, which nobody would give back
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.01)
        return
    raise _NotFast


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
    parser.add_argument("--survey", type=Path, help="a file that keeps the survey; what it lacks is added")
    parser.add_argument("--survey-seconds", type=float, default=float("inf"), help="CPU seconds of the survey at most")
    parser.add_argument("--tests", nargs="+", default=TESTS, help="the tests that may notice")
    parser.add_argument("--only", type=Path, help="what an earlier run printed: what survived there is tried again")
    parser.add_argument("--enough", type=float, default=30.0, help="CPU seconds of tests that are run against a change")
    options = parser.parse_args()
    if options.survey is not None:
        options.survey = options.survey.absolute()
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as name:
        mutation = _Mutation(options, Path(name))
        words = [*_OPTIONS, "-s", "-p", "no:terminal", f"--basetemp={name}/tests", *options.tests]
        ended = pytest.main(words, [mutation])
    sys.exit(ended not in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED) or not mutation.noticed_all)


if __name__ == "__main__":
    main()
