"""Which importers there are, and which of them reads a source."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.importers import layouts
from scenicq.importers.base import Importer
from scenicq.store.manifest import is_dataset

__all__ = ["ENTRY_POINTS", "choose_importer", "importers"]

ENTRY_POINTS = "scenicq.importers"
"""Group of entry points by which other packages add importers; each names a class without arguments."""


@dataclass(frozen=True, slots=True)
class _BuiltIn:
    """An importer of this package, loaded when it is needed: one of them reads a source.

    Attributes:
        module, type: Where its class is.
        finds: Its `recognises`, or what that asks whether it has found anything.
    """

    module: str
    type: str
    finds: Callable[[Path], object]

    def load(self) -> Importer:
        """Make it."""
        importer: Importer = getattr(import_module(f"scenicq.importers.{self.module}"), self.type)()
        return importer


_BUILT_IN = {
    "interchange": _BuiltIn("interchange", "Interchange", layouts.is_interchange),
    "nuscenes": _BuiltIn("nuscenes", "NuScenes", layouts.is_nuscenes),
    "argoverse2": _BuiltIn("argoverse2", "Argoverse2", layouts.argoverse2_logs),
    "argoverse2-forecasting": _BuiltIn("argoverse2_forecasting", "Argoverse2Forecasting", layouts.argoverse2_scenarios),
    "waymo": _BuiltIn("waymo", "Waymo", layouts.waymo_files),
    "commonroad": _BuiltIn("commonroad", "CommonRoad", layouts.commonroad_files),
    "kitti": _BuiltIn("kitti", "Kitti", layouts.kitti_files),
    "openlabel": _BuiltIn("openlabel", "OpenLabel", layouts.openlabel_files),
    "interaction": _BuiltIn("interaction", "Interaction", layouts.interaction_files),
}


def importers() -> dict[str, Importer]:
    """All importers by name: the built-in ones, then those of installed packages."""
    return {name: importer.load() for name, importer in _BUILT_IN.items()} | _installed()


def _installed() -> dict[str, Importer]:
    from importlib.metadata import entry_points  # noqa: PLC0415 - slow to load

    found: dict[str, Importer] = {}
    for entry in sorted(entry_points(group=ENTRY_POINTS), key=lambda entry: (entry.name, entry.value)):
        if entry.name not in _BUILT_IN and entry.name not in found:
            found[entry.name] = entry.load()()
    return found


_TABLES = (".csv", ".tsv", ".xlsx", ".parquet", ".json", ".jsonl")
_OWN_TABLE = 'a table of your own becomes a source in a few lines: "Your own labels" in scenicq/docs/data.md'


def choose_importer(source: Path, name: str | None = None) -> Importer:
    """The importer that reads a source.

    Args:
        source: The source.
        name: Name of the importer to take, whatever it recognises; None to find one.

    Raises:
        DataError: `file-missing`, `option-invalid`, `dataset-unrecognised` or `dataset-ambiguous`.
    """
    installed = _installed()
    known = [*_BUILT_IN, *installed]
    if name is not None and name not in known:
        hint = f"known formats: {', '.join(known)}"
        raise DataError(Diagnostic("option-invalid", f"there is no format `{name}`", hints=(hint,)))
    if not source.exists():
        raise DataError(Diagnostic("file-missing", f"{source} is not there"))
    claimants = (
        [name]
        if name is not None
        else [
            *(name for name, importer in _BUILT_IN.items() if importer.finds(source)),
            *(name for name, importer in installed.items() if importer.recognises(source)),
        ]
    )
    if len(claimants) == 1:
        chosen = claimants[0]
        return installed[chosen] if chosen in installed else _BUILT_IN[chosen].load()
    if claimants:
        names = " and ".join(f"`{importer}`" for importer in claimants)
        hints = tuple(f"`--format {importer}` chooses one" for importer in claimants)
        raise DataError(Diagnostic("dataset-ambiguous", f"{source} is recognised by {names}", hints=hints))
    hints = tuple(f"`{importer.name}` looks for {importer.layout}" for importer in importers().values())
    if source.suffix.lower() in _TABLES:
        hints = (_OWN_TABLE, *hints)
    if is_dataset(source):
        hints = ("it is a dataset of scenicq already",)
    raise DataError(Diagnostic("dataset-unrecognised", f"no importer recognises {source}", hints=hints))
