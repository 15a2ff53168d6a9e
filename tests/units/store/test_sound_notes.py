"""Notes of sound datasets: one is read whole once, and again when it has changed."""

from __future__ import annotations

import os
import shutil

import scenicq
from scenicq.notebook import datasets
from scenicq.store.dataset import open_dataset
from scenicq.store.sound_notes import SoundNotes


def test_a_note_holds_as_long_as_no_file_changes(crossroads, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(crossroads, copy)
    dataset = open_dataset(copy, check=False)
    for notes in (SoundNotes(), SoundNotes(tmp_path / "notes" / "sound")):
        assert not notes.has(dataset.place, dataset.manifest)
        notes.add(dataset.place, dataset.manifest)
        assert notes.has(dataset.place, dataset.manifest)
    assert SoundNotes(tmp_path / "notes" / "sound").has(dataset.place, dataset.manifest)
    assert not SoundNotes().has(dataset.place, dataset.manifest)
    labels = next((copy / "labels").glob("*.parquet"))
    os.utime(labels, ns=(1, 1))
    assert not SoundNotes(tmp_path / "notes" / "sound").has(dataset.place, dataset.manifest)


def test_a_folder_that_cannot_be_written_is_no_error(crossroads, tmp_path):
    (tmp_path / "file").write_text("")
    notes = SoundNotes(tmp_path / "file" / "sound")
    dataset = open_dataset(crossroads, check=False)
    notes.add(dataset.place, dataset.manifest)
    assert notes.has(dataset.place, dataset.manifest)


def test_a_dataset_is_read_whole_once_in_a_process(crossroads, tmp_path, monkeypatch):
    copy = tmp_path / "copy"
    shutil.copytree(crossroads, copy)
    whole: list[object] = []

    def noted(address, **options):
        whole.extend([address] if options.get("check", True) else [])
        return open_dataset(address, **options)

    monkeypatch.setattr(datasets, "open_dataset", noted)
    for notes in (None, None, tmp_path / "notes", tmp_path / "notes"):
        assert len(scenicq.open(copy, notes=notes)) == 156
    assert whole == [copy, copy]
