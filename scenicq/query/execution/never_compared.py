"""What a program sets and the labels of a dataset do not observe: it is not compared, and its author must know.

One pass over the columns in question says for each property that the program sets in how many frames it is missing;
what no label has is named with its line, what labels have instead, and a name spelled nearly like it. So is a class of
which no label object is.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Collection, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from scenicq.errors import Diagnostic, Span, similar
from scenicq.forest.groups import PARAMS
from scenicq.forest.scenario import Scenario
from scenicq.forest.unobserved import is_only_observed
from scenicq.forest.walk import features
from scenicq.match.options import MatchOptions
from scenicq.store.classes import ROOT, ancestors, class_matches, fold, is_class, subclasses
from scenicq.store.dataset import Dataset
from scenicq.store.place import open_parquet
from scenicq.store.sql import sql_text

if TYPE_CHECKING:
    import duckdb

__all__ = ["Coverage", "coverage"]

_COLUMNS = {
    "heading": "heading", "width": "width", "length": "length", "height": "height", "velocity": "motion_vx",
    "speed": "motion_vx", "angularSpeed": "yaw_rate", "acceleration": "acceleration",
}  # fmt: skip
"""Properties that have columns of their own; all others are attributes."""
_NOT_SEEN = frozenset({
    "position", "behavior", "requireVisible", "allowCollisions", "regionContainedIn", "visibleDistance", "viewAngle",
    "cameraOffset", "mutationScale", "positionStdDev", "headingStdDev", "parentOrientation", "yaw", "baseOffset",
})  # fmt: skip
"""Properties that are never warned about: every label has them, or they govern sight, requirements, simulation."""
_SAMPLED = 1000


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of what a program sets is compared with a dataset.

    Attributes:
        warnings: One for each property that no label has (never-compared), and for each class that no label object has
            (class-absent); no-tracks, where nothing has a track.
        missing: How many frames lack a property that other frames have, by its name in the program.
    """

    warnings: tuple[Diagnostic, ...] = ()
    missing: dict[str, int] = field(default_factory=dict[str, int])


@dataclass(frozen=True, slots=True)
class _Setting:
    """A property that the program sets, or that a requirement of it reads.

    Attributes:
        what: In the words of the program, such as `car.speed`.
        name: The property; of a parameter its name.
        category: The class of the object; "" for a parameter.
        ego: Whether the label's ego is meant, rather than the label objects.
        span: Where it is set or read.
        told: What is shown beside that place.
        comparable: Whether its value is one that a label could have.
    """

    what: str
    name: str
    category: str
    ego: bool
    span: Span | None
    told: str = "set here"
    comparable: bool = True


def _settings(scenario: Scenario, options: MatchOptions) -> Iterator[_Setting]:
    """Yield what a scenario sets or reads; `coverage` drops repeated places."""
    for name, given in scenario.params.items():
        if given.explicit and name not in options.ignore_params:
            yield _Setting(f"param {name}", name, "", ego=True, span=given.span)
    roots = [given.value for owner in scenario.objects for given in owner.properties.values()]
    roots += [requirement.condition for requirement in scenario.requirements]
    used = set(features(*roots))
    for owner in scenario.objects:
        ego = owner.index == scenario.ego and options.ego == "label"
        for name, given in owner.properties.items():
            own = given.explicit and name not in _NOT_SEEN and name not in owner.mutated
            # a property that the program has for its own use is no claim about labels
            if own and (name in _COLUMNS or (owner.index, name) not in used):
                yield _Setting(f"{owner.name}.{name}", name, owner.category, ego, given.span)
        for name, span in owner.uncomparable.items():
            if name not in _NOT_SEEN:
                yield _Setting(f"{owner.name}.{name}", name, owner.category, ego, span, comparable=False)
    yield from _only_read(scenario, options)


def _only_read(scenario: Scenario, options: MatchOptions) -> Iterator[_Setting]:
    """Properties that a scenario reads and only labels tell. No default replaces a missing one."""
    frame, over_time = (
        "read here: a frame that depends on it is unknown",
        "read here: an interval that depends on it is unknown",
    )
    read = [(requirement.condition, requirement.span, frame) for requirement in scenario.requirements]
    read += [
        (given.value, given.span, frame)
        for owner in scenario.objects
        for name, given in owner.properties.items()
        if given.explicit or name in ("position", "heading")
    ]
    dynamics = scenario.dynamics
    read += [(condition, condition.span, over_time) for condition in (dynamics.conditions if dynamics else ())]
    for root, span, told in read:
        for index, name in features(root):
            if index != PARAMS and is_only_observed(scenario, index, name):
                owner = scenario.every_object[index]
                ego = index == scenario.ego and options.ego == "label"
                yield _Setting(f"{owner.name}.{name}", name, owner.category, ego, span, told)


