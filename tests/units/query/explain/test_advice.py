"""Advice for queries that find hardly anything: its numbers are those that the changed program has."""

from __future__ import annotations

import json
import random
import re
import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq import budget
from scenicq.errors import Source
from scenicq.importers.ingest import ingest
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.advice import advice
from scenicq.smt.solver import NoAnswer
from scenicq.store.dataset import open_dataset
from scenicq_cli.advise import advise

SAMPLES = Path(__file__).parents[4] / "sample_data"
TEXT = """model scenic.domains.driving.model
roadway = network.laneRegion.union(network.intersectionRegion)
ego = new Car on roadway
walker = new Pedestrian on sidewalk, facing Range(0, 360) deg
require (distance to walker) < 2
"""


@pytest.fixture(scope="module")
def dataset(crossroads):
    return open_dataset(crossroads)


def taken(dataset, text, tolerance="position=0.25,heading=5deg", **match):
    options = QueryOptions(match=MatchOptions(tolerance=parse_tolerance(tolerance), **match), solver="portable")
    query = Query(dataset, Source("p.scenic", text), options)
    list(query.results())
    return query


def test_each_number_is_that_of_the_changed_program(dataset):
    query = taken(dataset, TEXT)
    assert query.funnel.matches == 0
    found = advice(query)
    assert found.complete
    assert found.first[0] == query.funnel.excluded.most_common(1)[0]
    told = {each.change.text: each for each in found.outlooks}
    without = told["without `require (distance to walker) < 2`"]
    assert without.certain
    assert not without.sampled
    assert without.least == taken(dataset, TEXT.replace("require (distance to walker) < 2\n", "")).funnel.matches > 0
    for change, outlook in told.items():
        if change.startswith("--tolerance "):
            assert outlook.least == taken(dataset, TEXT, change.removeprefix("--tolerance ")).funnel.matches
    assert [each.least for each in found.outlooks] == sorted((each.least for each in found.outlooks), reverse=True)


def test_a_feature_is_a_change_too(dataset):
    text = TEXT.replace("< 2", "< 30").replace("facing Range(0, 360) deg", "facing Range(1, 2) deg")
    told = {each.change.text: each.least for each in advice(taken(dataset, text)).outlooks}
    loose = taken(dataset, text, "position=0.25,heading=5deg,walker.heading=180deg")
    assert told["`walker.heading` not compared"] == loose.funnel.matches > 0


def test_a_wider_class_is_a_change_too(dataset):
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Bus on road, facing Range(0, 360) deg\n"
    told = {each.change.text: each.least for each in advice(taken(dataset, text)).outlooks}
    assert told["`other` as `Vehicle`"] == taken(dataset, text.replace("Bus", "Vehicle")).funnel.matches > 0


def test_a_parameter_is_a_change_too(dataset):
    plain = TEXT.replace("< 2", "< 30")
    text = plain.replace("ego =", "param weather = 'foggy'\nego =")
    told = {each.change.text: each.least for each in advice(taken(dataset, text)).outlooks}
    assert told["--ignore-params weather"] == taken(dataset, plain).funnel.matches > 0


def test_large_datasets_are_sampled(dataset, monkeypatch):
    monkeypatch.setattr(LIMITS, "advice_frames", 100)
    query = taken(dataset, TEXT)
    assert not any(each.sampled for each in advice(query).outlooks)  # where the sample is all there is
    monkeypatch.setattr(LIMITS, "advice_frames", 10)
    found = advice(query)
    assert found.outlooks
    assert all(each.sampled for each in found.outlooks)


def test_brief_advice_is_bounded_by_work_and_says_no_more_than_all_of_it(dataset):
    query = taken(dataset, TEXT)
    brief, full = advice(query, brief=True), advice(query)
    assert not brief.complete
    known = {each.change.text: each for each in full.outlooks}
    for each in brief.outlooks:
        assert each.least <= known[each.change.text].least <= each.most


def test_brief_advice_goes_on_until_something_helps(dataset, monkeypatch):
    monkeypatch.setattr(LIMITS, "brief_changes", 1)
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Truck\nrequire (distance to other) < 1\n"
    query = taken(dataset, text)
    assert query.funnel.excluded.most_common(1)[0][0] == "other.class"
    (first, *_) = advice(query, brief=True).outlooks
    assert first.change.text == "without `require (distance to other) < 1`"


def test_an_object_at_a_side_is_told_to_be_on_a_line(dataset):
    text = (
        "model scenic.domains.driving.model\nego = new Car with speed 99\nother = new Bus left of ego by Range(1, 3)\n"
    )
    (told,) = advice(taken(dataset, text)).hints
    assert told == (
        "`left of ego by` a number leaves a line; `at ego offset by Range(-6, -1) @ Range(-5, 5)` is an area"
    )
    text = "model scenic.domains.driving.model\nego = new Car\nother = new Bus at ego offset by Range(-6, -1) @ 3\n"
    assert advice(taken(dataset, text)).hints == ()


