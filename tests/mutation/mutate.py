"""Coverage by mutation: small changes of `match/`, `query/prefilter` and `forest/`, and whether fast tests notice them.

Each change is made in a copy of the package, and tests are run against it, those that are named like the module first;
a run that takes much longer than without a change counts as noticed, for a change may make a loop endless. Survivors
are printed to be read. That the tests pass in the copy without a change is seen first.
"""

import argparse
import ast
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
TESTS = {
    "match": ["tests/match"],
    "query/prefilter": ["tests/query/prefilter"],
    "forest": ["tests/forest", "tests/compiler"],
}
"""The tests that should notice a change in a folder; those of the whole chain come after them."""
_LAST = ["tests/query/test_five.py", "tests/generate/test_generate.py"]
_NO_TESTS = 5
"""The exit code of pytest where nothing is to be run."""
_MOST_S = 3600.0
"""After so long a run hangs: it waits for what never comes."""
_SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}  # fmt: skip


def mutants(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Changes that can be made: each makes the change in the tree, is handed out, and takes it back."""
    for node in ast.walk(tree):
        match node:
            case ast.Compare(ops=ops):
                for place, op in enumerate(ops):
                    if type(op) in _SWAPS:
                        ops[place] = _SWAPS[type(op)]()
                        yield node.lineno, f"{type(op).__name__} -> {type(ops[place]).__name__}"
                        ops[place] = op
            case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in _SWAPS:
                node.op = _SWAPS[type(op)]()
                yield node.lineno, f"{type(op).__name__} -> {type(node.op).__name__}"
                node.op = op
            case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
                node.test = ast.UnaryOp(ast.Not(), test)
                yield node.lineno, "condition inverted"
                node.test = test
            case ast.Constant(value=bool() as value):
                node.value = not value
                yield node.lineno, f"{value} -> {not value}"
                node.value = value
            case ast.Constant(value=int() as value):
                node.value = value + 1
                yield node.lineno, f"{value} -> {value + 1}"
                node.value = value
            case ast.Return(value=ast.expr() as value):
                node.value = ast.Constant(None)
                yield node.lineno, "returns None"
                node.value = value
            case _:
                pass


def main() -> None:
    """Make changes, run tests, count; exits with 1 where less than nine in ten are noticed."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    files = [(folder, file) for folder in TESTS for file in sorted((ROOT / "scenicq" / folder).rglob("*.py"))]
    every = [
        (folder, file, number)
        for folder, file in files
        for number, _ in enumerate(mutants(ast.parse(file.read_text())))
    ]
    chosen = random.Random(options.seed).sample(every, min(options.count, len(every)))
    outcomes: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for part in ("scenicq", "cli", "tests", "sample_data", "pyproject.toml", "README.md"):
            copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
            copy(ROOT / part, work / part)
        (work / "scenicq_cli").symlink_to("cli")
        limits = {
            tests: _seconds(work, tests)
            for tests in {name for folder, file, _ in chosen for name in _tests(folder, file)}
        }
        for folder, file, number in chosen:
            tree = ast.parse(file.read_text())
            target = work / file.relative_to(ROOT)
            for place, (line, what) in enumerate(mutants(tree)):
                if place == number:
                    target.write_text(ast.unparse(tree))
                    noticed = any(_fails(work, name, limits[name]) for name in _tests(folder, file))
                    outcomes["noticed" if noticed else "survived"] += 1
                    if not noticed:
                        print(f"survived: {file.relative_to(ROOT)}:{line} {what}", flush=True)
            shutil.copy(file, target)
    print(f"{outcomes['noticed']} of {outcomes.total()} changes noticed")
    sys.exit(outcomes["noticed"] < 0.9 * outcomes.total())


def _tests(folder: str, file: Path) -> list[str]:
    """The tests that should notice a change of a module: those of its name, of its folder, and of the whole chain."""
    inside = file.relative_to(ROOT / "scenicq")
    named = Path("tests", inside.parent, f"test_{inside.name}")
    beside = [str(path) for path in (named, named.parent) if (ROOT / path).exists()]
    return [*dict.fromkeys([*beside, *TESTS[folder], *_LAST])]


def _run(work: Path, tests: str, cpu_seconds: int | None) -> tuple[int, float]:
    """Run tests in the copy: the exit code, below zero where the time was over, and the CPU seconds."""
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not slow", tests]
    environment = {**os.environ, "PYTHONPATH": str(work), "PYTHONDONTWRITEBYTECODE": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)

    def limit() -> None:
        if cpu_seconds is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds))

    try:
        done = subprocess.run(words, cwd=work, env=environment, capture_output=True, check=False, preexec_fn=limit,
                              timeout=_MOST_S)  # fmt: skip
    except subprocess.TimeoutExpired:
        return -1, _MOST_S
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.returncode, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _seconds(work: Path, tests: str) -> int:
    """The CPU seconds that tests may take: three times what they take without a change."""
    code, took = _run(work, tests, None)
    if code not in (0, _NO_TESTS):
        raise SystemExit(f"{tests} fails without a change")
    return 30 + int(3 * took)


def _fails(work: Path, tests: str, cpu_seconds: int) -> bool:
    return _run(work, tests, cpu_seconds)[0] not in (0, _NO_TESTS)


if __name__ == "__main__":
    main()
