# ruff: noqa: E501 - a program is easier to read on one line
"""Small programs that between them use every step of the decision ladder, and every specifier of the first scenarios."""

HEADER = "model scenic.domains.driving.model\n"

PROGRAMS: dict[str, str] = {
    "on road": "ego = new Car\nother = new Car",
    "ahead": "ego = new Car\nother = new Car ahead of ego by Range(4, 10)",
    "figure 3": "ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire not (other in intersection)",
    "offset": "ego = new Car\nother = new Car offset by (Range(-4, 4), Range(5, 20)), facing Range(-10, 10) deg relative to ego.heading",
    "left of": "ego = new Car\nother = new Car left of ego by Range(0.5, 2), facing 180 deg relative to ego.heading",
    "beyond": "ego = new Car\nbike = new Bicycle ahead of ego by 5\nother = new Pedestrian beyond bike by Range(2, 8)",
    "facing field": "ego = new Car on road, facing Range(-15, 15) deg relative to roadDirection",
    "visible road": "ego = new Car with viewAngle 120 deg, with visibleDistance 40\nother = new Car on visible road",
    "not visible": "ego = new Car with viewAngle 120 deg, with visibleDistance 20\nother = new Car on not visible road",
    "picked lane": "ego = new Car on Uniform(*network.lanes)\nother = new Pedestrian in crossing",
    "apparently": "ego = new Car\nother = new Car offset by (Range(-5, 5), Range(5, 10)), apparently facing Range(80, 100) deg",
    "toward": "ego = new Car\nother = new Pedestrian offset by (Range(-5, 5), Range(5, 10)), facing toward ego",
    "requirement": "ego = new Car\nother = new Car\nrequire (distance to other) < 20\nrequire abs(relative heading of other) > 30 deg",
    "normal": "ego = new Car\nother = new Car ahead of ego by Normal(8, 2), facing Normal(0, 0.1) relative to roadDirection",
    "figure 6": "spot = new OrientedPoint on network.laneRegion\n"
    "ego = new Car at (spot offset by (Range(2, 4), Range(5, 10)))\n"
    "side = new Car left of spot by Range(1, 3)",
    "shared": "gap = Range(4, 12)\nego = new Car\nfirst = new Car ahead of ego by gap\nsecond = new Car behind ego by gap",
    "shared heading": "turn = Range(-30, 30) deg\nego = new Car\nfirst = new Car offset by (3, 10), facing turn relative to ego.heading\n"
    "second = new Car offset by (-3, 10), facing -turn relative to ego.heading",
    "hidden requirement": "gap = Range(0, 20)\nego = new Car\nother = new Car ahead of ego by gap\nrequire gap > 5 and gap < 7",
    "nonlinear": "angle = Range(-20, 20) deg\nego = new Car\nother = new Car offset along angle relative to ego.heading by (0, Range(5, 10)),\n"
    "    facing angle relative to ego.heading",
    "discrete": "side = Uniform(-1, 1)\nego = new Car\nother = new Car offset by (side * 3.5, Range(5, 8))\n"
    "third = new Car offset by (side * 7, Range(10, 12))",
    "row": "ego = new Car\nprevious = ego\nfor i in range(3):\n    previous = new Car ahead of previous by Range(3, 6)",
    "crowd": "ego = new Car on road\nfor i in range(4):\n    new Pedestrian offset by (Range(-5, 5), Range(2, 30)), facing Range(-120, 120) deg relative to ego.heading",
    "mutated": "ego = new Car\nother = new Car ahead of ego by 5\nmutate other",
    "speed": "ego = new Car\nother = new Car ahead of ego by Range(2, 5), with width Range(1, 3)",
    "follow": "ego = new Car on network.laneRegion\nother = new Car following roadDirection from ego for Range(5, 10)",
    "badly parked": "ego = new Car\nspot = new OrientedPoint on visible curb\n"
    "parked = new Car left of spot by 0.5, facing Uniform(-1, 1) * Range(10, 20) deg relative to roadDirection",
    "random discs": "ego = new Car\nspot = new OrientedPoint offset by (Range(-9, 9), Range(2, 6))\n"
    "other = new Car ahead of ego by Range(2, 9)\nrequire CircularRegion(spot, 2) intersects other\n"
    "require CircularRegion(spot, 1) intersects CircularRegion(spot offset by (Range(0, 3), 0), 1)",
    "wide view": "ego = new Car with viewAngle 300 deg, with visibleDistance 30\nother = new Pedestrian in visible road, facing Range(0, 360) deg",
}
