"""The prefilter: SQL that says which frames could match, who could play which role in them, and what excludes the rest.

A plan works through a block of the dataset in stages, the cheap ones first, each on the frames that are left: columns
of the frame; one pass over the objects, which gives every object the number of conditions that it meets of each role;
memberships of regions; distinct objects for all roles; pairs of objects that conditions tie together. Objects are only
ever joined two by two, and only those that are left. A frame that misses a step is out, with that step's name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from scenicq.forest.scenario import Scenario, ScenarioObject
from scenicq.geometry.network import Network
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.condition_reader import EGO, ColumnCondition
from scenicq.query.prefilter.conditions import necessary_conditions, sufficient_conditions
from scenicq.query.prefilter.decision import decision, new_table
from scenicq.query.prefilter.map_relations import MapRelations
from scenicq.query.prefilter.other_objects import OBJECTS, OTHER, OtherCondition, other_conditions
from scenicq.query.prefilter.params import param_conditions
from scenicq.query.prefilter.plan_draft import Draft, Stage, Step, blamed_step
from scenicq.query.prefilter.regions import RegionNames
from scenicq.query.prefilter.sql_ends import SqlTruth, columns_of, number
from scenicq.store.classes import ROOT, class_matches, subclasses
from scenicq.store.sql import sql_text

__all__ = ["LABELS", "LINKS", "MEMBERSHIPS", "OBJECTS", "PASSED", "SENSORS", "Plan", "make_plan"]

LABELS, MEMBERSHIPS = "block_labels", "block_memberships"
"""The views that a plan reads: rows of a block of each table with their `number` in the file."""
LINKS = "block_links"
"""The view of how the elements of the maps of a block hang together."""
SENSORS = "block_sensors"
"""The view of the sensor files of a block."""
PASSED = "passed"
"""The table of the numbers `f` of the frames that their own columns leave."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The prefilter of a scenario on one map.

    Attributes:
        map: The map.
        steps: Conditions in the order in which they are blamed.
        columns: A query for the number `f` of each frame and the step `missed` that its columns alone say it misses, -1
            for none. Those that miss none are `PASSED`, and all else is about them.
        stages: How the other steps are decided.
        names: The query of each table of names of map elements that the stages read, by the table and its columns.
        roles: The objects for which the table `roles` then has a column `r0`, `r1` ...: whether the object in row `row`
            may play them; none where there is nobody but the ego. None if every object of a frame must be looked at.
        decision: SQL that makes the table `decided` of frames that surely match, of those that all stages have left;
            none where SQL decides nothing, or was not asked to.
        players: Where nobody reads what frames fail at, and no condition is about two objects or memberships: a query
            for what all stages together leave, the number `f` of a frame, the `row` of an object and the roles that it
            may play.
    """

    map: str
    steps: tuple[Step, ...]
    columns: str
    stages: tuple[Stage, ...]
    roles: tuple[int, ...] | None
    decision: tuple[str, ...] = ()
    players: str = ""
    names: tuple[tuple[str, str], ...] = ()

    @property
    def left(self) -> str:
        """SQL of the numbers of the frames that all stages have left."""
        return f"(SELECT f FROM {self.stages[-1].table} WHERE missed IS NULL)"

    @property
    def statements(self) -> list[str]:
        """All statements, for people."""
        staged = [statement for stage in self.stages for statement in stage.statements]
        named = [new_table(*each) for each in self.names]
        if self.players:
            return [self.players]
        return [self.columns, *named, *staged, *self.decision] if staged else []

    @property
    def sql(self) -> str:
        """All statements as one text."""
        return ";\n".join(self.statements)


@dataclass(slots=True)
class _Role:
    """One object's conditions: those on columns of its row, then those on memberships."""

    owner: ScenarioObject
    classes: str
    plain: list[ColumnCondition]
    placed: list[ColumnCondition]
    column: str

    @property
    def full(self) -> int:
        """The level of a row that meets all conditions on columns."""
        return len(self.plain) + 1


def _level(conditions_: Sequence[SqlTruth], first: int = 0) -> str:
    """How many conditions hold before the first that does not."""
    if not conditions_:
        return f"{first}::UTINYINT"
    cases = " ".join(f"WHEN NOT coalesce({sql}, true) THEN {place}" for place, sql in enumerate(conditions_, first))
    return f"(CASE {cases} ELSE {first + len(conditions_)} END)::UTINYINT"


