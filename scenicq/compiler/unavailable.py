"""Names that Scenic or Python has and that cannot be matched: a refusal that says why, instead of "not defined"."""

from __future__ import annotations

from scenicq.compiler.values import fail
from scenicq.errors import ScenarioError, Span

__all__ = ["unavailable_attribute", "unavailable_name"]

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
        "`new Vehicle` asks for one vehicle, which every requirement may speak of",
        "that there are no others can only be asked of all together, with `--exact`",
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


def unavailable_name(name: str, span: Span) -> ScenarioError | None:
    """The refusal of a name that Scenic or Python defines; None for any other."""
    return _refusal(_REASONS.get(name), name, span)


def unavailable_attribute(name: str, span: Span) -> ScenarioError | None:
    """The refusal of an attribute that Scenic's objects and regions have; None for any other."""
    return _refusal(_ATTRIBUTE_REASONS.get(name), name, span)


def _refusal(reason: tuple[str, ...] | None, name: str, span: Span) -> ScenarioError | None:
    if reason is None:
        return None
    return fail("unsupported-construct", f"`{name}` is not supported", span, reason[0], reason[1:])
