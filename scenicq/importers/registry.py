"""Which importers there are, and which of them reads a source."""

from __future__ import annotations

from importlib.metadata import entry_points
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.argoverse2 import Argoverse2
from scenicq.importers.argoverse2_forecasting import Argoverse2Forecasting
from scenicq.importers.base import Importer
from scenicq.importers.commonroad import CommonRoad
from scenicq.importers.interaction import Interaction
from scenicq.importers.interchange import Interchange
from scenicq.importers.kitti import Kitti
from scenicq.importers.nuscenes import NuScenes
from scenicq.importers.openlabel import OpenLabel
from scenicq.importers.waymo import Waymo
from scenicq.store.manifest import is_dataset

__all__ = ["ENTRY_POINTS", "choose_importer", "importers"]

ENTRY_POINTS = "scenicq.importers"
"""Group of entry points by which other packages add importers; each names a class without arguments."""


def importers() -> dict[str, Importer]:
    """All importers by name: the built-in ones, then those of installed packages."""
    built_in: tuple[Importer, ...] = (
        Interchange(),
        NuScenes(),
        Argoverse2(),
        Argoverse2Forecasting(),
        Waymo(),
        CommonRoad(),
        Kitti(),
        OpenLabel(),
        Interaction(),
    )
    found: dict[str, Importer] = {importer.name: importer for importer in built_in}
    for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: (entry.name, entry.value)):
        if entry.name not in found:
            found[entry.name] = entry.load()()
    return found


def choose_importer(source: Path, name: str | None = None) -> Importer:
    """The importer that reads a source.

    Args:
        source: The source.
        name: Of an importer, to choose it whatever it recognises.

    Raises:
        DataError: `file-missing`, `option-invalid`, `dataset-unrecognised` or `dataset-ambiguous`.
    """
    known = importers()
    if name is not None and name not in known:
        hint = f"known formats: {', '.join(known)}"
        raise DataError(Diagnostic("option-invalid", f"there is no format `{name}`", hints=(hint,)))
    if not source.exists():
        raise DataError(Diagnostic("file-missing", f"{source} is not there"))
    if name is not None:
        return known[name]
    claimants = [importer for importer in known.values() if importer.recognises(source)]
    if len(claimants) == 1:
        return claimants[0]
    if claimants:
        names = " and ".join(f"`{importer.name}`" for importer in claimants)
        hints = tuple(f"`--format {importer.name}` chooses one" for importer in claimants)
        raise DataError(Diagnostic("dataset-ambiguous", f"{source} is recognised by {names}", hints=hints))
    hints = tuple(f"`{importer.name}` looks for {importer.layout}" for importer in known.values())
    if is_dataset(source):
        hints = ("it is a dataset of scenicq already",)
    raise DataError(Diagnostic("dataset-unrecognised", f"no importer recognises {source}", hints=hints))
