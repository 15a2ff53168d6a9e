"""A plan at work: the dataset block by block, and what is left of each block.

A block is a run of frames in one part of the store, so memory depends on the size of a part, never on the dataset's.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice, pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.query.prefilter.decision import new_table
from scenicq.query.prefilter.plan import LABELS, MEMBERSHIPS, OBJECTS, PASSED, SENSORS, Plan
from scenicq.store.dataset import Dataset
from scenicq.store.in_memory import fetch_columns
from scenicq.store.sql import sql_text

if TYPE_CHECKING:
    import duckdb

__all__ = [
    "Block",
    "Extent",
    "blocks",
    "blocks_of",
    "extents",
    "hold",
    "join_first",
    "keep_players",
    "names",
    "object_rows",
    "run_plan",
    "run_players",
    "run_prefilter",
    "whole_recordings",
]

_FEWEST_FRAMES, _MOST_FRAMES = 2048, 120_000
"""Frames of a block; those with many objects are fewer, as a part has a bounded number of objects."""
_MOST_NAMED = 512
"""Frames of a block whose memberships are looked up by name: of them, statistics skip what lies elsewhere."""


@dataclass(frozen=True, slots=True)
class Extent:
    """The frames of one map in one part of the store.

    Attributes:
        part: Number of the part.
        first, end: From the first row of its labels to behind the last; frames of other maps may lie between.
        recordings: The least and the greatest name of a recording.
        frames: How many frames of the map there are.
    """

    part: int
    first: int
    end: int
    recordings: tuple[str, str]
    frames: int

    def alone(self, recordings: tuple[str, str] | None) -> bool:
        """Whether no frame of another map, or of another recording than asked for, lies between.

        Args:
            recordings: The first and the last recording that is asked for; None for all.
        """
        whole = recordings is None or (recordings[0] <= self.recordings[0] and self.recordings[1] <= recordings[1])
        return whole and self.frames == self.end - self.first


@dataclass(frozen=True, slots=True)
class Block:
    """Frames of one map, or of several over which a program is the same, that follow each other in one part.

    Attributes:
        map: The map; of several the first.
        part: Number of the part.
        first, end: The rows of its labels, the end left out.
        recordings: Only from the first of these to the second, in order of their names; None for all.
        runs: Of a query over time, the first and the last row of each recording, the last left out: they stay whole.
        maps: Where its rows are those of several maps, and of nothing else: their names in the order of the rows; of
            a query over time that of each recording.
    """

    map: str
    part: int
    first: int
    end: int
    recordings: tuple[str, str] | None = None
    runs: tuple[tuple[int, int], ...] = ()
    maps: tuple[str, ...] = ()

    @property
    def divisible(self) -> bool:
        """Whether it can be halved."""
        return len(self.runs) > 1 if self.runs else self.end - self.first > 1

    def halves(self) -> tuple[Block, Block]:
        """The block in two; it must be divisible."""
        if self.runs:
            middle = len(self.runs) // 2
            return self._some_runs(0, middle), self._some_runs(middle, len(self.runs))
        middle = (self.first + self.end) // 2
        return replace(self, end=middle), replace(self, first=middle)

    def _some_runs(self, low: int, high: int) -> Block:
        runs, maps = self.runs[low:high], self.maps[low:high]
        own = maps[0] if maps else self.map
        return replace(self, map=own, first=runs[0][0], end=runs[-1][1], runs=runs, maps=maps)

    def by_map(self) -> list[Block]:
        """The recordings of a query over time, map by map."""
        if not self.maps:
            return [self]
        ends = [n for n in range(1, len(self.maps)) if self.maps[n] != self.maps[n - 1]]
        cuts = pairwise([0, *ends, len(self.maps)])
        return [replace(self._some_runs(low, high), maps=()) for low, high in cuts]

    @property
    def where(self) -> str:
        """What selects its rows of `labels`, in SQL."""
        rows = f"file_row_number BETWEEN {self.first} AND {self.end - 1}"
        if self.maps:
            return rows
        between = "" if self.recordings is None else " AND recording BETWEEN {} AND {}".format(
            *map(sql_text, self.recordings)
        )  # fmt: skip
        return f"map = {sql_text(self.map)} AND {rows}{between}"

    def has(self, map_name: str, recording: str) -> bool:
        """Whether frames of a recording on a map, that lie between its rows, are among its frames."""
        if self.maps:
            return True
        first, last = self.recordings or ("", None)
        return map_name == self.map and recording >= first and (last is None or recording <= last)

    def followed_by(self, other: Block) -> Block | None:
        """Both as one block; None where the other does not follow, or is of another map."""
        if (self.part, self.end, self.recordings) != (other.part, other.first, other.recordings):
            return None
        if bool(self.maps) != bool(other.maps) or (not self.maps and self.map != other.map):
            return None
        maps = (*self.maps, *other.maps)
        maps = maps if self.runs else tuple(dict.fromkeys(maps))
        return replace(self, end=other.end, runs=(*self.runs, *other.runs), maps=maps)


def extents(dataset: Dataset, connection: duckdb.DuckDBPyConnection) -> dict[str, list[Extent]]:
    """Where the frames of each map are.

    Args:
        dataset: The dataset.
        connection: To it.
    """
    found: dict[str, list[Extent]] = {}
    for part in range(len(dataset.files("labels"))):
        rows = connection.execute(
            "SELECT map, min(file_row_number), max(file_row_number) + 1, min(recording), max(recording), count(*) "
            f"FROM {dataset.scan('labels', part, numbered=True)} GROUP BY map"
        ).fetchall()
        for name, first, end, low, high, frames in rows:
            found.setdefault(name, []).append(Extent(part, first, end, (low, high), frames))
    return found


def blocks(
    where: Mapping[str, list[Extent]],
    map_name: str,
    recordings: tuple[str, str] | None = None,
    *,
    least: int = 1,
    whole: bool = True,
) -> list[Block]:
    """The frames of one map, cut into blocks in the order of the store.

    Args:
        where: The dataset's `extents`.
        map_name: The map.
        recordings: The first and the last recording to look at, in order of their names; None for all.
        least: Blocks that there should be, unless they would become very small.
        whole: Whether a part may be one block; else blocks are as small as they may be.
    """
    return blocks_of(where, {map_name: recordings}, least=least, whole=whole)


def blocks_of(
    where: Mapping[str, list[Extent]],
    chosen: Mapping[str, tuple[str, str] | None],
    *,
    least: int = 1,
    whole: bool = True,
) -> list[Block]:
    """The frames of some maps, map by map, cut into blocks in the order of the store; one block may be of several maps.

    Args:
        where: The dataset's `extents`.
        chosen: The maps, each with the first and the last recording to look at; None for all.
        least: As of `blocks`.
        whole: As of `blocks`.
    """
    runs: list[_Run] = []
    for name, recordings in chosen.items():
        for each in where.get(name, []):
            if recordings is not None and (recordings[0] > each.recordings[1] or each.recordings[0] > recordings[1]):
                continue
            alone = len(chosen) > 1 and each.alone(recordings)
            if alone and runs and runs[-1].ends_before(each):
                runs[-1].maps.append((name, each.end))
            else:
                runs.append(_Run(each.part, each.first, [(name, each.end)], recordings, shared=alone))
    frames = sum(run.end - run.first for run in runs)
    size = min(_MOST_FRAMES, max(_FEWEST_FRAMES, -(-frames // least))) if whole else _FEWEST_FRAMES
    return [block for run in runs for block in run.blocks(size)]


@dataclass(slots=True)
class _Run:
    """Rows of a part that follow each other.

    Attributes:
        part: The part.
        first: The first row.
        maps: The maps in the order of their rows, each with the row behind its last.
        recordings: As of `Block`.
        shared: Whether nothing but frames of these maps lies there, so that more may follow.
    """

    part: int
    first: int
    maps: list[tuple[str, int]]
    recordings: tuple[str, str] | None
    shared: bool

    @property
    def end(self) -> int:
        """The row behind the last."""
        return self.maps[-1][1]

    def ends_before(self, extent: Extent) -> bool:
        """Whether an extent of frames of one map alone follows."""
        return self.shared and (self.part, self.end) == (extent.part, extent.first)

    def blocks(self, size: int) -> Iterator[Block]:
        """The rows cut into blocks of about that size."""
        count = -(-(self.end - self.first) // size)
        ends = [self.first + (self.end - self.first) * n // count for n in range(count + 1)]
        ends_of_maps = [end for _, end in self.maps]
        for low, high in pairwise(ends):
            mine = self.maps[bisect_right(ends_of_maps, low) : bisect_left(ends_of_maps, high) + 1]
            maps = tuple(name for name, _ in mine) if self.shared else ()
            yield Block(mine[0][0], self.part, low, high, None if self.shared else self.recordings, maps=maps)


def join_first(waiting: list[Block], most: int) -> Block:
    """Take the first of some blocks, with those that follow it in its part as far as all have so many frames at most.

    Args:
        waiting: Blocks in the order of the store, from which those are taken.
        most: How many frames.
    """
    first = waiting.pop(0)
    while waiting:
        joined = first.followed_by(waiting[0])
        if joined is None or joined.end - joined.first > min(most, _MOST_FRAMES):
            break
        first = joined
        waiting.pop(0)
    return first


def whole_recordings(dataset: Dataset, connection: duckdb.DuckDBPyConnection, cut: Iterable[Block]) -> list[Block]:
    """The blocks cut anew where a recording ends, each about as large as before.

    Args:
        dataset: The dataset.
        connection: To it.
        cut: Blocks in the order of the store.
    """
    found: list[Block] = []
    for blocks_ in _of_same_maps(cut):
        size = max(block.end - block.first for block in blocks_)
        whole = replace(blocks_[0], end=blocks_[-1].end)
        labels = dataset.scan("labels", whole.part, numbered=True)
        rows = connection.execute(
            "SELECT min(file_row_number), max(file_row_number) + 1, map "
            f"FROM {labels} WHERE {whole.where} GROUP BY map, recording ORDER BY 1"
        ).fetchall()
        run: list[tuple[int, int]] = []
        maps: list[str] = []
        for number, (first, end, name) in enumerate(rows):
            run.append((first, end))
            maps.append(name)
            if end - run[0][0] >= size or number + 1 == len(rows):
                shared = tuple(maps) if whole.maps else ()
                found.append(
                    Block(maps[0], whole.part, run[0][0], run[-1][1], whole.recordings, tuple(run), shared)
                )  # fmt: skip
                run, maps = [], []
    return found


def _of_same_maps(cut: Iterable[Block]) -> Iterator[list[Block]]:
    """Blocks in order, those together that are of one map of a part, or that follow each other."""
    group: list[Block] = []
    for block in cut:
        if group:
            last = group[-1]
            own = (block.part, block.map, block.recordings) == (last.part, last.map, last.recordings)
            follows = (block.part, block.first) == (last.part, last.end)
            if bool(last.maps) != bool(block.maps) or not (follows if block.maps else own):
                yield group
                group = []
        group.append(block)
    if group:
        yield group


def object_rows(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, block: Block
) -> dict[str, tuple[int, int]]:  # fmt: skip
    """Where the label objects of each map of a block are: the first row, and that behind the last."""
    rows = connection.execute(
        "SELECT map, min(first_object), max(first_object + object_count) "
        f"FROM {dataset.scan('labels', block.part, numbered=True)} WHERE {block.where} GROUP BY map"
    ).fetchall()
    return {name: (first, end) for name, first, end in rows}


_TABLES = {LABELS: "labels", OBJECTS: "objects", MEMBERSHIPS: "memberships", SENSORS: "sensors"}
"""What the views that a plan reads are of."""


def _rows_of(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, block: Block, offset: int = 0
) -> Iterator[tuple[str, str]]:
    """The views that a plan reads, with the SQL of each; of the objects only the rows of the block are looked at.

    That of the labels comes first, and the rest costs nothing until it is asked for.
    """
    scans = {view: dataset.scan(table, block.part, numbered=True) for view, table in _TABLES.items()}
    selected = f"SELECT *, {offset} + file_row_number AS number FROM "
    yield LABELS, f"{selected}{scans[LABELS]} WHERE {block.where}"
    (ends,) = connection.execute(
        "SELECT min(first_object), max(first_object + object_count), min(first_sensor), "
        f"max(first_sensor + sensor_count) FROM {scans[LABELS]} WHERE {block.where}"
    ).fetchall()
    limits = {OBJECTS: ends[:2], SENSORS: ends[2:]}
    for view, rows in scans.items():
        where = ""
        if view == LABELS:
            continue
        if view in limits and None not in limits[view]:
            where = " WHERE file_row_number BETWEEN {} AND {} - 1".format(*limits[view])
        elif view == MEMBERSHIPS and block.end - block.first <= _MOST_NAMED:
            frames = connection.execute(f"SELECT frame FROM {scans[LABELS]} WHERE {block.where}").fetchall()
            named = [sql_text(name) for (name,) in frames]
            where = f" WHERE frame IN ({', '.join(named) or 'NULL'})"
        yield view, selected + rows + where


def _open(connection: duckdb.DuckDBPyConnection, views: Iterable[tuple[str, str]]) -> None:
    """Make views of some rows."""
    for view, rows in views:
        connection.execute(f"CREATE OR REPLACE TEMP VIEW {view} AS {rows}")


def _name(connection: duckdb.DuckDBPyConnection, plan: Plan) -> None:
    """Make the tables of names that a plan reads and a connection does not have: their texts are long."""
    if not plan.names:
        return
    known = {
        name for (name,) in connection.execute("SELECT table_name FROM duckdb_tables() WHERE temporary").fetchall()
    }
    for table, query in plan.names:
        if table.partition("(")[0] not in known:
            connection.execute(new_table(table, query))


_PART = 1 << 40
"""More rows than a part has."""


def hold(dataset: Dataset, connection: duckdb.DuckDBPyConnection, chosen: Sequence[Block]) -> int:
    """Read some blocks of one map into memory, for plans to be run on all of them together (`run_plan`).

    Args:
        dataset: The dataset.
        connection: To it; no block has been run on it.
        chosen: The blocks, in order.

    Returns:
        How many frames they have.
    """
    unions: dict[str, list[str]] = {view: [] for view in _TABLES}
    for block in chosen:
        for view, rows in _rows_of(dataset, connection, block, block.part * _PART):
            unions[view].append(rows)
    for view, selected in unions.items():
        mine = "" if view == LABELS else f" WHERE frame IN (SELECT frame FROM {LABELS})"
        distinct = dict.fromkeys(selected)  # memberships may be of a whole part
        connection.execute(f"CREATE TEMP TABLE {view} AS SELECT * FROM ({' UNION ALL '.join(distinct)}){mine}")
    ((count,),) = connection.execute(f"SELECT count(*) FROM {LABELS}").fetchall()
    return int(count)


def run_prefilter(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, plan: Plan, block: Block
) -> NDArray[np.int16]:
    """Run a plan on a block.

    Args:
        dataset: The dataset.
        connection: To it; keeps what `candidates` reads.
        plan: The plan.
        block: The block.

    Returns:
        For each frame in order the number of the step that excludes it, -1 for candidates.
    """
    return run_plan(connection, plan, _rows_of(dataset, connection, block))


def run_players(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, plan: Plan, block: Block
) -> Mapping[str, NDArray[Any]]:
    """Run the one query of a plan that needs no stages on a block.

    Args:
        dataset: The dataset.
        connection: To it.
        plan: The plan; with `players`.
        block: The block.

    Returns:
        The columns `f`, `row`, `r0` ..., in the order of the rows.
    """
    _name(connection, plan)
    views = ", ".join(f"{view} AS ({sql})" for view, sql in _rows_of(dataset, connection, block))
    found = fetch_columns(connection.execute(f"WITH {views} {plan.players}"))
    order = np.argsort(found["row"], kind="stable")
    return {name: np.asarray(each)[order] for name, each in found.items()}


def keep_players(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, plan: Plan, block: Block,
    found: Mapping[str, NDArray[Any]],
) -> None:  # fmt: skip
    """Leave to `candidates` what `run_plan` would, given the players of the frames that are left."""
    _open(connection, _rows_of(dataset, connection, block))
    connection.register(PASSED, pa.table(dict(found)))
    connection.execute(f"CREATE OR REPLACE TEMP TABLE roles AS SELECT * FROM {PASSED}")
    last = plan.stages[-1].table
    connection.execute(f"CREATE OR REPLACE TEMP TABLE {last} AS SELECT DISTINCT f, NULL AS missed FROM roles")


def run_plan(
    connection: duckdb.DuckDBPyConnection, plan: Plan, views: Iterable[tuple[str, str]] = ()
) -> NDArray[np.int16]:
    """Run a plan on the frames that a connection holds; see `run_prefilter`.

    Args:
        connection: The connection.
        plan: The plan.
        views: Those that the connection does not have yet, the labels' first. They are made where the columns of the
            frames alone do not exclude all: in many blocks these do, and then one query is all that is asked.
    """
    views = iter(views)
    asked = list(islice(views, 1))
    _name(connection, plan)
    rows = "".join(f"WITH {view} AS ({sql}) " for view, sql in asked)
    found = fetch_columns(connection.execute(rows + plan.columns))
    order = np.argsort(found["f"])
    numbers, missed = found["f"][order], found["missed"][order].astype(np.int16)
    left = numbers[missed < 0]
    if not len(left):
        return missed
    connection.register(PASSED, pa.table({"f": left}))
    _open(connection, chain(asked, views))
    for place, stage in enumerate(plan.stages):
        for statement in stage.statements:
            connection.execute(statement)
        if place:
            kept = connection.execute(f"SELECT f, coalesce(missed, -1) AS missed FROM {stage.table}")
            found = fetch_columns(kept)
            missed[np.searchsorted(numbers, found["f"])] = found["missed"]
            if not (missed < 0).any():
                break
    return missed


def names(dataset: Dataset, connection: duckdb.DuckDBPyConnection, block: Block) -> list[tuple[str, str, int]]:
    """Frame, recording and timestamp of every frame of a block, in order."""
    _open(connection, islice(_rows_of(dataset, connection, block), 1))
    return connection.execute(f"SELECT frame, recording, timestamp_us FROM {LABELS} ORDER BY number").fetchall()
