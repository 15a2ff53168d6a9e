"""Invented recordings in which the truth is known: what is missed with which probability, and who plays the role.

A layout draws recordings; in each, what is missed hangs on what the layout says (distance, night, the drive) and
never on the role, unless a dataset is planted with a difference. `plant` writes a source, its predictions and the
program into a folder, and `judge` puts them through the command.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["LAYOUTS", "Judgement", "Layout", "Moment", "Planted", "judge", "match", "plant", "predict"]

Rng = np.random.Generator
Run = Callable[..., Any]
"""Runs `scenicq` with words and gives what has `exit_code`, `stdout` and `output`."""

ANYWHERE = "in everywhere, facing Range(0, 360) deg"


@dataclass(frozen=True, slots=True)
class Planted:
    """A label object.

    Attributes:
        name: Its track; unique in its frame.
        right, ahead: How far it is to the right of the ego and ahead of it, metres.
        rate: Probability that it is missed, without a difference.
        role: Whether it can play the role.
        category: Its class.
        visibility: A level; None where the source does not say.
        lasting: Whether it is missed in all frames of its recording or in none.
    """

    name: str
    right: float
    ahead: float
    rate: float
    role: bool = False
    category: str = "Car"
    visibility: str | None = None
    lasting: bool = False


@dataclass(frozen=True, slots=True)
class Moment:
    """A frame."""

    objects: Sequence[Planted]
    speed: float = 5.0
    params: Mapping[str, Any] = field(default_factory=dict)


Recording = Sequence[Moment]


def _place(name: str, near: float, far: float, category: str = "Car") -> str:
    """A line of a program: something ahead of the ego."""
    place = f"ego offset by Range(-2, 2) @ Range({near:g}, {far:g})"
    return f"{name} = new {category} at {place}, facing Range(0, 360) deg\n"


@dataclass(frozen=True, slots=True)
class Layout:
    """Recordings of one kind.

    Attributes:
        name: Short.
        what: A sentence.
        draw: Draws the recordings.
        program: Without the ego's line.
        more: By how much more objects of the role are missed where a difference is planted.
        ego: The ego's line.
        options: More words for `evaluate`.
        vary: Draws by how much more is missed in a dataset, by the number of the recording and the object.
    """

    name: str
    what: str
    draw: Callable[[Rng], Sequence[Recording]]
    program: str = _place("other", 10, 20)
    more: float = 0.2
    ego: str = f"ego = new Car {ANYWHERE}\n"
    options: tuple[str, ...] = ()
    vary: Callable[[Rng], Callable[[int, Planted], float]] | None = None

    def rates(self, recordings: Sequence[Recording], rng: Rng, more: float) -> Iterator[tuple[Planted, bool]]:
        """Every object, and whether it is missed in a dataset.

        Args:
            recordings: What was drawn.
            rng: Source of luck.
            more: By how much more objects of the role are missed.
        """
        off = self.vary(rng) if self.vary is not None else lambda _number, _each: 0.0
        for number, recording in enumerate(recordings):
            luck: dict[str, float] = {}
            for moment in recording:
                for each in moment.objects:
                    own = luck.setdefault(each.name, rng.random()) if each.lasting else rng.random()
                    yield each, own < each.rate + more * each.role + off(number, each)


def plant(layout: Layout, folder: Path, seed: int) -> Sequence[Recording]:
    """Write a source and a program; gives what was drawn."""
    rng = np.random.default_rng(seed)
    recordings = layout.draw(rng)
    source = folder / "source"
    (source / "maps").mkdir(parents=True)
    header = {"name": "planted", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    square = [[-1e4, -1e4], [1e4, -1e4], [1e4, 1e4], [-1e4, 1e4], [-1e4, -1e4]]
    ground = {"type": "Feature", "properties": {"id": "ground", "kind": "drivable"},
              "geometry": {"type": "Polygon", "coordinates": [square]}}  # fmt: skip
    (source / "maps" / "town.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [ground]}))
    with (source / "labels.jsonl").open("w") as lines:
        for number, recording in enumerate(recordings):
            for step, moment in enumerate(recording):
                lines.write(json.dumps(_label(number, step, moment)) + "\n")
    (folder / "asked.scenic").write_text("model scenic.domains.driving.model\n" + layout.ego + layout.program)
    return recordings


def _label(number: int, step: int, moment: Moment) -> dict[str, Any]:
    y = 10.0 * step
    objects = [
        {"id": each.name, "class": each.category, "track": each.name, "position": [each.right, y + each.ahead],
         "heading": 0.0, "width": 1.9, "length": 4.5, "velocity": [0, 0],
         "attributes": {} if each.visibility is None else {"visibility": each.visibility}}
        for each in moment.objects
    ]  # fmt: skip
    return {"id": f"{number:03}/{step}", "recording": f"{number:03}", "timestamp_us": 10**15 + 500_000 * step,
            "map": "town", "ego": {"position": [0.0, y], "heading": 0.0, "width": 1.9, "length": 4.5,
            "velocity": [0, moment.speed]}, "objects": objects, "params": dict(moment.params)}  # fmt: skip


def predict(layout: Layout, recordings: Sequence[Recording], file: Path, rng: Rng, more: float = 0.0) -> None:
    """Write predictions: every object where it is, but for those that are missed.

    Args:
        layout: The layout of the recordings.
        recordings: What was drawn.
        file: Where to.
        rng: Source of luck.
        more: By how much more objects of the role are missed.
    """
    told = layout.rates(recordings, rng, more)
    with file.open("w") as lines:
        for number, recording in enumerate(recordings):
            for step, moment in enumerate(recording):
                boxes = [
                    {"class": each.category, "position": [each.right, 10.0 * step + each.ahead], "heading": 0.0,
                     "width": 1.9, "length": 4.5, "score": 0.9}
                    for each, missed in itertools.islice(told, len(moment.objects))
                    if not missed
                ]  # fmt: skip
                lines.write(json.dumps({"id": f"{number:03}/{step}", "objects": boxes}) + "\n")


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the command says of the rows that answer the question.

    Attributes:
        worse, better: Whether some row is told missed more often than others, or less.
        refused: Whether it says of every row what is missing for a verdict.
        holds: Whether the interval of the first row's difference holds the truth; None without an interval.
        against: Whether the recordings are said to speak against the failure.
        text: All of it.
    """

    worse: bool
    better: bool
    refused: bool
    holds: bool | None
    against: bool
    text: str


