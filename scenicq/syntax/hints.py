"""Hints for authors who write plain English, or a unit, where Scenic has other words.

The parser asks for one where it cannot go on: the word that it stumbles over, or one shortly before it, tells what was
meant. Each table here is a vocabulary: the words that authors write, with the text of the hint.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from scenicq.syntax.tokens import Token

__all__ = [
    "BIKE_LANES_HINT",
    "MOVING_HINT",
    "STANDING_HINT",
    "TURNING_HINT",
    "condition_hint",
    "phrase_hint",
    "specifier_hint",
    "unit_hint",
]


class _Unit(NamedTuple):
    """How to write a number in some unit.

    Attributes:
        convention: The unit that Scenic assumes for such numbers.
        suffix: What follows a number to make it one of Scenic's, such as ` / 3.6`; empty if nothing has to.
    """

    convention: str
    suffix: str


_LENGTH, _SPEED, _TIME = "lengths are in metres", "speeds are in metres a second", "times are in seconds"
_DEGREES, _RADIANS = "`deg` stands for degrees", "angles are in radians"
_UNITS = {
    name: unit
    for names, unit in {
        "m meter meters metre metres": _Unit(_LENGTH, ""),
        "km kilometers kilometres": _Unit(_LENGTH, " * 1000"),
        "cm": _Unit(_LENGTH, " / 100"),
        "ft feet": _Unit(_LENGTH, " * 0.3048"),
        "m/s mps": _Unit(_SPEED, ""),
        "km/h kmh kph": _Unit(_SPEED, " / 3.6"),
        "mph": _Unit(_SPEED, " * 0.447"),
        "degree degrees degs": _Unit(_DEGREES, " deg"),
        "rad radians": _Unit(_RADIANS, ""),
        "s sec secs second seconds": _Unit(_TIME, ""),
        "min minutes": _Unit(_TIME, " * 60"),
    }.items()
    for name in names.split()
}

_DISTANCE = "`(distance from a to b) < 10` compares a distance"
STANDING_HINT, MOVING_HINT = "`X.speed < 0.5` asks whether X stands", "`X.speed > 1` asks whether X moves"
TURNING_HINT = "`X.angularSpeed > 0.2` asks whether X turns left, `< -0.2` right"
BIKE_LANES_HINT = "`[each._bikeLane for each in network.laneGroups if each._bikeLane]` are those that the map knows"
_AHEAD = (
    "`along(ego, X) > 0` asks whether X is ahead on the ego's course (`from scenicq.labels import along`); "
    "`ahead of Y by Range(0, 20)` places a new object"
)
_BEHIND = _AHEAD.replace("> 0", "< 0").replace("X is ahead", "X is behind").replace("ahead of Y", "behind Y")
_LEFT = (
    "`beside(ego, X) > 0` asks whether X is left of the ego's course (`from scenicq.labels import beside`); "
    "`left of Y by Range(0, 5)` places a new object"
)
_RIGHT = _LEFT.replace("> 0", "< 0").replace("left of", "right of")
_INSIDE = "`X in R` asks whether the box of X lies in a region, `X.position in R` its centre alone"
_TOWARD = (
    "`abs(relative heading of (angle from X to Y) from X) < 20 deg` asks whether X faces Y; "
    "`facing toward Y` turns a new object"
)
_SEES = "`X can see Y` asks whether Y is in view"
_OVER_TIME = "`require (A) until (B)` and `eventually (A and next (eventually B))` say what comes after what"
_AT_FIRST = "`require A` asks A of the start alone, unless it says always or eventually"
_HOW_LONG = "`require always A` asks A of whole intervals; the option --min-duration says how long they last"
_BEYOND = (
    "`hides(X, Y)` asks whether X hides Y from the ego (`from scenicq.labels import hides`); "
    "`beyond X by Range(2, 30)` places a new object where X hides it"
)
_IN_CONDITIONS = {
    "between": "`5 < a < 10` asks whether a number is between two",
    **dict.fromkeys(("near", "within", "close", "far"), _DISTANCE),
    **dict.fromkeys(("turning", "turns"), TURNING_HINT),
    **dict.fromkeys(("stopped", "parked", "stationary", "standing"), STANDING_HINT),
    **dict.fromkeys(("ahead", "front"), _AHEAD),
    **dict.fromkeys(("behind", "back"), _BEHIND),
    "left": _LEFT,
    "right": _RIGHT,
    **dict.fromkeys(("on", "inside", "onto"), _INSIDE),
    **dict.fromkeys(("faces", "facing"), _TOWARD),
    **dict.fromkeys(("sees", "visible"), _SEES),
    **dict.fromkeys(("then", "after", "before", "overtakes", "passes"), _OVER_TIME),
    **dict.fromkeys(("initial", "initially"), _AT_FIRST),
    "for": _HOW_LONG,
    **dict.fromkeys(("occludes", "hides", "occluded", "hidden"), _BEYOND),
}
"""Hints for the words of `require` and `terminate when`."""
_IN_OBJECTS = {
    "same": "`facing Range(-10, 10) deg relative to X.heading` is the direction of X",
    "opposite": "`facing Range(170, 190) deg relative to X.heading` is against the direction of X",
    "between": "`Range(a, b)` is an interval",
    "front": "`ahead of X by Range(0, 20)` places an object in front of another",
}
"""Hints for the words of all other statements, which describe objects."""
_NEARBY = "a requirement limits the distance: `require (distance from a to b) < 10`"
_OUTSIDE = "`in everywhere` with `require not (a.position in road)` keeps an object out of a region"
_ASIDE = "`at X offset by Range(1, 6) @ Range(-5, 5)` is an area on the right of X"
_IN_SPECIFIERS = {
    **dict.fromkeys(("near", "within", "close"), _NEARBY),
    **dict.fromkeys(("off", "outside", "not"), _OUTSIDE),
    **dict.fromkeys(("next", "beside", "alongside"), _ASIDE),
}
"""Hints for words that start no specifier."""
_WORDS_BACK = 4
"""How many words before the one that the parser cannot use may tell what was meant."""


def unit_hint(number: str, word: str) -> str:
    """What to write for a number with a unit; "" where the word is no unit."""
    unit = _UNITS.get(word)
    return f"{unit.convention}: write `{number}{unit.suffix}`" if unit else ""


def phrase_hint(tokens: Sequence[Token], index: int) -> str:
    """The hint for English words around a token that the parser cannot use; "" where there is none.

    Args:
        tokens: All tokens of the program.
        index: Where the token stands among them.
    """
    word, before = tokens[index].text, tokens[max(0, index - 1)]
    after = [token.text for token in tokens[index + 1 : index + 3]]
    if before.kind == "number":
        unit = word + "".join(after) if after[:1] == ["/"] else word
        # `5..10` and `5 to 10` are meant as intervals
        end = word.lstrip(".") if word.startswith(".") else after[0] if word == "to" and after else ""
        if end.isdecimal():
            return f"`Range({before.text.rstrip('.')}, {end})` is an interval"
        if hint := unit_hint(before.text, unit):
            return hint
    if before.text == "distance":
        return "`distance from a to b` is the distance between two"
    if word in _UNITS and before.text == ")":
        convention, suffix = _UNITS[word]
        return f"{convention}: write {f'`(...){suffix}`' if suffix else 'the number alone'}"
    if word == "with" and after[:1] == [":"]:
        return "`with speed 3, with width 2` sets two properties"
    start = index
    while start and tokens[start - 1].kind not in ("newline", "indent", "dedent"):
        start -= 1
    hints = _IN_CONDITIONS if tokens[start].text in ("require", "terminate") else _IN_OBJECTS
    words = (token.text for token in tokens[max(start, index - _WORDS_BACK) : index + 1])
    return next((hints[each] for each in words if each in hints), "")


def condition_hint(word: str) -> str:
    """How to write the condition that authors express by a word between two names; "" for other words."""
    return _IN_CONDITIONS.get(word, "")


def specifier_hint(word: str) -> str:
    """How to place an object where authors write a word that starts no specifier; "" for other words."""
    return _IN_SPECIFIERS.get(word, "")
