"""Runs programs in Scenic's Newtonian simulator and replays recorded motion against them. Runs in the environment that
has `scenic` and not `scenicq`.

Usage: python simulate.py MAP.xodr OUT

Writes OUT/map.geojson as `draw_scenes.py` does, then answers requests, one JSON object a line:

- {"text" or "file", "seed", "seconds", "steps"} compiles and simulates a program. The answer is its trace: what is
  known of the objects, their states at each step (x, y, heading, velocity), and how it ended; or an error, and whether
  a simulation may have been interrupted, after which Scenic takes itself to be within one.
- {"replay": [{"states", "time_step"}, ...], "behaviors"} has Scenic decide, for the scene simulated last, whether the
  program holds on given states: actions do nothing, its behaviors run or are left out, and objects are where the states
  say. The answer has one pair for each: "terminated" by the program, "lasts" beyond the states, or "rejected", and the
  step at which; or "failed", where Scenic does.
"""

from __future__ import annotations

import functools
import importlib.metadata
import json
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
from draw_scenes import CARLA, INSTALLED, MODE, thing
from network_features import features_of
from patience import OutOfPatienceError, patience
from scenic import scenarioFromFile, scenarioFromString
from scenic.core.simulators import Simulator, TerminationType
from scenic.core.vectors import Vector
from scenic.domains.driving.roads import Network
from scenic.domains.driving.simulators import DrivingSimulation
from scenic.simulators.newtonian.simulator import NewtonianSimulation

WORLD = "simulated_world"
MOST_ATTEMPTS = 2_000
TIME_STEP = 0.1


def state(thing: Any) -> list[float]:
    """Where an object is and how it moves."""
    return [float(each) for each in (thing.x, thing.y, thing.heading, thing.velocity.x, thing.velocity.y)]


class Replayed(DrivingSimulation):
    """A simulation in which objects are where recorded states say."""

    def __init__(self, scene: Any, states: list[list[list[float]]], **options: Any) -> None:
        """Replay the states of all steps, those of the objects of the scene in its order."""
        self._states = states
        super().__init__(scene, **options)

    def createObjectInSimulator(self, obj: Any) -> None:
        """Nothing: the state of the first step is read like all others."""

    def step(self) -> None:
        """Nothing: states are read by the number of the step."""

    def executeActions(self, allActions: Any) -> None:
        """Nothing: objects are where the states say."""

    def actionsAreCompatible(self, agent: Any, actions: Any) -> bool:
        """Any action may be taken."""
        return True

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:
        """What is recorded of an object, and what else Scenic asks for as it is."""
        number = next(n for n, each in enumerate(self.objects) if each is obj)
        x, y, heading, east, north = self._states[self.currentTime][number]
        yaw, _, _ = obj.parentOrientation.globalToLocalAngles(heading, 0, 0)
        velocity = Vector(east, north)
        moved = {"position": Vector(x, y), "yaw": yaw, "velocity": velocity, "speed": velocity.norm(), "elevation": 0.0}
        return {each: moved[each] if each in moved else getattr(obj, each) for each in properties}


class Replayer(Simulator):
    """Makes simulations that replay states."""

    def __init__(self, states: list[list[list[float]]]) -> None:
        """Replay these states."""
        super().__init__()
        self._states = states

    def createSimulation(self, scene: Any, **options: Any) -> Replayed:
        """A simulation of the scene."""
        return Replayed(scene, self._states, **options)


class Simulations:
    """Simulates programs on one map, and remembers the last scene."""

    def __init__(self, chart: Path) -> None:
        """Simulate on a map."""
        self._chart = chart
        self._scene: Any = None

    def simulate(self, request: dict[str, Any]) -> dict[str, Any]:
        """A trace of a program, or why there is none."""
        random.seed(request["seed"])
        np.random.seed(request["seed"])
        self._scene = None
        rejected = 0
        try:
            with patience(request["seconds"]):
                scenario = self._compiled(request)
                simulator = scenario.getSimulator()
                while True:
                    scene, _ = scenario.generate(maxIterations=MOST_ATTEMPTS)
                    first = [thing(each) for each in scene.objects]
                    done = simulator.simulate(scene, maxSteps=request["steps"], maxIterations=1, timestep=TIME_STEP)
                    if done is not None:
                        break
                    rejected += 1
        except OutOfPatienceError:
            return {"error": f"no simulation in time; {rejected} were rejected", "interrupted": True}
        except Exception as error:  # whatever Scenic says of the program is its answer
            return {"error": f"{type(error).__name__}: {error}"}
        self._scene = scene
        # scenarios may make more, with the first step
        first += [thing(each) for each in done.objects[len(first) :]]
        return {
            "objects": first,
            "states": done.trajectory,
            "time_step": TIME_STEP,
            "end": done.result.terminationType.name,
            "rejected": rejected,
        }

    def replay(self, states: list[list[list[float]]], time_step: float, *, behaviors: bool) -> tuple[str, int]:
        """How the program of the last scene fares on given states, with its behaviors or without them."""
        for each in self._scene.objects if not behaviors else ():
            each.behavior = None
        found = self._replayed(states, time_step, len(states) - 1)
        if behaviors and found[0] == "lasts":
            # behaviors run after a step is seen, and may end it there
            later = self._replayed([*states, states[-1]], time_step, len(states))
            found = later if later == ("terminated", len(states) - 1) else found
        return found

    def _replayed(self, states: list[list[list[float]]], time_step: float, steps: int) -> tuple[str, int]:
        simulator = Replayer(states)
        try:
            done = simulator.createSimulation(
                self._scene, maxSteps=steps, name="replay", timestep=time_step, enableReplay=False
            )
        except Exception as error:
            if getattr(error, "simulation", None) is None:
                return f"failed: {type(error).__name__}: {error}", 0
            return "rejected", error.simulation.currentTime
        lasts = done.result.terminationType == TerminationType.timeLimit
        return "lasts" if lasts else "terminated", done.currentTime

    def _compiled(self, request: dict[str, Any]) -> Any:
        given = {"params": {"map": str(self._chart), "render": 0}, "model": WORLD, **MODE}
        if "file" in request:
            return scenarioFromFile(request["file"], **given)
        return scenarioFromString(request["text"], **given)


def main(arguments: list[str]) -> None:
    """Write the map, then answer requests."""
    chart, out = Path(arguments[0]), Path(arguments[1])
    importlib.metadata.version = lambda name: CARLA if name == "carla" else INSTALLED(name)
    Network.fromFile = functools.cache(Network.fromFile)
    NewtonianSimulation.currentState = lambda self: [state(each) for each in self.objects]
    collection = {"type": "FeatureCollection", "features": features_of(Network.fromFile(str(chart)))}
    (out / "map.geojson").write_text(json.dumps(collection), encoding="utf-8")
    simulations = Simulations(chart)
    answers, sys.stdout = sys.stdout, sys.stderr  # programs may print
    for line in sys.stdin:
        request = json.loads(line)
        if "replay" in request:
            answer: Any = [
                simulations.replay(each["states"], each["time_step"], behaviors=request.get("behaviors", False))
                for each in request["replay"]
            ]
        else:
            answer = simulations.simulate(request)
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
