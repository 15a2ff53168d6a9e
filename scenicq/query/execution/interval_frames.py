"""The frames of an interval, with the label objects that play the roles in each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing

from scenicq.errors import DataError, Diagnostic
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.query.execution.results import Result
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.sql import sql_text

__all__ = ["frames_of", "locate", "roles_in", "verdict_at"]


def locate(dataset: Dataset, recording: str) -> tuple[int, int, int]:
    """Where a recording is: the number of its part, its first row of `labels`, and the row behind its last.

    Raises:
        DataError: option-invalid: there is no such recording.
    """
    with closing(dataset.connect()) as connection:
        for part in range(len(dataset.files("labels"))):
            found = connection.execute(
                "SELECT min(file_row_number), max(file_row_number) + 1 "
                f"FROM {dataset.scan('labels', part, numbered=True)} WHERE recording = ?",
                [recording],
            ).fetchone()
            if found is not None and found[0] is not None:
                return part, found[0], found[1]
    raise DataError(Diagnostic("option-invalid", f"the dataset has no recording `{recording}`"))


def frames_of(dataset: Dataset, result: Result) -> Iterator[tuple[Label, dict[str, str]]]:
    """The labels of an interval in order of time, each with the label object of each role that is observed there.

    Args:
        dataset: The dataset.
        result: A result that is an interval.
    """
    span = result.interval
    if span is None:
        raise ValueError("the result is of a frame")
    where = f"recording = {sql_text(result.recording)} AND timestamp_us BETWEEN {result.timestamp_us} AND {span.end_us}"
    with closing(dataset.connect()) as connection:
        names = [name for (name,) in connection.execute(f"SELECT frame FROM labels WHERE {where}").fetchall()]
    for label in dataset.labels(names):
        yield label, roles_in(label, result)


def verdict_at(label: Label, result: Result) -> Verdict:
    """The verdict of a result with the label objects of one of its frames in the roles; arguments as of `roles_in`.

    Values of random variables are those of the initial scene, and of no other frame.
    """
    roles = roles_in(label, result)
    match result.verdict:
        case Match(witness=witness):
            return Match(roles, witness if label.frame == result.frame else {})
        case Unknown(reason, cause):
            return Unknown(reason, cause, roles)
        case NoMatch(cause):
            return NoMatch(cause, roles)


def roles_in(label: Label, result: Result) -> dict[str, str]:
    """The label object of each role that is observed in a frame, by the name of the role.

    Args:
        label: The label of the result's frame, or of any frame of its interval.
        result: Its verdict names objects where it is on a frame, tracks where it is on an interval.
    """
    verdict = result.verdict
    correspondence = verdict.partial if isinstance(verdict, NoMatch) else verdict.correspondence
    if result.interval is None:
        return dict(correspondence)
    objects = {each.track if each.track is not None else each.id: each.id for each in label.objects}
    objects["ego"] = "ego"
    return {role: objects[track] for role, track in correspondence.items() if track in objects}
