"""What a run of the matcher is told besides scenario and labels."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from scenicq.forest.scenario import BuiltIn
from scenicq.match.tolerance import Tolerance
from scenicq.store.classes import Granularity

__all__ = ["MatchOptions", "Method"]

Method = Literal["auto", "smt", "monolithic"]

EXEMPT_PARAMS = frozenset(
    {"map", "carla_map", "lgsvl_map", "render", "use2DMap", "time_step", "timestep", "weather_file"}
)
"""Parameters that say how to simulate, not what the scene is."""


@dataclass(frozen=True, slots=True)
class MatchOptions:
    """Options of a match.

    Attributes:
        tolerance: Per feature.
        classes: Whether classes are folded.
        ego: Whether the scenario's ego is the label's ego, or any label object of its class.
        radius: Metres around the ego beyond which neither label objects nor the map are considered.
        enforce: Built-in requirements in force.
        exact: Whether the correspondence must cover all label objects.
        method: How groups are decided.
        timeout_s: Seconds for one label, our own work and the solver's together.
        precision: The solver's precision (δ).
        ignore_params: Global parameters that are not compared.
        budget: Steps of the correspondence search for one label.
        correspondences: Correspondences that are reported of one label, at most, where all are asked for.
    """

    tolerance: Tolerance = field(default_factory=Tolerance)
    classes: Granularity = "fine"
    ego: Literal["label", "any"] = "label"
    radius: float | None = None
    enforce: frozenset[BuiltIn] = frozenset({BuiltIn.VISIBILITY})
    exact: bool = False
    method: Method = "auto"
    timeout_s: float = 10.0
    precision: float = 1e-4
    ignore_params: frozenset[str] = field(default=EXEMPT_PARAMS)
    budget: int = 1_000_000
    correspondences: int = 1000
