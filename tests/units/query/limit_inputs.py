"""What the limits are tried on: queries over frames and over time, explanations, programs, questions, draws.

Each input says what it found, as facts: a match, or something unknown, by what it is about; a fact that is missing is a
no. Whatever else is told has a fact of its own, `told`, that a limit may change.
"""

from __future__ import annotations

import functools
import random
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "temporal"))
sys.path.insert(0, str(Path(__file__).parents[1] / "match"))
sys.path.insert(0, str(Path(__file__).parents[1] / "match/fields"))
import built_in
import pytest
from choices_definition import alike, random_program, random_trace
from choices_definition import recording_of as recording_of_trace
from comparisons import between, c, compared
from formulas import Var, Variable
from nudged_scenes import dataset_of
from patchwork import SIDE, Beside, patchwork
from programs import HEADER, PROGRAMS

from scenicq.compiler.program import compile_scenario
from scenicq.errors import CannotEvaluate, Source
from scenicq.forest.nodes import ArithmeticOp, Constant, DirectionAt, LogicOp
from scenicq.forest.show_modes import show_modes
from scenicq.geometry.default_street import street
from scenicq.geometry.regions import Disc, IntersectionOf, PolygonSet
from scenicq.geometry.sampling import sampler
from scenicq.geometry.shapes import box, polygon
from scenicq.limits import LIMITS
from scenicq.match.fields import field_solver
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Refuted, Satisfied, finish
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.advice import advice
from scenicq.query.explain.frame_explanation import explain, show_explanation
from scenicq.query.explain.interval_explanation import explain_recording
from scenicq.query.explain.nearest_interval import nearest_intervals
from scenicq.query.explain.nearest_miss import nearest_misses
from scenicq.smt.answer import Answer, NoAnswer, Sat
from scenicq.smt.case_split import check_by_cases
from scenicq.smt.command import SmtlibSolver
from scenicq.smt.distance_terms import BoxTerms
from scenicq.smt.enclosing import box_holds
from scenicq.smt.problem import Problem
from scenicq.smt.terms import apply, compare, disjunction, number, parts
from scenicq.smt.worker_solver import WorkerSolver
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

__all__ = ["INPUTS", "Facts", "Stores", "stores_of"]

Facts = dict[tuple[object, ...], str]
"""What is a match, unknown or told, by what it is about."""

TOLERANCE = parse_tolerance("position=0.25,heading=5deg")


@dataclass(frozen=True)
class Stores:
    """The datasets that are asked.

    Attributes:
        folder: Where datasets are written as they are wanted.
        time: Recordings of which something is missing here and there.
        crossroads: The recordings that ship with the project.
        many: One frame with more cars than first fit looks at.
    """

    folder: Path
    time: Dataset
    crossroads: Dataset
    many: Dataset
    _frames: dict[str, Dataset] = field(default_factory=dict[str, Dataset])

    def frames(self, name: str) -> Dataset:
        """Scenes of a program and of another one, as they are and nudged, on the street."""
        if name not in self._frames:
            (self.folder / name).mkdir()
            texts = {each: {**PROGRAMS, **EXTRA}[each] for each in dict.fromkeys((name, "figure 3"))}
            drawn = {each: text for each, text in texts.items() if each not in UNDRAWN}
            self._frames[name] = dataset_of(drawn, self.folder / name)
        return self._frames[name]

    def of(self, store: str) -> Dataset:
        """A dataset by its name."""
        return self.frames(store) if store in PROGRAMS or store in EXTRA else getattr(self, store)


# --- programs

