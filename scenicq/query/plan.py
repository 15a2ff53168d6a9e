"""The prefilter: one SQL query per map that says which frames could match, and what excludes each other frame.

One pass over the objects of each frame counts, for every role, the label objects that meet its necessary conditions
(`conditions`); never a join of objects with objects. A frame that misses one is out, with that condition's name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, cast

from scenicq.errors import Span
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.query.conditions import Condition, object_conditions
from scenicq.query.expression import SLACK, number
from scenicq.store.classes import ROOT, class_matches, subclasses
from scenicq.store.sql import sql_text

__all__ = ["Excluded", "Plan", "Step", "frames_sql", "make_plan"]


@dataclass(frozen=True, slots=True)
class Step:
    """A necessary condition of a frame.

    Attributes:
        what: What it is about, in the words of the program.
        detail: What a frame that misses it lacks.
        sql: Over the joined counts of the frame.
        span: Where the program says it.
    """

    what: str
    detail: str
    sql: str
    span: Span | None


@dataclass(frozen=True, slots=True)
class Excluded:
    """A frame with the step that excludes it; None if it is a candidate."""

    frame: str
    recording: str
    timestamp_us: int
    step: Step | None


@dataclass(frozen=True, slots=True)
class Plan:
    """The prefilter of a scenario on one map.

    Attributes:
        map: The map.
        steps: Conditions in the order in which they are blamed.
        sql: The query: frame, recording, timestamp and the number of the first step missed.
    """

    map: str
    steps: tuple[Step, ...]
    sql: str

    def run(self, connection: Any, batch: int = 50_000) -> Iterator[Excluded]:
        """Every frame of the map in the order of the store.

        Args:
            connection: A DuckDB connection with the dataset's views.
            batch: Rows fetched at a time.
        """
        reader = connection.sql(self.sql).to_arrow_reader(batch)
        for table in reader:
            for row in cast("list[dict[str, Any]]", table.to_pylist()):
                missed = cast("int | None", row["missed"])
                step = None if missed is None else self.steps[missed]
                yield Excluded(row["frame"], row["recording"], row["timestamp_us"], step)

    def left(self, connection: Any) -> list[int]:
        """How many frames of the map are left before the first step and after each."""
        sql = f"SELECT missed, count(*) FROM ({self.sql}) GROUP BY missed"
        missed: dict[int | None, int] = dict(connection.execute(sql).fetchall())
        left = [sum(missed.values())]
        for step in range(len(self.steps)):
            left.append(left[-1] - missed.get(step, 0))
        return left


def _class_sql(category: str, options: MatchOptions) -> str:
    names = sorted(name for name in subclasses(ROOT) if class_matches(category, name, options.classes))
    return f"class IN ({', '.join(map(sql_text, names))})" if names else "false"


def _filled(condition: Condition, near: dict[str, str]) -> str:
    """A condition's SQL, with its memberships (if any) as a column of the joined flags."""
    if not condition.region:
        return f"coalesce({condition.sql}, true)"
    name = near.setdefault(condition.region, f"near{len(near)}")
    return f"coalesce({name}, false)"


