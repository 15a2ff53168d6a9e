"""What the command keeps in the user's own folders: where `cli/README.md` says, or nowhere."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from scenicq_cli.user_folders import map_cache, user_cache

SAMPLES = Path(__file__).parents[3] / "sample_data"
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the folders are those of Linux")


@pytest.mark.parametrize(
    ("more", "kept"),
    [
        ({}, ".local/state/scenicq"),
        ({"XDG_STATE_HOME": "{home}/elsewhere"}, "elsewhere/scenicq"),
        ({"XDG_STATE_HOME": "relative"}, ".local/state/scenicq"),
        ({"SCENICQ_STATE": "off"}, None),
        ({"SCENICQ_STATE": "off", "XDG_STATE_HOME": "{home}/elsewhere"}, None),
    ],
)
@pytest.mark.one_in(6)
@pytest.mark.slow
def test_the_state_lies_where_the_readme_says(more, kept, command, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    env = {"PATH": os.environ["PATH"], "HOME": str(home)} | {key: text.format(home=home) for key, text in more.items()}
    for words in (
        ("ingest", SAMPLES / "crossroads", tmp_path / "d", "-q"),
        ("match", SAMPLES / "scenarios" / "02_crossing_cars.scenic", tmp_path / "d", "--limit", "1", "--exit-zero"),
    ):
        done = subprocess.run([command, *words], capture_output=True, text=True, check=False, env=env, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("error")) == (0, 0), done.stderr
    written = {path.relative_to(home).parent.as_posix() for path in home.rglob("*") if path.is_file()}
    assert all(each.startswith(kept) for each in written) if kept else not written
    assert bool(written) == (kept is not None)


def test_converted_maps_are_kept_in_the_cache_or_go_again(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with map_cache() as folder:
        assert folder == tmp_path / "scenicq" / "maps" == user_cache() / "maps"
    monkeypatch.setenv("SCENICQ_STATE", "off")
    with map_cache() as folder:
        (folder / "map").touch()
    assert not folder.exists()
    assert not list(tmp_path.iterdir())
