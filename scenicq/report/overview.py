"""The head of a report: the program with each line's share of exclusions, the funnel, how to run it again."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any, cast

from scenicq import __version__
from scenicq.match.tolerance import Tolerance
from scenicq.option_values import Amount, OptionKind
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.results import Funnel
from scenicq.query.execution.run import Query
from scenicq.report.frames import table
from scenicq.report.shares import Line
from scenicq.report.svg import element, escape

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


def program_section(lines: Sequence[Line], rest: Mapping[str, int], frames: int) -> str:
    """The program as a table.

    Args:
        lines: Its lines.
        rest: Frames excluded by what no line says.
        frames: Frames looked at.
    """
    rows: list[str] = []
    for line in lines:
        share = line.excluded / frames if frames else 0.0
        told = f"{line.excluded:,} frames ({share:.1%}) failed first here"
        cells = element("td", _bar(share, told) if line.excluded else "", class_="share")
        count = element(
            "td", f"{share:.1%}" if line.excluded else "", class_="count", title="; ".join(line.what) or None
        )
        number = element("th", str(line.number), scope="row")
        code = element("td", element("code", escape(line.text) or "&#8203;"))
        rows.append(element("tr", number, count, cells, code, id=f"line-{line.number}"))
    names = (element("th", "line", scope="col"), element("th", "excluded", scope="col", colspan=2))
    head = element("tr", *names, element("th", "program", scope="col"))
    body = element("table", element("thead", head), element("tbody", *rows), class_="program")
    others = [(escape(what), f"{count:,}", f"{count / frames:.1%}") for what, count in rest.items()]
    return element(
        "section",
        element("h2", "Program", id="program-title"),
        element("p", "Each frame that does not match is counted at the line that it failed first at.", class_="hint"),
        element("div", body, class_="scroll"),
        table("Excluded by what no single line says", ("what", "frames", "share"), others),
        aria_labelledby="program-title",
        class_="program-pane",
    )


def _step(name: str, number: int, frames: int | None = None) -> str:
    """A row of the funnel, with a bar for its share of frames where it counts any."""
    bar = "" if frames is None else _bar(number / frames if frames else 0.0, f"{number:,} of {frames:,}")
    return element(
        "tr",
        element("th", escape(name), scope="row"),
        element("td", f"{number:,}", class_="count"),
        element("td", bar, class_="share"),
    )


def funnel_section(funnel: Funnel, cut: str) -> str:
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
            ("of these ways cut off: the recording or a track ends before the program", funnel.over_time["cut off"]),
            ("intervals that match", funnel.matches),
            ("intervals that are unknown", funnel.unknowns),
        ]
    else:
        steps.append(("with an object for every role", funnel.with_roles))
        steps += [("matches", funnel.matches), ("unknown", funnel.unknowns)]
    rows = [_step(name, number, funnel.frames) for name, number in steps]
    rows += [_step(name, number) for name, number in counted]
    told = [
        "; ".join((f"{each.message}{f' ({each.span.place})' if each.span is not None else ''}", *each.hints))
        for each in funnel.warnings
    ]
    told += [
        f"`{what}` is missing in {count:,} frame{'' if count == 1 else 's'} of the dataset, and not compared there"
        for what, count in sorted(funnel.missing.items())
    ]
    warnings = [element("li", escape(each)) for each in told]
    failed = [
        (escape(what), f"{count:,}", f"{count / funnel.frames:.1%}")
        for what, count in sorted(funnel.excluded.items(), key=lambda item: (-item[1], item[0]))
    ]
    broken = [
        (escape(what), f"{count:,}")
        for what, count in sorted(funnel.broken.items(), key=lambda item: (-item[1], item[0]))
    ]
    return element(
        "section",
        element("h2", "Where the frames went", id="funnel-title"),
        element("p", escape(f"Not complete: {cut}."), class_="hint") if cut else "",
        element("ul", *warnings, class_="cause") if warnings else "",
        element("table", element("tbody", *rows), class_="funnel"),
        table("First failed at", ("what", "frames", "share"), failed),
        table("Then failed at", ("what", "ways to give the objects tracks"), broken),
        aria_labelledby="funnel-title",
    )


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


def how_section(query: Query, command: str, elapsed_s: float) -> str:
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
    copy = element(
        "p",
        element("code", escape(command), id="command"),
        " ",
        element("button", "Copy", type="button", id="copy"),
        element("span", role="status", id="copied"),
        class_="command",
    )
    rows = ((escape(name), escape(value)) for name, value in _flat(query.options))
    return element(
        "section",
        element("h2", "Run it again", id="how-title"),
        copy if command else "",
        element("p", f"The query took {elapsed_s:.1f} s.", class_="hint"),
        element(
            "div",
            table("Options", ("option", "value"), list(rows)),
            table("Versions", ("package", "version"), [(escape(n), escape(v)) for n, v in versions().items()]),
            table("Dataset", ("what", "value"), [(escape(n), escape(v)) for n, v in about]),
            class_="columns",
        ),
        aria_labelledby="how-title",
    )
