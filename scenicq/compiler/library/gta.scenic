# The library of the 2019 paper (appendix A), with the models of cars, colours and helper functions of Scenic's model
# for GTA V. The map comes from the dataset.

_models = {
    "BLISTA": _record("BLISTA", 1.75871, 4.10139),
    "BUS": _record("BUS", 2.9007, 13.202),
    "NINEF": _record("NINEF", 2.07699, 4.50658),
    "ASEA": _record("ASEA", 1.83066, 4.45861),
    "BALLER": _record("BALLER", 2.10791, 5.10333),
    "BISON": _record("BISON", 2.29372, 5.4827),
    "BUFFALO": _record("BUFFALO", 2.04265, 5.07782),
    "BOBCATXL": _record("BOBCATXL", 2.37944, 5.78222),
    "DOMINATOR": _record("DOMINATOR", 1.9353, 4.9355),
    "GRANGER": _record("GRANGER", 3.02698, 5.94577),
    "JACKAL": _record("JACKAL", 2.00041, 4.91436),
    "ORACLE": _record("ORACLE", 2.07787, 5.12544),
    "PATRIOT": _record("PATRIOT", 2.26679, 5.13695),
    "PRANGER": _record("PRANGER", 3.02698, 5.94577),
}
BUS = _models["BUS"]

def _defaultModel():
    return Uniform(*[_models[name] for name in _models if name != "BUS"])

CarModel = _module("CarModel", {
    "models": _models,
    "defaultModel": _defaultModel,
    "uniformModel": _defaultModel,
    "egoModel": lambda: _models["BLISTA"],
})

class Car:
    position: new Point on road
    heading: (roadDirection at self.position) + self.roadDeviation
    roadDeviation: 0
    width: self.model.width
    length: self.model.length
    viewAngle: 80 deg
    visibleDistance: 30
    model: CarModel.defaultModel()
    color: CarColor.defaultColor()

class EgoCar(Car):
    model: CarModel.egoModel()

class Bus(Car):
    model: _models["BUS"]

class Compact(Car):
    model: _models["BLISTA"]

def createPlatoonAt(car, numCars, model=None, dist=Range(2, 8), shift=Range(-0.5, 0.5), wiggle=0):
    cars = [car]
    last = car
    for i in range(numCars - 1):
        center = follow roadDirection from (front of last) for resample(dist)
        spot = new OrientedPoint right of center by shift, facing resample(wiggle) relative to roadDirection
        last = new Car ahead of spot, with model (car.model if model is None else resample(model))
        cars.append(last)
    return cars

def carAheadOfCar(car, gap, offsetX=0, wiggle=0):
    spot = new OrientedPoint at (front of car) offset by Vector(offsetX, gap), facing resample(wiggle) relative to roadDirection
    return new Car ahead of spot
