"""The bounds of contracts in one table, each with what it rests on.

Simulated: traces of Scenic's Newtonian simulator. Driven: tracks of vehicles of recorded logs.
`tests/tools/conformance/contracts.py` measures both.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BOUNDS", "ContractBound"]


@dataclass(frozen=True, slots=True)
class ContractBound:
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


BOUNDS: dict[str, ContractBound] = {
    "window": ContractBound(1.0, "s", "how long no sample must show a contract until it is broken",
                    "the least time over which the store takes a slope of speed"),
    "lane window": ContractBound(2.0, "s", "the same where a lane is kept, or changed",
                                 "simulated: sharp bends are cut for up to 1.3 s at 10 m/s, over the lane beside; "
                                 "a change of lanes may swing off the road for over a second"),
    "speed": ContractBound(1.0, "m/s", "how far a speed may be from a target",
                   "simulated: at most 0.5 m/s above it once reached, for targets of 5 to 20 m/s"),
    "speed share": ContractBound(0.15, "of the target", "or this share of it", "simulated: 2.6 % to 10.2 % above it"),
    "held": ContractBound(3.0, "m/s", "how far above a target a speed may be that is not gained",
                  "simulated: held for good, as nothing brakes. Driven: lets 2 % more windows pass for half of "
                  "their speed, 5 m/s 17 % more"),
    "change": ContractBound(0.3, "m/s²", "from which acceleration on a speed is gained, or lost",
                    "simulated: 2.8 m/s² until the target is near. Driven: at rest 90 % lie within 0.2 m/s², 98 % "
                    "within 0.5 m/s²"),
    "brake": ContractBound(0.2, "m/s²", "at most the acceleration of who does not get faster",
                   "simulated: 0 or less. Driven: 95 % of windows of two stops, with 0.1 m/s² 93 %"),
    "set speed": ContractBound(0.5, "m/s", "how far a speed, or a velocity, may be from one that is set",
                       "simulated: 0. Driven: at rest 99 % of speeds lie below 0.6 m/s"),
    "rest": ContractBound(0.5, "m/s", "below which an object is at rest",
                  "driven: 95 % of those at rest lie below 0.3 m/s"),
    "heading": ContractBound(30.0, "°", "how far a heading may be from a direction",
                     "simulated: 99 % of samples within 16°. Driven, where the road has one direction: 99 % within 2°"),
    "lane": ContractBound(1.0, "m", "how far a centre may be beside its lane",
                  "simulated: every sample of 8 traces at up to 13 m/s; 5.7 m beside it in a turn at 20 m/s"),
    "line": ContractBound(2.5, "m", "how far a centre may be from a line that is followed in a junction",
                  "half the width of a lane, and not quite the bound of lanes beside it"),
    "arrived": ContractBound(0.5, "m", "from a centreline, where a change of lanes is over",
                     "Scenic's library says 0.1 m, which 2 samples a second pass over"),
    "junction": ContractBound(10.0, "m", "before a junction, where a turn may slow down", "as in Scenic's library"),
    "turn speed": ContractBound(5.0, "m/s", "to which a turn slows down", "as in Scenic's library"),
    "trajectory end": ContractBound(5.0, "m", "before what a trajectory leads to, where it is over",
                            "as in Scenic's library"),
    "dead end": ContractBound(10.0, "m", "before the end of a lane that leads nowhere: one brakes",
                      "as in Scenic's library"),
    "position": ContractBound(0.5, "m", "how far a centre may be from where it is set", "as a change of lanes arrives"),
}  # fmt: skip
"""All bounds by name."""
