"""A self-contained page: style and script inside, and a policy that lets nothing else run or load."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from importlib import resources

from scenicq import __version__
from scenicq.report.legend import legend
from scenicq.report.picture import stylesheet
from scenicq.report.svg import element, escape

__all__ = ["GENERATOR", "page", "runs_section"]

GENERATOR = "scenicq report"
"""What marks a page as one of ours."""
_KINDS = (("match", "matches"), ("unknown", "unknown"), ("near", "near misses"))


def _asset(name: str) -> str:
    return resources.files("scenicq.report").joinpath("assets", name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def page(title: str, body: Sequence[str], *, script: bool = True) -> str:
    """A page.

    Args:
        title: Its title, a plain text.
        body: Markup, already escaped.
        script: Whether it needs the report's script.
    """
    style = f"{stylesheet()}\n{_asset('page.css')}"
    code = _asset("page.js") if script else ""
    policy = "; ".join(
        (
            "default-src 'none'",
            "img-src 'self' file: data:",
            f"style-src {_hash(style)}",
            f"script-src {_hash(code)}" if script else "script-src 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
    head = (
        '<meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f'<meta name="generator" content="{GENERATOR} {escape(__version__)}">'
        f"{element('title', escape(title))}<style>{style}</style>"
    )
    end = f"<script>{code}</script>" if script else ""
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body>{"".join(body)}{end}</body></html>\n'


def _select(name: str, label: str, options: Sequence[tuple[str, str]]) -> str:
    return element("label", label, element("select", *(element("option", t, value=v) for v, t in options), id=name))


def _toolbar(recordings: Sequence[str], kinds: Sequence[str]) -> str:
    names = [element("option", "", value=name).removesuffix("</option>") for name in recordings]
    orders = (("data-order", "dataset order"), ("-data-length", "longest first"), ("data-time", "by time"))
    verdicts = [("", "all"), *((kind, text) for kind, text in _KINDS if kind in kinds)]
    return element(
        "div",
        element(
            "label",
            "Recording ",
            '<input type="search" id="filter" list="recordings" placeholder="all" autocomplete="off">',
        ),
        element("datalist", *names, id="recordings"),
        _select("kind", "Verdict ", verdicts) if len(verdicts) > 2 else "",
        _select("sort", "Sort ", orders),
        element("span", "", id="shown", role="status"),
        element(
            "span",
            "<kbd>j</kbd> <kbd>k</kbd> run, <kbd>\N{LEFTWARDS ARROW}</kbd> <kbd>\N{RIGHTWARDS ARROW}</kbd> frame, "
            "<kbd>/</kbd> filter",
            class_="keys",
        ),
        class_="toolbar",
        role="search",
    )


def runs_section(
    cards: Sequence[str], recordings: Sequence[str], kinds: Sequence[str], note: str, what: str = "run"
) -> str:
    """The runs, with what filters and sorts them.

    Args:
        cards: As `draw_card` gives them.
        recordings: Names of all their recordings.
        kinds: Kinds of verdicts that there are: match, unknown, near.
        note: What the reader should know, or nothing.
        what: What a card is about: a run, or an interval.
    """
    empty = element("p", "No frame matches. The funnel says what excluded them.", class_="hint") if not cards else ""
    return element(
        "section",
        element("h2", "Frames", id="runs-title"),
        element("p", escape(note), class_="hint") if note else "",
        empty,
        _toolbar(recordings, kinds) if cards else "",
        legend() if cards else "",
        element("div", *cards, id="runs", data_what=what),
        aria_labelledby="runs-title",
    )
