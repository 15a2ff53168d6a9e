"""A dataset opened for a notebook or a script: `scenicq.open`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Unpack

import duckdb

from scenicq.errors import DataError, Diagnostic, Source
from scenicq.notebook.frames import Frame
from scenicq.notebook.matches import Matches
from scenicq.option_values import Text, read_option
from scenicq.query.execution.option_texts import DRIVING, OptionTexts, read_options
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.sound_notes import SoundNotes

__all__ = ["OpenedDataset", "open"]


@dataclass(eq=False, repr=False)
class OpenedDataset:
    """A dataset: frames by name, programs to match, SQL to ask.

    Attributes:
        dataset: The dataset itself.
    """

    dataset: Dataset
    _connection: duckdb.DuckDBPyConnection | None = field(default=None, init=False)

    def __reduce__(self) -> tuple[type[OpenedDataset], tuple[Dataset]]:
        """A copy, also in another process, has connections of its own."""
        return OpenedDataset, (self.dataset,)

    def match(self, program: str | Path, **options: Unpack[OptionTexts]) -> Matches:
        """Find the frames that match a program.

        Args:
            program: A file, as a path or a name that ends in `.scenic`; else the program itself, for which the driving
                world model is there unless it imports another.
            options: As of `scenicq match`, such as `tolerance="position=0.3"`, `every=True` for frames that do not
                match, too, or `jobs=4`.

        Raises:
            ScenarioError: The program is wrong, or fits no map of the dataset.
            DataError: file-missing, file-invalid or option-invalid.
        """
        if not isinstance(program, str | Path):  # pyright: ignore[reportUnnecessaryIsInstance] - whoever calls may pass anything
            message = f"a program is a text or the path of a file, not {type(program).__name__}"
            raise DataError(Diagnostic("option-invalid", message))
        is_file = isinstance(program, Path) or (program.endswith(".scenic") and "\n" not in program)
        source = read_program(program) if is_file else Source("<program>", str(program))
        texts = options if is_file else _with_model(options)
        return Matches(Query(self.dataset, source, read_options(**texts)))

    def sql(self, query: str) -> duckdb.DuckDBPyRelation:
        """Ask the dataset's tables, which are read and never written; `scenicq info --columns` lists them.

        Args:
            query: SQL as DuckDB knows it.

        Raises:
            DataError: sql-invalid.
        """
        if self._connection is None:
            self._connection = self.dataset.connect()
        try:
            return self._connection.sql(query)
        except duckdb.Error as error:
            raise DataError(Diagnostic("sql-invalid", str(error).strip().partition("\n\n")[0])) from None

    def __getitem__(self, frame: str) -> Frame:
        """A frame by its name.

        Raises:
            DataError: option-invalid: there is no such frame.
        """
        return Frame(self.dataset, self.dataset.label(read_option("frame", Text("the name of a frame"), frame)))

    def __contains__(self, frame: object) -> bool:
        """Whether there is a frame of that name."""
        return isinstance(frame, str) and any(True for _ in self.dataset.labels([frame]))

    def __iter__(self) -> Iterator[Frame]:
        """The frames in the order of recording, time and frame, read in batches."""
        return (Frame(self.dataset, label) for label in self.dataset.labels())

    def __len__(self) -> int:
        """How many frames there are."""
        return self.dataset.manifest.total.frames

    @property
    def maps(self) -> tuple[str, ...]:
        """Names of the maps."""
        return self.dataset.maps

    def __repr__(self) -> str:
        """Name and counts."""
        total = self.dataset.manifest.total
        return f"<dataset {self.dataset.name}: {total.frames:,} frames, {total.objects:,} objects>"


def _with_model(options: OptionTexts) -> OptionTexts:
    """The options with the driving world model, unless they name one."""
    texts: OptionTexts = {"model": DRIVING}
    texts.update(options)
    return texts


_SOUND = SoundNotes()
"""The datasets that this process has found sound."""


def open(address: str | Path, *, notes: str | Path | None = None) -> OpenedDataset:
    """Open a dataset that `scenicq ingest` made.

    The whole dataset is read to check that it is sound: once in a process, and again after a file has changed.

    Args:
        address: A folder, or what fsspec understands, such as `s3://bucket/dataset`.
        notes: A folder in which it is noted that a dataset is sound, for other processes; that of the command is
            `sound` in its state folder, such as `~/.local/state/scenicq/sound`.

    Raises:
        DataError: store-missing, store-version, store-damaged, dataset-invalid or option-invalid.
    """
    if not isinstance(address, str | Path):  # pyright: ignore[reportUnnecessaryIsInstance]
        message = f"the address of a dataset is a text or a path, not {type(address).__name__}"
        raise DataError(Diagnostic("option-invalid", message))
    sound = _SOUND if notes is None else SoundNotes(Path(notes))
    dataset = open_dataset(address, check=False)
    if not sound.has(dataset.place, dataset.manifest):
        dataset = open_dataset(address)
        sound.add(dataset.place, dataset.manifest)
    return OpenedDataset(dataset)
