"""The commands that the README shows are run, in the folder of the sample data, and print what it shows.

In a `console` block, a line `$ command` is run; the lines up to the next command are compared with what it prints on
standard output and error, where `...` stands for anything. Blocks that start with `$ make` or `$ pip` are for reading.
"""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def _blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def _steps(block):
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output


def _matches(expected, actual):
    parts = [re.escape(part) for part in expected.strip().split("...")]
    return re.fullmatch(".*".join(parts), actual.strip(), re.DOTALL) is not None


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the sample data, in which the blocks run one after the other."""
    here = tmp_path_factory.mktemp("readme")
    shutil.copytree(ROOT / "sample_data", here / "sample_data")
    return here


def test_the_commands_print_what_is_shown(folder, command):
    ran = 0
    for block in _blocks("console"):
        for line, expected in _steps(block):
            if not line.startswith(("make", "pip", "git", "cd")):
                words = line.replace("scenicq ", f"{command} ", 1)
                done = subprocess.run(
                    words,
                    shell=True,
                    cwd=folder,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    check=False,
                )
                actual = re.sub(r"[ \t]+$", "", done.stdout, flags=re.MULTILINE)
                assert _matches(expected, actual), f"$ {line}\n{actual}"
                ran += 1
    assert ran >= 6


def test_the_python_example_runs(folder, command):
    subprocess.run([command, "ingest", "sample_data/crossroads", "town", "-q", "--force"], cwd=folder, check=True)
    (program,) = _blocks("python")
    done = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True, check=True)
    assert len(re.findall(r"^03-busy-intersection/\d\d {'ego': 'ego'", done.stdout, re.MULTILINE)) == 5


def test_the_scenario_shown_is_the_one_that_is_run():
    (shown,) = _blocks("scenic")
    file = (ROOT / "sample_data" / "scenarios" / "02_crossing_cars.scenic").read_text(encoding="utf-8")
    assert file.partition("\n")[2].strip() == shown.strip()


def test_the_comparison_compares():
    assert _matches("a\n...\nz", "a\nb\nc\nz\n")
    assert not _matches("a\n...\nz", "a\nb\nc\n")
    assert not _matches("a", "a\nb")
