"""Folders of a dataset that are links: nobody reads, writes or removes anything through one."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.manifest import FOLDERS
from scenicq.store.partial import Partial
from scenicq.store.rebuild import rebuild

SOURCE = Path(__file__).parents[3] / "sample_data" / "nuscenes_tiny"
pytestmark = pytest.mark.skipif(os.name != "posix", reason="links")


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tiny") / "d"
    ingest(SOURCE, folder)
    return folder


@pytest.fixture
def place(tmp_path: Path, tiny: Path) -> Path:
    """A folder with a dataset `d` and a folder `outside`."""
    shutil.copytree(tiny, tmp_path / "d")
    (tmp_path / "outside").mkdir()
    return tmp_path


def contents(folder: Path) -> dict[str, bytes | str]:
    """Every file by its path, and where links lead."""
    found: dict[str, bytes | str] = {}
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            found[str(path.relative_to(folder))] = os.readlink(path)
        elif path.is_file():
            found[str(path.relative_to(folder))] = path.read_bytes()
    return found


def read(dataset: Path) -> None:
    list(open_dataset(dataset, check=False).labels())


def index(dataset: Path) -> None:
    rebuild(open_dataset(dataset, older=True, check=False))


def replace(dataset: Path) -> None:
    ingest(SOURCE, dataset, force=True)


def update(dataset: Path) -> None:
    ingest(SOURCE, dataset, update=True)


@pytest.mark.parametrize("use", [read, index, replace, update])
@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("name", FOLDERS)
def test_a_dataset_with_a_linked_folder_is_refused_and_untouched(
    place: Path, name: str, inside: bool, use: Callable[[Path], None]
) -> None:
    dataset = place / "d"
    real = (dataset / "real" if inside else place / "outside") / name
    real.parent.mkdir(exist_ok=True)
    (dataset / name).rename(real)
    (dataset / name).symlink_to(real)
    before = contents(place)
    with pytest.raises(DataError, match="link") as caught:
        use(dataset)
    assert {each.code for each in caught.value.diagnostics} <= {"store-damaged", "target-unwritable"}
    assert contents(place) == before


@pytest.mark.parametrize("name", ["", *FOLDERS])
@pytest.mark.one_in(3)
def test_nothing_is_written_through_links_where_a_dataset_grows(place: Path, name: str) -> None:
    left = Partial(place / "new").folder
    (place / "outside" / "mine").write_text("mine")
    if name:
        left.mkdir()
        (left / name).symlink_to(place / "outside")
    else:
        left.symlink_to(place / "outside")
    for force in (False, True):
        try:
            ingest(SOURCE, place / "new", force=force)
        except DataError as error:
            refused = {each.code for each in error.diagnostics}
        else:
            refused = set[str]()
        assert refused == (set() if name else {"target-unwritable"})
    assert contents(place / "outside") == {"mine": b"mine"}


def test_a_dataset_may_be_a_link_itself(place: Path) -> None:
    (place / "link").symlink_to(place / "d")
    frames = open_dataset(place / "link", check=False).manifest.total.frames
    replace(place / "link")
    index(place / "link")
    assert (place / "link").is_symlink()
    assert open_dataset(place / "d", check=False).manifest.total.frames == frames


def test_what_others_keep_beside_the_tables_stays(place: Path) -> None:
    (place / "d" / "notes").mkdir()
    (place / "d" / "notes" / "mine.txt").write_text("mine")
    (place / "d" / "labels" / "part-00000-old.parquet").write_bytes(b"old")
    index(place / "d")
    assert (place / "d" / "notes" / "mine.txt").read_text() == "mine"
    assert not (place / "d" / "labels" / "part-00000-old.parquet").exists()
