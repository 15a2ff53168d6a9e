"""What the map says of observed places is asked once for all values of hidden numbers, and comes out the same."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely

from scenicq.forest import build
from scenicq.forest.nodes import (
    ArithmeticOp,
    Compare,
    CompareOp,
    Contains,
    DirectionAt,
    Distance,
    Feature,
    Logic,
    LogicOp,
    Node,
    Range,
)
from scenicq.forest.walk import transform
from scenicq.geometry.network import Network
from scenicq.importers.base import read_maps
from scenicq.importers.report import Report
from scenicq.report.outlines import outline
from scenicq.temporal.atoms import AtomColumns

MAP = Path(__file__).parents[3] / "sample_data" / "crossroads" / "maps"
EVERYWHERE = (-1e4, -1e4, 1e4, 1e4)
PLACE = Feature(0, "position", "vector", current=True)


@cache
def network() -> Network:
    return Network("crossroads", read_maps({"crossroads": next(MAP.iterdir())}, Report())["crossroads"])


class Seen:
    """One object at random places of the map, some of which are missing."""

    def __init__(self, count: int = 400) -> None:
        rng = np.random.default_rng(5)
        bounds = shapely.union_all(outline(network().region("intersection"), EVERYWHERE)).bounds
        low, high = np.array(bounds).reshape(2, 2)
        self.xy = rng.uniform(low - 20, high + 20, (count, 2)).T
        self.xy[:, rng.random(count) < 0.1] = np.nan

    def __len__(self) -> int:
        return self.xy.shape[1]

    def observed(self, _index: int, _name: str):
        return tuple(self.xy)


HIDDEN = Range(build.constant(-4.0), build.constant(4.0))
DIRECTION = DirectionAt(build.constant(network().roadDirection), PLACE)
NEAR = Compare(CompareOp.LT, build.arithmetic(ArithmeticOp.ABS, build.minus(DIRECTION, HIDDEN)), build.constant(0.5))
CONDITIONS: dict[str, Node] = {
    "direction": NEAR,
    "inside": Logic(LogicOp.AND, (NEAR, Contains(build.constant(network().region("intersection")), PLACE))),
    "distance": Compare(CompareOp.LT, Distance(build.constant(network().region("intersection")), PLACE), HIDDEN),
    "either": Logic(LogicOp.OR, (NEAR, Compare(CompareOp.LT, DIRECTION, build.constant(0.0)))),
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_conditions_are_those_of_each_value_by_itself(name):
    condition, samples = CONDITIONS[name], Seen()
    columns = AtomColumns(None, samples)
    held: set[int] = set()
    for value in (-3.0, -1.5, 0.0, 0.2, 1.6, 3.0):
        found = columns.assigned({HIDDEN.identity: value}).truth_of(condition)
        known = transform(condition, lambda node, value=value: build.constant(value) if node is HIDDEN else node)
        assert found.tolist() == AtomColumns(None, samples).truth_of(known).tolist()
        held |= set(found.tolist())
    several = max(len(each) for each in network().roadDirection.values_many(samples.xy.T[~np.isnan(samples.xy[0])]))
    assert several > 1
    assert len(held) == 3