def make_plan(
    scenario: Scenario, network: Network, options: MatchOptions, recordings: tuple[str, str] | None = None
) -> Plan:
    """The prefilter of a scenario, compiled against the map, under the options.

    Every step is necessary: a frame that matches misses none of them.

    Args:
        scenario: The scenario.
        network: The map it was compiled against.
        options: Tolerances, classes, radius.
        recordings: The first and the last recording to look at, in order of their names; None for all.
    """
    roles = [thing for thing in scenario.objects if thing.index != scenario.ego]
    ego = scenario.objects[scenario.ego]
    own_ego = options.ego == "label"
    near: dict[str, str] = {}
    steps: list[Step] = []
    counts: dict[str, str] = {}
    if own_ego:
        found = object_conditions(scenario, ego, network, options)
        steps += [Step(each.what, "", _filled(each, near), each.span) for each in found]
        ego_near = dict(near)
    else:
        ego_near = {}
    near = {}
    pools: dict[str, int] = {}
    for thing in roles:
        chosen = _class_sql(thing.category, options)
        if own_ego and options.radius is not None:
            chosen = f"{chosen} AND ego_distance <= {number(options.radius + SLACK)}"
        pools[chosen] = pools.get(chosen, 0) + 1
        # With any object as the ego, the label's own ego may play another role.
        least = pools[chosen] if own_ego else max(0, pools[chosen] - 1)
        count = counts.setdefault(chosen, f"n{len(counts)}")
        steps.append(Step(f"{thing.name}.class", f"no {thing.category}", f"{count} >= {least}", thing.span))
    for thing in roles if own_ego else ():
        so_far = _class_sql(thing.category, options)
        for condition in object_conditions(scenario, thing, network, options):
            so_far = f"{so_far} AND {_filled(condition, near)}"
            count = counts.setdefault(so_far, f"n{len(counts)}")
            steps.append(Step(condition.what, "", f"{count} >= 1", condition.span))
    return Plan(network.name, tuple(steps), _query(network.name, steps, counts, (near, ego_near), recordings))


def _flags(name: str, near: dict[str, str], *, ego: bool) -> str:
    """The memberships of every object (or of the egos) as one row of flags."""
    picked = ", ".join(f"bool_or({sql}) AS {flag}" for sql, flag in near.items())
    wanted = " OR ".join(near)
    own = "=" if ego else "<>"
    return (
        f"{name} AS (SELECT frame, object, {picked} FROM memberships "
        f"WHERE object {own} 'ego' AND ({wanted}) AND frame IN (SELECT frame FROM frames) GROUP BY frame, object)"
    )


def frames_sql(map_name: str, recordings: tuple[str, str] | None) -> str:
    """The frames of a map, possibly between two recordings."""
    between = (
        "" if recordings is None else f" AND recording BETWEEN {sql_text(recordings[0])} AND {sql_text(recordings[1])}"
    )
    return f"SELECT * FROM labels WHERE map = {sql_text(map_name)}{between}"


def _query(
    map_name: str,
    steps: list[Step],
    counts: dict[str, str],
    flags: tuple[dict[str, str], dict[str, str]],
    recordings: tuple[str, str] | None,
) -> str:
    near, ego_near = flags
    parts = [f"frames AS ({frames_sql(map_name, recordings)})"]
    source, ego_source = "objects JOIN frames USING (frame)", "frames"
    columns = "objects.* EXCLUDE (recording, timestamp_us), frames.* EXCLUDE (frame)"
    if near:
        parts.append(_flags("object_flags", near, ego=False))
        on = "object_flags.frame = objects.frame AND object_flags.object = objects.id"
        source = f"{source} LEFT JOIN object_flags ON {on}"
        columns = f"{columns}, {', '.join(f'object_flags.{flag}' for flag in near.values())}"
    if ego_near:
        parts.append(_flags("ego_flags", ego_near, ego=True))
        ego_source = "frames LEFT JOIN ego_flags USING (frame)"
    if counts:
        tallied = ", ".join(f"count(*) FILTER (WHERE {sql}) AS {name}" for sql, name in counts.items())
        parts.append(f"candidates AS (SELECT {columns} FROM {source})")
        parts.append(f"counts AS (SELECT frame, {tallied} FROM candidates GROUP BY frame)")
        ego_source = f"{ego_source} LEFT JOIN counts USING (frame)"
    missed = " ".join(f"WHEN NOT ({_zeroed(step.sql, counts)}) THEN {number_}" for number_, step in enumerate(steps))
    blamed = f"CASE {missed} END" if steps else "NULL::INTEGER"
    return (
        f"WITH {', '.join(parts)} SELECT frame, recording, timestamp_us, {blamed} AS missed "
        f"FROM {ego_source} ORDER BY recording, timestamp_us, frame"
    )


def _zeroed(sql: str, counts: dict[str, str]) -> str:
    """Counts of frames without any object are 0, not null."""
    name = sql.split(" ", 1)[0]
    return f"coalesce({name}, 0){sql[len(name) :]}" if name in counts.values() else sql