def match(run: Run, folder: Path) -> None:
    """Ingest and match what was planted, and write simulated runs that failed often."""
    for words in (
        ("ingest", folder / "source", folder / "dataset", "-q"),
        ("match", folder / "asked.scenic", folder / "dataset", "-o", folder / "asked.jsonl", "--all-matches", "-q"),
    ):
        done = run(*words)
        assert done.exit_code == 0, done.output
    rows = "".join(f"asked,{int(number < 50)}\n" for number in range(100))
    (folder / "runs.csv").write_text("scenario,failed\n" + rows)


def judge(run: Run, folder: Path, predictions: Path, options: Sequence[str] = (), truth: float = 0.0) -> Judgement:
    """What `evaluate` says of predictions.

    Args:
        run: The command.
        folder: Where it was planted and matched.
        predictions: The file.
        options: More words.
        truth: By how much more objects of the role are missed.
    """
    done = run("evaluate", folder / "asked.jsonl", folder / "dataset", "--predictions", predictions, "--format", "json",
               "--simulated", folder / "runs.csv", *options)  # fmt: skip
    assert done.exit_code == 0, done.output
    (found,) = json.loads(done.stdout)["scenarios"]
    rows = found["roles"] or [found["all_objects"]]
    said = {row["says"] for row in rows}
    low, high = rows[0]["difference_low"], rows[0]["difference_high"]
    return Judgement(
        worse="worse" in said,
        better="better" in said,
        refused=all(row["missing"] for row in rows),
        holds=None if low is None else low <= truth <= high,
        against=found["simulated"]["says"] == "against",
        text=done.stdout,
    )


