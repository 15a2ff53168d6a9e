"""Notes of which datasets are sound, so that each is read whole once, and again only when it has changed."""

from __future__ import annotations

import contextlib
from pathlib import Path

from scenicq.store.manifest import Manifest
from scenicq.store.place import Place, stamp_of

__all__ = ["SoundNotes"]


class SoundNotes:
    """Which datasets this process found sound, or an earlier one with notes in the same folder.

    If the folder cannot be read or written, datasets are only read more often.
    """

    def __init__(self, folder: Path | None = None) -> None:
        """Begin with what the folder says.

        Args:
            folder: Where the notes are; None for what this process alone has found out.
        """
        self._folder = folder
        self._found: set[str] = set()

    def has(self, place: Place, manifest: Manifest) -> bool:
        """Whether a dataset was found sound and has not changed since.

        Args:
            place: Where the dataset is.
            manifest: The dataset's manifest.
        """
        stamp = stamp_of(place, manifest)
        with contextlib.suppress(OSError):
            return stamp in self._found or (self._folder is not None and (self._folder / stamp).exists())
        return False

    def add(self, place: Place, manifest: Manifest) -> None:
        """Note that a dataset is sound; arguments as of `has`."""
        stamp = stamp_of(place, manifest)
        self._found.add(stamp)
        if self._folder is not None:
            with contextlib.suppress(OSError):
                self._folder.mkdir(parents=True, exist_ok=True)
                (self._folder / stamp).touch()
