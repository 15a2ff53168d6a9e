"""Notes of datasets that were found to be sound: each is read whole once, and again only when it has changed."""

from __future__ import annotations

import contextlib
from pathlib import Path

from scenicq.store.manifest import Manifest
from scenicq.store.place import Place, stamp_of

__all__ = ["SoundNotes"]


class SoundNotes:
    """Which datasets are sound, as this process has found out, or one before it that kept notes in the same folder.

    A folder that cannot be read or written costs no more than that.
    """

    def __init__(self, folder: Path | None = None) -> None:
        """Begin with what the folder says.

        Args:
            folder: Of the notes; None for what this process alone has found out.
        """
        self._folder = folder
        self._found: set[str] = set()

    def has(self, place: Place, manifest: Manifest) -> bool:
        """Whether a dataset was found to be sound, and is as it was then.

        Args:
            place: Of the dataset.
            manifest: Of the dataset.
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
