"""A self-contained page: style and script inside, and a policy that lets nothing else run or load."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from scenicq import __version__
from scenicq.report.legend import SIGNS
from scenicq.report.picture import stylesheet
from scenicq.report.templates import asset, markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["GENERATOR", "page", "runs_section"]

GENERATOR = "scenicq report"
"""What marks a page as one of ours."""
_KINDS = (("match", "matches"), ("unknown", "unknown"), ("near", "near misses"))


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def page(title: str, body: Sequence[Markup], *, script: bool = True) -> Markup:
    """A page.

    Args:
        title: Its title, a plain text.
        body: Its parts.
        script: Whether it needs the report's script.
    """
    style = f"{stylesheet()}\n{asset('page.css')}"
    code = asset("page.js") if script else ""
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
    return markup(
        "page", "page", title=title, body=body, style=style, script=code, policy=policy,
        generator=f"{GENERATOR} {__version__}",
    )  # fmt: skip


def runs_section(
    cards: Sequence[Markup], recordings: Sequence[str], kinds: Sequence[str], note: str, what: str = "run"
) -> Markup:
    """The runs, with what filters and sorts them.

    Args:
        cards: As `draw_card` gives them.
        recordings: Names of all their recordings.
        kinds: Kinds of verdicts that there are: match, unknown, near.
        note: What the reader should know, or nothing.
        what: What a card is about: a run, or an interval.
    """
    verdicts = [("", "all"), *((kind, text) for kind, text in _KINDS if kind in kinds)]
    return markup(
        "page", "runs_section", cards=cards, recordings=recordings, verdicts=verdicts, note=note, what=what, signs=SIGNS
    )
