"""The sensor files of a frame, where they can be found: links that can only open a file, and thumbnails."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

__all__ = ["Sensor", "SensorFiles", "can_make_thumbnails"]

_IMAGES = frozenset({".jpg", ".jpeg", ".png", ".webp"})
_SIZE = (320, 200)


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor file of a frame.

    Attributes:
        channel: Its channel.
        path: As the source gives it.
        link: The address of the file, relative to the report where that is possible; None if it was not found.
        thumbnail: The same of a small image, if there is one.
    """

    channel: str
    path: str
    link: str | None = None
    thumbnail: str | None = None


def can_make_thumbnails() -> bool:
    """Whether Pillow is installed, which makes them."""
    return find_spec("PIL") is not None


@dataclass(frozen=True, slots=True)
class SensorFiles:
    """Finds sensor files.

    Attributes:
        roots: Folders that the paths may be relative to.
        report: The folder of the report as it will be, which links start from.
        folder: Where its files are written now.
        thumbnails: Whether small images are made.
    """

    roots: tuple[Path, ...]
    report: Path
    folder: Path
    thumbnails: bool = False

    def find(self, sensors: Mapping[str, str]) -> list[Sensor]:
        """The sensor files of a frame, cameras first."""
        ordered = sorted(sensors.items(), key=lambda item: (not item[0].startswith("CAM"), item))
        return [self._find(channel, path) for channel, path in ordered]

    def _find(self, channel: str, path: str) -> Sensor:
        file = next(filter(_is_file, _candidates(self.roots, path)), None)
        if file is None:
            return Sensor(channel, path)
        return Sensor(channel, path, self._link(file.resolve()), self._thumbnail(file))

    def _link(self, file: Path) -> str:
        try:
            relative = Path(os.path.relpath(file, self.report.resolve()))
        except ValueError:
            # another drive
            return file.as_uri()
        # "./" in front: no name of a file is ever read as a scheme
        return f"./{quote(relative.as_posix())}"

    def _thumbnail(self, file: Path) -> str | None:
        if not self.thumbnails or file.suffix.lower() not in _IMAGES:
            return None
        name = hashlib.sha256(os.fsencode(file.resolve())).hexdigest()[:20] + ".jpg"
        target = self.folder / "thumbnails" / name
        if not target.exists():
            target.parent.mkdir(exist_ok=True)
            image: Any = import_module("PIL.Image")
            try:
                with image.open(file) as opened:
                    small = opened.convert("RGB")
                    small.thumbnail(_SIZE)
                    small.save(target, quality=80)
            except (OSError, ValueError, image.DecompressionBombError):
                return None
        return f"thumbnails/{name}"


def _candidates(roots: tuple[Path, ...], path: str) -> Iterable[Path]:
    """Where a file may lie; a path that leaves its root is not followed."""
    if "\0" in path or not path:
        return
    for root in roots:
        file = (root / path).resolve()
        if file.is_relative_to(root.resolve()):
            yield file


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False
