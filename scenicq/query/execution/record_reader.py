"""From records back to results and questions: what pieces on disk need to be exported and pictured like fresh ones."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

from scenicq.errors import DataError, Diagnostic, Source, Span
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.query.execution.partitions import fingerprint
from scenicq.query.execution.program_files import SiblingFiles, program_text
from scenicq.query.execution.results import IntervalSpan, Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.atomic_files import made_folder, write_whole
from scenicq.store.dataset import open_dataset
from scenicq.temporal.interval_options import IntervalOptions

__all__ = ["name_question", "note_question", "noted_question", "read_record"]


def read_record(record: Mapping[str, Any], source: Source) -> Result:
    """The result that `scenicq.query.execution.results.record` made a record of.

    Args:
        record: The record.
        source: The program, in which causes have their place.
    """
    verdict = _verdict(record, source)
    if "frames" not in record:
        return Result(record["frame"], record["recording"], record["timestamp_us"], verdict, record["sensors"])
    frames = record["frames"]
    span = IntervalSpan(frames["last"], record["end_us"], frames["count"], record["open_ended"])
    return Result(frames["first"], record["recording"], record["start_us"], verdict, interval=span)


def _verdict(record: Mapping[str, Any], source: Source) -> Verdict:
    roles: dict[str, str] = record["correspondence"]
    if record["verdict"] == "match":
        witness: dict[str, WitnessValue] = {
            name: (value[0], value[1]) if isinstance(value, list) else value
            for name, value in cast("dict[str, Any]", record["witness"]).items()
        }
        return Match(roles, witness)
    told: dict[str, str] = record["cause"]
    cause = Cause(told.get("what", ""), told.get("detail", ""), _span(told.get("place", ""), source))
    return Unknown(told["reason"], cause, roles) if record["verdict"] == "unknown" else NoMatch(cause, roles)


def _span(place: str, source: Source) -> Span | None:
    name, *numbers = place.rsplit(":", 2)
    if name != source.file_name or len(numbers) != 2:
        return None
    line, column = map(int, numbers)
    start = source.line_starts[line - 1] + column - 1
    return Span(source, start, min(start + 1, len(source.text)))


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
