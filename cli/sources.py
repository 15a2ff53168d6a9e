"""The folder in which the sensor files of a dataset are, as this user has said it, never as the dataset says.

A dataset names the folder that it was made from. But a dataset may come from a stranger, and a report shows small
images of the files that it names. So only two folders count: the one from which this user ingested just this dataset,
and the one that `--sensors` gives.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenicq.errors import Diagnostic
from scenicq.store.manifest import MANIFEST, Manifest, read_manifest
from scenicq.store.place import Place, find_place
from scenicq.store.sound_notes import SoundNotes

from .path_type import LocalPathType
from .report import show
from .user_folders import state_folder

if TYPE_CHECKING:  # an ingest needs no DuckDB, which comes with this
    from scenicq.store.dataset import Dataset

__all__ = ["SENSORS", "is_noted_sound", "note_sound", "recorded_source", "remember", "sensor_root"]

SENSORS = click.option(
    "--sensors",
    metavar="DIR",
    type=LocalPathType(path_type=Path, exists=True, file_okay=False),
    help="The folder that the paths of sensor files start from.  [default: the source, if you ingested it here]",
)
"""The option for that folder."""


def remember(folder: Path, source: Path) -> None:
    """Note that this user has made a dataset from a source, and that it is sound.

    If the user's folder cannot be written, nothing is noted.

    Args:
        folder: The dataset's folder.
        source: What it was made from.
    """
    with contextlib.suppress(OSError, RuntimeError):
        line = json.dumps({"dataset": _digest((folder / MANIFEST).read_bytes()), "source": str(source.resolve())})
        notes = _notes()
        notes.parent.mkdir(parents=True, exist_ok=True)
        with notes.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
        place = find_place(folder)
        note_sound(place, read_manifest(place.name, place.manifest()))


def note_sound(place: Place, manifest: Manifest) -> None:
    """Note that a dataset is sound as long as its files stay as they are.

    Args:
        place: Where the dataset is.
        manifest: The dataset's manifest.
    """
    with contextlib.suppress(OSError, RuntimeError):
        _sound().add(place, manifest)


def is_noted_sound(place: Place, manifest: Manifest) -> bool:
    """Whether this user made a dataset or found it sound, and it has not changed since."""
    try:
        return _sound().has(place, manifest)
    except (OSError, RuntimeError):
        return False


def _sound() -> SoundNotes:
    return SoundNotes(state_folder() / "sound")


def recorded_source(dataset: Dataset) -> Path | None:
    """The source that this user made a dataset from, wherever the dataset is now; None if somebody else made it."""
    digest = _digest(dataset.place.manifest())
    found = None
    with contextlib.suppress(OSError, RuntimeError, ValueError), _notes().open(encoding="utf-8") as file:
        for line in file:
            if digest in line:
                found = Path(json.loads(line)["source"])
    return found


def sensor_root(dataset: Dataset, given: Path | None) -> Path | None:
    """The folder that the paths of sensor files start from; None, with a warning, if nobody has said it.

    Args:
        dataset: The dataset; files in its own folder are found in any case.
        given: The folder that the user gives, if any.
    """
    root = given or recorded_source(dataset)
    if root is None and any(part.rows for part in dataset.manifest.tables["sensors"]):
        message = f"only {dataset.name} itself is searched for sensor files: it was not made here, or not by you"
        hint = "`--sensors DIR` gives the folder that their paths start from"
        show([Diagnostic("file-missing", message, hints=(hint,), severity="warning")])
    return root


def _digest(manifest: bytes) -> str:
    return hashlib.sha256(manifest).hexdigest()


def _notes() -> Path:
    return state_folder() / "ingested.jsonl"