def _classes(category: str, options: MatchOptions) -> list[str]:
    return sorted(name for name in subclasses(ROOT) if class_matches(category, name, options.classes))


def _any_of(names: Iterable[str]) -> str:
    listed = ", ".join(map(sql_text, sorted(set(names))))
    return f"a.class IN ({listed})" if listed else "false"


def make_plan(
    scenario: Scenario, network: Network, options: MatchOptions, *, deciding: bool = False, counting: bool = True
) -> Plan:
    """The prefilter of a scenario, compiled against the map, under the options.

    Every step is necessary: a frame that matches misses none of them, and keeps every object that plays a role in some
    match.

    Args:
        scenario: The scenario.
        network: The map it was compiled against.
        options: Tolerances, classes, radius.
        deciding: Whether SQL is to say, too, which frames surely match.
        counting: Whether somebody reads which step a frame misses first; if not, it is any one.
    """
    scenario, own_ego = prepare_scenario(scenario), options.ego == "label"
    relations = MapRelations(RegionNames(network), scenario.ego)
    found = list(necessary_conditions(scenario, network, options, relations)) if own_ego else []
    columns: dict[tuple[str, ...], str] = {}
    roles: list[_Role] = []
    for owner in scenario.objects:
        if owner.index != scenario.ego:
            mine = [each for each in found if each.objects == (owner.index,)]
            plain, placed = [each for each in mine if not each.region], [each for each in mine if each.region]
            classes = _any_of(_classes(owner.category, options))
            key = (classes, *(each.region or str(each.sql) for each in (*plain, *placed)))
            roles.append(_Role(owner, classes, plain, placed, columns.setdefault(key, f"c{len(columns)}")))
    pairs = _pairs(found)
    draft, params = Draft(), list(param_conditions(scenario, options))
    others = list(other_conditions(scenario, options.classes)) if own_ego else []
    _frames(draft, [each for each in found if not each.objects], params, roles, pairs, others)
    if others:
        _others(draft, others)
    if roles:
        _objects(draft, roles, pairs, options, counting=counting)
    proofs = sufficient_conditions(scenario, network, options, relations) if deciding else None
    wanted = list(dict.fromkeys(each.region for each in proofs or () if each.region))
    flags = {near: f"s{place}" for place, near in enumerate(wanted) if any(each.region for each in found)}
    placed_table = _regions(
        draft, [each for each in found if not each.objects and each.region], roles, flags, relations
    )
    if roles and own_ego:
        _distinct(draft, roles, placed_table, pairs)
        for objects, tied in list(pairs.items())[: LIMITS.joined_pairs]:
            _pair(draft, roles, objects, tied)
    played = tuple(role.owner.index for role in roles)
    alone = all(len(each.objects) < 2 and not each.region for each in found)
    apart = bool(roles) and own_ego and not options.exact and not counting and alone
    own = [*params, *(each for each in found if not each.objects)]
    left = f"(SELECT f FROM {draft.last} WHERE missed IS NULL)"
    return Plan(
        network.name,
        tuple(draft.steps),
        draft.columns,
        tuple(draft.stages),
        played if own_ego and not options.exact else None,
        () if proofs is None else decision(proofs, played, flags, options, tables=(LABELS, OBJECTS), left=left),
        _players(roles, own, options) if apart else "",
        tuple(relations.names.tables.items()),
    )


def _pairs(found: Sequence[ColumnCondition]) -> dict[tuple[int, ...], list[ColumnCondition]]:
    pairs: dict[tuple[int, ...], list[ColumnCondition]] = {}
    for each in found:
        if len(each.objects) == 2:
            pairs.setdefault(each.objects, []).append(each)
    return pairs


