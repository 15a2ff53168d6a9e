"""The user's folders for what the program can do without: notes, and files that can be made again.

`SCENICQ_STATE=off` keeps both from being read or written.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["map_cache", "state_folder", "user_cache"]

STATE = "SCENICQ_STATE"


def _is_off() -> bool:
    return os.environ.get(STATE, "").lower() == "off"


def _base(variable: str, usual: str) -> Path:
    """A folder of the user's; an entry that is not absolute is to be ignored, says the XDG specification."""
    base = Path(os.environ.get(variable, ""))
    return base if base.is_absolute() else Path.home() / usual


def state_folder() -> Path:
    """The folder of this user's notes; it need not be there.

    Raises:
        RuntimeError: The user has no home, or wants nothing to be remembered.
    """
    if _is_off():
        raise RuntimeError(f"{STATE} is off")
    if sys.platform == "win32":
        return _base("LOCALAPPDATA", "AppData/Local") / "scenicq"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "scenicq"
    return _base("XDG_STATE_HOME", ".local/state") / "scenicq"


def user_cache() -> Path:
    """The folder of files that can be made again; it need not be there.

    Raises:
        RuntimeError: The user has no home.
    """
    if sys.platform == "win32":
        return _base("LOCALAPPDATA", "AppData/Local") / "scenicq" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "scenicq"
    return _base("XDG_CACHE_HOME", ".cache") / "scenicq"


@contextmanager
def map_cache() -> Generator[Path]:
    """The folder of converted maps; a temporary one where nothing is to be kept."""
    if not _is_off():
        yield user_cache() / "maps"
        return
    with tempfile.TemporaryDirectory(prefix="scenicq-") as folder:
        yield Path(folder)
