"""Several models on the same frames: the paired comparison, how often it is wrong, and all that shows it."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import Result
from numpy.typing import NDArray

import scenicq
from scenicq.errors import DataError
from scenicq.evaluate.evaluation import ModelsEvaluation, evaluate, evaluate_models, name_models
from scenicq.evaluate.paired_models import PairedComparison, compare_pair
from scenicq.evaluate.resampling import discordance_test
from scenicq.evaluate.rows import evaluation_record
from scenicq.importers.prediction_files import read_predictions
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query
from scenicq.store.dataset import Dataset

PARKED = Path(__file__).parents[3] / "sample_data" / "parked"
Bools = NDArray[np.bool_]

Drawn = tuple[Bools, Bools, NDArray[np.int64]]
"""What the model misses, what the baseline misses, and clusters."""


def independent(rng: np.random.Generator, more: float) -> Drawn:
    cluster = np.repeat(np.arange(30), 12)
    return rng.random(360) < 0.15 + more, rng.random(360) < 0.15, cluster


def shared_rates(rng: np.random.Generator, more: float) -> Drawn:
    """Recordings are easy or hard for both."""
    cluster = np.repeat(np.arange(30), 12)
    rate = rng.beta(1, 6, 30)[cluster]
    return rng.random(360) < rate + more, rng.random(360) < rate, cluster


def own_rates(rng: np.random.Generator, more: float) -> Drawn:
    """Each model has recordings that it finds hard."""
    cluster = np.repeat(np.arange(30), 12)
    return (
        rng.random(360) < rng.beta(1.5, 8.5, 30)[cluster] + more,
        rng.random(360) < rng.beta(1.5, 8.5, 30)[cluster],
        cluster,
    )


def unequal(rng: np.random.Generator, more: float) -> Drawn:
    """Four long recordings and 26 short ones, with rates of their own."""
    cluster = np.repeat(np.arange(30), [100] * 4 + [4] * 26)
    first, second = (rng.beta(1.5, 8.5, 30)[cluster] for _ in range(2))
    return rng.random(len(cluster)) < first + more, rng.random(len(cluster)) < second, cluster


def tracks(rng: np.random.Generator, more: float) -> Drawn:
    """Who is missed once is missed in all six frames."""
    cluster = np.repeat(np.arange(30), 12)
    first, second = (np.repeat(rng.random(60), 6) for _ in range(2))
    return first < 0.15 + more, second < 0.15, cluster


def rare(rng: np.random.Generator, more: float) -> Drawn:
    cluster = np.repeat(np.arange(30), 12)
    return rng.random(360) < 0.01 + more, rng.random(360) < 0.01, cluster


LAYOUTS = (independent, shared_rates, own_rates, unequal, tracks, rare)


def judged(draw: Callable[[np.random.Generator, float], Drawn], more: float, count: int) -> list[PairedComparison]:
    found: list[PairedComparison] = []
    for seed in range(count):
        rng = np.random.default_rng((seed, LAYOUTS.index(draw)))
        model, baseline, cluster = draw(rng, more)
        found.append(compare_pair("objects", model, baseline, np.ones(len(model), dtype=np.bool_), cluster, rng))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("draw", LAYOUTS)
def test_models_that_miss_alike_are_told_apart_as_rarely_as_said(draw) -> None:
    """Nominal are 2.5 % either way; 400 datasets know that to 1.6 points (two standard errors)."""
    found = judged(draw, 0.0, 400)
    for word in ("worse", "better"):
        assert sum(each.says == word for each in found) <= 0.041 * len(found)
    held = [each.interval[0] <= 0 <= each.interval[1] for each in found if not math.isnan(each.interval[0])]
    assert np.mean(held) >= 0.93 - 0.022


@pytest.mark.slow
@pytest.mark.parametrize("draw", [independent, rare])
def test_a_planted_difference_is_told_and_held(draw) -> None:
    found = judged(draw, 0.1, 400)
    assert sum(each.says == "worse" for each in found) > 0.85 * len(found)
    assert not any(each.says in ("better", "no worse") for each in found)
    assert np.mean([each.interval[0] <= 0.1 <= each.interval[1] for each in found]) >= 0.93 - 0.022


def test_few_datasets_of_models_that_miss_alike() -> None:
    found = judged(own_rates, 0.0, 40)
    assert sum(each.says in ("worse", "better") for each in found) <= 6
    assert sum(each.says == "worse" for each in judged(independent, 0.15, 10)) >= 9


def test_the_figures_are_those_of_loops() -> None:
    rng = np.random.default_rng(3)
    model, baseline, cluster = own_rates(rng, 0.1)
    mine = rng.random(len(model)) < 0.7
    found = compare_pair("objects", model, baseline, mine, cluster, rng)
    pairs = [(bool(a), bool(b)) for a, b, c in zip(model, baseline, mine, strict=True) if c]
    assert found.share.of == found.other.of == len(pairs)
    assert found.only_model == sum(a and not b for a, b in pairs)
    assert found.only_baseline == sum(b and not a for a, b in pairs)
    assert found.difference == pytest.approx(sum(a - b for a, b in pairs) / len(pairs))
    turned = compare_pair("objects", baseline, model, mine, cluster, np.random.default_rng(3))
    assert turned.difference == -found.difference
    assert turned.interval == pytest.approx((-found.interval[1], -found.interval[0]))


def test_what_too_few_clusters_say() -> None:
    """Five recordings have no verdict, four no interval, and equal models need no test."""
    rng = np.random.default_rng(1)
    of = {count: np.repeat(np.arange(count), 40) for count in (4, 5, 60)}
    apart = {count: rng.random(len(each)) < 0.4 for count, each in of.items()}
    for count in (4, 5):
        nothing = np.zeros(40 * count, dtype=np.bool_)
        found = compare_pair("objects", apart[count], nothing, ~nothing, of[count], rng)
        assert found.says == "too little"
        assert math.isnan(found.interval[0]) == (count == 4)
        assert "equally large recordings" in found.because
    mine = np.ones(2400, dtype=np.bool_)
    equal = compare_pair("objects", apart[60], apart[60], mine, of[60], rng)
    assert (equal.difference, equal.says, equal.more) == (0, "no worse", None)
    assert math.isnan(equal.p_value)
    nobody = compare_pair("objects", apart[60], apart[60], ~mine, of[60], rng)
    assert nobody.says == "too little"
    assert "no object in common" in nobody.sentence


@pytest.mark.parametrize(("first", "second"), [(0, 0), (7, 0), (3, 9), (20, 20), (1, 1), (40, 25)])
def test_the_test_of_discordant_pairs_is_the_sum_of_its_terms(first, second) -> None:
    of = first + second
    chances = [math.comb(of, k) / 2**of for k in range(of + 1)]
    below, above = sum(chances[:first]), sum(chances[first + 1 :])
    wanted = min(1.0, 2 * (min(below, above) + chances[first] / 2))
    assert discordance_test(first, second) == pytest.approx(wanted)


def test_models_are_called_by_what_tells_them_apart() -> None:
    paths = [Path("runs/a/found.json"), Path("runs/b/found.json"), Path("c.jsonl")]
    assert name_models(paths[1:]) == ("found.json", "c.jsonl")
    assert name_models(paths) == ("a/found.json", "b/found.json", "c.jsonl")
    for wrong in ([paths[0], paths[0]], []):
        with pytest.raises(DataError) as caught:
            name_models(wrong)
        assert caught.value.diagnostics[0].code == "option-invalid"


@pytest.fixture(scope="module")
def better(street: Dataset) -> Path:
    """A file of a model that finds every second parked car, too."""
    lines = [json.loads(line) for line in (PARKED / "predictions.jsonl").read_text().splitlines()]
    labels = {label.frame: label for label in street.labels()}
    for number, line in enumerate(lines):
        for each in labels[line["id"]].objects:
            if each.id == "parked" and number % 2:
                box = {"class": "Car", "position": [each.x, each.y], "heading": each.heading, "width": each.width,
                       "length": each.length, "score": 0.9}  # fmt: skip
                line["objects"] = [*line["objects"], box]
    file = street.path.parent / "better.jsonl"
    file.write_text("\n".join(map(json.dumps, lines)))
    return file


@pytest.fixture(scope="module")
def both(street: Dataset, better: Path) -> ModelsEvaluation:
    query = Query(street, read_program(PARKED / "parked_car.scenic"))
    return evaluate_models(
        {"parked_car": query}, street, {"old": PARKED / "predictions.jsonl", "new": better}
    )  # fmt: skip


def test_each_model_has_the_figures_that_it_has_by_itself(both: ModelsEvaluation, street: Dataset) -> None:
    """All but the correction, which is of all tests of a command."""
    query = Query(street, read_program(PARKED / "parked_car.scenic"))
    alone = evaluate({"parked_car": query}, street, PARKED / "predictions.jsonl").scenarios[0]
    beside = both.models["old"].scenarios[0]
    for one, other in zip((*alone.roles, alone.all_objects), (*beside.roles, beside.all_objects), strict=True):
        assert replace(other, p_corrected=one.p_corrected) == one
        assert other.p_corrected >= one.p_corrected
    assert [each.share for each in beside.slices] == [each.share for each in alone.slices]


def test_the_model_that_was_mended_is_better(both: ModelsEvaluation) -> None:
    role, of_all, elsewhere = both.pairs
    assert (role.scenario, role.model, role.baseline) == ("parked_car", "new", "old")
    assert [each.about for each in both.pairs] == ["role parkedCar", "all objects", "objects of the other frames"]
    old, new = (each.scenarios[0].roles[0].share for each in both.models.values())
    assert role.share.missed == role.only_model + (old.missed - role.only_baseline)
    assert new.missed <= role.share.missed < role.other.missed
    assert role.says == "better"
    assert role.interval[1] < 0
    assert role.sentence.startswith("new missed ")
    assert "better than old" in role.sentence
    assert (elsewhere.only_model, of_all.only_model) == (0, 0)


def test_only_objects_that_count_for_both_are_compared(street: Dataset, better: Path) -> None:
    """A model that speaks of half of the frames is compared on them."""
    query = Query(street, read_program(PARKED / "parked_car.scenic"))
    whole = read_predictions(better)
    half = whole.taken(np.flatnonzero(whole.frame < len(whole.frames) // 2))
    half = replace(half, frames=whole.frames[: len(whole.frames) // 2])
    found = evaluate_models({"a": query}, street, {"half": half, "whole": whole}, missing="skip")
    for each in found.pairs:
        assert (each.only_model, each.only_baseline, each.difference) == (0, 0, 0)
    of = [sum(one.share.of for one in found.pairs[1:])]
    counted = found.models["half"].detection.object_class >= 0
    assert of == [counted.sum()]
    assert counted.sum() < (found.models["whole"].detection.object_class >= 0).sum()


def test_the_command_shows_both_in_every_format(
    run: Callable[..., Result], street: Dataset, better: Path, both: ModelsEvaluation, tmp_path: Path
) -> None:
    words = ["evaluate", PARKED / "parked_car.scenic", street.path, "--predictions", PARKED / "predictions.jsonl",
             "--predictions", better]  # fmt: skip
    table = run(*words, "--report", tmp_path / "pages").stdout
    renamed = [replace(each, model="better.jsonl", baseline="predictions.jsonl") for each in both.pairs]
    lines = table.splitlines()
    assert [line for line in lines if line in {each.sentence for each in renamed}] == [
        each.sentence for each in renamed
    ]
    assert lines.index("predictions.jsonl") < lines.index("better.jsonl")
    record = json.loads(run(*words, "--format", "json").stdout)
    assert [each["sentence"] for each in record["pairs"]] == [each.sentence for each in renamed]
    for (name, of_command), of_python in zip(record["models"].items(), both.models.values(), strict=True):
        plain = json.loads(json.dumps(evaluation_record(of_python)))
        assert of_command == plain | {"warnings": [f"{name}: {each.partition(': ')[2]}" for each in plain["warnings"]]}
    rows = list(csv.DictReader(io.StringIO(run(*words, "--format", "csv").stdout)))
    pairs = [row for row in rows if row["table"] == "pairs"]
    assert [(row["about"], row["model"], row["group"]) for row in pairs] == [
        (each.about, each.model, each.baseline) for each in renamed
    ]
    assert {row["model"] for row in rows} == {"better.jsonl", "predictions.jsonl"}
    done = run(*words, "-o", tmp_path / "figures.parquet")
    assert done.exit_code == 0
    assert pq.read_table(tmp_path / "figures.parquet").num_rows == len(rows)
    page = (tmp_path / "pages" / "index.html").read_text(encoding="utf-8")
    anchors = re.findall(r' id="([^"]+)"', page)
    assert len(set(anchors)) == len(anchors)
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(anchors)
    assert page.count("Worst frames") == 2
    assert renamed[0].sentence.replace("<", "&lt;") in page


@pytest.mark.parametrize(
    "more", [("--predictions", PARKED / "predictions.jsonl"), ("--simulated", PARKED / "runs.csv")]
)
def test_what_several_models_cannot_have(run: Callable[..., Result], street: Dataset, better: Path, more) -> None:
    words = [PARKED / "predictions.jsonl", better]
    done = run("evaluate", PARKED / "parked_car.scenic", street.path, *(w for each in words for w in
               ("--predictions", each)), *more)  # fmt: skip
    assert done.exit_code == 2
    assert done.stderr.count("error[option-invalid]") == 1


def test_a_notebook_has_several_models(street: Dataset, better: Path, both: ModelsEvaluation) -> None:
    found = scenicq.open(street.path).match((PARKED / "parked_car.scenic").read_text())
    told = found.evaluate([PARKED / "predictions.jsonl", better])
    assert [each.split(" of ")[1:] for each in told.sentences] == [
        replace(each, model="better.jsonl", baseline="predictions.jsonl").sentence.split(" of ")[1:]
        for each in both.pairs
    ]
    assert told._repr_html_().count("<h4>") == 2


def test_warnings_of_one_model_do_not_name_it(street: Dataset) -> None:
    program = (PARKED / "parked_car.scenic").read_text() + "\nrequire (distance to parkedCar) < 7\n"
    told = scenicq.open(street.path).match(program).evaluate(PARKED / "predictions.jsonl").evaluation
    (warning,) = [each for each in told.warnings if each.code == "no-verdict"]
    assert warning.message.startswith("program: no verdict on role parkedCar")
