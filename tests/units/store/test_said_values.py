"""What labels say beside the columns is counted by name and value."""

from __future__ import annotations

import json
import random
from collections import Counter

import pytest

from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.said_values import said_attributes, said_params
from scenicq.store.writer import write_dataset

NAMES = ["moving", "points", 'a "name"', "x/y~z", "$.p", "größe"]
VALUES = ["parked", "4", "", "true", 'say "no"', True, False, 0.0, -2.5, 1e9]


@pytest.fixture
def dataset(tmp_path):
    draw = random.Random(1)

    def some():
        return {name: draw.choice(VALUES) for name in draw.sample(NAMES, draw.randrange(len(NAMES)))}

    labels = [
        Label(
            f"{number}", "r", number * 500_000, "none", LabelObject("ego", "Car", "car", 0, 0, attributes=some()),
            tuple(LabelObject(f"{k}", "Car", "car", k, 0, attributes=some()) for k in range(4)), some(),
        )
        for number in range(20)
    ]  # fmt: skip
    write_dataset(tmp_path / "d", iter([Recording("r", "none", tuple(labels))]), {}, name="d")
    return open_dataset(tmp_path / "d")


def text_of(value):
    return json.dumps(value) if isinstance(value, bool) else value


def expected(said):
    found = {}
    for each in said:
        for name, value in each.items():
            found.setdefault(name, []).append(value)
    numbers = {name: [v for v in values if type(v) is float] for name, values in found.items()}
    return {
        name: (
            len(values),
            (min(numbers[name]), max(numbers[name])) if numbers[name] else None,
            Counter(text_of(value) for value in values if type(value) is not float),
        )
        for name, values in found.items()
    }


def told(values):
    return {name: (each.count, each.numbers, Counter(each.others)) for name, each in values.items()}


def test_values_are_counted_as_labels_have_them(dataset):
    labels = list(dataset.labels())
    everybody = [each.attributes for label in labels for each in (label.ego, *label.objects)]
    assert told(said_attributes(dataset)) == expected(everybody)
    assert told(said_params(dataset)) == expected([label.params for label in labels])
    counts = [each.count for each in said_attributes(dataset).values()]
    assert counts == sorted(counts, reverse=True)


def test_info_shows_them(run, dataset):
    shown = run("info", dataset.address).stdout
    points = said_attributes(dataset)["moving"]
    text, number = next(iter(points.others.items()))
    line = next(line for line in shown.splitlines() if line.startswith("moving "))
    assert f"{points.numbers[0]:g} to {points.numbers[1]:.6g}, {text} {number}" in line
    assert "ATTRIBUTE" in shown
    assert "PARAMETER" in shown


def test_where_nothing_is_said_nothing_is_shown(run, crossroads, tmp_path):
    label = Label("f", "r", 0, "none", LabelObject("ego", "Car", "car", 0, 0))
    write_dataset(tmp_path / "d", iter([Recording("r", "none", (label,))]), {}, name="d")
    assert "ATTRIBUTE" not in run("info", tmp_path / "d").stdout
