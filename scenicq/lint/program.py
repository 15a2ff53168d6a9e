"""All warnings about a program, without those that it silences.

A comment on the line of a warning silences it: `# scenicq: ignore[angle-without-deg]`, or several codes with commas
between them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import islice

from scenicq.errors import Diagnostic, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.lint.conditions import lint_scenario
from scenicq.lint.text import lint_text
from scenicq.match.options import MatchOptions
from scenicq.query.execution.run import Query
from scenicq.syntax.parser import parse

__all__ = ["LINTED_MAPS", "lint", "lint_query"]

LINTED_MAPS = 8
"""Maps on which requirements are looked at."""

_SILENCED = re.compile(r"#\s*scenicq:\s*ignore\[([a-z\s,-]+)\]")


def lint(
    source: Source,
    compiled: Iterable[tuple[Scenario, Network | None]],
    options: MatchOptions,
    *,
    properties: bool = True,
) -> list[Diagnostic]:
    """What compiles but cannot be meant, in the order of the text.

    Args:
        source: The program, which compiles.
        compiled: The program over each map, as compiled or made ready; without the map where one was made up. What a
            requirement is on one map alone is not spoken of.
        options: Options of the matcher.
        properties: Whether properties that no class has are named, too; with a dataset its labels say more.
    """
    scenarios = [(scenario.as_written or scenario, network) for scenario, network in compiled]
    if not scenarios:
        return []
    body = parse(source, scenarios[0][0].version).body
    found = dict.fromkeys(lint_text(body, properties=properties))
    of_maps = [dict.fromkeys(lint_scenario(scenario, body, network, options)) for scenario, network in scenarios]
    found |= {each: None for each in of_maps[0] if all(each in others for others in of_maps[1:])}
    told = [each for each in found if not _silenced(each)]
    return sorted(told, key=lambda each: each.span.start if each.span is not None else 0)


def lint_query(query: Query, maps: Iterable[str] | None = None) -> list[Diagnostic]:
    """What of a query's program compiles but cannot be meant, on some of the maps that it fits.

    Args:
        query: The query.
        maps: Only these; all by default.

    Raises:
        ScenarioError: The program is wrong.
    """
    compiled = ((each.scenario, each.network) for each in islice(query.fitting(maps), LINTED_MAPS))
    return lint(query.source, compiled, query.options.match, properties=False)


def _silenced(diagnostic: Diagnostic) -> bool:
    span = diagnostic.span
    if span is None:
        return False
    first, last = (span.source.position(place)[0] for place in (span.start, max(span.start, span.end - 1)))
    lines = (span.source.line(number) for number in range(first, last + 1))
    codes = [code.strip() for line in lines for found in _SILENCED.findall(line) for code in found.split(",")]
    return diagnostic.code in codes
