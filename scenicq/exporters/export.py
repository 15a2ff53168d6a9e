"""Hands the matching frames back in the form that the next tool reads.

Every export is a folder that appears when it is complete; elsewhere its last file does.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import feather

from scenicq.errors import DataError, Diagnostic
from scenicq.exporters.export_record import MatchedFrame
from scenicq.exporters.interchange import write_interchange
from scenicq.exporters.openlabel import write_openlabel
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.interval_frames import frames_of
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import Result
from scenicq.store.atomic_files import whole_folder
from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

__all__ = ["EXPORTS", "ExportSummary", "Exporter"]


@dataclass(frozen=True, slots=True)
class ExportSummary:
    """What an export wrote.

    Attributes:
        target: The folder.
        files: Names of its files, sorted.
        frames: Matching frames.
        left_out: Warnings about what the form cannot hold, such as objects without a heading.
    """

    target: AnyPath
    files: tuple[str, ...]
    frames: int
    left_out: tuple[Diagnostic, ...]


@dataclass(eq=False)
class Exporter:
    """Collects matching frames and writes them at the end; memory is that of the correspondences.

    Attributes:
        kind: One of `EXPORTS`.
        dataset: Where the frames are from.
        target: Folder that is not there yet, here or elsewhere.
        scenario: Name of the scenario.

    Raises:
        DataError: `option-invalid` for a form that does not exist or does not suit the dataset; `target-exists`;
            `target-unwritable` for a place elsewhere.
    """

    kind: str
    dataset: Dataset
    target: AnyPath
    scenario: str = ""
    _matched: dict[str, MatchedFrame] = field(default_factory=dict[str, MatchedFrame], init=False, repr=False)
    _further: int = field(default=0, init=False, repr=False)
    _unknown: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in EXPORTS:
            hint = f"known are {', '.join(EXPORTS)}"
            raise DataError(Diagnostic("option-invalid", f"there is no export `{self.kind}`", hints=(hint,)))
        wanted, importer = _SOURCES.get(self.kind), self.dataset.manifest.importer
        if wanted is not None and importer != wanted:
            message = f"an export `{self.kind}` needs a dataset from {wanted}, this one is from {importer}"
            hint = "`interchange`, `openlabel` and `paths` suit every dataset"
            raise DataError(Diagnostic("option-invalid", message, hints=(hint,)))
        if target_of(self.target).is_taken():
            hint = "choose another name: an export never replaces anything"
            raise DataError(Diagnostic("target-exists", f"{self.target} exists", hints=(hint,)))
        if not self.target.name or self.target.name == "..":
            raise DataError(Diagnostic("target-unwritable", f"{self.target} is not the name of a new folder"))
        target_of(self.target).check_writable()

    def add(self, result: Result) -> None:
        """Take a result; those that are no match are passed over, of several of one frame the first counts.

        All frames of an interval are taken, with the label objects that have the tracks of the roles there.
        """
        if isinstance(result.verdict, Match) and result.interval is not None:
            for label, roles in frames_of(self.dataset, result):
                self._further += label.frame in self._matched
                self._matched.setdefault(
                    label.frame, MatchedFrame(label.frame, label.recording, roles, dict(label.sensors))
                )
        elif isinstance(result.verdict, Match):
            roles = dict(result.verdict.correspondence)
            self._further += result.frame in self._matched
            self._matched.setdefault(
                result.frame, MatchedFrame(result.frame, result.recording, roles, dict(result.sensors))
            )
        self._unknown += isinstance(result.verdict, Unknown)

    def finish(self, summary: ResultSummary | None = None) -> ExportSummary:
        """Write the folder.

        Args:
            summary: What the results say of themselves, where somebody knows it.

        Raises:
            DataError: `target-unwritable`.
        """
        problems: list[Diagnostic] = []
        try:
            with whole_folder(self.target) as folder:
                EXPORTS[self.kind](self, folder, problems)
                files = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        except OSError as error:
            message = f"{self.target} cannot be written: {error.strerror or error}"
            raise DataError(Diagnostic("target-unwritable", message)) from error
        told = (
            (self._further, "further matches of frames that are there already"),
            (self._unknown, "frames that could not be decided"),
        )
        problems += [
            Diagnostic("record-invalid", f"{count} {what} are left out", severity="warning")
            for count, what in told
            if count
        ]
        if summary is not None and not summary.complete:
            message = f"the export is not complete: {summary.why_cut}"
            problems.append(Diagnostic("results-incomplete", message, severity="warning"))
        return ExportSummary(self.target, tuple(files), len(self._matched), tuple(problems))

    @property
    def matched(self) -> Mapping[str, MatchedFrame]:
        """The matching frames by name, in the order in which they came."""
        return self._matched


def _nuscenes_tokens(export: Exporter, folder: Path, problems: list[Diagnostic]) -> None:
    """`tokens.txt`: sample tokens; `splits.json`: the scenes, as the devkit reads splits; `matches.json`: the roles."""
    frames = list(export.matched.values())
    _write_lines(folder / "tokens.txt", [each.frame for each in frames])
    scenes = list(dict.fromkeys(each.recording for each in frames))
    _write_json(folder / "splits.json", {export.scenario or "matches": scenes})
    rows = [{"sample_token": each.frame, "scene": each.recording, "roles": each.roles} for each in frames]
    _write_json(folder / "matches.json", rows)


def _argoverse2(export: Exporter, folder: Path, problems: list[Diagnostic]) -> None:
    """`matches.feather` and `matches.parquet`: log, timestamp, track and role, a row a role; `logs.txt`: the logs."""
    rows = [
        (each.recording, int(each.frame.rpartition("/")[2]), track, role)
        for each in export.matched.values()
        for role, track in each.roles.items()
    ]
    names = ("log_id", "timestamp_ns", "track_uuid", "role")
    kinds = (pa.string(), pa.int64(), pa.string(), pa.string())
    arrays = [pa.array([row[number] for row in rows], kind) for number, kind in enumerate(kinds)]
    table = pa.table(arrays, names=list(names))
    feather.write_feather(table, str(folder / "matches.feather"), compression="uncompressed")
    pq.write_table(table, folder / "matches.parquet")
    _write_lines(folder / "logs.txt", list(dict.fromkeys(each.recording for each in export.matched.values())))


def _paths(export: Exporter, folder: Path, problems: list[Diagnostic]) -> None:
    """`files.txt`: each sensor file once, relative to the source, for `rsync --files-from`."""
    frames = export.dataset.labels(export.matched)
    paths = dict.fromkeys(path for label in frames for path in label.sensors.values())
    sound = [path for path in paths if _is_inside(path)]
    if len(sound) < len(paths):
        message = f"{len(paths) - len(sound)} paths lead out of the source or have a line break; they are left out"
        problems.append(Diagnostic("record-invalid", message, severity="warning"))
    if not paths and export.matched:
        problems.append(Diagnostic("file-missing", "the dataset names no sensor files", severity="warning"))
    _write_lines(folder / "files.txt", sound)


def _is_inside(path: str) -> bool:
    steps = PurePosixPath(path)
    return not steps.is_absolute() and ".." not in steps.parts and not any(char in path for char in "\n\r\0")


def _interchange(export: Exporter, folder: Path, problems: list[Diagnostic]) -> None:
    """A folder that `scenicq ingest` reads."""
    problems.extend(write_interchange(export.dataset, export.matched, folder))


def _openlabel(export: Exporter, folder: Path, problems: list[Diagnostic]) -> None:
    """A file of ASAM OpenLABEL a recording."""
    problems.extend(write_openlabel(export.dataset, export.matched, folder, export.scenario))


EXPORTS: dict[str, Callable[[Exporter, Path, list[Diagnostic]], None]] = {
    "nuscenes-tokens": _nuscenes_tokens,
    "argoverse2": _argoverse2,
    "paths": _paths,
    "interchange": _interchange,
    "openlabel": _openlabel,
}
"""What writes each form."""

_SOURCES = {"nuscenes-tokens": "nuscenes", "argoverse2": "argoverse2"}
"""Forms that only make sense for datasets of one importer."""


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _write_json(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