def test_without_time_one_change_is_tried(dataset):
    query = taken(dataset, TEXT)
    found = advice(query, budget_s=0.0)
    assert not found.complete
    assert len(found.outlooks) <= 1


class _Hanging:
    """A solver that takes all the time that it is given, on clocks of its own."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        for clock in ("thread_time", "perf_counter"):
            monkeypatch.setattr(budget.time, clock, lambda: self.now_s)
        monkeypatch.setattr(LazySolver, "loads", lambda _: True)
        monkeypatch.setattr(LazySolver, "check", self.check)

    def check(self, problem: object, *, precision: float, timeout_s: float) -> NoAnswer:
        self.now_s += timeout_s
        return NoAnswer("timeout")


@pytest.mark.slow
@pytest.mark.parametrize("until_s", [None, 0.5])
def test_what_takes_all_time_has_no_more_than_the_budget(until_s, dataset, monkeypatch):
    """A label may take a minute, the advice not: neither in one label nor in all of them."""
    text = (
        "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire (distance to other) < 1\nmutate\n"
    )
    solver = _Hanging(monkeypatch)
    query = taken(dataset, text, timeout_s=60.0, method="smt")
    assert query.funnel.unknowns * 60 <= solver.now_s + 1e-6
    assert query.funnel.unknowns
    if until_s is not None:
        query.options = replace(query.options, until=time.monotonic() + until_s)
    before_s = solver.now_s
    found = advice(query, budget_s=2.0, brief=True)
    assert 0 < solver.now_s - before_s <= (until_s or 2.0) + 1e-6
    assert not found.complete
    # what nobody decided may match
    assert all(outlook.least < outlook.most for outlook in found.outlooks)


@pytest.mark.slow
def test_labels_that_had_all_their_time_have_none_left_for_advice(dataset, monkeypatch, capsys):
    text = (
        "model scenic.domains.driving.model\nego = new Car\nother = new Car\nrequire (distance to other) < 1\nmutate\n"
    )
    solver = _Hanging(monkeypatch)
    query = taken(dataset, text, timeout_s=3.0, method="smt")
    before_s = solver.now_s
    assert query.funnel.reasons["timeout"] * 3.0 == pytest.approx(before_s)
    advise(query, asked=False)
    assert solver.now_s == before_s
    assert "with one change there would be" in capsys.readouterr().err
    advise(query, asked=True)
    assert solver.now_s > before_s


@pytest.mark.slow
def test_the_command_advises_where_nothing_matches_and_when_asked(run, crossroads, scenarios, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(TEXT)
    done = run("match", file, crossroads, "--advise")
    assert (done.exit_code, done.stdout) == (1, "")
    assert done.stderr.startswith("0 matches in 156 frames; ")
    assert "without `require (distance to walker) < 2`" in done.stderr
    assert "line 5" in done.stderr
    assert run("match", file, crossroads).stderr.startswith("0 matches in 156 frames; ")
    assert run("match", file, crossroads, "--quiet").stderr == ""
    assert run("match", file, crossroads, "--limit", "3").stderr.startswith("0 matches in 156 frames; ")
    crossing = scenarios / "02_crossing_cars.scenic"
    assert run("match", crossing, crossroads).stderr == ""
    assert run("match", crossing, crossroads, "--limit", "1").stderr == ""
    asked = run("match", crossing, crossroads, "--advise")
    assert asked.exit_code == 0
    assert asked.stderr.startswith("5 matches in 156 frames; ")


@pytest.mark.parametrize(("frames", "told"), [(1000, False), (1001, True)])
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_less_than_a_frame_in_a_thousand_is_hardly_any(frames, told, run, tmp_path):
    """One match in 1,000 frames is left alone; of one in 1,001 it is said what excludes the others."""
    ego = {"position": [0, 0], "heading": 0, "width": 2, "length": 4, "class": "Car"}
    labels = (
        {
            "id": f"f{number:04}", "recording": f"r{number // 100}", "timestamp_us": number * 100_000, "map": "none",
            "ego": ego, "objects": [ego | {"id": "a", "position": [0, 10 if number == 7 else 30]}],
        }
        for number in range(frames)
    )  # fmt: skip
    source = tmp_path / "source"
    source.mkdir()
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    header = {"name": "many", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    ingest(source, tmp_path / "many")
    file = tmp_path / "p.scenic"
    placed = "in everywhere, facing Range(0, 360) deg"
    file.write_text(
        "model scenic.domains.driving.model\n"
        f"ego = new Car {placed}\nother = new Car {placed}\nrequire (distance to other) < 20\n"
    )
    done = run("match", file, tmp_path / "many", "--format", "ids")
    assert (done.exit_code, done.stdout) == (0, "f0007\n")
    first, *rest = done.stderr.splitlines() or [""]
    assert (first == "1 match in 1,001 frames; 1,000 fail first at `require (distance to other) < 20`") is told
    assert (
        any(re.match(r" +(16 to )?1,001  without `require \(distance to other\) < 20`  line 4", each) for each in rest)
        is told
    )


def test_an_interrupt_of_advice_leaves_the_results(run, crossroads, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("scenicq_cli.match.advise", interrupted)
    file = tmp_path / "p.scenic"
    file.write_text(TEXT)
    done = run("match", file, crossroads, "-o", tmp_path / "found.jsonl")
    assert (done.exit_code, done.stderr) == (130, "interrupted\n  = hint: all results are written\n")
    assert (tmp_path / "found.jsonl").exists()


def two_maps(folder, lacking=("elsewhere", "nowhere")):
    """The sample, of which every third recording lies on each of two maps that the dataset does not have."""
    source = Path(shutil.copytree(SAMPLES / "crossroads", folder / "source"))
    labels = [json.loads(line) for line in (source / "labels.jsonl").read_text().splitlines()]
    recordings = sorted({each["recording"] for each in labels})
    for each in labels:
        place = recordings.index(each["recording"]) % 3
        if place:
            each["map"] = lacking[place - 1]
    (source / "labels.jsonl").write_text("".join(json.dumps(each) + "\n" for each in labels))
    ingest(source, folder / "d")
    return open_dataset(folder / "d")


def test_frames_on_maps_that_lack_what_is_needed_are_in_no_number(tmp_path):
    dataset = two_maps(tmp_path)
    query = taken(dataset, TEXT)
    found = advice(query)
    elsewhere = sum(dataset.manifest.by_map[name].frames for name in ("elsewhere", "nowhere"))
    assert found.without_map == elsewhere > 0
    assert not found.first[0][0].startswith("map ")
    assert not any(each.sampled for each in found.outlooks)
    told = {each.change.text: each.least for each in found.outlooks}
    without = TEXT.replace("require (distance to walker) < 2\n", "")
    assert told["without `require (distance to walker) < 2`"] == taken(dataset, without).funnel.matches > 0
    (warning,) = query.funnel.warnings
    assert warning.message.startswith(f"{elsewhere} frames on 2 maps (`elsewhere`, `nowhere`) cannot match; on `else")


CLASSES = ("Car", "Bus", "Pedestrian", "Vehicle")
PLACES = ("on road", "on sidewalk, facing Range(0, 360) deg", "on intersection", "ahead of ego by Range(1, 30)",
          "in everywhere, facing Range(0, 360) deg")  # fmt: skip
REQUIREMENTS = ("(distance to a) < 12", "(distance from a to b) < 8", "a.speed > 3",
                "abs(relative heading of b) < 60 deg", "a.position in road", "b.speed < 1")  # fmt: skip
SPEEDS = ("", ", with speed Range(2, 6)", ", with width Range(1.5, 2.2)")


def drawn(seed):
    """A program of three objects and two requirements."""
    draw = random.Random(seed)
    lines = ["model scenic.domains.driving.model", "ego = new Car on road"]
    lines += [f"{name} = new {draw.choice(CLASSES)} {draw.choice(PLACES)}{draw.choice(SPEEDS)}" for name in "ab"]
    lines += [f"require {each}" for each in draw.sample(REQUIREMENTS, 2)]
    return "\n".join(lines) + "\n"


def rewritten(text, change):
    """The program and the tolerance that a user would come to who does as a change says; None where it is no such."""
    usual = "position=0.25,heading=5deg"
    if requirement := re.fullmatch(r"without `(.+)`", change.text):
        return text.replace(f"{requirement[1]}\n", ""), usual
    if change.text.startswith("--tolerance "):
        return text, change.text.removeprefix("--tolerance ")
    if feature := re.fullmatch(r"`(\w+)\.(\w+)` not compared", change.text):
        sizes = {"position": "100000", "heading": "180deg"}
        return text, f"{usual},{feature[1]}.{feature[2]}={sizes.get(feature[2], '1000')}"
    if wider := re.fullmatch(r"`(\w+)` as `(\w+)`", change.text):
        return re.sub(rf"^{wider[1]} = new \w+", f"{wider[1]} = new {wider[2]}", text, flags=re.MULTILINE), usual
    return None


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.one_in(4)
def test_whatever_the_program_a_number_is_that_of_a_run_with_the_change(dataset, seed):
    query = taken(dataset, drawn(seed))
    for each in advice(query).outlooks:
        # a class of another kind may have other defaults, which a wider class alone does not change
        found = None if each.change.both or " as `" in each.change.text else rewritten(drawn(seed), each.change)
        if found is not None:
            again = taken(dataset, *found).funnel.matches
            assert each.least <= again <= each.most, (drawn(seed), each.change.text)
            assert not each.certain or again == each.least
