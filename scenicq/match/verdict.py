"""What matching a label yields: a verdict with its proof or its cause."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from scenicq.errors import Span

__all__ = ["Cause", "Match", "NoMatch", "Unknown", "Verdict", "WitnessValue"]

WitnessValue = float | tuple[float, float]
"""A number, or a point (x, y) in metres."""


@dataclass(frozen=True, slots=True)
class Cause:
    """What excludes a match, or leaves it open.

    Attributes:
        what: The feature (`pedestrian.heading`) or requirement (`require ...`), in the words of the program.
        detail: The fact, such as a value and what was allowed.
        span: Where the program says it.
        objects: Indices of the objects it is about.
    """

    what: str
    detail: str = ""
    span: Span | None = None
    objects: tuple[int, ...] = ()

    @property
    def place(self) -> str:
        """`file:line:column` without the file's folder, or nothing."""
        return self.span.mark if self.span else ""


@dataclass(frozen=True, slots=True)
class Match:
    """The label matches.

    Attributes:
        correspondence: Label object id of each object, by the object's name; the ego's is "ego" or a label object's id.
        witness: A value of each random variable that proves it, by its place in the program.
    """

    correspondence: Mapping[str, str]
    witness: Mapping[str, WitnessValue]

    def __reduce__(self) -> tuple[type[Match], tuple[Mapping[str, str], Mapping[str, WitnessValue]]]:
        """Pickled as a call: matches come from other processes by the ten thousand."""
        return Match, (self.correspondence, self.witness)


@dataclass(frozen=True, slots=True)
class NoMatch:
    """The label does not match.

    Attributes:
        cause: What excludes the correspondence that came furthest.
        partial: That correspondence.
    """

    cause: Cause
    partial: Mapping[str, str] = field(default_factory=dict[str, str])


@dataclass(frozen=True, slots=True)
class Unknown:
    """It was not decided whether the label matches.

    Attributes:
        reason: "unobserved", "timeout", "budget", "nonlinear", "precision", "unsupported", "crash" or "garbage"
            (`docs/matching.md` says what each means), or a sentence.
        cause: The feature or requirement that was not decided.
        correspondence: The correspondence that may match.
    """

    reason: str
    cause: Cause
    correspondence: Mapping[str, str] = field(default_factory=dict[str, str])


Verdict = Match | NoMatch | Unknown
