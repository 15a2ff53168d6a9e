"""Assign predictions to label objects: by centre distance, the highest score first, each object once."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.store.in_memory import connect_in_memory, fetch_columns

__all__ = ["Centres", "Pairs", "assign", "find_pairs"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Centres:
    """Boxes as assignment sees them; the arrays have shape (n,).

    Attributes:
        frame: Number of the frame.
        category: Number of the class.
        x, y, z: Centre, metres; z is None where distances are those in the plane.
    """

    frame: NDArray[np.int32]
    category: NDArray[np.int32]
    x: Reals
    y: Reals
    z: Reals | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Predictions with the label objects of their frame and class that are near, for each prediction the nearest first.

    Attributes:
        prediction, object: Numbers of both, shape (n,).
        distance: Between the centres, shape (n,).
    """

    prediction: Numbers
    object: Numbers
    distance: Reals


def find_pairs(predictions: Centres, objects: Centres, reach_m: float, *, nearest_only: bool = False) -> Pairs:
    """Find the pairs of one frame and class that lie nearer than a distance.

    Args:
        predictions: In any order.
        objects: Label objects, those of a frame in the order of the source, by which equal distances are told apart.
        reach_m: The distance.
        nearest_only: Whether each prediction is paired with the nearest object alone, at any distance.
    """
    axes = "xy" if predictions.z is None or objects.z is None else "xyz"
    with closing(connect_in_memory()) as connection:
        connection.register("predictions", _table(predictions))
        connection.register("objects", _table(objects))
        joined = "FROM predictions p JOIN objects o ON p.frame = o.frame AND p.category = o.category"
        if nearest_only:
            # a pair of numbers is compared by the first, then by the second
            square = " + ".join(f"(p.{axis} - o.{axis}) * (p.{axis} - o.{axis})" for axis in axes)
            least = connection.execute(
                f"SELECT prediction, least.number AS object, sqrt(least.square) AS distance FROM "
                f"(SELECT p.number AS prediction, min({{square: {square}, number: o.number}}) AS least {joined} "
                f"GROUP BY p.number) ORDER BY prediction"
            )
            found = fetch_columns(least)
            return Pairs(_numbers(found["prediction"]), _numbers(found["object"]), np.asarray(found["distance"]))
        near_by = connection.execute(
            f"SELECT p.number AS prediction, o.number AS object, "
            f"{', '.join(f'p.{axis} - o.{axis} AS d{axis}' for axis in axes)} {joined} "
            "WHERE abs(p.x - o.x) < $reach AND abs(p.y - o.y) < $reach",
            {"reach": reach_m},
        )
        found = fetch_columns(near_by)
    distance = np.sqrt(sum(np.square(found[f"d{axis}"]) for axis in axes))
    near = distance < reach_m
    prediction, numbers, distance = found["prediction"][near], found["object"][near], distance[near]
    order = np.lexsort((numbers, distance, prediction))
    return Pairs(_numbers(prediction[order]), _numbers(numbers[order]), distance[order])


def _numbers(values: NDArray[np.int64]) -> Numbers:
    return np.asarray(values, dtype=np.int64)


def _table(boxes: Centres) -> pa.Table:
    columns = {"number": np.arange(len(boxes.x)), "frame": boxes.frame, "category": boxes.category}
    columns |= {"x": boxes.x, "y": boxes.y} | ({} if boxes.z is None else {"z": boxes.z})
    return pa.table(columns)


def assign(pairs: Pairs, rank: Numbers, objects: int, threshold_m: float, *, nearest_only: bool = False) -> Numbers:
    """Assign a label object to each prediction, -1 where it gets none, shape (predictions,).

    In the order of rank each prediction takes the nearest object that is still free. Here all predictions ask at once:
    an object keeps the one of the highest rank among those that have asked, the others ask the next nearest. As all
    objects prefer the same predictions, this ends in the same assignment (Gale and Shapley 1962).

    Args:
        pairs: Near pairs.
        rank: The rank of each prediction, 0 the first, shape (predictions,).
        objects: How many label objects there are.
        threshold_m: Pairs at this distance or more do not count.
        nearest_only: Whether a prediction whose nearest object is taken, however far that is, gets no other.
    """
    chosen = np.full(len(pairs.distance), True) if nearest_only else pairs.distance < threshold_m
    prediction, wanted, distance = pairs.prediction[chosen], pairs.object[chosen], pairs.distance[chosen]
    first = np.flatnonzero(np.append(True, prediction[1:] != prediction[:-1])[: len(prediction)])
    last = np.append(first[1:], len(prediction))[: len(first)]
    who = prediction[first]
    line = np.full(len(rank), -1, dtype=np.int64)
    line[who] = np.arange(len(who))
    by_rank = np.empty(len(rank), dtype=np.int64)
    by_rank[rank] = np.arange(len(rank))
    free = len(rank)
    holder = np.full(objects, free, dtype=np.int64)
    at, asking = first.copy(), np.arange(len(first))
    while len(asking):
        asked = wanted[at[asking]]
        touched = np.unique(asked)
        before = holder[touched]
        np.minimum.at(holder, asked, rank[who[asking]])
        displaced = before[(before != holder[touched]) & (before < free)]
        refused = asking[holder[asked] != rank[who[asking]]]
        asking = np.concatenate((refused, line[by_rank[displaced]]))
        at[asking] += 1
        asking = asking[at[asking] < last[asking]]
    found = np.full(len(rank), -1, dtype=np.int64)
    taken = np.flatnonzero(holder < free)
    found[by_rank[holder[taken]]] = taken
    if nearest_only:
        far = prediction[distance >= threshold_m]
        found[far] = -1
    return found
