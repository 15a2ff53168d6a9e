"""A solution guessed for a group whose fields point somewhere at hidden points: shoot, look where it lands, correct.

With some values for the random numbers every field has a direction; with these directions the rest is affine and is
solved exactly; the solution gives other directions, and so on. What comes of it is replayed, so that a wrong guess
never makes a match, and no guess makes no difference.
"""

from __future__ import annotations

import math
from dataclasses import replace

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.condition import condition
from scenicq.forest.evaluate import evaluate_all
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Node, Value
from scenicq.forest.walk import leaves, postorder
from scenicq.match.ground import replay
from scenicq.match.interval import ends
from scenicq.match.ladder import LINEAR_SLACK, Item, Yes, decide
from scenicq.match.options import Tolerance

__all__ = ["shoot"]

_LOOSE = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0, 0.0)
"""Metres and radians that are allowed beyond the tolerance, round by round: the first directions are rough guesses."""
_MOST_TURNS = 9
"""Combinations of directions that are tried where a field allows several, three of each."""
_EACH = 3


def shoot(items: list[Item], tolerance: Tolerance) -> Yes | None:
    """A solution that replays, if one is found soon.

    Args:
        items: The constraints of a group, conditioned.
        tolerance: Per feature.
    """
    roots = tuple(node for _, node, _ in items)
    start: dict[Identity, Value] = {}
    for leaf in leaves(*roots):
        limits = ends(leaf)
        if limits is None or not all(map(math.isfinite, limits)):
            return None
        start[leaf.identity] = (limits[0] + limits[1]) / 2
    fields = [node for node in postorder(roots) if isinstance(node, DirectionAt)]
    for turn in range(min(_MOST_TURNS, _EACH ** len(fields))):
        found, several = _rounds(items, roots, fields, start, turn, tolerance)
        if found is not None or not several:
            return found
    return None


def _rounds(
    items: list[Item],
    roots: tuple[Node, ...],
    fields: list[DirectionAt],
    start: dict[Identity, Value],
    turn: int,
    tolerance: Tolerance,
) -> tuple[Yes | None, bool]:
    """What one combination of directions leads to, and whether there were others to choose."""
    values, several = start, False
    for loose in _LOOSE:
        choose = _Chooser(turn)
        try:
            seen = evaluate_all(roots, values, None, choose)
        except CannotEvaluate:
            return None, True
        several = several or choose.several
        headings = [seen.get(id(field)) for field in fields]
        if not all(isinstance(heading, float) for heading in headings):
            return None, True
        memo: dict[int, Node] = {
            id(field): Constant(heading, span=field.span) for field, heading in zip(fields, headings, strict=True)
        }
        outcome = decide(
            [(c, condition(node, {}, None, memo), known) for c, node, known in items], _loosened(tolerance, loose)
        )
        if not isinstance(outcome, Yes):
            return None, several
        values = {**start, **outcome.values}
        if replay(items, values, tolerance, LINEAR_SLACK):
            return Yes(values), several
    return None, several


def _loosened(tolerance: Tolerance, by: float) -> Tolerance:
    return replace(
        tolerance,
        x=None if tolerance.x is None else tolerance.x + by,
        y=None if tolerance.y is None else tolerance.y + by,
        position=tolerance.position + by,
        heading=tolerance.heading + by,
    )


class _Chooser:
    """Picks one of the directions that a field allows, each time another digit of a number."""

    def __init__(self, turn: int) -> None:
        self.left = turn
        self.several = False

    def __call__(self, _: DirectionAt, allowed: tuple[float, ...]) -> float:
        if len(allowed) == 1:
            return allowed[0]
        self.several = True
        self.left, pick = divmod(self.left, _EACH)
        return allowed[pick % len(allowed)]