def beside(rng: Rng, count: int, near: float, far: float, rate: Callable[[float], float], first: int = 0,
           **more: Any) -> Iterator[Planted]:  # fmt: skip
    """Cars at some distance and to the left or right, never in front of the ego."""
    for number in range(count):
        away, turn = rng.uniform(near, far), rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 1.4)
        yield Planted(f"beside{first + number}", away * np.sin(turn), away * np.cos(turn), rate(away), **more)


def ahead(rng: Rng, near: float, far: float, rate: Callable[[float], float], name: str = "front",
          **more: Any) -> Planted:  # fmt: skip
    """A car in the role's place."""
    away = rng.uniform(near, far)
    return Planted(name, rng.uniform(-1.5, 1.5), away, rate(away), role=True, **more)


def always(rate: float) -> Callable[[float], float]:
    """The same at any distance."""
    return lambda _away: rate


def farther(low: float, high: float, start: float, end: float) -> Callable[[float], float]:
    """From one rate to another between two distances, as a logistic curve is."""
    return lambda away: low + (high - low) / (1 + np.exp(-(away - (start + end) / 2) / (end - start) * 6))


def _recordings(count: int, frames: int, moment: Callable[[int, int], Moment]) -> Sequence[Recording]:
    return [[moment(number, step) for step in range(frames)] for number in range(count)]


def _base(rng: Rng) -> Sequence[Recording]:
    rate = always(0.1)
    return _recordings(30, 6, lambda *_: Moment([ahead(rng, 10, 20, rate), *beside(rng, 4, 10, 20, rate)]))


def _many_candidates(rng: Rng) -> Sequence[Recording]:
    rate = farther(0.05, 0.7, 30, 50)

    def moment(*_: int) -> Moment:
        front = [ahead(rng, 30, 50, rate, f"front{number}") for number in range(4)]
        front.sort(key=lambda each: -each.ahead)
        return Moment([*front, *beside(rng, 4, 28, 52, rate)])

    return _recordings(30, 6, moment)


def _standing(rng: Rng) -> Sequence[Recording]:
    rate = farther(0.02, 0.6, 10, 60)

    def moment(number: int, step: int) -> Moment:
        standing = (number + step) % 3 == 0
        return Moment([*beside(rng, 5, 8, 60 if standing else 35, rate, role=standing)], 0.5 if standing else 8.0)

    return _recordings(30, 6, moment)


def _standing_recordings(rng: Rng) -> Sequence[Recording]:
    rate = farther(0.02, 0.6, 10, 60)

    def moment(number: int, _step: int) -> Moment:
        standing = number % 3 == 0
        return Moment([*beside(rng, 5, 8, 60 if standing else 35, rate, role=standing)], 0.5 if standing else 8.0)

    return _recordings(30, 6, moment)


def _far(rng: Rng) -> Sequence[Recording]:
    rate = farther(0.05, 0.8, 50, 100)
    return _recordings(30, 6, lambda *_: Moment([ahead(rng, 80, 100, rate), *beside(rng, 4, 52, 75, rate)]))


def _stratum(rng: Rng) -> Sequence[Recording]:
    rate = farther(0.05, 0.5, 30, 50)
    return _recordings(30, 6, lambda *_: Moment([ahead(rng, 42, 49, rate), *beside(rng, 4, 31, 40, rate)]))


def _few_controls(count: int) -> Callable[[Rng], Sequence[Recording]]:
    def draw(rng: Rng) -> Sequence[Recording]:
        rate = always(0.1)
        places = set(rng.choice(180, count, replace=False).tolist())

        def moment(number: int, step: int) -> Moment:
            others = beside(rng, 1, 10, 20, rate) if 6 * number + step in places else ()
            return Moment([ahead(rng, 10, 20, rate), *others])

        return _recordings(30, 6, moment)

    return draw


def _night(beside_by_night: int, dark: float) -> Callable[[Rng], Sequence[Recording]]:
    def draw(rng: Rng) -> Sequence[Recording]:
        def moment(number: int, _step: int) -> Moment:
            night = number % 2 == 0
            rate = always(dark if night else 0.1)
            front = [ahead(rng, 10, 20, rate)] if night else []
            others = beside(rng, beside_by_night if night else 4, 10, 20, rate)
            return Moment([*front, *others], params={"time": "night" if night else "day"})

        return _recordings(40, 6, moment)

    return draw


