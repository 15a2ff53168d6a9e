"""What is said of names and attributes that are not there: why Scenic's or Python's are refused, what else was meant.

Words around which the parser cannot go on are in `scenicq.syntax.hints`.
"""

from __future__ import annotations

import re

from scenicq.compiler.values import Instance, ModelValue, Module, describe, fail, is_node
from scenicq.errors import ScenarioError, Span, similar
from scenicq.geometry.elements import Lane, NetworkElement
from scenicq.geometry.network import Network
from scenicq.syntax.hints import BIKE_LANES_HINT, MOVING_HINT, STANDING_HINT, TURNING_HINT

__all__ = ["unavailable_name", "unknown_attribute", "unknown_name"]

_NAMES: dict[str, tuple[str, ...]] = {
    "Shape MeshShape BoxShape CylinderShape ConeShape SpheroidShape": (
        "labels are matched in 2D",
        "give objects a `width` and a `length` instead of a shape",
    ),
    "Orientation": ("labels are matched in 2D", "a heading is one angle, as in `facing 30 deg`"),
    "Region PolygonalFootprintRegion VoxelRegion EmptyRegion AllRegion": (
        "not a region that can be matched",
        "use `PolygonalRegion`, `CircularRegion`, `everywhere` and their like",
    ),
    "Mutator PositionMutator HeadingMutator OrientationMutator": (
        "noise of one's own cannot be analysed",
        "`mutate` adds noise to the position and the heading",
    ),
    "Distribution ExternalParameter VerifaiParameter VerifaiSampler TimeSeries distributionFunction "
    "distributionMethod": (
        "a distribution of one's own cannot be analysed",
        "use `Range`, `Normal`, `Uniform` and their like, and arithmetic on them",
    ),
    "simulation File Files Recorder": (
        "does not describe one instant",
        "a scene is matched at one instant: remove this",
    ),
    "open input eval exec compile getattr setattr delattr hasattr vars dir globals locals type super object id hash "
    "memoryview breakpoint exit quit help": (
        "out of a scenario's reach",
        "scenarios are data: they reach neither files nor the Python interpreter",
    ),
    "objects vehicles cars pedestrians others agents actors": (
        "a program names the objects that it asks for",
        "`new Vehicle` asks for one vehicle, which requirements can name",
        "`--exact` asks that no other objects are there",
    ),
    "divmod iter next slice ord chr bin hex oct ascii repr format bytes bytearray complex property staticmethod "
    "classmethod": (
        "not part of the Python subset",
        "write what the scene needs with arithmetic, lists and functions",
    ),
}
_REASONS = {name: reason for names, reason in _NAMES.items() for name in names.split()}

_ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "pitch roll": ("labels are matched in 2D", "use `heading`"),
    "onSurface topSurface bottomSurface leftSurface rightSurface frontSurface backSurface surface occupiedSpace "
    "boundingBox boundingPolygon inradius onDirection": (
        "labels are matched in 2D",
        "use `width`, `length` and points such as `front of` the object",
    ),
    "getSurfaceRegion getVolumeRegion voxelized projectVector dimensionality size": (
        "labels are matched in 2D",
        "use regions in the plane",
    ),
    "signedDistanceTo pointAlongBy buffer boundary": (
        "not a part of regions that can be matched",
        "`distance to` a region, `on` it, and `follow` along a field can",
    ),
    "lastActions observations": ("does not describe one instant", "a scene is matched at one instant: remove this"),
}
_ATTRIBUTE_REASONS = {name: reason for names, reason in _ATTRIBUTES.items() for name in names.split()}
_SYNONYMS = {
    "crosswalk": "crossing", "crosswalks": "crossing", "zebra": "crossing", "walkway": "sidewalk",
    "footpath": "sidewalk", "pavement": "sidewalk", "junction": "intersection", "crossroads": "intersection",
    "street": "road", "roadway": "road", "roads": "road", "kerb": "curb", "intersections": "intersection",
    "sidewalks": "sidewalk", "crossings": "crossing", "car": "Car", "vehicle": "Vehicle", "truck": "Truck",
    "Person": "Pedestrian", "Walker": "Pedestrian", "Human": "Pedestrian", "Bike": "Bicycle", "Cyclist": "Bicycle",
    "Bicyclist": "Bicycle", "Motorbike": "Motorcycle", "Motorcyclist": "Motorcycle", "Lorry": "Truck",
    "Worker": "ConstructionWorker", "Policeman": "PoliceOfficer", "Scooter": "PersonalMobility", "Dog": "Animal",
    "SchoolBus": "Bus", "SUV": "Car", "Taxi": "Car", "Pickup": "Car", "Bollard": "Barrier",
}  # fmt: skip
"""What people call what the driving model has."""
_OF_MAP = {
    "Crosswalk": "crossing", "Crossing": "crossing", "Intersection": "intersection", "Junction": "intersection",
    "Lane": "lane", "Road": "road", "Sidewalk": "sidewalk", "ParkingSpot": "shoulder",
}  # fmt: skip
"""What people make an object of and is a part of the map, by the region there."""
_COMPASS = {"north": 0, "west": 90, "south": 180, "east": -90}
_OF_SIGNS = "labels of signs are of class `Prop`"
_BY_NAME = {
    "Sign": _OF_SIGNS, "StopSign": _OF_SIGNS, "TrafficSign": _OF_SIGNS,
    "distance": "`distance from a to b` has no brackets", "dist": "`distance from a to b` is the distance",
    "angle": "`angle from a to b` has no brackets", "velocity": "`X.velocity` is the velocity of an object X",
    "speed": "`X.speed` is the speed of an object X", "heading": "`X.heading` is the heading of an object X",
    **dict.fromkeys(("parked", "stopped"), STANDING_HINT), "moving": MOVING_HINT, "turning": TURNING_HINT,
    "bikeLane": BIKE_LANES_HINT,
    "oncoming": "`facing Range(160, 200) deg relative to ego.heading`",
    "lane": "`X.lane` is the lane of an object X", "leftLane": "`X.laneSection.laneToLeft` is the lane left of X's",
    "rightLane": "`X.laneSection.laneToRight` is the lane right of X's",
    "weather": "`param weather = 'rain'` compares what labels say of the weather",
    "time": "`param time = 12` compares what labels say of the time",
    "intersects": "`X intersects Y` asks whether the boxes of two overlap",
    "random": "`Uniform(a, b)` chooses, `Range(a, b)` draws a number",
    "Offset": "`at X offset by 2 @ 5` is 2 m to the right and 5 m ahead of X",
    "Weather": "`param weather = 'rain'` compares what labels say of the weather",
    **{name: f"`on {region}` places an object there" for name, region in _OF_MAP.items()},
    **{name: f"a direction is an angle, to the left of north: `{angle} deg`" for name, angle in _COMPASS.items()},
    "self": "`self` is for classes; a `require` after the object uses the object's name",
}  # fmt: skip
"""Hints for names that the driving model spells in another way."""
_BESIDE = re.compile(
    r"(?i)_?(left|right)_?(lane|neighbou?r)?|(lane|neighbou?r)_?(to_?)?(left|right)|laneTo(Left|Right)"
)
"""Names that authors give to the lane beside another."""
_RATE = "`angularSpeed` is the rate at which it turns, in radians a second"
_BY_ATTRIBUTE = {
    "yawrate": _RATE, "angularvelocity": _RATE, "turnrate": _RATE, "accel": "`acceleration` is along the course",
    **dict.fromkeys(("isparked", "parked", "isstopped", "stopped", "isstationary"), STANDING_HINT),
    **dict.fromkeys(("ismoving", "moving"), MOVING_HINT),
    "category": "`new Bus` asks for a class", "type": "`new Bus` asks for a class",
    "occluded": "`beyond Y by Range(2, 30)` places an object where Y hides it from the ego",
    "isoccluded": "`beyond Y by Range(2, 30)` places an object where Y hides it from the ego",
    "visible": "`ego can see X` asks whether X is in view", "isvisible": "`ego can see X` asks whether X is in view",
    "distance": "`distance from ego to X` is the distance",
}  # fmt: skip
"""How Scenic says what people ask an object for, by the attribute in small letters."""
_ASIDE = re.compile(r"^_|At$|Region$")
"""Attributes of the map that hints do not list: look-ups and regions that another attribute gives, too."""
_OWNER = re.compile(r"([A-Za-z_][\w.]{0,60})\.\Z")
"""The dotted name before an attribute."""


