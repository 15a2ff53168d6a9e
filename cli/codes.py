"""`scenicq codes`: what a diagnostic's code means, and what to do."""

from __future__ import annotations

import json
import re
from importlib.resources import files
from textwrap import indent

import click

from scenicq.errors import CODES, similar

from .manual import Manual
from .report import columns
from .streams import say

__all__ = ["codes"]

_SECTION = re.compile(r"^## (\S+)\n(.*?)(?=^## |^<!-- end)", re.DOTALL | re.MULTILINE)
_TO_DO = re.compile(r"^What to do: (.*)$", re.MULTILINE)
_PROGRAM = re.compile(r"^```scenic\n(.*?)^```\n?", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def pages() -> dict[str, str]:
    """For each code its page, for a terminal: without links, and with programs indented."""
    text = files("scenicq").joinpath("codes.md").read_text(encoding="utf-8")
    return {code: _plain(page) for code, page in _SECTION.findall(text)}


def _plain(page: str) -> str:
    page = re.sub(r"^From \[.*$", "", page, flags=re.MULTILINE)
    page = _PROGRAM.sub(lambda found: indent(found[1], "    "), page)
    return _LINK.sub(r"\1", page).strip()


@click.command(
    cls=Manual,
    arguments={"CODE...": "What stands in brackets behind `error` or `warning`; without one, all are listed."},
    exits={0: "each code is known"},
    epilog="\b\nExamples:\n  scenicq codes never-compared\n  scenicq codes\n  scenicq codes --format json",
)
@click.argument("code", metavar="[CODE...]", nargs=-1)
@click.option("--format", "format_", type=click.Choice(["text", "json"]), default="text",
              help="json is for programs.")  # fmt: skip
def codes(*, code: tuple[str, ...], format_: str) -> None:
    """Say what the code of a message means, and what to do.

    A message has its code in brackets: `error[unknown-name]`.
    """
    asked = [each.strip("[]") for each in code]
    for each in asked:
        if each not in CODES:
            near = similar(each, CODES)
            raise click.UsageError(f"No code '{each}'." + (f" Did you mean '{near}'?" if near else ""))
    if format_ == "json":
        texts = pages()
        content = [
            {"code": each, "meaning": CODES[each], "to_do": to_do[1] if (to_do := _TO_DO.search(texts[each])) else None}
            for each in asked or CODES
        ]
        say(json.dumps(content, indent=1))
    elif asked:
        texts = pages()
        say("\n\n".join(f"{click.style(each, bold=True)}\n\n{texts[each]}" for each in asked))
    else:
        say("\n".join(columns(list(CODES.items()))))
