"""Where the user's system keeps what can be made again."""

from __future__ import annotations

import os
import sys
from pathlib import Path

__all__ = ["user_cache"]


def user_cache() -> Path:
    """The folder of this program in the user's cache; it need not be there."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA")
        return (Path(base) if base else Path.home() / "AppData" / "Local") / "scenicq" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "scenicq"
    base = os.environ.get("XDG_CACHE_HOME", "")
    # An entry that is not absolute is to be ignored, says the XDG specification.
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "scenicq"
