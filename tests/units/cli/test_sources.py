"""Images from beside a dataset get into a report by the word of who runs it, never by that of the dataset."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

SOURCE = Path(__file__).parents[3] / "sample_data" / "crossroads"
FRAME = "03-busy-intersection/09"
PICTURE = f"samples/CAM_FRONT/{FRAME}.jpg"


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """The sample recordings with one picture."""
    images = pytest.importorskip("PIL.Image", reason="the extra scenicq[thumbnails] is not installed")
    folder = tmp_path / "source"
    shutil.copytree(SOURCE, folder)
    (folder / PICTURE).parent.mkdir(parents=True)
    images.new("RGB", (320, 180)).save(folder / PICTURE)
    return folder


@pytest.fixture
def page(run: Callable[..., Any], tmp_path: Path) -> Callable[..., tuple[bool, str]]:
    """Whether the page of a frame has the picture inside, and what is said on the way."""

    def make(dataset: Path, *options: object) -> tuple[bool, str]:
        done = run("show", dataset, FRAME, "-o", tmp_path / "page.html", *options)
        assert done.exit_code == 0, done.output
        text = (tmp_path / "page.html").read_text(encoding="utf-8")
        inside = "data:image" in text
        assert inside == (PICTURE.rpartition("/")[2] + '"' in text)
        return inside, done.stderr

    return make


def test_whoever_ingests_sees_pictures(run: Callable[..., Any], source: Path, page: Any, tmp_path: Path) -> None:
    dataset = tmp_path / "d"
    assert run("ingest", source, dataset, "-q").exit_code == 0
    assert page(dataset) == (True, "")
    dataset.rename(tmp_path / "moved")
    assert page(tmp_path / "moved") == (True, "")
    assert run("index", tmp_path / "moved", "-q").exit_code == 0
    assert page(tmp_path / "moved") == (True, "")
    assert run("ingest", source, tmp_path / "moved", "--force", "-q").exit_code == 0
    assert page(tmp_path / "moved") == (True, "")


@pytest.mark.slow
def test_a_dataset_of_somebody_else_opens_no_folder(
    run: Callable[..., Any], source: Path, page: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("ingest", source, tmp_path / "d", "-q").exit_code == 0
    made = (tmp_path / "d" / "dataset.json").read_bytes()
    for changed in (made.replace(b"crossroads", b"crossroad2", 1), made):
        (tmp_path / "d" / "dataset.json").write_bytes(changed)
        assert json.loads(changed)["provenance"]["source"] == str(source)
        if changed == made:
            monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other user"))
        inside, told = page(tmp_path / "d")
        assert not inside
        assert "`--sensors DIR` gives the folder" in told
        assert run("index", tmp_path / "d", "-q").exit_code == 0
        assert not page(tmp_path / "d")[0]
        assert page(tmp_path / "d", "--sensors", source) == (True, "")
    (tmp_path / "d" / PICTURE).parent.mkdir(parents=True)
    shutil.copy(source / PICTURE, tmp_path / "d" / PICTURE)
    assert page(tmp_path / "d")[0]


def test_a_home_that_cannot_be_written_stops_no_ingest(
    run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    assert run("ingest", SOURCE, tmp_path / "d", "-q").exit_code == 0


def test_the_folder_given_must_be_there(run: Callable[..., Any], crossroads: Path, tmp_path: Path) -> None:
    done = run("show", crossroads, FRAME, "-o", tmp_path / "p.html", "--sensors", tmp_path / "none")
    assert done.exit_code == 2
    assert "does not exist" in done.output
