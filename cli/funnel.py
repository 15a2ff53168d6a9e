"""The summary of a query: how many frames are left after each step, and what the others failed at."""

from __future__ import annotations

import random
from collections.abc import Collection, Generator
from contextlib import closing
from dataclasses import dataclass, field

import click

from scenicq.errors import Diagnostic
from scenicq.forest.scenario import BuiltIn
from scenicq.match.verdict import Match
from scenicq.query.execution.results import Funnel, Result
from scenicq.query.execution.run import Query

from .report import columns, count, show

__all__ = ["MatchSample", "show_funnel"]

_BUDGET_S = 1.0
"""Seconds for what nobody asked for."""
_SAMPLE = 200
"""Frames of which that is told at most."""


@dataclass(slots=True)
class MatchSample:
    """Some of the frames or intervals that match, each with the same chance, gathered as results come.

    Attributes:
        matches: They.
        of: How many there were.
    """

    matches: list[Result] = field(default_factory=list[Result])
    of: int = 0
    _last: str = ""
    _draw: random.Random = field(default_factory=lambda: random.Random(0))

    def gathered(self, results: Generator[Result]) -> Generator[Result]:
        """The same results."""
        with closing(results):
            for each in results:
                # correspondences of one frame come together
                if isinstance(each.verdict, Match) and (each.interval is not None or each.frame != self._last):
                    self._last = each.frame
                    self.of += 1
                    if len(self.matches) < _SAMPLE:
                        self.matches.append(each)
                    elif (place := self._draw.randrange(self.of)) < _SAMPLE:
                        self.matches[place] = each
                yield each


def _steps(query: Query) -> list[tuple[str, str]]:
    funnel, total = query.funnel, query.dataset.manifest.total.frames
    limit = "--deadline" if funnel.cut else "--limit"
    stopped = "" if funnel.frames >= total else f" of {total:,} looked at (stopped at {limit})"
    filtered = "after the prefilter" if query.options.prefilter else "the prefilter is off"
    reasons = ", ".join(f"{number:,} {reason}" for reason, number in funnel.reasons.most_common())
    over_time = funnel.over_time
    of = f" of {count(over_time['recordings'], 'recording')}" if over_time else ""
    matches, unknown = ("intervals that match", "intervals that are unknown") if over_time else ("matches", "unknown")
    return [
        (f"{funnel.frames:,}", f"frames{of}{stopped}"),
        (f"{funnel.candidates:,}", filtered),
        *(_over_time(funnel) or [(f"{funnel.with_roles:,}", "with a label object for every role")]),
        (f"{funnel.matches:,}", matches),
        *_chosen(funnel),
        (f"{funnel.unknowns:,}", f"{unknown}{f': {reasons}' if reasons else ''}"),
    ]


def _chosen(funnel: Funnel) -> list[tuple[str, str]]:
    """Say how many matches are shown, where `--where` or `--sort` chooses."""
    chosen = funnel.chosen
    if chosen is None:
        return []
    rows = [(f"{chosen.shown:,}", "of these shown")]
    if chosen.where:
        unclear = f", {chosen.unclear:,} of which it is not known" if chosen.unclear else ""
        rows.append((f"{chosen.others + chosen.unclear:,}", f"left out by --where{unclear}"))
    if chosen.beyond:
        rows.append((f"{chosen.beyond:,}", "behind the limit of --sort"))
    return rows


def _over_time(funnel: Funnel) -> list[tuple[str, str]]:
    """The steps between frames and intervals, for a query over time; none for one about frames."""
    told = {
        "starts": "frames that match the initial scene",
        "bindings": "ways to give the objects tracks from there on",
        "cut off": "ways cut off, as the recording or a track ends before the program",
    }
    return [(f"{funnel.over_time[name]:,}", text) for name, text in told.items()] if funnel.over_time else []


def _failures(funnel: Funnel) -> list[str]:
    if not funnel.excluded:
        return []
    counted = sorted(funnel.excluded.items(), key=lambda item: (-item[1], item[0]))
    rows = [(what, f"{number:,}", f"{number / funnel.frames:.0%}") for what, number in counted]
    return columns([("first failed at", "frames", "share"), *rows], right=frozenset({1, 2}))


def _broken(funnel: Funnel) -> list[str]:
    counted = sorted(funnel.broken.items(), key=lambda item: (-item[1], item[0]))
    rows = [(what, f"{number:,}") for what, number in counted]
    return columns([("then failed at", "bindings"), *rows], right=frozenset({1})) if rows else []


def _defaults(query: Query) -> list[str]:
    """What the directions of the world model leave out, of which the program says nothing."""
    compiled, excluded = next(query.fitting(), None), query.funnel.excluded
    if compiled is None:
        return []
    owners = [each for each in compiled.scenario.objects if not each.properties["heading"].explicit]
    left_out = {f"{each.name}.heading": excluded[f"{each.name}.heading"] for each in owners}
    named = [name for name, number in left_out.items() if number]
    if not named:
        return []
    frames = sum(left_out.values())
    names = ", ".join(f"`{name}`" for name in named)
    return [
        f"  {count(frames, 'frame')} failed first at {names}, which the program leaves to the default, the",
        "    direction of the road; `facing Range(-180, 180) deg` takes any direction",
    ]


def _alone(query: Query, sample: MatchSample) -> list[str]:
    """How many matches there are by the tolerance alone."""
    if not sample.matches:
        return []
    from scenicq.query.explain.tolerance_share import by_tolerance_alone  # noqa: PLC0415 - takes long to load

    share = by_tolerance_alone(query, sample.matches, _BUDGET_S)
    told = [
        f"{number:,} by that of {what}"
        for what, number in (("positions", share.positions), ("headings", share.headings))
        if number
    ]
    looked = f"{share.matches:,} of {sample.of:,} matches" if share.matches < sample.of else count(sample.of, "match")
    began = ", at their first frames" if query.is_over_time() else ""
    return [f"    of {looked} by a tolerance alone: {', '.join(told)}{began}"] if told else []


def show_funnel(query: Query, elapsed_s: float, told: Collection[Diagnostic], sample: MatchSample) -> None:
    """Print the summary on standard error.

    Args:
        query: After its results were taken.
        elapsed_s: Seconds that it took.
        told: Warnings that were shown before the results.
        sample: Some of the frames that match.
    """
    show(each for each in query.funnel.warnings if each not in told)
    lines = columns(_steps(query), right=frozenset({0}))
    lines += [*_failures(query.funnel), *_defaults(query), *_broken(query.funnel)]
    for what, frames in sorted(query.funnel.missing.items()):
        lines.append(f"  `{what}` is missing in {count(frames, 'frame')} of the dataset, and not compared there")
    for what, number in sorted(query.funnel.unrecorded.items()):
        name, _, reason = what.rpartition(": ")
        lines.append(f"  `{name}` is recorded as null {count(number, 'time')}: {reason}")
    waived = [requirement.value for requirement in BuiltIn if requirement not in query.options.match.enforce]
    if waived:
        lines.append(f"  waived: {', '.join(waived)} (see --enforce)")
    lines.append(f"  tolerance: {query.options.match.tolerance} (see --tolerance)")
    lines += _alone(query, sample)
    lines.append(f"  {count(query.funnel.frames, 'frame')} in {elapsed_s:.1f} s")
    click.echo("\n".join(lines), err=True)
