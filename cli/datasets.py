"""Open datasets for commands: one that somebody else made is checked once, before anything is done with it."""

from __future__ import annotations

from pathlib import Path

from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.separate_check import check_apart

from .sources import is_noted_sound, note_sound

__all__ = ["open_checked"]


def open_checked(address: str | Path) -> Dataset:
    """Open a dataset that a user names.

    Raises:
        DataError: As `open_dataset` does.
    """
    dataset = open_dataset(address, check=False)
    with dataset.blamed():
        if not is_noted_sound(dataset.place, dataset.manifest):
            check_apart(dataset.reference)
            note_sound(dataset.place, dataset.manifest)
    return dataset
