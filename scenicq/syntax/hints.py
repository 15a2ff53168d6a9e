"""What people write in plain English where Scenic has other words: hints for places where the parser cannot go on."""

from __future__ import annotations

from collections.abc import Sequence

from scenicq.syntax.tokens import Token

__all__ = ["BIKE_LANES", "MOVES", "STANDS", "TURNS", "condition_hint", "phrase_hint", "place_hint", "unit_hint"]

_LENGTH, _SPEED, _TIME = "lengths are in metres", "speeds are in metres a second", "times are in seconds"
_DEGREES, _RADIANS = "`deg` stands for degrees", "angles are in radians"
_UNITS = {
    "m meter meters metre metres": (_LENGTH, ""), "km kilometers kilometres": (_LENGTH, " * 1000"),
    "cm": (_LENGTH, " / 100"), "ft feet": (_LENGTH, " * 0.3048"), "m/s mps": (_SPEED, ""),
    "km/h kmh kph": (_SPEED, " / 3.6"), "mph": (_SPEED, " * 0.447"), "degree degrees degs": (_DEGREES, " deg"),
    "rad radians": (_RADIANS, ""), "s sec secs second seconds": (_TIME, ""), "min minutes": (_TIME, " * 60"),
}  # fmt: skip
"""What numbers mean without a unit, by the units that people write, and what makes such a number of theirs."""
_UNIT = {word: told for words, told in _UNITS.items() for word in words.split()}

_DISTANCE = "`(distance from a to b) < 10` compares a distance"
STANDS, MOVES = "`X.speed < 0.5` asks whether X stands", "`X.speed > 1` asks whether X moves"
TURNS = "`X.angularSpeed > 0.2` asks whether X turns left, `< -0.2` right"
BIKE_LANES = "`[each._bikeLane for each in network.laneGroups if each._bikeLane]` are those that the map knows"
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
_SAID = {
    "between": "`5 < a < 10` asks whether a number is between two", "near": _DISTANCE, "within": _DISTANCE,
    "close": _DISTANCE, "far": _DISTANCE, "turning": TURNS, "turns": TURNS, "stopped": STANDS, "parked": STANDS,
    "stationary": STANDS, "standing": STANDS, "ahead": _AHEAD, "front": _AHEAD, "behind": _BEHIND, "left": _LEFT,
    "back": _BEHIND,
    "right": _RIGHT, "on": _INSIDE, "inside": _INSIDE, "onto": _INSIDE, "faces": _TOWARD, "facing": _TOWARD,
    "sees": _SEES, "visible": _SEES, "then": _OVER_TIME, "after": _OVER_TIME, "before": _OVER_TIME,
    "overtakes": _OVER_TIME, "passes": _OVER_TIME, "initial": _AT_FIRST, "initially": _AT_FIRST, "for": _HOW_LONG,
    "occludes": _BEYOND, "hides": _BEYOND, "occluded": _BEYOND, "hidden": _BEYOND,
}  # fmt: skip
"""How a condition is said that people write with that word."""
_MADE = {
    "same": "`facing Range(-10, 10) deg relative to X.heading` is the direction of X",
    "opposite": "`facing Range(170, 190) deg relative to X.heading` is against the direction of X",
    "between": "`Range(a, b)` is an interval",
    "front": "`ahead of X by Range(0, 20)` places an object in front of another",
}  # fmt: skip
"""How an object is described that people describe with that word."""
_FAR = "a requirement says how far: `require (distance from a to b) < 10`"
_OUT = "a requirement says where it is not: `in everywhere` and `require not (a.position in road)`"
_ASIDE = "`at X offset by Range(1, 6) @ Range(-5, 5)` is an area on the right of X"
_PLACED = {
    "near": _FAR, "within": _FAR, "close": _FAR, "off": _OUT, "outside": _OUT, "not": _OUT,
    "next": _ASIDE, "beside": _ASIDE, "alongside": _ASIDE,
}  # fmt: skip
"""What people try to place objects with, and how Scenic says it."""
_FURTHEST = 4
"""Words before the place where the parser cannot go on that may say what was meant."""


def unit_hint(number: str, word: str) -> str:
    """What to write for a number with a unit; nothing for a word that is none."""
    told = _UNIT.get(word)
    return f"{told[0]}: write `{number}{told[1]}`" if told else ""


def phrase_hint(tokens: Sequence[Token], index: int) -> str:
    """What to write for English words around a token that continues nothing.

    Args:
        tokens: All of them.
        index: The token that the parser cannot use.

    Returns:
        The hint, or nothing.
    """
    word, before = tokens[index].text, tokens[max(0, index - 1)]
    after = [each.text for each in tokens[index + 1 : index + 3]]
    if before.kind == "number":
        unit = word + "".join(after) if after[:1] == ["/"] else word
        end = word.lstrip(".") if word.startswith(".") else after[0] if word == "to" and after else ""
        if end.isdecimal():
            return f"`Range({before.text.rstrip('.')}, {end})` is an interval"
        if hint := unit_hint(before.text, unit):
            return hint
    if before.text == "distance":
        return "`distance from a to b` is the distance between two"
    start = index
    while start and tokens[start - 1].kind not in ("newline", "indent", "dedent"):
        start -= 1
    if word in _UNIT and before.text == ")":
        means, factor = _UNIT[word]
        return f"{means}: write {f'`(...){factor}`' if factor else 'the number alone'}"
    if word == "with" and after[:1] == [":"]:
        return "`with speed 3, with width 2` sets two properties"
    said = _SAID if tokens[start].text in ("require", "terminate") else _MADE
    words = (token.text for token in tokens[max(start, index - _FURTHEST) : index + 1])
    return next((said[each] for each in words if each in said), "")


def condition_hint(word: str) -> str:
    """How the condition is said that people write with a word between two names; nothing for other words."""
    return _SAID.get(word, "")


def place_hint(word: str) -> str:
    """How objects are placed that people place with a word that starts no specifier; nothing for other words."""
    return _PLACED.get(word, "")
