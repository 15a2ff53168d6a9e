"""World models: what `model scenic.domains.driving.model` and its like bring in, over one map.

The classes are written in Scenic (`library/*.scenic`) and read by the same front end as users' programs; the road
network comes from the dataset. Simulators' models resolve to the same classes: what a simulator adds over time has no
meaning at one instant.
"""

from __future__ import annotations

from functools import cache
from importlib import resources

from scenicq.compiler.builtins import mathematics
from scenicq.compiler.values import ModelValue, Module, fail
from scenicq.errors import Source, Span
from scenicq.forest import build
from scenicq.geometry.elements import Intersection, Lane, LaneGroup, LaneSection, NetworkElement, Road
from scenicq.geometry.network import Network
from scenicq.geometry.regions import union
from scenicq.syntax import ast
from scenicq.syntax.parser import parse

__all__ = ["library_text", "known_modules", "network_names", "plain_module"]

_DRIVING = (
    "scenic.domains.driving.model",
    "scenic.simulators.carla.model",
    "scenic.simulators.lgsvl.model",
    "scenic.simulators.gta.model",
    "scenic.simulators.metadrive.model",
    "scenic.simulators.newtonian.driving_model",
    "scenic.simulators.webots.road.model",
)
_LIBRARIES = ("driving.scenic", "carla.scenic")


@cache
def library_text(name: str) -> ast.Module:
    """The syntax of one of the library's files."""
    text = resources.files(__package__).joinpath("library", name).read_text(encoding="utf-8")
    return parse(Source(f"<{name}>", text), 3)


def known_modules() -> tuple[str, ...]:
    """The models and modules that resolve."""
    return (*_DRIVING, "scenic.domains.driving.roads", "math")


def libraries_of(name: str) -> tuple[str, ...]:
    """The library files that a model stands for; empty for what is not a model."""
    return _LIBRARIES if name in _DRIVING else ()


def network_names(network: Network) -> dict[str, ModelValue]:
    """The names that a driving model gives to the parts of the map."""
    regions = {
        "road": network.drivableRegion,
        "curb": network.curbRegion,
        "sidewalk": network.sidewalkRegion,
        "shoulder": network.shoulderRegion,
        "crossing": network.crossingRegion,
        "roadOrShoulder": union(network.drivableRegion, network.shoulderRegion),
        "intersection": network.intersectionRegion,
        "roadDirection": network.roadDirection,
        "roadOrientation": network.roadDirection,
    }
    names: dict[str, ModelValue] = {name: build.constant(value) for name, value in regions.items()}
    return names | {"network": network}


def plain_module(name: str, span: Span) -> Module:
    """A module that does not depend on the map.

    Raises:
        ScenarioError: unknown-model.
    """
    if name == "math":
        return Module("math", mathematics())
    if name == "scenic.domains.driving.roads":
        classes = {cls.__name__: cls for cls in (Intersection, Lane, LaneGroup, LaneSection, NetworkElement, Road)}
        return Module(name, dict[str, ModelValue](classes))
    raise fail("unknown-model", f"`{name}` is not a model or module known here", span, "not found",
               ("known are `scenic.domains.driving.model`, the models of Scenic's driving simulators, and `math`",
                "a scenario never imports Python code: write what it needs in Scenic"))  # fmt: skip
