"""Benchmarks, fuzzers and comparisons that nobody runs every day still find what they import."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
FOLDERS = ("bench", "conformance", "dependencies", "fuzz", "mutation", "source_mutations")
SCRIPTS = [
    file
    for folder in FOLDERS
    for file in sorted((TESTS / "tools" / folder).glob("*.py"))
    if not file.name.startswith(("test_", "conftest"))
]
ELSEWHERE = {"scenic", "rv_ltl", "coverage"}
"""Packages that are in environments of their own."""
RUN = "import runpy, sys; sys.path[0] = sys.argv[1]; runpy.run_path(sys.argv[2], run_name='imported')"


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda file: file.relative_to(TESTS).as_posix())
def test_a_script_finds_what_it_imports(script):
    command = [sys.executable, "-c", RUN, str(script.parent), str(script)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "missing libraries: libibex.so" in done.stderr:
        pytest.skip("dReal is installed without libibex.so")
    missing = re.search(r"No module named '(\w+)", done.stderr)
    assert done.returncode == 0 or (missing and missing[1] in ELSEWHERE), done.stderr