FRAMES = (
    "figure 3", "not visible", "picked lane", "requirement", "figure 6", "shared", "hidden requirement", "nonlinear",
    "discrete", "crowd", "follow", "badly parked", "random discs", "row",
)  # fmt: skip
BY_SOLVER = ("requirement", "shared", "hidden requirement", "discrete")
EXTRA = {
    "whole numbers": "n = DiscreteRange(1, 3)\nego = new Car\nother = new Car offset by (Range(-1, 1), 5 * n)",
    "many whole numbers": "n = DiscreteRange(0, 90)\nego = new Car\n"
    "other = new Car offset by (0.05 * n, Range(5, 8)), facing n * Range(0.5, 1) deg relative to ego.heading",
    "near the curb": "ego = new Car on road\nspot = new Point offset by (Range(-6, 6), Range(2, 9))\n"
    "other = new Car ahead of ego by Range(2, 9)\nrequire (distance from spot to curb) < 2",
    "rounded": "from math import floor\ngap = Range(1, 5)\nego = new Car\n"
    "other = new Car ahead of ego by floor(gap) + gap / 9",
    "picked maneuver": "lane = Uniform(*network.lanes)\nway = Uniform(*lane.maneuvers)\n"
    "ego = new Car on way.startLane\nother = new Car on way.endLane",
    "alternatives": "gap = Range(0, 20)\nwide = Range(0, 4)\nego = new Car\nother = new Car offset by (wide, gap + 5)\n"
    "require (gap > 5 and (gap < 7 or wide > 2)) or (gap < 2 and (wide < 1 or wide > 3))",
    "ego alone": "ego = new Car on road, facing Range(-15, 15) deg relative to roadDirection",
    "who is fast": "ego = new Car\nother = new Car offset by (Range(-9, 9), Range(2, 20))\n"
    "require (Uniform(ego, other)).speed > 3",
    "looked up": "ego = new Car\nother = new Car on ego.lane",
    "near an intersection": "ego = new Car\nother = new Car offset by (Range(-9, 9), Range(2, 20))\n"
    "require (distance from ego to intersection) < 10",
    "one lane": "ego = new Car on network.lanes[0]\nother = new Car on network.lanes[0]",
    "one gap for all": "gap = Range(3, 6)\nego = new Car\nlast = ego\nfor i in range(3):\n"
    "    last = new Car ahead of last by gap",
    "one gap for three": "gap = Range(3, 6)\nego = new Car\na = new Car ahead of ego by gap\n"
    "b = new Car behind ego by gap\nthird = new Car left of ego by gap",
    "shifted": "ego = new Car on intersection\nshift = Range(-0.5, 0.5)\nlast = ego\nfor i in range(2):\n"
    "    base = new OrientedPoint at (front of last) offset by (0, Range(2, 6)), facing roadDirection\n"
    "    last = new Car at base offset by (shift, 1), facing Range(-5, 5) deg relative to base.heading",
    "turned": "ego = new Car on road\nother = new Car offset by (Range(-4, 4), Range(5, 9)),\n"
    "    facing Uniform(-1, 1) * Range(10, 20) deg relative to ego.heading",
    "crossing spot": "spot = new OrientedPoint on intersection\n"
    "ego = new Car at (spot offset by (Range(2, 4), Range(5, 10)))\nside = new Car left of spot by Range(1, 3)",
    "many offsets": "ego = new Car\nother = new Car offset by (Range(-2, 2) + Range(-1, 1), Range(5, 9) + Range(0, 1))",
}
UNDRAWN = ("who is fast",)
"""Of these no scene is drawn: a class says 0 of a speed."""
LANGUAGE = {
    "strings": "x = f'{1}-{2}'\nego = new Car at (0, 0)",
    "lists": "xs = [[1], [2]]\nrequire xs == [[1], [2]]\nego = new Car at (0, 0)",
    "whole numbers": "x = 2 ** 5\nego = new Car at (x, 0)",
    "calls": "def f(x):\n    return x\nego = new Car at (f(3), 0)",
    "known way": "ego = new Car at (1.75, 40)\nother = new Car following roadDirection from ego for 12",
    "rounded": "x = Range(0, 3)\nego = new Car at (0, 0)\nrequire round(x) >= 1",
    "read twice": "ego = new Car at (0, 0)\nrequire (distance from (0, 1) < 3 and distance from (1, 2) to ego < 9 "
    "and distance from (0, 2) < 3 and distance from (1, 2) to ego < 9)",
    "projected": "path = PolylineRegion([(0, 0), (10, 5), (20, -3)])\np = new Point at (Range(0, 20), 20)\n"
    "ego = new Car at path.project(p)",
    "variants": "scenario Main():\n    setup:\n        ego = new Car at (0, 0)\n    compose:\n"
    "        do choose Left(), Right()\nscenario Left():\n    setup:\n        new Car at (-9, 0)\n"
    "scenario Right():\n    setup:\n        new Car at (9, 0)",
    "monitored": "monitor M():\n    wait\n    wait\nego = new Car at (0, 0)\nrequire monitor M()",
}
LATER = """
scenario Main():
    setup:
        ego = new Object at (Range(-9, 9), Range(-9, 9)), facing Range(0, 360) deg
    compose:
        wait
        do Later()
scenario Later():
    setup:
        other = new Object at (Range(-9, 9), Range(-9, 9)), facing Range(0, 360) deg
    compose:
        while (distance from other to ego) > 1:
            wait
"""
"""Another object is there from the second sample on."""
BENT = LATER.replace("other = new Object at (Range(-9, 9), Range(-9, 9))", "x = Range(-3, 3)\n        "
                     "other = new Object at (x * x, Range(-9, 9) + x)")  # fmt: skip
