"""Choose where texts stand in a picture: at the spot where they hide least."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

__all__ = ["Placement"]

Spot = tuple[float, float]
"""The centre of a text, in centimetres."""

_OUTSIDE = 99.0
"""How bad it is to stand outside of the picture."""


@dataclass(eq=False)
class Placement:
    """What texts should not hide, placed texts included.

    Attributes:
        across, along: Where the picture's sides are, in centimetres.
    """

    across: tuple[float, float] = (-math.inf, math.inf)
    along: tuple[float, float] = (-math.inf, math.inf)
    _taken: list[tuple[float, float, float, float, float]] = field(
        default_factory=list[tuple[float, float, float, float, float]]
    )

    def keep(self, center: Spot, wide: float, high: float, bad: float) -> None:
        """Note what is there.

        Args:
            center: Its centre.
            wide: Half its width, in centimetres.
            high: Half its height.
            bad: How bad it would be to hide it.
        """
        self._taken.append((*center, wide, high, bad))

    def place(self, spots: Sequence[Spot], wide: float, high: float, bad: float) -> Spot:
        """Place a text at the spot where it hides least, the first of equal ones.

        Args:
            spots: Where it may stand, the best first.
            wide: Half its width, in centimetres.
            high: Half its height.
            bad: How bad it would be to hide it.
        """

        def hidden(spot: Spot) -> float:
            x, y = spot
            (west, east), (north, south) = self.across, self.along
            outside = not (west + wide < x < east - wide and north + high < y < south - high)
            return _OUTSIDE * outside + sum(
                worse
                for a, b, broad, tall, worse in self._taken
                if abs(x - a) < wide + broad and abs(y - b) < high + tall
            )

        found = min(spots, key=hidden)
        self.keep(found, wide, high, bad)
        return found