def unavailable_name(name: str, span: Span) -> ScenarioError | None:
    """The refusal of a name that Scenic or Python defines; None for any other."""
    return _refusal(_REASONS.get(name), name, span)


def _refusal(reason: tuple[str, ...] | None, name: str, span: Span) -> ScenarioError | None:
    if reason is None:
        return None
    return fail("unsupported-construct", f"`{name}` is not supported", span, reason[0], reason[1:])


def unknown_name(name: str, known: set[str], region: str | None, span: Span) -> ScenarioError:
    """What is said of a name that is not defined; `region` is the map's of elements that are called so."""
    close = similar(name, known)
    hints = (f"`{close}` has a similar name",) if close else ()
    if _SYNONYMS.get(name) in known:
        hints = (f"`{_SYNONYMS[name]}` is what Scenic calls it",)
    elif name in _BY_NAME:
        hints = (_BY_NAME[name],)
    elif region is not None:
        hints = (f"`network.{region}` is what the map has of this kind",)
    elif not close and "roadDirection" not in known:
        hints = ("names such as `road` and `Car` come with `model scenic.domains.driving.model`",)
    return fail("unknown-name", f"`{name}` is not defined", span, "not found", hints)


def unknown_attribute(value: ModelValue, name: str, known: set[str], place: str, span: Span) -> ScenarioError:
    """What is said of an attribute that a value does not have; `place` is what the network calls it at a point."""
    is_thing = isinstance(value, Instance)
    shown = describe(value)
    if isinstance(value, Module) and value.name == "globalParameters":
        close = similar(name, known)
        hints = (f"`{close}` is spelled nearly like it",) if close else (f"`param {name} = ...` sets it",)
        return fail("unknown-attribute", f"the program has no parameter `{name}`", span, "not set", hints)
    message, label = f"{shown} has no attribute `{name}`", "not found"
    if is_thing and place:
        return fail("unknown-attribute", message, span, label, (f"`network.{place}(...)` says what lies at any point",))
    if is_node(value) or isinstance(value, Instance | NetworkElement):
        refused = _refusal(_ATTRIBUTE_REASONS.get(name), name, span)
        if refused is not None:
            return refused
    if isinstance(value, Lane) and (side := _BESIDE.fullmatch(name)):
        other = "Left" if "left" in side[0].lower() else "Right"
        hint = f"`X.laneSection.laneTo{other}` is the lane beside that of an object `X`"
        return fail("unknown-attribute", message, span, label, (hint,))
    close = similar(name, known)
    hints = (f"`{close}` is an attribute with a similar name",) if close else ()
    if isinstance(value, Network | NetworkElement) and not close:
        called = f"{_SYNONYMS.get(name, '')}s"
        has = ", ".join(f"`{each}`" for each in sorted(known) if not _ASIDE.search(each))
        hints = (f"`{called}` is what Scenic calls them",) if called in known else (f"it has {has}",)
    if isinstance(value, Network) and name in ("bikeLanes", "bikeLane", "bicycleLanes"):
        hints = (BIKE_LANES_HINT,)
    if is_thing and (said := _BY_ATTRIBUTE.get(name.replace("_", "").lower())):
        hints = (said,)
    if is_thing and not hints:
        hints = (f"`{name}` can be read if labels of the dataset have it: give `scenicq check` the dataset, too",)
    if owner := _OWNER.search(span.source.text, 0, span.start):
        label = f"`{owner[1]}` is {shown}"
    return fail("unknown-attribute", message, span, label, hints)
