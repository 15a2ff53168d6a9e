"""The last step of a plan, where nobody asks for proofs: SQL that names frames which surely match, or are unknown.

It works on the objects that the prefilter has left for each role. Whether there are distinct ones for all roles is told
by counting (Hall's theorem) where no condition ties two of them together, else by joining them. A frame that does not
surely match is unknown where of each object it is told that it fills the role surely, or if what is not observed is so.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.condition_reader import EGO, ColumnCondition
from scenicq.query.prefilter.sql_ends import any_of, columns_of, number, renamed_tables

if TYPE_CHECKING:
    import duckdb

__all__ = ["MATCHING", "UNOBSERVED", "decided_frames", "decision", "new_table"]

_DECIDED = "decided"
MATCHING, UNOBSERVED = 1, 2
"""What is told of a frame: it surely matches, or what is not observed would tell."""


def decision(
    found: Sequence[ColumnCondition],
    roles: Sequence[int],
    flags: Mapping[str, str],
    options: MatchOptions,
    *,
    tables: tuple[str, str],
    left: str,
) -> tuple[str, ...]:
    """Statements that make the table `decided` of the numbers `f` of frames, with what is told of them as `told`.

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

    def proved(objects_: tuple[int, ...], *, settled: bool = False) -> list[str]:
        """What proves the conditions on some objects; or that each is proved or open."""
        alias, mine = "g" if objects_ else "e", [each for each in found if each.objects == objects_]
        return list(dict.fromkeys(
            f"{alias}.{flags[each.region]}" if each.region
            else f"({any_of([each.sql, each.open])})" if settled else f"({each.sql})"
            for each in mine
        ))  # fmt: skip

    # what two roles are to each other may be open for one pair alone
    open_ = not ties and any(each.open is not False for each in found)
    frames = " AND ".join([f"{EGO}.number IN {left}", *proved((), settled=open_)])
    sure = proved(()) if open_ else []
    # a table that nothing is asked of would be joined all the same
    asked = {bool(each.objects) for each in placed}
    ego_flags = f" LEFT JOIN flags e ON e.f = {EGO}.number AND e.object = 'ego'" if False in asked else ""
    if not roles:
        told = f"CASE WHEN coalesce({' AND '.join(['true', *sure])}, false) THEN {MATCHING} ELSE {UNOBSERVED} END"
        query = f"SELECT {EGO}.number AS f, {told} AS told FROM {labels} {EGO}{ego_flags} WHERE {frames}"
        return (new_table(_DECIDED, query),)
    near = [] if options.radius is None else [f"a.ego_distance <= {number(options.radius - SLACK)}"]
    columns = [
        f"coalesce({' AND '.join([f'r.r{place}', *near, *sure, *proved((index,))])}, false) AS s{place}"
        for place, index in enumerate(roles)
    ]
    for place, index in enumerate(roles) if open_ else ():
        settled = " AND ".join([f"r.r{place}", *near, *proved((index,), settled=True)])
        columns.append(f"coalesce({settled}, false) AS o{place}")
        columns.append(f"r.r{place} AS m{place}")
    tied = [each.sql for each in ties]
    columns += [f"a.{name}" for name in sorted({*columns_of("a", tied), *columns_of("b", tied)})]
    columns += [f"{EGO}.{name}" for name in columns_of(EGO, tied)]
    object_flags = " LEFT JOIN flags g ON g.f = r.f AND g.object = a.id" if True in asked else ""
    told = (
        f"SELECT r.f, r.row, {', '.join(columns)} FROM roles r JOIN {objects} a ON a.number = r.row "
        f"JOIN {labels} {EGO} ON {EGO}.number = r.f{ego_flags}{object_flags} WHERE {frames}"
    )
    decided = _joined(roles, ties) if ties else _counted(len(roles), open_=open_)
    return new_table("sure", told), new_table(_DECIDED, decided)


def decided_frames(
    connection: duckdb.DuckDBPyConnection, statements: Sequence[str], labels: str, left: str
) -> list[tuple[int, int, str, str, int]]:
    """The frames left of the block on which the prefilter was run last, in order, with what is told of them.

    Args:
        connection: The one that `run_prefilter` was given last.
        statements: Those of `decision`.
        labels: The view of frames.
        left: SQL of the numbers of the frames that are left.

    Returns:
        Number, what is told of it (`MATCHING`, `UNOBSERVED` or 0 for nothing), frame, recording and timestamp of each.
    """
    for statement in statements:
        connection.execute(statement)
    return connection.execute(
        f"SELECT number, coalesce(told, 0), frame, recording, timestamp_us FROM {labels} "
        f"LEFT JOIN {_DECIDED} ON number = f WHERE number IN {left} ORDER BY number"
    ).fetchall()


def new_table(name: str, query: str) -> str:
    """The statement that makes a table in memory."""
    return f"CREATE OR REPLACE TEMP TABLE {name} AS {query}"


def _counted(roles: int, *, open_: bool) -> str:
    """The frames in which any number of roles have as many objects among them."""

    def enough(column: str) -> str:
        return " AND ".join(
            f"count(*) FILTER ({' OR '.join(f'{column}{place}' for place in chosen)}) >= {size}"
            for size in range(1, roles + 1)
            for chosen in itertools.combinations(range(roles), size)
        )

    if not open_:
        return f"SELECT f, {MATCHING} AS told FROM sure GROUP BY f HAVING {enough('s')}"
    settled = " AND ".join(f"bool_and(o{place} OR NOT m{place})" for place in range(roles))
    told = f"CASE WHEN {enough('s')} THEN {MATCHING} WHEN {settled} AND {enough('o')} THEN {UNOBSERVED} ELSE 0 END"
    return f"SELECT f, {told} AS told FROM sure GROUP BY f"


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
    return f"SELECT DISTINCT p0.f, {MATCHING} AS told FROM {' '.join(tables)} WHERE {' AND '.join(holds)}"
