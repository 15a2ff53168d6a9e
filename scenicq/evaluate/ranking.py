"""Rank matches from typical to borderline, and pick matches that spread over recordings and random variables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.evaluate.density import GroupDensity
from scenicq.evaluate.observed_columns import ObservedValues
from scenicq.evaluate.variables import Draws
from scenicq.evaluate.weighting import log_weights
from scenicq.forest.groups import PARAMS, Comparison
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import Scenario
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import Signature, build_groups
from scenicq.match.problem.observation import observe, observe_params
from scenicq.match.verdict import Match
from scenicq.query.execution.interval_frames import roles_in
from scenicq.query.execution.results import LogDensity, Result
from scenicq.query.execution.run import Query
from scenicq.store.labels import Label

__all__ = ["densities", "log_densities", "rank_results", "sample_diverse", "sample_plain"]

Reals = NDArray[np.float64]

_DRAWS = 512
_DIGITS = 10
"""Decimals of a log-density: what differs beyond them is rounding, and equal densities keep the dataset's order."""


def log_densities(
    scenario: Scenario,
    labels: Sequence[tuple[Label, Mapping[str, str]]],
    options: MatchOptions | None = None,
    *,
    draws: int = _DRAWS,
    seed: int = 0,
) -> list[LogDensity]:
    """The log-density of labels under a program, up to a constant that is the same for all labels of one map.

    Args:
        scenario: Compiled for the map of the labels.
        labels: Labels, each with the correspondence by which it matches.
        options: The matcher's, for what is compared.
        draws: How many draws of hidden variables.
        seed: The seed of the draws.
    """
    written = scenario.as_written or scenario
    options = options or MatchOptions()
    signatures: dict[Signature, list[int]] = {}
    seen: list[ObservedValues] = []
    for number, (label, correspondence) in enumerate(labels):
        observed, signature = _observed(written, label, correspondence)
        seen.append(observed)
        signatures.setdefault(signature, []).append(number)
    found: dict[int, LogDensity] = {}
    for signature, numbers in signatures.items():
        mine = [seen[number] for number in numbers]
        found |= dict(zip(numbers, _of_one_signature(written, signature, mine, options, draws, seed), strict=True))
    return [found[number] for number in range(len(labels))]


def _observed(scenario: Scenario, label: Label, correspondence: Mapping[str, str]) -> tuple[ObservedValues, Signature]:
    members = {member.id: member for member in label.objects} | {"ego": label.ego}
    observed: dict[tuple[int, str], Value] = {}
    names: list[frozenset[str]] = []
    for each in scenario.objects:
        played = correspondence.get(each.name)
        its: Mapping[str, Value] = {} if played is None else observe(members[played])
        names.append(frozenset(its))
        observed |= {(each.index, name): value for name, value in its.items()}
    params = observe_params(label)
    observed |= {(PARAMS, name): value for name, value in params.items()}
    return observed, (*names, frozenset(params))


def _of_one_signature(
    scenario: Scenario,
    signature: Signature,
    labels: Sequence[ObservedValues],
    options: MatchOptions,
    draws: int,
    seed: int,
) -> list[LogDensity]:
    names = [owner.name for owner in scenario.objects]
    shared = Draws(draws, seed)
    logs, errors, of_variables = np.zeros(len(labels)), np.zeros(len(labels)), np.zeros(len(labels))
    solved: list[Reals] = []
    finite: list[list[Value]] = [[] for _ in labels]
    fixed: list[str] = []
    counted = False
    for group in build_groups(scenario, signature, options):
        each = GroupDensity(group, shared)
        fixed += [_about(compared, names) for compared in each.fixed]
        if each.trivial:
            continue
        counted = True
        try:
            values = each.values(labels)
        except CannotEvaluate as why:
            return [LogDensity(None, fixed=tuple(fixed), reason=str(why))] * len(labels)
        logs += values.log
        of_variables += values.log + values.log_size
        errors = np.hypot(errors, values.error)
        solved.append(values.solved)
        for number, label in enumerate(labels):
            finite[number].extend(each.finite_values(label))
    if not counted:
        return [LogDensity(None, fixed=tuple(fixed), reason="every feature is fixed by an equality")] * len(labels)
    outside = "outside of what the program generates, by less than the tolerance"
    inside = np.flatnonzero(np.isfinite(logs))
    kinds = [tuple(finite[number]) for number in inside.tolist()]
    weights = np.full(len(labels), math.nan)
    weights[inside] = log_weights(of_variables[inside], np.hstack(solved)[inside], kinds, seed)
    return [
        LogDensity(round(float(log), _DIGITS), float(error), tuple(fixed), log_weight=float(weight))
        if math.isfinite(log)
        else LogDensity(None, 0, tuple(fixed), outside)
        for log, error, weight in zip(logs, errors, weights, strict=True)
    ]