OVER_TIME_ON_ROADS = {
    "directions": "other = new Car\nrequire always abs((roadDirection at other) - other.heading) < 60 deg",
}


def over_time() -> dict[int, str]:
    """Programs with choices, hidden numbers and points, and monitors, by their place in a row of random ones."""
    draw = random.Random(11)
    found = [random_program(draw) for _ in range(48)]
    chosen = (0, 1, 2, 4, 5, 6, 26, 47)
    return {number: (alike(found[number]) if number in (0, 6) else found[number]).text() for number in chosen}


# --- datasets


def stores_of(folder: Path, crossroads: Path) -> Stores:
    """Write the datasets."""
    draw = random.Random(7)
    traces = [recording_of_trace(f"r{number:02}", random_trace(draw)) for number in range(10)]
    write_dataset(folder / "time", traces, {}, name="traces")
    around = [LabelObject(f"c{k:02}", "Car", "car", 25.0, 0.1 * k, 0.0) for k in range(74)]  # nearer than the last
    around.append(LabelObject("last", "Car", "car", 5.0, 51.0, 0.0))
    ego = LabelObject("ego", "Car", "car", 5.0, 0.0, 0.0)
    many = Recording("many", "none", (Label("many-0", "many", 0, "none", ego, tuple(around)),))
    write_dataset(folder / "many", [many], {}, name="many")
    return Stores(folder, open_dataset(folder / "time"), open_dataset(crossroads), open_dataset(folder / "many"))


# --- kinds of inputs


def asked(store: str, text: str, stores: Stores, *, head: str = HEADER, **options: object) -> Query:
    """A query of one of the datasets; options are those of the query or of the match."""
    match = {name: value for name, value in options.items() if name in MatchOptions.__dataclass_fields__}
    rest = {name: value for name, value in options.items() if name not in match}
    usual = MatchOptions(**{"tolerance": TOLERANCE, "timeout_s": 20.0, **match})
    settings = QueryOptions(usual, solver="portable", time=IntervalOptions(intervals="all"))
    return Query(stores.of(store), Source("p.scenic", head + text), replace(settings, **rest))


def answers(stores: Stores, store: str, text: str, **options: object) -> Facts:
    """What is found of each frame, or of each interval and start."""
    found: Facts = {}
    for each in asked(store, text, stores, **options).results():
        verdict = each.verdict
        roles = () if each.interval is None else tuple(sorted(verdict.correspondence.items()))
        if isinstance(verdict, Match):
            found[each.frame, roles, each.interval and each.interval.last] = "match"
            if each.interval is not None and each.interval.open_ended:
                found[each.frame, roles, "longer"] = "unknown"
        elif isinstance(verdict, Unknown):
            found[each.frame, "open"] = "unknown"
            found[each.frame, roles, "open"] = "unknown"
    return found


def told(lines: object) -> Facts:
    """What people are told."""
    return {("told",): repr(lines)}


def compiled(stores: Stores, text: str, **_: object) -> Facts:
    """A program that is compiled."""
    return told(compile_scenario(Source("p.scenic", HEADER + text), street(), behaviors="guards") is not None)


def modes(stores: Stores, **_: object) -> Facts:
    """The modes of a program."""
    text = "behavior B():\n    while self.speed > 1:\n        wait\nego = new Car at (0, 0), with behavior B()"
    return told(show_modes(compile_scenario(Source("p.scenic", HEADER + text), street(), behaviors="guards")))


def near_frames(stores: Stores, text: str, **_: object) -> Facts:
    ranked = nearest_misses(asked("crossroads", text, stores), 2)
    return told([(each.frame, each.verdict) for each in ranked])


def near_recordings(stores: Stores, text: str, **options: object) -> Facts:
    query = asked("crossroads", text, stores)
    query = replace(query, options=replace(query.options, time=IntervalOptions(**options)))
    return told([(each.recording, each.verdict) for each in nearest_intervals(query, 3)])


def why_no_interval(stores: Stores, text: str, recording: str, **_: object) -> Facts:
    with LazySolver("portable") as solver:
        return told(explain_recording(asked("crossroads", text, stores), solver, recording, None))


def why_no_frame(stores: Stores, text: str, **_: object) -> Facts:
    query = asked("turned", text, stores)
    matcher = Matcher(query.compile("street")[0], query.options.match)
    names = [f"frame-{number:04}" for number in range(4)]
    return told([show_explanation(explain(matcher, label)) for label in query.dataset.labels(names)])


