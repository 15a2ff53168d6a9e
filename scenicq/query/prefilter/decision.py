"""The last step of a plan, where nobody asks for proofs: SQL that names frames which surely match.

It works on the objects that the prefilter has left for each role. Whether there are distinct ones for all roles is told
by counting (Hall's theorem) where no condition ties two of them together, else by joining them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.condition_reader import EGO, ColumnCondition
from scenicq.query.prefilter.sql_ends import columns_of, number, renamed_tables

if TYPE_CHECKING:
    import duckdb

__all__ = ["decided_frames", "decision", "new_table"]

_DECIDED = "decided"


def decision(
    found: Sequence[ColumnCondition],
    roles: Sequence[int],
    flags: Mapping[str, str],
    options: MatchOptions,
    *,
    tables: tuple[str, str],
    left: str,
) -> tuple[str, ...]:
    """Statements that make the table `decided` of the numbers `f` of the frames that surely match.

    Args:
        found: What proves a match.
        roles: The object of each column of the table `roles`.
        flags: The column of the table `flags` for each condition on memberships.
        options: The radius.
        tables: The views of frames and of objects.
        left: SQL of the numbers of the frames that are left.

    Returns:
        None of them where SQL cannot decide it.
    """
    labels, objects = tables
    ties = [each for each in found if len(each.objects) == 2]
    if len(roles) > (LIMITS.tied_roles if ties else LIMITS.counted_roles):
        return ()
    placed = [each for each in found if each.region]
    if any(each.region not in flags for each in placed):
        return ()

    def proved(objects_: tuple[int, ...]) -> list[str]:
        alias, mine = "g" if objects_ else "e", [each for each in found if each.objects == objects_]
        return list(dict.fromkeys(f"{alias}.{flags[each.region]}" if each.region else f"({each.sql})" for each in mine))

    frames = " AND ".join([f"{EGO}.number IN {left}", *proved(())])
    # a table that nothing is asked of would be joined all the same
    asked = {bool(each.objects) for each in placed}
    ego_flags = f" LEFT JOIN flags e ON e.f = {EGO}.number AND e.object = 'ego'" if False in asked else ""
    if not roles:
        return (new_table(_DECIDED, f"SELECT {EGO}.number AS f FROM {labels} {EGO}{ego_flags} WHERE {frames}"),)
    near = [] if options.radius is None else [f"a.ego_distance <= {number(options.radius - SLACK)}"]
    columns = [
        f"coalesce({' AND '.join([f'r.r{place}', *near, *proved((index,))])}, false) AS s{place}"
        for place, index in enumerate(roles)
    ]
    tied = [each.sql for each in ties]
    columns += [f"a.{name}" for name in sorted({*columns_of("a", tied), *columns_of("b", tied)})]
    columns += [f"{EGO}.{name}" for name in columns_of(EGO, tied)]
    object_flags = " LEFT JOIN flags g ON g.f = r.f AND g.object = a.id" if True in asked else ""
    sure = (
        f"SELECT r.f, r.row, {', '.join(columns)} FROM roles r JOIN {objects} a ON a.number = r.row "
        f"JOIN {labels} {EGO} ON {EGO}.number = r.f{ego_flags}{object_flags} WHERE {frames}"
    )
    return new_table("sure", sure), new_table(_DECIDED, _joined(roles, ties) if ties else _counted(len(roles)))


def decided_frames(
    connection: duckdb.DuckDBPyConnection, statements: Sequence[str], labels: str, left: str
) -> list[tuple[int, bool, str, str, int]]:
    """The frames left of the block on which the prefilter was run last, in order, with whether they surely match.

    Args:
        connection: The one that `run_prefilter` was given last.
        statements: Those of `decision`.
        labels: The view of frames.
        left: SQL of the numbers of the frames that are left.

    Returns:
        Number, whether it surely matches, frame, recording and timestamp of each.
    """
    for statement in statements:
        connection.execute(statement)
    return connection.execute(
        f"SELECT number, number IN (SELECT f FROM {_DECIDED}), frame, recording, timestamp_us FROM {labels} "
        f"WHERE number IN {left} ORDER BY number"
    ).fetchall()


def new_table(name: str, query: str) -> str:
    """The statement that makes a table in memory."""
    return f"CREATE OR REPLACE TEMP TABLE {name} AS {query}"


def _counted(roles: int) -> str:
    """The frames in which any number of roles have as many objects among them."""
    enough = [
        f"count(*) FILTER ({' OR '.join(f's{place}' for place in chosen)}) >= {size}"
        for size in range(1, roles + 1)
        for chosen in itertools.combinations(range(roles), size)
    ]
    return f"SELECT f FROM sure GROUP BY f HAVING {' AND '.join(enough)}"


def _joined(roles: Sequence[int], ties: Sequence[ColumnCondition]) -> str:
    """The frames in which distinct objects have all roles, two by two tied together."""
    tables = ["sure p0"]
    for place in range(1, len(roles)):
        apart = [f"p{place}.row <> p{other}.row" for other in range(place)]
        tables.append(f"JOIN sure p{place} ON p{place}.f = p0.f AND {' AND '.join(apart)}")
    holds = [f"p{place}.s{place}" for place in range(len(roles))]
    for each in ties:
        one, other = (f"p{roles.index(index)}" for index in each.objects)
        holds.append(f"({renamed_tables(str(each.sql), {'a': one, 'b': other, EGO: one})})")
    return f"SELECT DISTINCT p0.f FROM {' '.join(tables)} WHERE {' AND '.join(holds)}"
