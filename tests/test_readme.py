"""The commands and programs that pages for users show are run, in the folder of the sample data.

In a `console` block, a line `$ command` is run; the lines up to the next command are compared with what it prints on
standard output and error, where `...` stands for anything. Lines that start with `$ make` or `$ pip` are for reading.
Each `python` block is run as a file of its own.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from console_blocks import blocks, matches, steps

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [
    page
    for page in (ROOT / "README.md", ROOT / "cli" / "README.md", *sorted((ROOT / "scenicq" / "docs").glob("*.md")))
    if any(blocks(page.read_text(encoding="utf-8"), "console", "python"))
]
WORDS = 1_500
"""As many as are read in five minutes, with the tables in between."""


def _run_block(kind, text, folder, command):
    """Run a block of a page; what it prints is what stands there."""
    if kind == "python":
        done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        if "for found in crossing:" in text:
            assert len(re.findall(r"^03-busy-intersection/\d\d {'ego': 'ego'", done.stdout, re.MULTILINE)) == 5
        return
    for line, expected in steps(text):
        if not line.startswith(("make", "pip", "git", "cd")):
            words = line.replace("scenicq ", f"{command} ", 1)
            done = subprocess.run(
                words, shell=True, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
            )
            assert matches(expected, done.stdout), f"$ {line}\n{done.stdout}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
@pytest.mark.one_in(3)
def test_what_a_page_shows_is_what_happens(page, crossroads, command, tmp_path):
    shutil.copytree(ROOT / "sample_data", tmp_path / "sample_data")
    if page.parent != ROOT:  # the first page says how `town` is made
        shutil.copytree(crossroads, tmp_path / "town")
    for block in blocks(page.read_text(encoding="utf-8"), "console", "python"):
        _run_block(block[1], block[3], tmp_path, command)


def test_the_readme_and_four_pages_show_what_happens():
    assert len(PAGES) >= 5


def test_the_readme_is_read_in_five_minutes():
    assert len(README.split()) <= WORDS


def test_two_commands_set_up_a_fresh_machine():
    start = README.partition("## Start")[2].partition("\n## ")[0]
    assert re.findall(r"^\$ (make.*)$", start, re.MULTILINE) == ["make demo", "make test"]


def test_the_scenario_shown_is_the_one_that_is_run():
    (shown,) = re.findall(r"```scenic\n(.*?)```", README, re.DOTALL)
    file = (ROOT / "sample_data" / "scenarios" / "02_crossing_cars.scenic").read_text(encoding="utf-8")
    assert file.partition("\n")[2].strip() == shown.strip()


def test_the_comparison_compares():
    assert matches("a\n...\nz", "a\nb\nc\nz\n")
    assert not matches("a\n...\nz", "a\nb\nc\n")
    assert not matches("a", "a\nb")