def _about(compared: Comparison, names: Sequence[str]) -> str:
    """A feature in the words of the program."""
    if compared.object == PARAMS:
        return f"param {compared.property}"
    return f"{names[compared.object]}.{compared.property}"


def densities(query: Query, results: Sequence[Result]) -> list[LogDensity | None]:
    """The log-density of each result that is a match, None for others.

    Args:
        query: The query that found them.
        results: What it found.
    """
    labels = {label.frame: label for label in query.dataset.labels(result.frame for result in results)}
    by_map: dict[str, list[int]] = {}
    for number, result in enumerate(results):
        if isinstance(result.verdict, Match):
            by_map.setdefault(labels[result.frame].map, []).append(number)
    found: list[LogDensity | None] = [None] * len(results)
    for name, numbers in by_map.items():
        scenario = query.compiled_map(name).scenario
        bound = [(label := labels[results[n].frame], roles_in(label, results[n])) for n in numbers]
        for number, density in zip(numbers, log_densities(scenario, bound, query.options.match), strict=True):
            found[number] = density
    return found


def rank_results(query: Query, results: Iterable[Result]) -> list[Result]:
    """Sort results from typical to borderline, each with its log-density; those without one come last, in their order.

    Args:
        query: The query that found them.
        results: What it found.
    """
    given = list(results)
    known = [replace(each, density=density) for each, density in zip(given, densities(query, given), strict=True)]

    def order(number: int) -> tuple[float, int]:
        density = known[number].density
        return (math.inf if density is None or density.log is None else -density.log, number)

    return [known[number] for number in sorted(range(len(known)), key=order)]


def sample_plain(results: Sequence[Result], count: int, seed: int = 0) -> list[Result]:
    """Pick matches at random, and keep their order.

    Args:
        results: Matches.
        count: How many.
        seed: The seed of the choice.
    """
    if len(results) <= count:
        return list(results)
    chosen = np.sort(np.random.default_rng(seed).choice(len(results), count, replace=False))
    return [results[number] for number in chosen.tolist()]


def sample_diverse(results: Sequence[Result], count: int) -> list[Result]:
    """Pick matches that spread over recordings and over values of the random variables, and keep their order.

    Recordings take turns; of each, the match is taken that is farthest from those that are taken already, in the
    numbers of its witness, each scaled to its range, and in time.

    Args:
        results: Matches.
        count: How many.
    """
    if len(results) <= count:
        return list(results)
    points = _points(results)
    names = {name: number for number, name in enumerate(dict.fromkeys(result.recording for result in results))}
    recording = np.array([names[result.recording] for result in results])
    away = np.full(len(results), np.inf)
    taken = np.zeros(len(results), dtype=np.bool_)
    used = np.zeros(len(names))
    # the first is the one in the middle
    away[:] = 1 / (1e-9 + np.square(points - np.median(points, axis=0)).sum(axis=1))
    for number in range(count):
        left = used + np.where(np.bincount(recording[~taken], minlength=len(names)) > 0, 0.0, np.inf)
        open_ = ~taken & (used[recording] == left.min())
        best = int(np.flatnonzero(open_)[np.argmax(away[open_])])
        taken[best] = True
        used[recording[best]] += 1
        near = np.square(points - points[best]).sum(axis=1)
        away = near if number == 0 else np.minimum(away, near)
    return [results[number] for number in np.flatnonzero(taken).tolist()]


def _points(results: Sequence[Result]) -> NDArray[np.float64]:
    """The numbers of witnesses and the times, each from 0 to 1; shape (results, numbers)."""
    columns: dict[str, dict[int, float]] = {}
    for number, result in enumerate(results):
        columns.setdefault("time", {})[number] = result.timestamp_us
        if not isinstance(result.verdict, Match):
            continue
        for key, value in result.verdict.witness.items():
            for axis, each in enumerate(value if isinstance(value, tuple) else (value,)):
                columns.setdefault(f"{key} {axis}", {})[number] = float(each)
    found = np.zeros((len(results), len(columns)))
    for place, column in enumerate(columns.values()):
        numbers, values = np.array(list(column)), np.array(list(column.values()))
        width = float(np.ptp(values))
        found[:, place] = 0.5
        found[numbers, place] = (values - values.min()) / width if width else 0.5
    return found
