"""The changes that the page for contributors shows apply to this version, and their tests pass."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "scenicq" / "docs" / "changes"
CHANGES = sorted(FOLDER.glob("*.diff"))
ALSO = {
    "importer": ["tests/contracts/test_importers.py", "tests/units/importers/test_registry.py"],
    "specifier": ["tests/test_language.py"],
    "distribution": ["tests/test_language.py"],
    "tolerance": ["tests/units/match/test_tolerance.py"],
}
"""Tests of what is around a change, beside those that it brings."""
pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="git applies the changes")


def apply(change: Path, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = ["git", "apply", *options, str(change)]
    environment = {**os.environ, "GIT_CEILING_DIRECTORIES": str(folder.parent)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_the_page_shows_each_change():
    page = (FOLDER.parent / "CONTRIBUTING.md").read_text()
    assert sorted(set(re.findall(r"\]\(changes/(\w+)\.diff\)", page))) == [change.stem for change in CHANGES]
    assert ALSO.keys() == {change.stem for change in CHANGES}


@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.stem)
def test_a_change_applies(change):
    done = apply(change, ROOT, "--check", "-C1")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.stem)
def test_the_tests_of_a_change_pass(change, tmp_path):
    copy = tmp_path / "scenicq"
    for name in ("scenicq", "cli", "tests", "sample_data", "pyproject.toml", "README.md"):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copyfile(source, copy / name)
    done = apply(change, copy, "-C1")
    assert done.returncode == 0, done.stderr
    brought = re.findall(r"^\+\+\+ b/(tests/\S*test_\w+\.py)$", change.read_text(), re.MULTILINE)
    assert brought
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    tests = list(dict.fromkeys([*brought, *ALSO[change.stem]]))
    done = subprocess.run([*command, *tests], cwd=copy, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "failed" not in done.stdout.splitlines()[-1]
