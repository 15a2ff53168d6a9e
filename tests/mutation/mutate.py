"""Coverage by mutation: small changes of `match/`, `query/prefilter` and `forest/`, and whether fast tests notice them.

Each change is made in a copy of the package, and the tests of the changed module's folder are run against it; a run
that takes too long counts as noticed, for a change may make a loop endless. Survivors are printed to be read.
"""

import argparse
import ast
import os
import random
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
    parser.add_argument("--timeout", type=float, default=300.0, help="seconds for the tests of one change")
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
        for folder, file, number in chosen:
            tree = ast.parse(file.read_text())
            target = work / file.relative_to(ROOT)
            for place, (line, what) in enumerate(mutants(tree)):
                if place == number:
                    target.write_text(ast.unparse(tree))
                    noticed = _noticed(work, folder, options.timeout)
                    outcomes["noticed" if noticed else "survived"] += 1
                    if not noticed:
                        print(f"survived: {file.relative_to(ROOT)}:{line} {what}", flush=True)
            shutil.copy(file, target)
    print(f"{outcomes['noticed']} of {outcomes.total()} changes noticed")
    sys.exit(outcomes["noticed"] < 0.9 * outcomes.total())


def _noticed(work: Path, folder: str, timeout: float) -> bool:
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    environment = {**os.environ, "PYTHONPATH": str(work), "PYTHONDONTWRITEBYTECODE": "1"}
    for tests in (TESTS[folder], _LAST):
        try:
            done = subprocess.run([*words, *tests], cwd=work, env=environment, capture_output=True, timeout=timeout,
                                  check=False)  # fmt: skip
        except subprocess.TimeoutExpired:
            return True
        if done.returncode:
            return True
    return False


if __name__ == "__main__":
    main()