def coverage(dataset: Dataset, scenarios: Iterable[Scenario], options: MatchOptions) -> Coverage:
    """How much of what a program sets is compared with a dataset.

    Args:
        dataset: The dataset.
        scenarios: The program, compiled over maps of the dataset.
        options: Classes, ego and ignored parameters.
    """
    scenarios = tuple(scenarios)
    places: dict[tuple[Span | None, str, str], _Setting] = {}
    for scenario in scenarios:
        for each in _settings(scenario, options):
            places.setdefault((each.span, each.name, each.category), each)
    found = sorted(places.values(), key=lambda each: each.span.start if each.span is not None else 0)
    without = (*_without_objects(dataset, scenarios, options), *_without_tracks(dataset, scenarios))
    if not dataset.manifest.total.frames:
        return Coverage(without)
    with dataset.blamed():
        # connecting takes longer than most questions, and of most programs the statistics say that nothing is missing
        found = _perhaps_missing(dataset, found)
    if not found:
        return Coverage(without)
    with closing(dataset.connect(views=False)) as connection, dataset.blamed():
        counts = _counts(dataset, connection, [each for each in found if each.comparable], options)
        warnings: list[Diagnostic] = []
        missing: dict[str, int] = {}
        for each in found:
            rows, present, lacking = counts.get(each, (1, 0, 0))
            if not present and rows:
                warnings.append(_warning(dataset, connection, each, options))
            elif present and lacking:
                missing[each.what] = max(lacking, missing.get(each.what, 0))
    return Coverage((*without, *warnings), missing)


def _without_objects(dataset: Dataset, scenarios: Iterable[Scenario], options: MatchOptions) -> Iterator[Diagnostic]:
    """A warning for each class that a role needs and no label object has; hints name those above it that some have."""
    counts = dataset.manifest.by_class
    if not counts:
        return
    absent: dict[str, Span | None] = {}
    for ego, owner in ((scenario.ego, owner) for scenario in scenarios for owner in scenario.objects):
        played = owner.index != ego or options.ego != "label"
        there = any(class_matches(owner.category, name, options.classes) for name in counts)
        if played and is_class(owner.category) and not there:
            absent.setdefault(owner.category, owner.span)
    for category, span in absent.items():
        above = [name for name in ancestors(category)[1:] if name in counts]
        hints = [
            f"{counts[name]:,} are of class `{name}`, and may be such: `new {name}` matches them" for name in above
        ]
        if any(class_matches(category, name, "coarse") for name in counts):
            hints.append(f"`--classes coarse` takes all of a kind for a `{fold(category, 'coarse')}`")
        yield Diagnostic(
            "class-absent", f"no label object of the dataset is a `{category}`", span, "nothing can play this role",
            hints=tuple(hints), severity="warning",
        )  # fmt: skip


def _without_tracks(dataset: Dataset, scenarios: Iterable[Scenario]) -> tuple[Diagnostic, ...]:
    """A warning where a program over time has objects besides the ego, and nothing says which objects are the same."""
    over_time = any(scenario.dynamics is not None and len(scenario.objects) > 1 for scenario in scenarios)
    if not over_time or dataset.manifest.tracks or not dataset.manifest.total.objects:
        return ()
    message = "no object of the dataset has a track: each is another one in every frame, and no interval is longer"
    hint = "in the interchange format `track` says which objects of several labels are the same"
    return (Diagnostic("no-tracks", message, hints=(hint,), severity="warning"),)


def _classes(category: str, options: MatchOptions) -> str:
    names = [name for name in subclasses(ROOT) if class_matches(category, name, options.classes)]
    return f"({', '.join(map(sql_text, sorted(names)))})"


def _present(each: _Setting) -> str:
    """SQL that is true of a row that has the property."""
    if known := _column(each):
        return f"{known} IS NOT NULL"
    column = ("ego_" if each.ego else "") + "attributes" if each.category else "params"
    key = json.dumps(each.name, ensure_ascii=False) + ":"
    return f"coalesce(contains({column}, {sql_text(key)}), false)"


def _counts(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, asked: list[_Setting], options: MatchOptions
) -> dict[_Setting, tuple[int, int, int]]:
    """For each property: how many rows could have it, how many have it, and how many frames have a row without it."""
    found: dict[_Setting, tuple[int, int, int]] = {}
    for table in ("labels", "objects"):
        mine = [each for each in asked if _table(each) == table]
        rows = [f"count(*) FILTER ({_own(each, options)})" for each in mine]
        present = [f"count(*) FILTER ({_own(each, options)} AND {_present(each)})" for each in mine]
        numbers = _row(dataset, connection, [*rows, *present], table)
        counts = list(zip(mine, numbers, numbers[len(mine) :], strict=False))
        partial = [each for each, count, there in counts if 0 < there < count]
        frames = [
            f"count(DISTINCT frame) FILTER ({_own(each, options)} AND NOT ({_present(each)}))" for each in partial
        ]
        lacking = dict(zip(partial, _row(dataset, connection, frames, table), strict=True))
        found |= {each: (count, there, lacking.get(each, 0)) for each, count, there in counts}
    return found


