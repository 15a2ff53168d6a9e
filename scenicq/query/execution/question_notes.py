"""What is asked, written beside the pieces of its results: they are exported and pictured like fresh ones."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

from scenicq.errors import DataError, Diagnostic, Source
from scenicq.query.execution.pieces import fingerprint
from scenicq.query.execution.program_files import SiblingFiles, program_text
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.atomic_files import write_whole
from scenicq.store.dataset import open_dataset
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

__all__ = ["name_question", "note_question", "noted_question"]


class _Note(Struct, frozen=True):
    """What is asked: the dataset's address, the program with its name and file, and the options."""

    dataset: str
    scenario: str
    program: str
    file: str
    options: QueryOptions


def name_question(query: Query) -> str:
    """The name of what a query asks: another dataset, program, imported file or option makes it another."""
    text = program_text(query.source, query.siblings, query.options.version)
    return fingerprint(query.dataset, text, query.options)


def note_question(folder: AnyPath, query: Query) -> None:
    """Write beside the pieces of a query what it asks.

    Raises:
        DataError: target-unwritable.
    """
    question = name_question(query)
    file = _file(folder, question)
    if file.exists():
        return
    path = str(query.siblings.path.resolve())
    note = _Note(query.dataset.address, query.source.name, query.source.text, path, query.options)
    try:
        with target_of(folder).made_folder():
            write_whole(file, msgspec.json.encode(note).decode() + "\n")
    except UnicodeEncodeError:
        message = f"{file} cannot be written: the path {path} is not text in UTF-8"
        raise DataError(Diagnostic("target-unwritable", message)) from None
    except OSError as error:
        raise DataError(Diagnostic("target-unwritable", f"{file} cannot be written: {error.strerror}")) from None


def noted_question(folder: AnyPath, question: str) -> Query:
    """The query whose pieces are in a folder.

    Args:
        folder: Where the pieces are.
        question: Its name.

    Raises:
        DataError: file-missing or file-invalid; store-missing, store-damaged where the dataset is not what it was.
    """
    file = _file(folder, question)
    try:
        note = msgspec.json.decode(file.read_bytes(), type=_Note)
    except OSError:
        hint = "`match --shard` writes it beside the pieces"
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read", hints=(hint,))) from None
    except (msgspec.DecodeError, RecursionError) as error:
        raise DataError(Diagnostic("file-invalid", f"{file} does not say what was asked: {error}")) from None
    path, source = Path(note.file), Source(note.scenario, note.program)
    query = Query(open_dataset(note.dataset), source, note.options, files=SiblingFiles(path))
    if name_question(query) != question:
        message = f"the pieces in {folder} are of another version of {note.dataset} or of what {path} imports"
        raise DataError(Diagnostic("store-damaged", message, hints=("match again",)))
    return query


def _file(folder: AnyPath, question: str) -> AnyPath:
    return folder / f"{question}.json"