def _frames(
    draft: Draft,
    own: Sequence[ColumnCondition],
    params: Sequence[ColumnCondition],
    roles: Sequence[_Role],
    pairs: dict[tuple[int, ...], list[ColumnCondition]],
    others: Sequence[OtherCondition],
) -> None:
    """What the columns of the frame decide."""
    used = [each.counted for each in others]
    used += [each.sql for role in roles for each in role.plain] + [each.sql for tied in pairs.values() for each in tied]
    kept = "".join(f", {EGO}.{name}" for name in columns_of(EGO, used) if name != "frame")
    blamed = [
        (f"NOT coalesce({each.sql}, true)", draft.step(each.what, each.span))
        for each in (*params, *own)
        if not each.region
    ]
    draft.columns = f"SELECT {EGO}.number AS f, coalesce({blamed_step(blamed)}, -1) AS missed FROM {LABELS} {EGO}"
    query = (
        f"SELECT {EGO}.number AS f, {EGO}.frame{kept}, {blamed_step(())} AS missed FROM {LABELS} {EGO} "
        f"WHERE {EGO}.number IN (SELECT f FROM {PASSED})"
    )
    draft.stages.append(Stage("stage0", (new_table("stage0", query),)))


def _others(draft: Draft, others: Sequence[OtherCondition]) -> None:
    """How many label objects count, whether or not they may play a role."""
    tallied = ", ".join(f"count(*) FILTER ({each.counted}) AS n{place}" for place, each in enumerate(others))
    some = " OR ".join(dict.fromkeys(each.counted for each in others))
    counts = (
        f"SELECT {EGO}.f, {tallied} FROM {OBJECTS} {OTHER} JOIN {draft.last} {EGO} ON {OTHER}.frame = {EGO}.frame "
        f"WHERE {EGO}.missed IS NULL AND ({some}) GROUP BY {EGO}.f"
    )
    blamed: list[tuple[str, int]] = []
    for place, each in enumerate(others):
        what = "" if each.span is None else " ".join(each.span.text.split())
        number, few = f"coalesce(t.n{place}, 0)", each.at_least
        missed = f"{number} > {each.most}" if few is None else f"{number} < {few}"
        blamed.append((missed, draft.step(what, each.span)))
    draft.stage([], blamed, f"LEFT JOIN ({counts}) t ON t.f = s.f")


def _reached(role: _Role, classes: Sequence[str]) -> str:
    """How far an object of one of some classes comes in a role: 1 by its class, more by what is asked of it alone."""
    plain = [each.sql for each in role.plain]
    return _level(plain, 1) if len(classes) == 1 else _level([role.classes, *plain])


def _some_role(roles: Iterable[_Role]) -> str:
    """That an object meets the conditions of some role that need no column of the frame."""
    alone = [[each.sql for each in role.plain if not columns_of(EGO, [each.sql])] for role in roles]
    met = ["(" + " AND ".join(["true", *map(_possible, mine)]) + ")" for mine in alone]
    return f"({' OR '.join(dict.fromkeys(met))})"


def _possible(sql: SqlTruth) -> str:
    """That a condition holds where a label tells."""
    return f"coalesce({sql}, true)"


def _near(options: MatchOptions) -> str:
    """That an object is within the radius."""
    return "true" if options.radius is None else f"a.ego_distance <= {number(options.radius + SLACK)}"


def _players(roles: Sequence[_Role], own: Sequence[ColumnCondition], options: MatchOptions) -> str:
    """All conditions in one query; see `Plan.players`."""
    may = [" AND ".join([role.classes, *(_possible(each.sql) for each in role.plain)]) for role in roles]
    columns = ", ".join(f"({each}) AS r{place}" for place, each in enumerate(may))
    frames = " AND ".join(["true", *(_possible(each.sql) for each in own)])
    some = " OR ".join(f"({each})" for each in dict.fromkeys(may))
    return (
        f"SELECT {EGO}.number AS f, a.number AS row, {columns} FROM {OBJECTS} a JOIN {LABELS} {EGO} "
        f"ON a.frame = {EGO}.frame WHERE {frames} AND {_near(options)} AND {_some_role(roles)} "
        f"AND ({some})"
    )


