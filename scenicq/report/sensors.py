"""Find the sensor files of a frame: links that can only open a file, and thumbnails."""

from __future__ import annotations

import base64
import hashlib
import io
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from urllib.parse import quote

from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath, RemotePath

__all__ = ["Sensor", "SensorFiles", "can_make_thumbnails", "roots_of"]

_FORMATS = {".jpg": "JPEG", ".jpeg": "JPEG", ".png": "PNG", ".webp": "WEBP"}
"""Images by extension; Pillow must not try others, of which some run other programs."""
_MOST_PIXELS = 50_000_000
"""Pixels up to which an image is opened: four times the largest camera in use."""
INSIDE_BYTES = 10_000_000
"""Bytes of thumbnails that are put into a page; others lie beside it."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor file of a frame.

    Attributes:
        channel: Its channel.
        path: As the source gives it.
        link: The address of the file, relative to the report where that is possible; None if it was not found.
        thumbnail: The same of a small image, or the image itself as an address; None if there is none.
    """

    channel: str
    path: str
    link: str | None = None
    thumbnail: str | None = None


def roots_of(dataset: Dataset, source: Path | None) -> tuple[Path, ...]:
    """The folders on this machine where the sensor files of a dataset may be: its source's, and its own.

    Args:
        dataset: The dataset.
        source: Where the user says that it is from. What the dataset itself says is not taken: it may be a stranger's,
            and name any folder.
    """
    return tuple(filter(None, (source, dataset.folder)))


def can_make_thumbnails() -> bool:
    """Whether Pillow is installed, which makes them."""
    return find_spec("PIL") is not None


@dataclass(eq=False, slots=True)
class SensorFiles:
    """Finds sensor files.

    Attributes:
        roots: Folders that the paths may be relative to.
        report: The folder of the report as it will be, which links start from.
        folder: Where its files are written now.
        thumbnails: Whether small images are made.
        inside: Whether they are put into the page as far as that is reasonable, so that it can be sent as one file.
        most: Small images of one frame at most, those in front first.
        size: Width and height in pixels that a small image has at most.
    """

    roots: tuple[Path, ...]
    report: AnyPath
    folder: Path
    thumbnails: bool = False
    inside: bool = False
    most: int = 12
    size: tuple[int, int] = (320, 200)
    _made: dict[Path, str | None] = field(default_factory=dict[Path, str | None], init=False, repr=False)
    _bytes: int = field(default=0, init=False, repr=False)

    def find(self, sensors: Mapping[str, str]) -> list[Sensor]:
        """The sensor files of a frame, cameras first, and of those the one in front."""
        ordered = sorted(
            sensors.items(), key=lambda item: (not item[0].startswith("CAM"), "FRONT" not in item[0], item)
        )
        found: list[Sensor] = []
        seen = 0
        for channel, path in ordered:
            file = next(filter(_is_file, _candidates(self.roots, path)), None)
            if file is None:
                found.append(Sensor(channel, path))
                continue
            thumbnail = self._thumbnail(file) if seen < self.most else None
            seen += thumbnail is not None
            found.append(Sensor(channel, path, self._link(file), thumbnail))
        return found

    def _link(self, file: Path) -> str:
        if isinstance(self.report, RemotePath):
            return file.as_uri()
        try:
            relative = Path(os.path.relpath(file, self.report.resolve()))
        except ValueError:
            # another drive
            return file.as_uri()
        # "./" in front: no name of a file is ever read as a scheme
        return f"./{quote(relative.as_posix())}"

    def _thumbnail(self, file: Path) -> str | None:
        if not self.thumbnails or file.suffix.lower() not in _FORMATS:
            return None
        if file not in self._made:
            small = _small(file, self.size)
            self._made[file] = None if small is None else self._kept(file, small)
        return self._made[file]

    def _kept(self, file: Path, small: bytes) -> str:
        """The address of a small image."""
        if self.inside and self._bytes + len(small) <= INSIDE_BYTES:
            self._bytes += len(small)
            return f"data:image/jpeg;base64,{base64.b64encode(small).decode()}"
        name = f"thumbnails/{hashlib.sha256(os.fsencode(file)).hexdigest()[:20]}.jpg"
        target = self.folder / name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(small)
        return name


def _small(file: Path, size: tuple[int, int]) -> bytes | None:
    """Make a small JPEG of an image; None if the file is no image, broken, or too large."""
    images: Any = import_module("PIL.Image")
    into = io.BytesIO()
    try:
        with warnings.catch_warnings():
            # of images that are too large; what is done about them is said below
            warnings.simplefilter("ignore")
            image = images.open(file, formats=[_FORMATS[file.suffix.lower()]])
        with image as opened:
            if opened.width * opened.height > _MOST_PIXELS:
                return None
            # before anything is decoded: a JPEG is then read at a fraction of its size
            opened.draft("RGB", size)
            opened.thumbnail(size)
            opened.convert("RGB").save(into, "JPEG", quality=75)
    except (OSError, ValueError, SyntaxError, images.DecompressionBombError):
        return None
    return into.getvalue()


def _candidates(roots: tuple[Path, ...], path: str) -> Iterable[Path]:
    """Where a file may lie, without links; a path that leaves its root is not followed."""
    if "\0" in path or not path:
        return
    for root in roots:
        try:
            file = (root / path).resolve()
        except (OSError, RuntimeError):
            # a name too long for the file system, or a circle of links
            continue
        if file.is_relative_to(root.resolve()):
            yield file


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False