def advised(stores: Stores, text: str, *, brief: bool = False, sampled: bool = False, **_: object) -> Facts:
    query = asked("crossroads", text, stores)
    list(query.results())
    with pytest.MonkeyPatch.context() as patch:
        if sampled:
            patch.setattr(LIMITS, "advice_frames", 10)
        return told(advice(query, brief=brief))


def fact(answer: Answer) -> Facts:
    """What a solver answers."""
    said = {Sat: "match", NoAnswer: "unknown"}.get(type(answer))
    return {("question",): said} if said else {}


class Lost:
    """A solver that is lost where there are alternatives."""

    def loads(self) -> bool:
        """It is there."""
        return True

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Decide a problem."""
        if len(parts(LogicOp.OR, problem.constraint)) > 1:
            return NoAnswer("budget")
        return built_in.check(problem, precision=precision, timeout_s=timeout_s)


def by_cases(stores: Stores, **_: object) -> Facts:
    """A question that is asked again case by case."""
    either = disjunction([compare("<", Var("x"), number(-1.0)), compare("<", number(0.5), Var("x"))])
    return fact(check_by_cases(Lost(), Problem((X,), either), precision=1e-3, timeout_s=5.0))


def held_box(stores: Stores, **_: object) -> Facts:
    """Whether a region that is not convex may hold a box somewhere."""
    region = PolygonSet((polygon([(0, 0), (12, 0), (12, 5), (5, 5), (5, 12), (0, 12)]),), "ell")
    terms = BoxTerms.of(
        (apply(ArithmeticOp.MUL, number(9.0), Var("x")), number(2.0)), number(0.0), number(1.0), number(2.0)
    )
    try:
        formula = box_holds(terms, region, ((0.0, 9.0), (2.0, 2.0)))
    except CannotEvaluate:
        return fact(NoAnswer("unsupported"))
    return fact(built_in.check(Problem((X,), formula), precision=1e-3, timeout_s=5.0))


def worker(stores: Stores, **_: object) -> Facts:
    """A question to a solver in a process of its own."""
    with WorkerSolver("built_in:check") as solver:
        answer = solver.check(Problem((X,), compare("<", Var("x"), number(0.5))), precision=1e-3, timeout_s=20.0)
    return (
        {("question",): "match" if isinstance(answer, Sat) else "unknown"} if isinstance(answer, Sat | NoAnswer) else {}
    )


def command(stores: Stores, **_: object) -> Facts:
    """A question to a solver that is a command."""
    script = "import sys; sys.stdin.read(); print('sat'); print('((x 0.25))')"
    with SmtlibSolver(f'{sys.executable} -c "{script}"') as solver:
        answer = solver.check(Problem((X,), compare("<", Var("x"), number(0.5))), precision=1e-3, timeout_s=20.0)
    return (
        {("question",): "match" if isinstance(answer, Sat) else "unknown"} if isinstance(answer, Sat | NoAnswer) else {}
    )


class Fan:
    """Two directions at every place."""

    name = "fan"

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The directions at a place."""
        return x, y


def replayed(stores: Stores, **_: object) -> Facts:
    """A witness for which a field points the second of two ways."""
    turn = DirectionAt(Constant(Fan()), c((0.3, 0.4)))
    held = replay([compared("heading", turn, 0.4)], {}, EXACT, 0.0)
    return {("witness",): "match" if held else "unknown"}


def about_fields(stores: Stores, **_: object) -> Facts:
    """Cars beside each other in a field that points another way in each of its squares; they share a number."""
    found: Facts = {}
    rng = random.Random(1)
    with pytest.MonkeyPatch.context() as patch:
        # no witness is found by trial before
        patch.setattr(field_solver, "find_witness", lambda *_, **__: None)
        for number in range(2):
            field, value = patchwork(rng, 4), rng.uniform(0.5, 5.5)
            cars = [Beside(field, rng.uniform(0.0, 3 * SIDE - 2.0), k, 12.0) for k in range(rng.choice((2, 3)))]
            seen = [car.seen(rng.choice((value, rng.uniform(0.0, 6.0))), rng) for car in cars]
            shared = between(0.0, 6.0)
            parts = [car.items(shared, each) for car, each in zip(cars, seen, strict=True)]
            outcome = finish(field_solver.search_directions(parts, shared.identity, EXACT))
            if not isinstance(outcome, Refuted):
                found[(number,)] = "match" if isinstance(outcome, Satisfied) else "unknown"
    return found


