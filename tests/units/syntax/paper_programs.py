"""Programs as the papers print them: text, number of instances with specifiers, versions that the syntax allows."""

from __future__ import annotations

ANY = frozenset((1, 2, 3))
OLD = frozenset((1, 2))
FIRST = frozenset((1,))
SECOND = frozenset((2,))

PROGRAMS: dict[str, tuple[str, int, frozenset[int]]] = {
    "simplest": ("import gtaLib\nego = Car\nCar\n", 0, ANY),
    "car class, short": (
        "class Car:\n    position: Point on road\n    heading: roadDirection at self.position\n",
        1,
        OLD,
    ),
    "car ahead": ("Car offset by (-10, 10) @ (20, 40)\n", 1, FIRST),
    "car ahead, aligned": ("Car offset by (-10, 10) @ (20, 40), \\\n  facing (-5, 5) deg\n", 1, FIRST),
    "car ahead, along the road": (
        "Car offset by (-10, 10) @ (20, 40), \\\n  facing (-5, 5) deg relative to roadDirection\n",
        1,
        FIRST,
    ),
    "plain constructor": (
        "m = Car.defaultModelDistribution.sample()\npos = curb.offsetLeft(0.5 + m.width / 2)\nCar(pos, model=m)\n",
        0,
        ANY,
    ),
    "car left of spot": ("Car left of spot by 0.5, with model BUS\n", 1, OLD),
    "car at the curb": ("spot = OrientedPoint on visible curb\nCar left of spot by 0.25\n", 2, OLD),
    "car that sees": (
        "car2 = Car offset by (-10, 10) @ (20, 40), \\\n    with viewAngle 30 deg\nrequire car2 can see ego\n",
        1,
        FIRST,
    ),
    "soft requirement": ("require[0.5] car2 can see ego\n", 0, ANY),
    "mutation": ("taxi = Car at 120 @ 300, facing 37 deg\nmutate taxi\nmutate taxi by 2\n", 1, OLD),
    "mars": (
        """\
import mars
ego = Rover at 0 @ -2
goal = Goal at (-2, 2) @ (2, 2.5)

halfGapWidth = (1.2 * ego.width) / 2
bottleneck = OrientedPoint offset by (-1.5, 1.5) @ (0.5, 1.5), facing (-30, 30) deg
require abs((angle to goal) - (angle to bottleneck)) <= 10 deg
BigRock at bottleneck

leftEnd = OrientedPoint left of bottleneck by halfGapWidth, \\
        facing (60, 120) deg relative to bottleneck
rightEnd = OrientedPoint right of bottleneck by halfGapWidth, \\
        facing (-120, -60) deg relative to bottleneck
Pipe ahead of leftEnd, with height (1, 2)
Pipe ahead of rightEnd, with height (1, 2)

BigRock beyond bottleneck by (-0.5, 0.5) @ (0.5, 1)
BigRock beyond bottleneck by (-0.5, 0.5) @ (0.5, 1)
Pipe
Rock
Rock
Rock
""",
        10,
        FIRST,
    ),
    "diagonal": ("x = (0, 1)\ny = x @ x\n", 0, ANY),
    "car class": (
        """\
class Car:
    position: Point on road
    heading: (roadDirection at self.position) \\
        + self.roadDeviation
    roadDeviation: 0
    width: self.model.width
    height: self.model.height
    viewAngle: 80 deg
    visibleDistance: 30
    model: CarModel.defaultModel()
    color: CarColor.defaultColor()
""",
        1,
        OLD,
    ),
    "road deviation": ("Car facing 10 deg relative to roadDirection\nCar with roadDeviation 10 deg\n", 2, OLD),
    "single car": (
        (
            "wiggle = (-10 deg, 10 deg)\nego = EgoCar with roadDeviation wiggle\n"
            "Car visible, with roadDeviation resample(wiggle)\n"
        ),
        2,
        OLD,
    ),
    "badly parked car": (
        """\
ego = Car
spot = OrientedPoint on visible curb
badAngle = Uniform(1.0, -1.0) * (10, 20) deg
Car left of spot by 0.5, facing badAngle relative to roadDirection
""",
        2,
        OLD,
    ),
    "oncoming car": (
        "ego = Car\ncar2 = Car offset by (-10, 10) @ (20, 40), with viewAngle 30 deg\nrequire car2 can see ego\n",
        1,
        FIRST,
    ),
    "noise": (
        """\
param time = 12 * 60    # noon
param weather = 'EXTRASUNNY'

ego = EgoCar at -628.7878 @ -540.6067, \\
    facing -359.1691 deg

Car at -625.4444 @ -530.7654, facing 8.2872 deg, \\
    with model CarModel.models['DOMINATOR'], \\
    with color CarColor.byteToReal([187, 162, 157])

mutate
""",
        2,
        OLD,
    ),
    "two cars": (
        "wiggle = (-10 deg, 10 deg)\nego = EgoCar with roadDeviation wiggle\n"
        + "Car visible, with roadDeviation resample(wiggle)\n" * 2,
        3,
        OLD,
    ),
    "overlapping cars": (
        """\
wiggle = (-10 deg, 10 deg)
ego = EgoCar with roadDeviation wiggle

c = Car visible, with roadDeviation resample(wiggle)

leftRight = Uniform(1.0, -1.0) * (1.25, 2.75)
Car beyond c by leftRight @ (4, 10), with roadDeviation resample(wiggle)
""",
        3,
        FIRST,
    ),
    "four cars": (
        "param weather = 'RAIN'\nparam time = 0 * 60 # midnight\n\nwiggle = (-10 deg, 10 deg)\n"
        "ego = EgoCar with roadDeviation wiggle\n" + "Car visible, with roadDeviation resample(wiggle)\n" * 4,
        5,
        OLD,
    ),
    "platoon": (
        """\
param time = (8, 20) * 60          # 8 am to 8 pm
ego = Car with visibleDistance 60
c2 = Car visible
platoon = createPlatoonAt(c2, 5, dist=(2, 8))
""",
        2,
        OLD,
    ),
    "platoon function": (
        """\
def createPlatoonAt(car, numCars, model=None, dist=(2, 8), shift=(-0.5, 0.5), wiggle=0):
    lastCar = car
    for i in range(numCars-1):
        center = follow roadDirection from (front of lastCar) for resample(dist)
        pos = OrientedPoint right of center by shift, \\
            facing resample(wiggle) relative to roadDirection
        lastCar = Car ahead of pos, with model (car.model if model is None else resample(model))
""",
        2,
        OLD,
    ),
    "bumper to bumper": (
        """\
depth = 4
laneGap = 3.5
carGap = (1, 3)
laneShift = (-2, 2)
wiggle = (-5 deg, 5 deg)
modelDist = CarModel.defaultModel()

def createLaneAt(car):
    createPlatoonAt(car, depth, dist=carGap, wiggle=wiggle, model=modelDist)

ego = Car with visibleDistance 60
leftCar = carAheadOfCar(ego, laneShift + carGap, offsetX=-laneGap, wiggle=wiggle)
createLaneAt(leftCar)

midCar = carAheadOfCar(ego, resample(carGap), wiggle=wiggle)
createLaneAt(midCar)

rightCar = carAheadOfCar(ego, resample(laneShift) + resample(carGap), offsetX=laneGap, wiggle=wiggle)
createLaneAt(rightCar)
""",
        1,
        OLD,
    ),
    "car ahead of a car": (
        """\
def carAheadOfCar(car, gap, offsetX=0, wiggle=0):
    pos = OrientedPoint at (front of car) offset by (offsetX @ gap), \\
        facing resample(wiggle) relative to roadDirection
    return Car ahead of pos
""",
        2,
        OLD,
    ),
    "query paper, figure 6": (
        """\
spot = OrientedPoint on curb
ego = Car at (spot offset by (Range(2,4), Range(5,10)))
sideCar = Car left of spot by Range(1,3)
""",
        3,
        SECOND,
    ),
}
