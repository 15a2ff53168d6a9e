"""The head of a report: the program with each line's share of exclusions, the funnel, how to run it again."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, cast

from scenicq import __version__
from scenicq.match.tolerance import Tolerance
from scenicq.option_values import Amount, OptionKind
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.results import Funnel
from scenicq.query.execution.run import Query
from scenicq.report.shares import Line
from scenicq.report.svg import element
from scenicq.report.templates import markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["funnel_section", "how_section", "program_section", "versions"]

_PACKAGES = ("duckdb", "numpy", "pyarrow", "shapely", "highspy", "dreal")


_OPTIONS = {option.field: (name, option) for name, option in QUERY_OPTIONS.items()}
"""The options that people write, with their names, by where their values are."""


def _bar(share: float, told: str) -> str:
    fill = element("rect", class_="fill", width=f"{100 * share:.2f}", height=10)
    ground = element("rect", class_="track", width=100, height=10)
    return element(
        "svg", ground, fill, class_="bar", viewBox="0 0 100 10", preserveAspectRatio="none", role="img", aria_label=told
    )


def program_section(lines: Sequence[Line], rest: Mapping[str, int], frames: int) -> Markup:
    """The program as a table.

    Args:
        lines: Its lines.
        rest: Frames excluded by what no line says.
        frames: Frames looked at.
    """
    rows: list[tuple[Line, str, str]] = []
    for line in lines:
        share = line.excluded / frames if frames else 0.0
        told = f"{line.excluded:,} frames ({share:.1%}) failed first here"
        rows.append((line, f"{share:.1%}", _bar(share, told)) if line.excluded else (line, "", ""))
    others = [(what, f"{count:,}", f"{count / frames:.1%}") for what, count in rest.items()]
    return markup("overview", "program_section", lines=rows, rest=others)


def funnel_section(funnel: Funnel, cut: str) -> Markup:
    """How many frames are left after each step.

    Args:
        funnel: The funnel of a query whose results were taken.
        cut: What the results leave out; "" where they are complete.
    """
    recordings = funnel.over_time["recordings"]
    of = f" of {recordings:,} recording{'' if recordings == 1 else 's'}" if funnel.over_time else ""
    steps = [(f"frames{of}", funnel.frames), ("after the prefilter", funnel.candidates)]
    counted: list[tuple[str, int]] = []  # what is no frame, so that it has no share of them
    if funnel.over_time:
        steps.append(("frames that match the initial scene", funnel.over_time["starts"]))
        counted = [
            ("ways to give the objects tracks from there on", funnel.over_time["bindings"]),
            ("ways cut off, as the recording or a track ends before the program", funnel.over_time["cut off"]),
            ("intervals that match", funnel.matches),
            ("intervals that are unknown", funnel.unknowns),
        ]
    else:
        steps.append(("with an object for every role", funnel.with_roles))
        steps += [("matches", funnel.matches), ("unknown", funnel.unknowns)]
    rows = [
        (
            name,
            f"{number:,}",
            _bar(number / funnel.frames if funnel.frames else 0.0, f"{number:,} of {funnel.frames:,}"),
        )
        for name, number in steps
    ]
    rows += [(name, f"{number:,}", "") for name, number in counted]
    told = [
        "; ".join((f"{each.message}{f' ({each.span.place})' if each.span is not None else ''}", *each.hints))
        for each in funnel.warnings
    ]
    told += [
        f"`{what}` is missing in {count:,} frame{'' if count == 1 else 's'} of the dataset, and not compared there"
        for what, count in sorted(funnel.missing.items())
    ]
    failed = [
        (what, f"{count:,}", f"{count / funnel.frames:.1%}")
        for what, count in sorted(funnel.excluded.items(), key=lambda item: (-item[1], item[0]))
    ]
    broken = [
        (what, f"{count:,}") for what, count in sorted(funnel.broken.items(), key=lambda item: (-item[1], item[0]))
    ]
    return markup("overview", "funnel_section", cut=cut, warnings=told, steps=rows, failed=failed, broken=broken)


def versions() -> dict[str, str]:
    """The versions of what a result depends on."""
    found = {"python": sys.version.split()[0], "scenicq": __version__}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _flat(value: Any, name: str = "") -> list[tuple[str, str]]:
    if is_dataclass(value) and not isinstance(value, Tolerance):
        return [
            row
            for each in fields(value)
            for row in _flat(getattr(value, each.name), f"{name}.{each.name}" if name else each.name)
        ]
    written, option = _OPTIONS.get(name, (name.rpartition(".")[2], None))
    flag = option.flags[-1].removeprefix("--") if option is not None and option.flags else written.replace("_", "-")
    return [(flag, _shown(value, option.kind if option is not None else None))]


def _shown(value: Any, kind: OptionKind | None) -> str:
    """An option's value as a person would give it."""
    match value:
        case None:
            return "not given"
        case bool():
            return "yes" if value else "no"
        case float() if isinstance(kind, Amount) and kind.unit:
            return f"{value:g} {kind.unit}"
        case frozenset():
            return ", ".join(sorted(map(str, cast("frozenset[Any]", value)))) or "none"
        case _:
            return str(value)


def how_section(query: Query, command: str, elapsed_s: float) -> Markup:
    """The section that says how to make this report again: command line, options, versions, dataset.

    Args:
        query: The query.
        command: The command line, or nothing.
        elapsed_s: Seconds that the query took.
    """
    manifest = query.dataset.manifest
    about = [("path", query.dataset.name), ("name", manifest.name), ("importer", manifest.importer)]
    about.append(("dataset.json, SHA-256", hashlib.sha256(manifest.to_json().encode()).hexdigest()))
    about += [("source", manifest.provenance.source), ("time", manifest.provenance.time)]
    return markup(
        "overview", "how_section", command=command, elapsed_s=f"{elapsed_s:.1f}", options=_flat(query.options),
        versions=list(versions().items()), about=about,
    )  # fmt: skip