def drawn(stores: Stores, **_: object) -> Facts:
    """Points of regions that are hard to hit."""
    thin = PolygonSet((box(0.0, 0.0, 1000.0, 1000.0),), "wide")
    regions = (
        Disc((0.0, 0.0), 3.0),
        IntersectionOf((thin, Disc((-1.0, -1.0), 1.5))),
        IntersectionOf((thin, PolygonSet((box(999.999, 999.999, 1200.0, 1200.0),), "corner"))),
    )
    rng = random.Random(1)
    found: list[object] = []
    for region in regions:
        try:
            found.append(sampler(region)(rng))
        except ValueError as error:
            found.append(str(error))
    return told(found)


X = Variable("x", 0.0, 1.0)

TOO_CLOSE = (
    "ego = new Car on road\nwalker = new Pedestrian on sidewalk, facing Range(0, 360) deg\n"
    "require (distance to walker) < 2\n"
)
TWO_REASONS = "ego = new Car\nother = new Car\nrequire (distance to other) < 0.1\nrequire ego.speed > 900\n"

INPUTS: Mapping[str, Callable[..., Facts]] = {
    **{f"frames: {name}": functools.partial(answers, store=name, text=PROGRAMS[name]) for name in FRAMES},
    **{f"frames: {name}": functools.partial(answers, store=name, text=text) for name, text in EXTRA.items()},
    **{
        f"{who}: {name}": functools.partial(answers, store=name, text=PROGRAMS[name], method="smt", solver=solver)
        for name in BY_SOLVER
        for who, solver in (("built in", "portable"), ("solver", "dreal"))
    },
    **{
        f"solver: {name}": functools.partial(answers, store=name, text=EXTRA[name], method="smt", solver="dreal")
        for name in ("whole numbers", "many whole numbers", "near the curb", "rounded", "crossing spot")
    },
    **{
        f"ids: {name}": functools.partial(answers, store=name, text=PROGRAMS[name], proofs=False)
        for name in ("figure 3", "crowd", "row")
    },
    **{f"time: {n}": functools.partial(answers, store="time", text=text) for n, text in over_time().items()},
    "time, solver: 1": functools.partial(answers, store="time", text=over_time()[1], method="smt", solver="dreal"),
    **{
        f"roads: {name}": functools.partial(answers, store="crossroads", text="ego = new Car\n" + text)
        for name, text in OVER_TIME_ON_ROADS.items()
    },
    "many": functools.partial(
        answers,
        store="many",
        text="ego = new Object at (Range(0, 9), Range(-9, 9))\n"
        "other = new Object offset by (Range(-1, 1), Range(50, 52))",
        head="",
        prefilter=False,
    ),
    **{f"language: {name}": functools.partial(compiled, text=text) for name, text in LANGUAGE.items()},
    "language: modes": modes,
    "time: later": functools.partial(answers, store="time", text=LATER, head=""),
    "time: later, bent": functools.partial(answers, store="time", text=BENT, head=""),
    "question: cases": by_cases,
    "question: box": held_box,
    "worker": worker,
    "command": command,
    "fields": about_fields,
    "replayed": replayed,
    "draws": drawn,
    "near: frames": functools.partial(near_frames, text="ego = new Car\nother = new Car ahead of ego by Range(4, 10)"),
    "near: number": functools.partial(
        near_recordings,
        text="ego = new Car\nparked = new Car\nrequire (distance to parked) < 30\nrequire always parked.speed < 0.2\n",
    ),
    "near: duration": functools.partial(
        near_recordings, text="ego = new Car\nother = new Car ahead of ego by Range(3, 20)\n", min_duration_s=20.0
    ),
    "why: interval": functools.partial(
        why_no_interval,
        text="ego = new Car\nother = new Car\nrequire always ego.speed < 7.5\nterminate after 3 seconds\n",
        recording="05-two-lane-traffic",
    ),
    "why: frame": functools.partial(why_no_frame, text=EXTRA["turned"]),
    "advice": functools.partial(advised, text=TOO_CLOSE),
    "advice: brief": functools.partial(advised, text=TOO_CLOSE, brief=True),
    "advice: sampled": functools.partial(advised, text=TOO_CLOSE, sampled=True),
    "advice: brief, sampled": functools.partial(advised, text=TOO_CLOSE, brief=True, sampled=True),
    "advice: pairs": functools.partial(advised, text=TWO_REASONS),
    "advice: brief pairs": functools.partial(advised, text=TWO_REASONS, brief=True),
}
"""What is asked, by name."""
