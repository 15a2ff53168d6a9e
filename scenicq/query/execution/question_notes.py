"""What is asked, written beside the pieces of its results: they are exported and pictured like fresh ones."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scenicq.errors import DataError, Diagnostic, Source
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.query.execution.partitions import fingerprint
from scenicq.query.execution.program_files import SiblingFiles, program_text
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.atomic_files import made_folder, write_whole
from scenicq.store.dataset import open_dataset
from scenicq.temporal.interval_options import IntervalOptions

__all__ = ["name_question", "note_question", "noted_question"]


def name_question(query: Query) -> str:
    """The name of what a query asks: another dataset, program, imported file or option makes it another."""
    text = program_text(query.source, query.siblings, query.options.version)
    return fingerprint(query.dataset, text, query.options)


def note_question(folder: Path, query: Query) -> None:
    """Write beside the pieces of a query what it asks.

    Raises:
        DataError: target-unwritable.
    """
    question = name_question(query)
    file = _file(folder, question)
    if file.exists():
        return
    content = {
        "dataset": query.dataset.address,
        "scenario": query.source.name,
        "program": query.source.text,
        "file": str(query.siblings.path.resolve()),
        "options": asdict(query.options),
    }
    try:
        with made_folder(folder):
            write_whole(file, json.dumps(content, default=sorted) + "\n")
    except OSError as error:
        raise DataError(Diagnostic("target-unwritable", f"{file} cannot be written: {error.strerror}")) from None


def noted_question(folder: Path, question: str) -> Query:
    """The query whose pieces are in a folder.

    Args:
        folder: Where the pieces are.
        question: Its name.

    Raises:
        DataError: file-missing or file-invalid; store-missing, store-damaged where the dataset is not what it was.
    """
    file = _file(folder, question)
    try:
        content = json.loads(file.read_bytes())
        address, path, scenario, program = (str(content[key]) for key in ("dataset", "file", "scenario", "program"))
        source, options = Source(scenario, program), _options(content["options"])
    except OSError:
        hint = "`match --shard` writes it beside the pieces"
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read", hints=(hint,))) from None
    except (ValueError, TypeError, KeyError, AttributeError):
        raise DataError(Diagnostic("file-invalid", f"{file} does not say what was asked")) from None
    query = Query(open_dataset(address), source, options, files=SiblingFiles(Path(path)))
    if name_question(query) != question:
        message = f"the pieces in {folder} are of another version of {address} or of what {path} imports"
        raise DataError(Diagnostic("store-damaged", message, hints=("match again",)))
    return query


def _file(folder: Path, question: str) -> Path:
    return folder / f"{question}.json"


def _options(fields: dict[str, Any]) -> QueryOptions:
    match: dict[str, Any] = fields.pop("match")
    tolerance, enforce, ignored = (match.pop(name) for name in ("tolerance", "enforce", "ignore_params"))
    rules = tuple([(scope, name, size) for scope, name, size in tolerance["rules"]])
    options = MatchOptions(
        tolerance=Tolerance(**tolerance | {"rules": rules, "scopes": ()}),
        enforce=frozenset(map(BuiltIn, enforce)),
        ignore_params=frozenset(ignored),
        **match,
    )
    return QueryOptions(match=options, time=IntervalOptions(**fields.pop("time")), **fields)
