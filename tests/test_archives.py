"""The wheel has the code and its data and nothing else; the source archive makes that wheel, and it runs."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ARCHIVES = runpy.run_path(str(Path(__file__).parent / "tools/dependencies/archives.py"))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return ARCHIVES["build_archives"](tmp_path_factory.mktemp("archives"))


@pytest.mark.slow
def test_the_wheel_has_what_is_shipped_and_nothing_else(built):
    _, wheel = built
    assert ARCHIVES["files_of_wheel"](wheel) == ARCHIVES["shipped"]()
    assert wheel.stat().st_size < 4_000_000


@pytest.mark.slow
def test_the_source_archive_has_what_makes_the_wheel(built):
    archive, _ = built
    files = ARCHIVES["files_of_archive"](archive)
    assert {"LICENSE", "README.md", "pyproject.toml", "PKG-INFO"} <= files
    modules = {name.replace("scenicq_cli/", "cli/", 1) for name in ARCHIVES["shipped"]()}
    assert modules <= files
    assert not [
        name for name in files if name.startswith(("scenicq/docs", "scenicq/decisions", "tests", "sample_data"))
    ]


@pytest.mark.slow
def test_what_is_unpacked_runs(built, tmp_path):
    _, wheel = built
    code = "import sys; sys.argv = ['scenicq', 'doctor']; from scenicq_cli.start import main; main()"
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(wheel)!r}); {code}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "portable" in done.stdout


def test_what_is_shipped_is_known():
    shipped = ARCHIVES["shipped"]()
    assert {"scenicq/__init__.py", "scenicq_cli/start.py", "scenicq/py.typed"} <= shipped
    # one page is shipped, as a command shows it
    assert [name for name in shipped if name.endswith(".md")] == ["scenicq/codes.md"]
    assert not [name for name in shipped if "/docs/" in name]
