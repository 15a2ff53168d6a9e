"""What a plan leaves of a block: its labels, and who may play which role in them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.forest.nodes import COURSE, LAST_LANE
from scenicq.match.problem.observation import IN_COLUMNS
from scenicq.query.prefilter.plan import LABELS, OBJECTS, SENSORS, Plan
from scenicq.store.in_memory import fetch_columns
from scenicq.store.labels import Label
from scenicq.store.reader import COURSE_COLUMNS, LABEL_COLUMNS, LAST, MOTION_COLUMNS, OBJECT_COLUMNS, assemble
from scenicq.store.recorded_tracks import RecordedTracks
from scenicq.store.schema import ArrowTable

if TYPE_CHECKING:
    import duckdb

__all__ = ["Candidate", "CandidateRows", "candidate_rows", "candidates"]

_BATCH = 1024
"""Labels in memory."""


class Candidate(NamedTuple):
    """A label that may match, as the matcher is asked about it.

    Attributes:
        label: The label, possibly with those objects alone that may play a role.
        among: The numbers of the objects that may play each role (1 is the first object of the label); None for any.
    """

    label: Label
    among: Mapping[int, tuple[int, ...]] | None


@dataclass(frozen=True, slots=True)
class CandidateRows:
    """Who may play which role in the frames that are left of a block.

    Attributes:
        rows: Rows of `objects` in order, shape (m,).
        may: Whether each may play each role of the plan, shape (m, roles).
    """

    rows: NDArray[np.int64]
    may: NDArray[np.bool_]

    @classmethod
    def of(cls, found: Mapping[str, NDArray[Any]], roles: int) -> CandidateRows:
        """Those that a query with the columns `row`, `r0` ... gives, in the order of the rows."""
        may = [np.asarray(found[f"r{place}"], dtype=np.bool_) for place in range(roles)]
        return cls(np.asarray(found["row"], dtype=np.int64), np.column_stack(may))

    def between(self, first: int, end: int) -> CandidateRows:
        """Those of some rows that follow each other, the end left out."""
        low, high = np.searchsorted(self.rows, (first, end)).tolist()
        return CandidateRows(self.rows[low:high], self.may[low:high])


def candidate_rows(connection: duckdb.DuckDBPyConnection, plan: Plan) -> CandidateRows:
    """Who may play the roles of a plan in the block on which the prefilter was run last.

    Args:
        connection: The one that `run_prefilter` was given last.
        plan: The plan; with roles.
    """
    assert plan.roles
    left = f"(SELECT f FROM {plan.stages[-1].table} WHERE missed IS NULL)"
    roles = ", ".join(f"r{place}" for place in range(len(plan.roles)))
    found = connection.execute(f"SELECT row, {roles} FROM roles WHERE f IN {left} ORDER BY row")
    return CandidateRows.of(fetch_columns(found), len(plan.roles))


def candidates(
    connection: duckdb.DuckDBPyConnection,
    plan: Plan,
    *,
    motion: bool = False,
    observed: Collection[str] | None = None,
    among: NDArray[np.int64] | None = None,
    whole: bool = False,
    on_course: bool = False,
    recorded: RecordedTracks | None = None,
) -> Iterator[Candidate]:
    """The labels that are left of the block on which the prefilter was run last, in order.

    Args:
        connection: The one that `run_prefilter` was given last.
        plan: The plan.
        motion: Whether what is computed of motion is read, too.
        observed: Of label objects only class, position and these properties are read; None for all that is known.
        among: Rows of `labels`: only these; None for all.
        whole: Whether labels have all their objects, not only those that may play a role.
        on_course: Whether it is read where label objects are on the ego's course.
        recorded: What labels name as that which has the tracks of their recordings.
    """
    left = f"(SELECT f FROM {plan.stages[-1].table} WHERE missed IS NULL)"
    if among is not None:
        connection.register("wanted", pa.table({"f": among}))
        left = f"{left[:-1]} AND f IN (SELECT f FROM wanted))"
    chosen = [*_columns(observed), *(MOTION_COLUMNS if motion else [])]
    of_frames = ", ".join(f"l.{name}" for name in (*LABEL_COLUMNS, *(f"ego_{name}" for name in chosen[1:])))
    of_objects = ", ".join(f"a.{name}" for name in (*chosen, *(COURSE_COLUMNS if on_course else ())))
    frames = _rows(connection, f"SELECT l.number, {of_frames} FROM {LABELS} l WHERE l.number IN {left} ORDER BY 1")
    mine = f"JOIN {LABELS} l ON s.frame = l.frame WHERE l.number IN {left} ORDER BY s.number"
    # datasets without sensor files are many
    kept = mine if frames["sensor_count"].to_numpy().any() else "LIMIT 0"
    sensors = _rows(connection, f"SELECT s.channel, s.path FROM {SENSORS} s {kept}")
    if plan.roles is None:
        objects = _rows(connection, f"SELECT {of_objects.replace('a.', 's.')} FROM {OBJECTS} s {mine}")
        for label in _assembled(frames, objects, sensors, recorded):
            yield Candidate(label, None)
        return
    if whole:
        flags = "".join(f", coalesce(r.r{place}, false) AS r{place}" for place in range(len(plan.roles)))
        joined = "LEFT JOIN roles r ON a.number = r.row" if plan.roles else ""
        who = f"{OBJECTS} a JOIN (SELECT frame, number AS f FROM {LABELS}) l ON a.frame = l.frame {joined} "
        who += f"WHERE l.f IN {left}"
    elif plan.roles:
        flags = "".join(f", r.r{place}" for place in range(len(plan.roles)))
        who = f"{OBJECTS} a JOIN roles r ON a.number = r.row WHERE r.f IN {left}"
    else:
        flags, who = "", f"(SELECT *, number AS f FROM {OBJECTS} LIMIT 0) a JOIN (SELECT 0 AS f LIMIT 0) r USING (f)"
    frame = "l.f" if whole else "r.f"
    objects = _rows(connection, f"SELECT {of_objects}, {frame}{flags} FROM {who} ORDER BY a.number")
    numbers, owners = frames["number"].to_numpy(), objects["f"].to_numpy()
    counts = np.searchsorted(owners, numbers, side="right") - np.searchsorted(owners, numbers)
    frames = frames.set_column(frames.column_names.index("object_count"), "object_count", [counts.astype(np.int32)])
    ends = np.concatenate(([0], np.cumsum(counts)))
    may = [
        (index, *_numbered(np.array(objects[f"r{place}"].to_pylist(), dtype=bool), ends))
        for place, index in enumerate(plan.roles)
    ]
    for place, label in enumerate(_assembled(frames, objects, sensors, recorded)):
        yield Candidate(label, {index: tuple(mine[cuts[place] : cuts[place + 1]]) for index, mine, cuts in may})


def _columns(observed: Collection[str] | None) -> list[str]:
    """The columns of objects that say what they are, where, and which of some properties they have; the id is first."""
    if observed is None:
        return OBJECT_COLUMNS
    wanted = {"id", "class", "x", "y", *observed}
    if not wanted.isdisjoint(("velocity", "speed")):
        wanted.update(("vx", "vy"))
    if COURSE in observed:
        wanted.update(("track", "heading"))
    if LAST_LANE in observed:
        wanted.add(LAST)
    if not IN_COLUMNS.issuperset(observed):
        wanted.add("attributes")
    return [name for name in OBJECT_COLUMNS if name in wanted]


def _numbered(chosen: NDArray[np.bool_], ends: NDArray[np.int64]) -> tuple[list[int], list[int]]:
    """Objects that are chosen, counted from 1 in each label, and where those of a label end; `ends` begins with 0."""
    rows = np.flatnonzero(chosen)
    cuts = np.searchsorted(rows, ends)
    return (rows - np.repeat(ends[:-1], np.diff(cuts)) + 1).tolist(), cuts.tolist()


def _assembled(
    frames: ArrowTable, objects: ArrowTable, sensors: ArrowTable, recorded: RecordedTracks | None
) -> Iterator[Label]:
    """Labels, so many at a time that the size of a block does not matter."""
    ends = [np.concatenate(([0], np.cumsum(frames[f"{what}_count"].to_numpy()))) for what in ("object", "sensor")]
    for start in range(0, len(frames), _BATCH):
        stop = min(start + _BATCH, len(frames))
        mine, channels = (table.slice(rows[start], rows[stop] - rows[start])
                          for table, rows in zip((objects, sensors), ends, strict=True))  # fmt: skip
        yield from assemble(frames.slice(start, stop - start), mine, channels, recorded)


def _rows(connection: duckdb.DuckDBPyConnection, sql: str) -> ArrowTable:
    return connection.sql(sql).to_arrow_table()