def _objects(
    draft: Draft, roles: Sequence[_Role], pairs: dict[tuple[int, ...], list[ColumnCondition]], options: MatchOptions,
    *, counting: bool,
) -> None:  # fmt: skip
    """One pass over the objects: how far each comes in each role; without counts only those that may play one."""
    own_ego = options.ego == "label"
    tied = [each.sql for conditions_ in pairs.values() for each in conditions_]
    kept = [f"a.{name}" for name in sorted({*columns_of("a", tied), *columns_of("b", tied)})]
    if any(role.placed for role in roles):
        kept.append("a.id")
    distinct = {role.column: role for role in roles}
    classes = tuple(dict.fromkeys(role.classes for role in roles))
    levels = [f"{_reached(role, classes)} AS {role.column}" for role in distinct.values()]
    near = _near(options) if own_ego else "true"
    some = "true" if counting else _some_role(distinct.values())
    left = f"{EGO}.missed IS NULL"
    if draft.last != "stage0":
        left += f" AND {EGO}.f IN (SELECT f FROM {draft.last} WHERE missed IS NULL)"
    narrow = (
        f"SELECT {EGO}.f, a.number AS row, {', '.join([*kept, *levels])} FROM {OBJECTS} a "
        f"JOIN stage0 {EGO} ON a.frame = {EGO}.frame WHERE {left} AND ({' OR '.join(classes)}) "
        f"AND {near} AND {some}"
    )
    pools: dict[str, int] = {}
    blamed: list[tuple[str, int]] = []
    counts: dict[str, str] = {}
    for role in roles:
        pools[role.classes] = pools.get(role.classes, 0) + 1
        # With any object as the ego, the label's own ego may play another role.
        least = pools[role.classes] - (not own_ego)
        count = counts.setdefault(f"count(*) FILTER ({role.column} >= 1)", f"n{len(counts)}")
        step = draft.step(f"{role.owner.name}.class", role.owner.span, f"no {role.owner.category}")
        blamed.append((f"coalesce({count}, 0) < {least}", step))
    for role in roles:
        furthest = counts.setdefault(f"max({role.column})", f"n{len(counts)}")
        for place, each in enumerate(role.plain, 1):
            blamed.append((f"{furthest} <= {place}", draft.step(each.what, each.span)))
    tallied = ", ".join(f"{sql} AS {name}" for sql, name in counts.items())
    draft.stage(
        [new_table("narrow", narrow)],
        blamed,
        f"LEFT JOIN (SELECT f, {tallied} FROM narrow GROUP BY f) t ON t.f = s.f",
    )


def _regions(
    draft: Draft, own: Sequence[ColumnCondition], roles: Sequence[_Role], wanted: Mapping[str, str],
    relations: MapRelations,
) -> str:  # fmt: skip
    """What memberships of regions decide; returns the table of objects and how far they come.

    The table `flags` has a column for each condition that is wanted besides, over tables of `relations`.
    """
    mine = {each.region: f"e{place}" for place, each in enumerate(own)}
    distinct = {role.column: role for role in roles if role.placed}
    others: dict[str, str] = {}
    for role in distinct.values():
        for each in role.placed:
            others.setdefault(each.region, f"g{len(others)}")
    if not mine and not others:
        return "narrow"
    flags = [f"bool_or({sql}) AS {name}" for sql, name in (*mine.items(), *others.items(), *wanted.items())]
    left = f"f IN (SELECT f FROM {draft.last} WHERE missed IS NULL)"
    asked: list[str] = []
    if mine or not relations.is_empty:
        asked.append(f"SELECT f, frame, 'ego' AS object FROM stage0 WHERE {left}")
    if others:
        placed = " OR ".join(f"n.{name} = {role.full}" for name, role in distinct.items())
        asked.append(
            f"SELECT n.f, {EGO}.frame, n.id AS object FROM narrow n JOIN stage0 {EGO} USING (f) "
            f"WHERE ({placed}) AND n.{left}"
        )
    rows = (
        f"SELECT q.f, m.object, m.kind, m.region, m.distance, m.turn, m.section_turn FROM {MEMBERSHIPS} m "
        f"JOIN ({' UNION ALL '.join(asked)}) q ON m.frame = q.frame AND m.object = q.object"
    )
    statements: list[str] = []
    if not relations.is_empty:
        # asked more than once
        statements.append(new_table("placings", rows))
        rows = "SELECT * FROM placings"
        maps = f"SELECT number AS f, map FROM {LABELS}"
        statements += [new_table(*each) for each in relations.queries("placings", maps, LINKS)]
    statements.append(
        new_table(
            "flags",
            f"SELECT q.f, q.object, {', '.join(flags)} FROM ({rows}) q "
            f"WHERE {' OR '.join(dict.fromkeys((*mine, *others)))} GROUP BY q.f, q.object",
        )
    )
    joined = "LEFT JOIN flags e ON e.f = s.f AND e.object = 'ego'" if mine else ""
    blamed = [
        (f"NOT coalesce(e.{name}, false)", draft.step(each.what, each.span))
        for each, name in zip(own, mine.values(), strict=False)
    ]
    if others:
        raised: list[str] = []
        for name, role in distinct.items():
            further = _level([f"coalesce(g.{others[each.region]}, false)" for each in role.placed], role.full)
            raised.append(f"CASE WHEN {name} < {role.full} THEN {name} ELSE {further} END AS {name}")
        statements.append(
            new_table(
                "placed",
                f"SELECT n.* REPLACE ({', '.join(raised)}) FROM narrow n "
                "LEFT JOIN flags g ON g.f = n.f AND g.object = n.id "
                f"WHERE n.f IN (SELECT f FROM {draft.last} WHERE missed IS NULL)",
            )
        )
        tallied = ", ".join(f"max({name}) AS m{name}" for name in distinct)
        joined += f" LEFT JOIN (SELECT f, {tallied} FROM placed GROUP BY f) t ON t.f = s.f"
        for role in roles:
            for place, each in enumerate(role.placed, role.full):
                blamed.append((f"m{role.column} <= {place}", draft.step(each.what, each.span)))
    draft.stage(statements, blamed, joined)
    return "placed" if others else "narrow"