def _drives(rng: Rng) -> Sequence[Recording]:
    """Eight drives of five recordings."""
    rate = always(0.25)
    return _recordings(
        40,
        6,
        lambda number, _step: Moment(
            [ahead(rng, 10, 20, rate), *beside(rng, 4, 10, 20, rate)], params={"drive": f"drive{number // 5}"}
        ),
    )


def _by_drive(rng: Rng) -> Callable[[int, Planted], float]:
    """Each drive has rates of its own, for the role and for others."""
    roles, others = rng.uniform(-0.15, 0.15, 8), rng.uniform(-0.1, 0.1, 8)
    return lambda number, each: float((roles if each.role else others)[number // 5])


def _by_drive_alike(rng: Rng) -> Callable[[int, Planted], float]:
    off = rng.uniform(-0.1, 0.1, 8)
    return lambda number, _each: float(off[number // 5])


def _alone(rng: Rng) -> Sequence[Recording]:
    """A sixth of the role's objects is a kind of its own, seen in no other place, and missed more often."""

    def moment(number: int, _step: int) -> Moment:
        alone = number % 6 == 0
        rate = always(0.1)
        if alone:
            return Moment([ahead(rng, 10, 20, always(0.4), visibility="low")])
        return Moment([ahead(rng, 10, 20, rate, visibility="high"), *beside(rng, 4, 10, 20, rate, visibility="high")])

    return _recordings(30, 6, moment)


def _unseen(rng: Rng) -> Sequence[Recording]:
    """Half of the objects have a visibility, by which what is missed goes; the role's have it as often."""

    def car(of: Planted, low: bool, known: bool) -> Planted:
        return replace(of, rate=0.3 if low else 0.1, visibility=("low" if low else "high") if known else None)

    def moment(*_: int) -> Moment:
        cars = [ahead(rng, 10, 20, always(0.1)), *beside(rng, 4, 10, 20, always(0.1))]
        return Moment([car(each, rng.random() < (0.6 if each.role else 0.3), True) if rng.random() < 0.5
                       else car(each, False, False) for each in cars])  # fmt: skip

    return _recordings(30, 6, moment)


def _tracks(rng: Rng) -> Sequence[Recording]:
    """Who is missed in one frame is missed in all."""

    def recording() -> Recording:
        cars = [ahead(rng, 10, 20, always(0.2)), *beside(rng, 4, 10, 20, always(0.2))]
        return [Moment([replace(each, lasting=True) for each in cars])] * 6

    return [recording() for _ in range(40)]


def _hard_frames(rng: Rng) -> Sequence[Recording]:
    """The role is played in hard frames alone, in which more is missed of everybody."""

    def moment(*_: int) -> Moment:
        hard = rng.random() < 0.5
        rate = always(0.35 if hard else 0.1)
        return Moment([*([ahead(rng, 10, 20, rate)] if hard else []), *beside(rng, 4, 10, 20, rate)])

    return _recordings(30, 6, moment)


def _rare_misses(rng: Rng) -> Sequence[Recording]:
    rate = always(0.015)
    return _recordings(30, 6, lambda *_: Moment([ahead(rng, 10, 20, rate), *beside(rng, 4, 10, 20, rate)]))


def _unequal(rng: Rng) -> Sequence[Recording]:
    """A few long recordings and many short ones, each with its own rate."""
    sizes = [30, 24, 18, 12, *([4] * 26)]
    rates = 1 / (1 + np.exp(-rng.normal(-1.7, 0.6, len(sizes))))
    return [
        [Moment([ahead(rng, 10, 20, always(rate)), *beside(rng, 4, 10, 20, always(rate))]) for _ in range(size)]
        for size, rate in zip(sizes, rates.tolist(), strict=True)
    ]


def _few_recordings(rng: Rng) -> Sequence[Recording]:
    rates = 1 / (1 + np.exp(-rng.normal(-1.7, 0.8, 4)))
    return [
        [Moment([ahead(rng, 10, 20, always(rate)), *beside(rng, 4, 10, 20, always(rate))]) for _ in range(20)]
        for rate in rates.tolist()
    ]


def _rare_class(rng: Rng) -> Sequence[Recording]:
    """Bicycles, of which there are few; cars are missed less."""

    def moment(number: int, step: int) -> Moment:
        rate, cars = always(0.25), [*beside(rng, 3, 10, 20, always(0.05))]
        if number % 3 or step > 2:
            return Moment(cars)
        return Moment([ahead(rng, 10, 20, rate, category="Bicycle"), *cars,
                       *beside(rng, 1, 10, 20, rate, first=3, category="Bicycle")])  # fmt: skip

    return _recordings(60, 6, moment)


def _many_roles(rng: Rng) -> Sequence[Recording]:
    rate = always(0.15)

    def moment(*_: int) -> Moment:
        front = [replace(ahead(rng, 10 + 6 * n, 15 + 6 * n, rate, f"front{n}"), role=n == 0) for n in range(4)]
        return Moment([*front, *beside(rng, 6, 10, 34, rate)])

    return _recordings(30, 6, moment)


def _two_vehicles(rng: Rng) -> Sequence[Recording]:
    """Two vehicles, of which the one that plays the role more often has the worse sensor."""

    def moment(number: int, _step: int) -> Moment:
        old = number % 4 == 0
        rate = farther(0.1, 0.8, 10, 40) if old else farther(0.05, 0.5, 20, 60)
        front = [ahead(rng, 10, 40, rate)] if rng.random() < (0.9 if old else 0.2) else []
        return Moment([*front, *beside(rng, 5, 8, 45, rate)], params={"vehicle": "old" if old else "new"})

    return _recordings(40, 6, moment)


def _ahead_of(near: float, far: float) -> str:
    return _place("other", near, far)


LAYOUTS = {
    each.name: each
    for each in (
        Layout("base", "a car 10 to 20 m ahead, four beside", _base),
        Layout("many candidates", "four cars in the role's place, listed from far to near; missed more if far",
               _many_candidates, _ahead_of(30, 50)),
        Layout("standing ego", "only the ego plays a role; where it stands, labels are farther",
               _standing, "", ego=f"ego = new Car {ANYWHERE}, with speed Range(0, 1)\n"),
        Layout("standing recordings", "the same, in recordings of their own",
               _standing_recordings, "", ego=f"ego = new Car {ANYWHERE}, with speed Range(0, 1)\n"),
        Layout("far roles", "roles at 80 to 100 m, others at 52 to 75 m", _far, _ahead_of(80, 100), more=0.15),
        Layout("one stratum", "roles at 42 to 49 m, others at 31 to 40 m", _stratum, _ahead_of(42, 49)),
        Layout("6 others", "six others in all", _few_controls(6)),
        Layout("20 others", "twenty others in all", _few_controls(20)),
        Layout("night", "the role by night alone, when twice as much is missed", _night(4, 0.2)),
        Layout("dark night", "the same, four times as much", _night(4, 0.4)),
        Layout("alone by night", "the same, and no other car by night", _night(0, 0.4)),
        Layout("drives", "rates differ by drive, for the role by themselves", _drives, vary=_by_drive),
        Layout("shared drives", "rates differ by drive, for all alike", _drives, vary=_by_drive_alike),
        Layout("some alone", "17 % of the role's objects are like no other", _alone),
        Layout("hard frames", "the role in hard frames alone", _hard_frames),
        Layout("known in part", "the visibility of half of the objects is not known", _unseen),
        Layout("tracks", "who is missed once is missed always", _tracks),
        Layout("rare misses", "1.5 % are missed", _rare_misses, more=0.1),
        Layout("unequal recordings", "four long recordings and 26 short ones, with rates of their own", _unequal),
        Layout("four recordings", "four recordings with rates of their own", _few_recordings),
        Layout("rare class", "bicycles in a third of the recordings", _rare_class,
               _place("other", 10, 20, "Bicycle"), more=0.3),
        Layout("many roles", "four roles, one of which is planted", _many_roles, "".join(
            _place(f"front{n}", 10 + 6 * n, 15 + 6 * n) for n in range(4))),
        Layout("two vehicles", "the role is played before the vehicle with the worse sensor", _two_vehicles,
               _ahead_of(10, 40)),
    )
}  # fmt: skip
