"""What a process remembers of the map at the first sample is not what stands there at later ones."""

from __future__ import annotations

import pytest

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

STREET = street()
CHANGE = 4
"""The first sample in the lane on the right."""
HEADER = "model scenic.domains.driving.model\nego = new Car\n"
FORMS = {
    "a monitor": "monitor M():\n    first = {was}\n    while {now} is first:\n        wait\n    terminate\n"
    "require monitor M()\n",
    "a name of the scene": "first = {was}\nterminate when not ({now} is first)\n",
}  # fmt: skip


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """An ego that goes over from the left lane of a road to the right one."""
    folder = tmp_path_factory.mktemp("changes") / "d"
    labels = tuple(
        Label(
            f"r-{n}", "r", 500_000 * n, STREET.name,
            LabelObject("ego", "Car", "car", 1.75 if n < CHANGE else 5.25, 20.0 + 2 * n, 0.0, velocity=(0.0, 4.0)), (),
        )
        for n in range(8)
    )  # fmt: skip
    write_dataset(folder, [Recording("r", STREET.name, labels)], {STREET.name: STREET.features}, name="d")
    return open_dataset(folder)


@pytest.mark.parametrize("kind", ["_lane", "_laneSection", "_road", "_laneGroup"])
@pytest.mark.parametrize("form", FORMS)
def test_it_ends_where_the_element_changes_and_nowhere_else(dataset, form, kind):
    text = FORMS[form].format(was=f"ego.{kind}", now=f"ego.{kind}")
    found = Query(dataset, Source("p.scenic", HEADER + text), QueryOptions()).results()
    intervals = [(each.frame, each.interval.last) for each in found if isinstance(each.verdict, Match)]
    assert intervals == ([("r-0", f"r-{CHANGE}")] if kind in ("_lane", "_laneSection") else [])
