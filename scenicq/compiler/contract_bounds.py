"""The bounds of contracts in one table, each with what it rests on.

Simulated: traces of Scenic's Newtonian simulator. Driven: tracks of vehicles in Argoverse 2 and nuScenes.
`tests/conformance/contracts.py` measures both.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BOUNDS", "Bound"]


@dataclass(frozen=True, slots=True)
class Bound:
    """A number that a contract rests on.

    Attributes:
        value: The number.
        unit: Its unit.
        meaning: What it bounds.
        evidence: Why it is this one.
    """

    value: float
    unit: str
    meaning: str
    evidence: str


BOUNDS: dict[str, Bound] = {
    "window": Bound(1.0, "s", "a contract is broken that no sample of so long shows", "to be measured"),
    "speed": Bound(1.0, "m/s", "how far a speed may be from a target", "to be measured"),
    "speed share": Bound(0.15, "1", "or this share of the target", "to be measured"),
    "set speed": Bound(0.5, "m/s", "how far a speed may be from one that is set", "to be measured"),
    "held": Bound(5.0, "m/s", "how far above a target a speed may be that is held", "to be measured"),
    "change": Bound(0.1, "m/s²", "from which acceleration a speed is gained, or lost", "to be measured"),
    "brake": Bound(0.1, "m/s²", "acceleration of who brakes, at most", "to be measured"),
    "rest": Bound(0.5, "m/s", "below which an object is at rest", "to be measured"),
    "heading": Bound(30.0, "°", "how far a heading may be from a direction", "to be measured"),
    "lane": Bound(1.0, "m", "how far a centre may be beside its lane", "to be measured"),
    "line": Bound(2.5, "m", "how far a centre may be from a line that is followed", "to be measured"),
    "arrived": Bound(0.5, "m", "from a centreline, where a change of lanes is over", "to be measured"),
    "junction": Bound(10.0, "m", "before a junction, where a turn may slow down", "as in Scenic's library"),
    "turn speed": Bound(5.0, "m/s", "to which a turn slows down", "as in Scenic's library"),
    "trajectory end": Bound(5.0, "m", "before what a trajectory leads to, where it is over", "as in Scenic's library"),
    "dead end": Bound(
        10.0, "m", "before the end of a lane that leads nowhere, where one brakes", "as in Scenic's library"
    ),
    "position": Bound(0.5, "m", "how far a position may be from one that is set", "to be measured"),
}
"""All bounds by name."""
