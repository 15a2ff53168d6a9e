"""What programs ask about courses, by the command's own way through a dataset, against their definition.

`tests/oracles/labels/courses.py` says where places are on courses; conditions are evaluated on that in three truth
values.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from pathlib import Path

import pytest
from courses import Course, Lanes, Sample, lanes_of

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.exporters.sample import sample_labels
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.advice import advice
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

HEAD = (
    "from scenicq.labels import along, beside, corridor, course\n"
    "ego = new Object at (Range(-999, 999), Range(-999, 999)), facing Range(0, 360) deg\n"
    "c = new Object at (Range(-999, 999), Range(-999, 999)), facing Range(0, 360) deg\n"
)
Interval = tuple[float, float]


def _less(one: Interval, other: Interval) -> bool | None:
    return True if one[1] < other[0] else False if one[0] >= other[1] else None


def _both(*parts: bool | None) -> bool | None:
    return False if False in parts else None if None in parts else True


def _not(part: bool | None) -> bool | None:
    return None if part is None else not part


def _known(number: float) -> Interval:
    return number, number


def _size(one: Interval) -> Interval:
    low, high = one
    return (0.0 if low < 0 < high else min(abs(low), abs(high))), max(abs(low), abs(high))


CONDITIONS = {
    "0 < along(ego, c) < 20": lambda a, b, _: _both(_less(_known(0), a), _less(a, _known(20))),
    "along(ego, c) < -3": lambda a, b, _: _less(a, _known(-3)),
    "not (along(ego, c) > 8)": lambda a, b, _: _not(_less(_known(8), a)),
    "abs(beside(ego, c)) < 2": lambda a, b, _: _less(_size(b), _known(2)),
    "beside(ego, c) > 1 or along(ego, c) > 40": lambda a, b, _: _not(
        _both(_not(_less(_known(1), b)), _not(_less(_known(40), a)))
    ),
    "10 - 2 * along(ego, c) > 4": lambda a, b, _: _less(a, _known(3)),
    "5 < along(c, ego)": lambda a, b, other: _less(_known(5), other),
    "max(along(ego, c), along(c, ego)) < 12": lambda a, b, other: _both(
        _less(a, _known(12)), _less(other, _known(12))
    ),
}  # fmt: skip
THRESHOLDS = (0, 1, 2, 3, 5, 12, 20, 30, 40, 8)


def _drive(draw: random.Random, lanes: Lanes, count: int) -> list[Sample]:
    """Along lanes where there are any, else in bends; some stand, some go back, some are seen once."""
    samples: list[Sample] = []
    t, speed = 0.0, draw.choice([0.0, 3.0, 8.0])
    aside, turn = draw.uniform(-1, 1), draw.uniform(-0.3, 0.3)
    x, y, heading, name, at = draw.uniform(-8, 8), draw.uniform(-8, 8), draw.uniform(-3, 3), "", 0.0
    if lanes:
        name = draw.choice(sorted(each for each in lanes if lanes[each].after))
        at = lanes[name].line.length - draw.uniform(0, 25)
    for _ in range(count):
        if lanes:
            line = lanes[name].line
            at = max(at, 0.0)
            a, b = line.interpolate(max(at - 0.1, 0)), line.interpolate(min(at + 0.1, line.length))
            heading = math.atan2(a.x - b.x, b.y - a.y)
            here = line.interpolate(at)
            x, y = here.x - aside * math.cos(heading), here.y - aside * math.sin(heading)
        samples.append((t, x, y, heading))
        if draw.random() < 0.2:
            speed = draw.choice([0.0, 3.0, 8.0, -2.0])
        t += 0.5 if draw.random() < 0.95 else 2.0
        at += 0.5 * speed
        heading += 0.5 * turn * (speed != 0)
        x, y = x - math.sin(heading) * speed * 0.5, y + math.cos(heading) * speed * 0.5
        if lanes and at > lanes[name].line.length and lanes[name].after:
            at -= lanes[name].line.length
            name = draw.choice(lanes[name].after)
    return samples


def _followed(draw: random.Random, ego: list[Sample]) -> list[Sample]:
    """Somewhere before or behind where the ego is."""
    ahead, aside = draw.uniform(-25, 25), draw.uniform(-3, 3)
    return [
        (t, x - ahead * math.sin(h) - aside * math.cos(h), y + ahead * math.cos(h) - aside * math.sin(h), h)
        for t, x, y, h in ego
    ]


class Drawn:
    """A dataset of recordings of an ego and one object, with what the definition says of each frame."""

    def __init__(self, folder: Path, network: Network, seed: int, recorded: int) -> None:
        draw, lanes = random.Random(seed), lanes_of(network.features)
        recordings: list[Recording] = []
        self.frames: dict[str, tuple[list, list]] = {}
        for number in range(recorded):
            name, count = f"r{number}", draw.choice([1, 5, 9])
            ego = _drive(draw, lanes, count)
            times = [each[0] for each in ego]
            its = _followed(draw, ego) if draw.random() < 0.6 else _drive(draw, lanes, count)
            other = [(t, *each[1:]) for t, each in zip(times, its, strict=True)]
            labels = []
            for k, (mine, its) in enumerate(zip(ego, other, strict=True)):
                objects = (LabelObject("o", "Car", "car", *its[1:], 1.8, 4.5, track="t"),)
                me = LabelObject("ego", "Car", "car", *mine[1:], 1.8, 4.5)
                frame = f"{name}-{k}"
                labels.append(Label(frame, name, round(mine[0] * 1e6), network.name, me, objects))
                told = Course(ego, k, lanes, 1.5).plausible(its[1:3])
                self.frames[frame] = told, Course(other, k, lanes, 1.5).plausible(mine[1:3])
            recordings.append(Recording(name, network.name, tuple(labels)))
        maps = {network.name: network.features} if network.features else {}
        write_dataset(folder, recordings, maps, name="d")
        self.dataset: Dataset = open_dataset(folder)

    def truths(self, condition: str) -> dict[str, bool | None]:
        """What a condition is in each frame in which the definition is clear."""
        found: dict[str, bool | None] = {}
        for frame, (ahead, behind) in self.frames.items():
            if len(ahead) == len(behind) == 1 and not self._at_edge(ahead[0]) and not self._at_edge(behind[0]):
                (along, beside), (other, _) = self._intervals(ahead[0]), self._intervals(behind[0])
                found[frame] = CONDITIONS[condition](along, beside, other)
        return found

    @staticmethod
    def _at_edge(place: tuple[float, float | None, int]) -> bool:
        numbers = (place[0], place[1] or 0.0)
        return any(abs(abs(each) - edge) < 0.1 for each in numbers for edge in THRESHOLDS[1:]) or abs(place[0]) < 0.1

    @staticmethod
    def _intervals(place: tuple[float, float | None, int]) -> tuple[Interval, Interval]:
        along, beside, sign = place
        lengths = (along if sign >= 0 else -math.inf), (along if sign <= 0 else math.inf)
        return lengths, (-math.inf, math.inf) if beside is None else _known(beside)


@pytest.fixture(scope="module", params=["street", "nowhere"])
def drawn(request, tmp_path_factory, rounds) -> Drawn:
    network = street() if request.param == "street" else Network("none", ())
    seed, count = 3 if network.features else 4, max(4, rounds(9))
    return Drawn(tmp_path_factory.mktemp("drawn") / "d", network, seed, count)


def _found(dataset: Dataset, text: str, **options) -> dict[str, bool | None]:
    """The verdicts of frames that match or may."""
    options.setdefault("match", MatchOptions())
    return {
        result.frame: True if isinstance(result.verdict, Match) else None
        for result in Query(dataset, Source("p.scenic", text), QueryOptions(**options)).results()
        if isinstance(result.verdict, Match | Unknown)
    }


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.slow
def test_frames_are_those_of_the_definition(drawn: Drawn, condition: str) -> None:
    text = f"{HEAD}require {condition}\n"
    found = _found(drawn.dataset, text)
    assert found == _found(drawn.dataset, text, prefilter=False)
    seen = Counter()
    for frame, truth in drawn.truths(condition).items():
        assert found.get(frame, False) is truth, (frame, drawn.frames[frame])
        seen[truth] += 1
    assert seen[True]
    assert seen[False]


def test_names_alone_are_those_of_the_matches(drawn: Drawn, rounds) -> None:
    """Where no proof is asked for, columns alone decide; what is known up to two ends proves nothing by one of them."""
    unknown = 0
    for condition in [*CONDITIONS][: max(2, rounds(4))]:
        text = f"{HEAD}require {condition}\n"
        frames = _found(drawn.dataset, text)
        names = _found(drawn.dataset, text, proofs=False)
        assert names == frames
        unknown += sum(1 for sure in frames.values() if sure is None)
    assert unknown or not drawn.dataset.network(drawn.dataset.maps[0]).features


ASKED = {
    "any": "any({} for c in others(Object))", "filtered": "len([c for c in others(Object) if {}]) == 1",
    "all": "all({} for c in others(Object))", "not all": "not any(not ({}) for c in others(Object))",
}  # fmt: skip


@pytest.mark.parametrize("form", ASKED)
@pytest.mark.one_in(8)
def test_of_others_as_much_is_known_as_of_roles(drawn: Drawn, form: str) -> None:
    head = HEAD.replace("along,", "along, others,").split("\nc = ")[0]
    for condition in CONDITIONS:
        found = _found(drawn.dataset, f"{head}\nrequire {ASKED[form].format(condition)}\n")
        for frame, truth in drawn.truths(condition).items():
            assert found.get(frame, False) is truth, (condition, frame, drawn.frames[frame])


@pytest.mark.parametrize("condition", ["0 < along(ego, c) < 20", "5 < along(c, ego)"])
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_of_others_as_much_is_known_over_time(drawn: Drawn, condition: str) -> None:
    head = HEAD.replace("along,", "along, others,").split("\nc = ")[0]
    text = f"{head}\nrequire always any({condition} for c in others(Object))\n"
    found = _found(drawn.dataset, text, time=IntervalOptions(intervals="all"))
    for frame, truth in drawn.truths(condition).items():
        assert (found.get(frame) is True) == (truth is True)


def test_a_label_from_no_store_has_the_courses_of_its_lanes() -> None:
    head = HEAD.replace("along,", "along, others,").split("\nc = ")[0]
    text = (
        "model scenic.domains.driving.model\n" + head + "\nrequire any(5 < along(c, ego) < 9 for c in others(Object))\n"
    )
    matcher = Matcher(compile_scenario(Source("p.scenic", text), street()))
    ego = LabelObject("ego", "Car", "car", 2.0, 17.0, 0.0)
    for y, holds in ((10.0, True), (11.9, True), (12.1, False), (24.0, False)):
        label = Label("f", "r", 0, "street", ego, (LabelObject("o", "Car", "car", 2.0, y, 0.0),))
        assert isinstance(matcher.match(label), Match) is holds, y


@pytest.mark.parametrize("method", ["smt", "monolithic"])
@pytest.mark.one_in(4)
@pytest.mark.slow
def test_every_method_says_the_same(drawn: Drawn, method: str) -> None:
    for condition in [*CONDITIONS][:4]:
        text = f"{HEAD}require {condition}\n"
        assert _found(drawn.dataset, text) == _found(drawn.dataset, text, match=MatchOptions(method=method))


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.one_in(9)
def test_over_time_each_sample_is_what_the_frame_is(drawn: Drawn, condition: str) -> None:
    frames = _found(drawn.dataset, f"{HEAD}require {condition}\n")
    text = f"{HEAD}require always ({condition})\n"
    found = _found(drawn.dataset, text, time=IntervalOptions(intervals="all"))
    starts = {frame for frame, truth in found.items() if truth}
    assert starts == {frame for frame, truth in frames.items() if truth}


def test_a_corridor_holds_what_is_beside_the_course(drawn: Drawn) -> None:
    asked = _found(drawn.dataset, f"{HEAD}require c.position in corridor(ego, 2)\n")
    anywhere = "c = new Object at (Range(-999, 999), Range(-999, 999))"
    placed = HEAD.replace(anywhere, "c = new Object in corridor(ego, 2)")
    loose = _found(drawn.dataset, placed)
    exact = _found(drawn.dataset, f"{HEAD}require (distance from c to course(ego)) <= 2\n")
    assert exact == asked
    boxes = _found(drawn.dataset, f"{HEAD}require c in corridor(ego, 2)\n")
    assert set(boxes) < set(asked)
    assert set(asked) <= set(loose)  # within tolerance
    clear = [frame for frame, (ahead, _) in drawn.frames.items() if len(ahead) == 1 and ahead[0][1] is not None]
    near = {frame for frame in clear if abs(drawn.frames[frame][0][0][1]) < 1.9}
    assert near
    assert near <= set(asked)


def test_gaps_cut_where_the_query_says_so(tmp_path: Path) -> None:
    """An ego that turns off after 3 s without labels: the object stands where it drives then."""
    labels = []
    for k, (t, x, y) in enumerate([(0, 0, 0), (1, 0, 10), (4, -15, 25), (5, -25, 25)]):
        ego = LabelObject("ego", "Car", "car", x, y, math.pi / 2 if k > 1 else 0.0)
        there = (LabelObject("o", "Car", "car", -20.0, 25.0, math.pi / 2, track="t"),)
        labels.append(Label(f"f{k}", "r", t * 1_000_000, "none", ego, there))
    write_dataset(tmp_path / "d", [Recording("r", "none", tuple(labels))], {}, name="d")
    text = f"{HEAD}require abs(beside(ego, c)) < 2 and along(ego, c) > 0\n"
    dataset = open_dataset(tmp_path / "d")
    assert set(_found(dataset, text)) == {"f2"}
    assert set(_found(dataset, text, time=IntervalOptions(gap_s=4.0))) == {"f0", "f1", "f2"}
    timed = f"{HEAD}require always (abs(beside(ego, c)) < 2 and along(ego, c) > 0)\n"
    assert set(_found(dataset, timed, time=IntervalOptions(intervals="all"))) == {"f2"}
    assert set(_found(dataset, timed, time=IntervalOptions(intervals="all", gap_s=4.0))) == {"f0", "f1", "f2"}


PLACED = (
    "model scenic.domains.driving.model\nfrom scenicq.labels import along, beside, corridor\nego = new Car\n"
    "lead = new Car ahead of ego by Range(1, 20)\nrequire 0 < along(ego, lead) < 30\n"
    "require abs(beside(ego, lead)) < 3\n"
)


def test_drawn_scenes_match_their_program() -> None:
    network = street()
    scenario = compile_scenario(Source("p.scenic", PLACED), network)
    labels = list(sample_labels(scenario, 12, 1))
    assert len(labels) == 12
    matcher = Matcher(scenario)
    assert all(isinstance(matcher.match(label), Match) for label in labels)


REFUSED = {
    "s = new OrientedPoint on road\nrequire along(s, c) < 3": ("wrong-type", "a hidden `OrientedPoint` has no course"),
    "require along((1, 2), c) < 3": ("wrong-type", "a tuple has no course"),
    "s = new OrientedPoint on road\nrequire along(ego, s) < 3": ("unsupported-construct", "a hidden `OrientedPoint`"),
    "require c in corridor(ego, Range(1, 2))": ("wrong-value", "a known number of metres"),
    "require c in corridor(ego, -1)": ("wrong-value", "which is positive"),
    "d = new Object at (along(ego, c), 3)": ("unsupported-construct", "in `require`"),
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_has_no_course_is_refused_by_name(line: str) -> None:
    code, words = REFUSED[line]
    with pytest.raises(ScenarioError) as error:
        compile_scenario(Source("p.scenic", f"model scenic.domains.driving.model\n{HEAD}{line}\n"), street())
    (diagnostic,) = error.value.diagnostics
    assert diagnostic.code == code
    assert words in diagnostic.message


def test_with_a_hidden_number_each_start_has_the_course_of_its_track(drawn: Drawn) -> None:
    """What a label at the start leaves of a hidden number hangs on what its object drives, in frames and over time."""
    hidden = f"{HEAD}d = Range(0, 12)\nrequire 0 < along(ego, c) + d < 6\n"
    frames = _found(drawn.dataset, hidden)
    told = drawn.truths("0 < along(ego, c) < 20")
    clear = {frame: drawn.frames[frame][0][0] for frame in told if drawn.frames[frame][0][0][2] == 0}
    assert clear
    for frame, (along, _, _) in clear.items():
        if min(abs(along + 12), abs(along - 6)) > 0.1:
            assert frames.get(frame, False) is (-12 < along < 6), frame
    over_time = f"{HEAD}d = Range(0, 12)\nrequire 0 < along(ego, c) + d < 6\nrequire always d > -1\n"
    found = _found(drawn.dataset, over_time, time=IntervalOptions(intervals="all"))
    assert {frame for frame, truth in found.items() if truth} == {frame for frame, truth in frames.items() if truth}


def test_advice_counts_by_the_courses_of_tracks(drawn: Drawn) -> None:
    text = f"{HEAD}require along(ego, c) > 3\nrequire (distance to c) < -1\n"
    query = Query(drawn.dataset, Source("p.scenic", text), QueryOptions())
    assert not [each for each in query.results() if isinstance(each.verdict, Match)]
    without = next(each for each in advice(query).outlooks if "distance" in each.change.text)
    left = _found(drawn.dataset, f"{HEAD}require along(ego, c) > 3\n")
    assert without.least == sum(1 for truth in left.values() if truth)
