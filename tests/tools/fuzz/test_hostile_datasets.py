"""A dataset is checked as data: whatever its checksums say, no reader meets what it does not expect."""

import json
import random
import shutil
from pathlib import Path

import pyarrow as pa
import pytest
from hostile_datasets import commands, damages, enter, make_hostile, nested, rewrite

from scenicq.errors import DataError
from scenicq.store.dataset import open_dataset
from scenicq.store.separate_check import check_apart
from scenicq.store.soundness import check_dataset
from scenicq.store.wkb import wkb_problem

PROGRAM = Path(__file__).parents[3] / "sample_data/scenarios/02_crossing_cars.scenic"
KINDS = damages()
SOME = random.Random(16).sample(sorted(KINDS), 60)
REFUSED = (
    "regions.geometry nested", "regions.geometry counts", "regions.geometry nan", "regions.geometry bow",
    "labels.object_count -1", "labels.first_object 2147483647", "labels.params json 2", "objects.attributes json 5",
    "objects.x nan", "objects.x inf", "objects.x 1e+300", "objects.heading 1e+300", "objects.road_directions [nan]",
    "objects.x null", "objects.x type", "objects.x missing", "objects column twice", "objects empty", "objects twice",
    "objects backwards", "objects text", "objects magic", "objects no parts", "memberships.object text 2",
    "frame_index backwards", "lanes.centerline type", "regions.properties 2", "manifest total 5",
)  # fmt: skip


@pytest.fixture
def hostile(crossroads: Path, tmp_path: Path):
    return lambda kind: make_hostile(crossroads, tmp_path / "hostile", KINDS[kind]) and tmp_path / "hostile"


def test_there_are_as_many_kinds_of_damage_as_the_decisions_say():
    text = (Path(__file__).parents[3] / "scenicq/decisions/testing.md").read_text()
    assert f"{len(KINDS)} kinds of damage" in text
    assert len(COMMANDS) == 9
    assert "read in nine ways" in text


@pytest.mark.parametrize("kind", REFUSED)
def test_what_no_reader_expects_is_refused(kind, hostile):
    folder = hostile(kind)
    assert folder
    with pytest.raises(DataError) as caught:
        open_dataset(folder)
    assert {each.code for each in caught.value.diagnostics} <= {"dataset-invalid", "store-damaged"}


@pytest.mark.parametrize("kind", SOME)
@pytest.mark.one_in(2)
def test_a_damaged_dataset_opens_or_is_refused(kind, hostile):
    folder = hostile(kind)
    if folder:
        codes = set()
        try:
            open_dataset(folder)
        except DataError as error:
            codes = {each.code for each in error.diagnostics}
        assert codes <= {"dataset-invalid", "store-damaged"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(SOME) - set(REFUSED)))
def test_every_damaged_dataset_opens_or_is_refused(kind, hostile):
    test_a_damaged_dataset_opens_or_is_refused(kind, hostile)


def test_a_message_names_file_row_and_column(crossroads, tmp_path):
    folder = tmp_path / "hostile"
    shutil.copytree(crossroads, folder)

    def change(rows: pa.Table) -> pa.Table:
        values = rows["y"].to_pylist()
        values[2] = float("nan")
        return rows.set_column(rows.column_names.index("y"), "y", pa.array(values))

    rewrite(folder, "objects", change)
    with pytest.raises(DataError, match=r"objects/part-00000-\w+\.parquet, row 3, column `y`: is not finite"):
        open_dataset(folder)


def test_a_sound_dataset_is_sound(crossroads):
    dataset = open_dataset(crossroads, check=False)
    check_dataset(dataset.place, dataset.manifest)


def test_nested_collections_never_reach_the_geometry_library():
    assert wkb_problem(nested(100_000), lines=False) == "is not a polygon in the plane"


COMMANDS = ("match", "bare", "report", "check", "info", "show", "explain", "sample", "index")


@pytest.mark.parametrize("what", COMMANDS)
@pytest.mark.one_in(12)
def test_every_command_that_is_run_on_damage_does_its_work_without(what, run, crossroads, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(crossroads, folder)
    words = commands(folder, tmp_path)
    assert set(words) == set(COMMANDS)
    assert run(*words[what]).exit_code == 0


@pytest.mark.parametrize("what", COMMANDS)
def test_no_command_reads_nested_collections(what, run, hostile, tmp_path, monkeypatch):
    monkeypatch.setattr("scenicq_cli.datasets.check_apart", lambda dataset: dataset.open(check=True))
    result = run(*commands(hostile("regions.geometry nested"), tmp_path)[what])
    assert result.exit_code == 2
    assert result.stderr.startswith("error[dataset-invalid]")
    assert "row 1, column `geometry`" in result.stderr


def test_the_command_refuses_a_strangers_dataset_and_says_where(run, hostile):
    folder = hostile("objects.road_directions [nan]")
    for more in ((), ("--no-prefilter",)):
        result = run("match", PROGRAM, folder, *more)
        assert result.exit_code == 2
        assert "dataset-invalid" in result.stderr
        assert "column `road_directions`: is not finite" in result.stderr


def test_a_dataset_is_looked_at_once_and_again_after_a_change(run, crossroads, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = tmp_path / "copy"
    shutil.copytree(crossroads, folder)
    assert run("info", folder).exit_code == 0
    notes = list((tmp_path / "state/scenicq/sound").iterdir())
    assert len(notes) == 1
    assert run("info", folder).exit_code == 0
    assert list((tmp_path / "state/scenicq/sound").iterdir()) == notes
    KINDS["objects.x nan"](folder)
    assert run("info", folder).exit_code == 2


def test_a_dataset_made_here_is_not_looked_at(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr("scenicq_cli.datasets.check_apart", lambda _: pytest.fail("it was looked at"))
    assert run("ingest", PROGRAM.parents[1] / "crossroads", tmp_path / "made", "-q").exit_code == 0
    assert run("info", tmp_path / "made").exit_code == 0


def _die() -> object:
    import os

    os._exit(1)


def test_a_dataset_that_ends_the_process_which_reads_it_is_refused(crossroads, monkeypatch):
    monkeypatch.setattr("scenicq.store.separate_check._start", _answer_by_dying)
    with pytest.raises(DataError, match="the process that reads it dies"):
        check_apart(open_dataset(crossroads, check=False).reference)


def _answer_by_dying():
    return lambda address, tell: _die()


def test_what_was_computed_at_ingest_is_computed_again(run, crossroads, tmp_path):
    folder = tmp_path / "hostile"
    shutil.copytree(crossroads, folder)
    rewrite(folder, "memberships", lambda rows: rows.slice(0, len(rows) - 1))
    open_dataset(folder)
    assert run("info", folder).exit_code == 0
    told = run("info", folder, "--verify")
    assert told.exit_code == 2
    assert "dataset-invalid" in told.stderr
    assert run("info", crossroads, "--verify").exit_code == 0


def test_a_file_that_is_entered_in_the_manifest_with_another_table_is_refused(crossroads, tmp_path):
    folder = tmp_path / "hostile"
    shutil.copytree(crossroads, folder)
    parts = json.loads((folder / "dataset.json").read_text())["tables"]
    shutil.copy(folder / parts["sensors"][0]["path"], folder / parts["labels"][0]["path"])
    enter(folder, "labels", 0)
    with pytest.raises(DataError, match="has other columns than it must have"):
        open_dataset(folder)
