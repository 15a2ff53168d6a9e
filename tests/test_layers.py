"""The contracts on imports hold, and every folder is shipped."""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_contracts_on_imports_are_kept():
    command = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([command, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "Contracts: 8 kept, 0 broken." in done.stdout


PAGES = {"decisions", "docs", "typings"}
"""Folders for those who have the sources: pages, and what the type checker is told."""


def test_every_folder_is_shipped():
    listed = set(SETTINGS["tool"]["setuptools"]["packages"])
    folders = {
        path.parent.relative_to(ROOT)
        for path in (ROOT / "scenicq").rglob("*.*")
        if "__pycache__" not in path.parts and path.relative_to(ROOT).parts[1] not in PAGES
    }
    assert listed == {".".join(folder.parts) for folder in folders} | {"scenicq_cli"}


def test_every_data_file_is_shipped():
    patterns = SETTINGS["tool"]["setuptools"]["package-data"]
    for file in (ROOT / "scenicq").rglob("*"):
        if (
            file.is_file()
            and file.suffix not in (".py", ".pyc", ".md")
            and file.relative_to(ROOT).parts[1] not in PAGES
        ):
            package = ".".join(file.parent.relative_to(ROOT).parts)
            assert any(file.match(pattern) for pattern in patterns.get(package, ())), file
