"""What an export may look like, by name: all that a command line needs to know of exports before it makes one."""

from __future__ import annotations

__all__ = ["FORMS"]

FORMS = ("nuscenes-tokens", "argoverse2", "paths", "interchange", "openlabel")
"""Names of the forms."""
