"""Results as lines of JSON: what `record` says of them, without the records.

Matches come by the hundred thousand, and of each the keys are known: it is written out at once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from json.encoder import encode_basestring

from scenicq.match.verdict import Match, WitnessValue
from scenicq.query.execution.results import Result, record

__all__ = ["json_line", "json_text"]

json_text = json.JSONEncoder(ensure_ascii=False, check_circular=False).encode
"""A record as JSON."""
_UNUSUAL = frozenset({"nan", "inf", "-inf"})


def json_line(result: Result, more: Mapping[str, str] | None = None) -> str:
    """A result as JSON, without a line end: `json_text` of its record.

    Args:
        result: The result.
        more: What else is known of it, such as its dataset.
    """
    verdict = result.verdict
    if type(verdict) is Match and result.interval is None and result.density is None:
        try:
            witness = ", ".join([f"{encode_basestring(k)}: {_value(v)}" for k, v in verdict.witness.items()])
        except TypeError:
            pass  # something else than floating-point numbers
        else:
            return (
                f'{{"frame": {encode_basestring(result.frame)}, "recording": {encode_basestring(result.recording)}, '
                f'"timestamp_us": {result.timestamp_us}, "verdict": "match", '
                f'"correspondence": {{{_texts(verdict.correspondence)}}}, "witness": {{{witness}}}, '
                f'"sensors": {{{_texts(result.sensors)}}}{f", {_texts(more)}" if more else ""}}}'
            )
    return json_text(record(result) | dict(more or {}))


def _texts(texts: Mapping[str, str]) -> str:
    return ", ".join([f"{encode_basestring(key)}: {encode_basestring(text)}" for key, text in texts.items()])


def _value(value: WitnessValue) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_number, value))}]"
    return _number(value)


def _number(value: float) -> str:
    """A number as Python's encoder writes it; an integer is a `TypeError`."""
    text = float.__repr__(value)
    return json_text(value) if text in _UNUSUAL else text