def _distinct(
    draft: Draft, roles: Sequence[_Role], source: str, pairs: dict[tuple[int, ...], list[ColumnCondition]]
) -> None:
    """Who is left for each role, and whether there are enough of them for all."""
    tied = [each.sql for conditions_ in pairs.values() for each in conditions_]
    kept = "".join(f", {name}" for name in sorted({*columns_of("a", tied), *columns_of("b", tied)}))
    flags = [f"{role.column} = {role.full + len(role.placed)}" for role in roles]
    chosen = ", ".join(f"{flag} AS r{place}" for place, flag in enumerate(flags))
    table = new_table(
        "roles",
        f"SELECT f, row{kept}, {chosen} FROM {source} "
        f"WHERE ({' OR '.join(dict.fromkeys(flags))}) AND f IN (SELECT f FROM {draft.last} WHERE missed IS NULL)",
    )
    blamed: list[tuple[str, int]] = []
    tally = ""
    if len(roles) > 1:
        step = draft.step("correspondence", roles[-1].owner.span, "no distinct label objects for all objects")
        blamed = [(f"coalesce(n, 0) < {len(roles)}", step)]
        anybody = " OR ".join(f"r{place}" for place in range(len(roles)))
        tally = f"LEFT JOIN (SELECT f, count(*) FILTER ({anybody}) AS n FROM roles GROUP BY f) t ON t.f = s.f"
    draft.stage([table], blamed, tally)


def _pair(draft: Draft, roles: Sequence[_Role], objects: tuple[int, ...], tied: Sequence[ColumnCondition]) -> None:
    """Two roles whose objects conditions tie together: whoever has no partner is out of the role."""
    one, other = (next(place for place, role in enumerate(roles) if role.owner.index == index) for index in objects)
    ego = f" JOIN stage0 {EGO} ON {EGO}.f = a.f" if columns_of(EGO, [each.sql for each in tied]) else ""
    level = _level([each.sql for each in tied])
    statements = [
        new_table(
            "pairs",
            f"SELECT a.f, a.row AS one, b.row AS other, {level} AS level FROM roles a "
            f"JOIN roles b ON a.f = b.f AND a.row <> b.row{ego} WHERE a.r{one} AND b.r{other} "
            f"AND a.f IN (SELECT f FROM {draft.last} WHERE missed IS NULL)",
        ),
        new_table(
            "roles",
            "SELECT * REPLACE ("
            + ", ".join(
                f"r{place} AND row IN (SELECT {side} FROM pairs WHERE level = {len(tied)}) AS r{place}"
                for place, side in ((one, "one"), (other, "other"))
            )
            + ") FROM roles WHERE f IN (SELECT f FROM pairs)",
        ),
    ]
    blamed = [(f"coalesce(t.level, 0) <= {place}", draft.step(each.what, each.span)) for place, each in enumerate(tied)]
    draft.stage(statements, blamed, "LEFT JOIN (SELECT f, max(level) AS level FROM pairs GROUP BY f) t ON t.f = s.f")