def _column(each: _Setting) -> str | None:
    """The column that a property is in; None for one among the attributes."""
    return ("ego_" if each.ego else "") + _COLUMNS[each.name] if each.category and each.name in _COLUMNS else None


def _own(each: _Setting, options: MatchOptions) -> str:
    """SQL that is true of a row that could have a property."""
    return f"{'ego_class' if each.ego else 'class'} IN {_classes(each.category, options)}" if each.category else "true"


def _row(dataset: Dataset, connection: duckdb.DuckDBPyConnection, columns: list[str], table: str) -> tuple[int, ...]:
    if not columns:
        return ()
    row = connection.execute(f"SELECT {', '.join(columns)} FROM {dataset.scan(table)}").fetchone()
    assert row is not None
    return row


def _perhaps_missing(dataset: Dataset, found: Iterable[_Setting]) -> list[_Setting]:
    """Drop the properties whose column has a value in every row, as the files' statistics say."""
    asked = [each for each in found if each.comparable]
    full = {
        (table, name)
        for table in ("labels", "objects")
        for name in _full_columns(dataset, table, {_column(each) for each in asked if _table(each) == table} - {None})
    }
    return [each for each in found if not each.comparable or (_table(each), _column(each)) not in full]


def _table(each: _Setting) -> str:
    return "labels" if each.ego else "objects"


def _full_columns(dataset: Dataset, table: str, names: Collection[str | None]) -> Collection[str | None]:
    """Which of some columns of a table have a value in every row."""
    full = set(names)
    for file in dataset.files(table):
        if not full:
            break
        with open_parquet(file) as parquet:
            metadata = parquet.metadata
            places = [place for place in range(metadata.num_columns) if metadata.schema.column(place).path in full]
            for group, place in itertools.product(range(metadata.num_row_groups), places):
                column = metadata.row_group(group).column(place)
                if column.statistics is None or column.statistics.null_count != 0:
                    full.discard(column.path_in_schema)
    return full


def _known(dataset: Dataset, connection: duckdb.DuckDBPyConnection, each: _Setting, options: MatchOptions) -> list[str]:
    """Names of the properties, besides class and position, that labels give such an object; or of their parameters."""
    table, prefix = (dataset.scan("labels"), "ego_") if each.ego else (dataset.scan("objects"), "")
    own = f"{prefix}class IN {_classes(each.category, options)}" if each.category else "true"
    names: list[str] = []
    if each.category:
        flags = ", ".join(f"bool_or({prefix}{column} IS NOT NULL)" for column in _COLUMNS.values())
        row = connection.execute(f"SELECT {flags} FROM {table} WHERE {own}").fetchone() or ()
        names = [name for name, there in zip(_COLUMNS, row, strict=True) if there]
    column = f"{prefix}attributes" if each.category else "params"
    query = f"SELECT DISTINCT {column} FROM {table} WHERE {own} AND {column} IS NOT NULL ORDER BY ALL LIMIT {_SAMPLED}"
    further: set[str] = set()
    for (text,) in connection.execute(query).fetchall():
        values: dict[str, Any] = json.loads(text)
        further.update(values)
    return names + sorted(further - set(names))


def _warning(
    dataset: Dataset, connection: duckdb.DuckDBPyConnection, each: _Setting, options: MatchOptions
) -> Diagnostic:
    known = _known(dataset, connection, each, options)
    kind = "the ego" if each.ego else f"`{each.category}`"
    if not each.category:
        message = f"`{each.what}` is never compared: no label of the dataset has such a parameter"
        have = f"parameters of the labels: {', '.join(known) or 'none'}"
    elif not each.comparable:
        message = f"`{each.what}` is never compared: no property of a label is a list, a tuple or the like"
        have = f"the labels have of {kind}: {', '.join(known) or 'class and position alone'}"
    else:
        message = f"`{each.what}` is never compared: no label of {kind} in the dataset has it"
        have = f"the labels have of {kind}: {', '.join(known) or 'class and position alone'}"
    near = similar(each.name, {*known, *_COLUMNS} - {each.name})
    absent = "" if near in known else ", which the labels do not have either"
    hints = (have, *([f"`{near}` is spelled nearly like it{absent}"] if near else []))
    return Diagnostic("never-compared", message, each.span, each.told, hints=hints, severity="warning")
