"""What an ingest writes, every reader takes: no value of a source, whatever it is, makes an unsound dataset."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.verification import verify_computed

SOURCE = Path(__file__).parents[3] / "sample_data/crossroads"
JUNK: list[Any] = [
    *("", "x" * 4096, "x" * 4097, "x" * ((1 << 20) + 1), "ego", "\u202e"),
    *(-1, 0, 10**299, 10**301, -(10**301), 10**400, 2**63 - 1, -(2**63), 1e308, 1e7, 1e7 + 1, -1e-308, 3.2, 100.0),
    *(None, True, [], {}, [1e308, 1e308], [1e7, -1e7], [0.0, 2e7]),
    *({"x" * 5000: "x" * 5000}, {"x": "y" * (1 << 20)}, {"x": 10**308}, {"x": 10**301}, {"": ""}),
]


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value inside of a value, to groups as well."""
    if path:
        yield path
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inside:
        if key != 1 or "objects" not in path:  # one object stands for all
            yield from leaves(each, (*path, key))


def changed(value: Any, path: tuple[Any, ...], junk: Any) -> Any:
    made = copy.deepcopy(value)
    inner = made
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = junk
    return made


def with_everything(line: dict[str, Any]) -> dict[str, Any]:
    """A label with every field that there is."""
    more = {"z": 1.0, "pitch": 0.1, "roll": 0.1, "height": 1.5, "attributes": {"a": "b", "n": 1}}
    line["ego"] |= more | {"class": "Car"}
    line["objects"] = [each | more for each in line["objects"][:2]]
    line["params"] = {"weather": "cloudy", "lux": 3}
    line["sensors"] = {"FRONT": "front.jpg", "BACK": "back.jpg"}
    return line


def spread(pairs: list[Any], rounds: Callable[[int], int]) -> list[Any]:
    """All pairs of a place and a value, or of each place a share, another one than of the place before."""
    share = 4 // rounds(4)
    return [pair for number, pair in enumerate(pairs) if number % share == number // len(JUNK) % share]


@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.one_in(4)
@pytest.mark.slow
def test_every_field_of_a_label(tmp_path, alone, rounds):
    """Each value in place of each field, in a recording of its own or beside sound labels."""
    source = Path(shutil.copytree(SOURCE, tmp_path / "source"))
    first = with_everything(json.loads((source / "labels.jsonl").read_text().splitlines()[0]))
    lines = []
    for number, (path, junk) in enumerate(spread(list(product(leaves(first), JUNK)), rounds)):
        own = first | {"id": f"frame-{number}", "recording": f"r-{number if alone else number // 50}"}
        own["timestamp_us"] = 1_700_000_000_000_000 + 1_000_000 * number
        lines.append(changed(own, path, junk))
    assert len(lines) > rounds(1000)
    (source / "labels.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    summary = ingest(source, tmp_path / "made")
    made = open_dataset(tmp_path / "made")
    verify_computed(made)
    left = sum(each.count for each in summary.left_out if each.what == "label" and not each.kept)
    assert summary.frames + left == len(lines)
    assert summary.frames > len(lines) // 2
    assert max(len(each.message) for each in summary.diagnostics) < 6000


@pytest.mark.slow
def test_every_property_of_a_map(tmp_path):
    source = Path(shutil.copytree(SOURCE, tmp_path / "source"))
    file = source / "maps" / "crossroads.geojson"
    features = json.loads(file.read_text())["features"]
    kinds = {each["properties"]["kind"]: each["properties"] for each in features}
    lines = (source / "labels.jsonl").read_text().splitlines()[:3]
    (source / "labels.jsonl").write_text("\n".join(lines) + "\n")
    junk = [*JUNK, ["x" * 5000], ["x", "y" * 4097], [[[1e308, 1.0], [0.0, 0.0]]]]
    deep: Any = "x"
    for _ in range(100):
        deep = {"x": deep}
    more = []
    for kind, properties in kinds.items():
        shape = next(each["geometry"] for each in features if each["properties"]["kind"] == kind)
        for path in leaves({"properties": properties | {"other": 1}, "geometry": shape}):
            for value in [*junk, deep]:
                made = {"properties": properties | {"id": f"more-{len(more)}"}, "geometry": shape}
                more.append({"type": "Feature", **changed(made, path, value)} if path != ("properties", "id") else made)
    more += [
        {"type": "Feature", "geometry": features[0]["geometry"], "properties": {"id": value, "kind": "road"}}
        for value in junk
    ]
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [*features, *more]}))
    summary = ingest(source, tmp_path / "made")
    verify_computed(open_dataset(tmp_path / "made"))
    left = sum(each.count for each in summary.left_out if each.what == "map element" and not each.kept)
    made = open_dataset(tmp_path / "made", check=False).manifest.maps["crossroads"]
    assert made + left == len(features) + len(more)


@pytest.mark.parametrize("name", ["", "x" * 4097])
def test_a_map_has_a_name(tmp_path, name):
    with pytest.raises(DataError, match="the name of map"):
        ingest(SOURCE, tmp_path / "made", maps=[f"{name}={SOURCE / 'maps' / 'crossroads.geojson'}"])
