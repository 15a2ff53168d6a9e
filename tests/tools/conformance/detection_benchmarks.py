"""Do evaluations say what the benchmarks' own evaluations say?

    python tests/tools/conformance/detection_benchmarks.py nuscenes DATAROOT PYTHON [VERSION]
    python tests/tools/conformance/detection_benchmarks.py argoverse2 FOLDER PYTHON
    python tests/tools/conformance/detection_benchmarks.py fixtures FOLDER PYTHON

PYTHON has nuscenes-devkit (1.2.0) or av2 (0.3.6) in an environment of its own. Detections are made from the labels:
moved, turned, resized, some of another class, fewer the farther away, with boxes where nothing is; half of the runs
have few different scores. DATAROOT is a nuScenes folder; labels without attributes or numbers of points get some.
FOLDER holds logs of Argoverse 2, or the `detections*.feather` and `labels.feather` of the tests of its API. All figures
of all classes must be equal to `LARGEST`.
"""

from __future__ import annotations

import json
import math
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.feather as feather

from scenicq.evaluate.benchmark import benchmark_figures
from scenicq.evaluate.classes import class_figures
from scenicq.evaluate.detection import detect
from scenicq.importers.ingest import ingest
from scenicq.importers.prediction_files import read_predictions
from scenicq.importers.predictions import NUSCENES
from scenicq.store.dataset import Dataset, open_dataset

HERE = Path(__file__).resolve().parent
LARGEST = 1e-6
SPLITS = ("mini_train", "mini_val")
VALIDATION = frozenset({"scene-0103", "scene-0916"})
"""Of nuScenes mini; its other recordings are for training."""

WHOLE = "all classes"
"""What the benchmark's totals are called."""

Figures = Mapping[str, Mapping[str, float]]


def main() -> None:
    """Compare, print, and fail where something differs."""
    which, folder, python = sys.argv[1:4]
    with tempfile.TemporaryDirectory() as temporary:
        work = Path(temporary)
        match which:
            case "nuscenes":
                found = list(of_nuscenes(Path(folder), python, sys.argv[4] if len(sys.argv) > 4 else "v1.0-mini", work))
            case "argoverse2":
                found = list(of_argoverse2(Path(folder), python, work))
            case _:
                found = list(of_fixtures(Path(folder), python, work))
    raise SystemExit(0 if found and all(found) else 1)


def theirs(python: str, *arguments: object) -> Figures:
    """The figures of a benchmark's own evaluation."""
    command = [python, "-W", "ignore", str(HERE / "benchmark_figures.py"), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    told = [line for line in done.stdout.splitlines() if line.startswith("FIGURES ")]
    if done.returncode or not told:
        raise SystemExit(done.stderr[-2000:])
    return json.loads(told[-1].removeprefix("FIGURES "))


def ours(dataset: Dataset, file: Path, *, everywhere: bool = False) -> Figures:
    """The same figures as scenicq has them, over all frames of a file."""
    predictions = read_predictions(file)
    if everywhere:
        predictions = replace(predictions, protocol=replace(predictions.protocol, roi_m=math.inf))
    detection = detect(dataset, predictions, "skip")
    weights = np.ones((2, len(detection.frames.recordings)))
    found: dict[str, dict[str, float]] = {}
    recording = detection.frames.recording.astype(np.int64)
    for each in class_figures(detection, "all", detection.covered, recording, weights, -math.inf):
        mine = found.setdefault(each.category, {})
        mine[f"{each.distance_m:g}"] = each.average_precision[0]
        mine |= {name: value for name, (value, _) in each.errors.items()}
    if (whole := benchmark_figures(detection)) is not None:
        found[WHOLE] = {whole.measure: whole.score, "mAP": whole.average_precision, **whole.errors}
    return found


def compared(title: str, mine: Figures, other: Figures, boxes: int) -> bool:
    """Whether both say the same; prints by how much they differ.

    A benchmark says 1 of an error where nothing was found and of one that it leaves out, and 0 of a class that has no
    label object; here there is no such figure.
    """
    count, worst, where = 0, 0.0, ""
    for name, figures in other.items():
        for what, value in figures.items():
            own = mine.get(name, {}).get(what)
            if own is None:
                off = 0.0 if value in (0.0, 1.0) or math.isnan(value) else math.inf
            else:
                count, off = count + 1, abs(own - value)
            if not off <= worst:
                worst, where = off, f", {name} {what}: {own} and {value}"
    extra = {name for name in mine if name not in other} - ({WHOLE} if WHOLE not in other else set())
    same = worst <= LARGEST and not extra and count > 0
    told = f"{title}: {count} figures of {len(mine)} classes, {boxes:,} boxes, at most {worst:.1e} off"
    print("equal " if same else "DIFFER", told + ("" if same else where) + "".join(sorted(extra)), flush=True)
    return same


def of_nuscenes(root: Path, python: str, version: str, work: Path) -> Iterator[bool]:
    """Compare with the devkit, on both splits of mini."""
    rng = random.Random(1)
    source = work / "nuscenes"
    shutil.copytree(root / version, source / version)
    for file in (source / version).iterdir():
        file.chmod(0o644)
    tables = {name: json.loads((source / version / f"{name}.json").read_text()) for name in
              ("sample", "scene", "sample_annotation", "instance", "category", "attribute", "map")}  # fmt: skip
    for each in tables["map"]:
        # the devkit wants the files of the masks to be there
        (source / each["filename"]).parent.mkdir(parents=True, exist_ok=True)
        (source / each["filename"]).touch()
    plant_points(tables, rng)
    plant_attributes(tables, rng)
    (source / version / "sample_annotation.json").write_text(json.dumps(tables["sample_annotation"]))
    ingest(source, work / "dataset")
    dataset = open_dataset(work / "dataset")
    scene = {each["token"]: each["name"] for each in tables["scene"]}
    for split in SPLITS:
        samples = {each["token"] for each in tables["sample"]
                   if (scene[each["scene_token"]] in VALIDATION) == (split == "mini_val")}  # fmt: skip
        for steps in (0, 20):
            results = nuscenes_boxes(tables, samples, random.Random(steps), steps)
            file = work / f"{split}-{steps}.json"
            meta = {f"use_{name}": False for name in ("camera", "lidar", "radar", "map", "external")}
            file.write_text(json.dumps({"meta": meta, "results": results}))
            boxes = sum(map(len, results.values()))
            title = f"{split}, {f'{steps} different scores' if steps else 'all scores different'}"
            yield compared(title, ours(dataset, file), theirs(python, "nuscenes", source, version, split, file), boxes)


def plant_points(tables: Mapping[str, list[dict[str, Any]]], rng: random.Random) -> None:
    """Give numbers of points, some of which are 0, to labels that have none."""
    for each in tables["sample_annotation"]:
        for name in ("num_lidar_pts", "num_radar_pts"):
            if each[name] is None:
                each[name] = rng.choice((0, 0, 1, 5))


def plant_attributes(tables: Mapping[str, list[dict[str, Any]]], rng: random.Random) -> None:
    """Give attributes to labels of a source that has none."""
    token = {each["name"]: each["token"] for each in tables["attribute"]}
    if any(each["attribute_tokens"] for each in tables["sample_annotation"]):
        return
    category = {each["token"]: each["name"] for each in tables["category"]}
    of_instance = {each["token"]: category[each["category_token"]] for each in tables["instance"]}
    for each in tables["sample_annotation"]:
        names = attributes_of(of_instance[each["instance_token"]], token)
        if names and rng.random() < 0.9:
            each["attribute_tokens"] = [token[rng.choice(names)]]


def attributes_of(category: str, known: Mapping[str, str]) -> list[str]:
    """The attributes that objects of a category may have."""
    group = category.split(".")[0 if category.startswith("vehicle") else 1] if "." in category else ""
    group = {"bicycle": "cycle", "motorcycle": "cycle"}.get(category.rpartition(".")[2], group)
    return sorted(name for name in known if name.startswith(f"{group}."))


def nuscenes_boxes(
    tables: Mapping[str, list[dict[str, Any]]], samples: set[str], rng: random.Random, steps: int
) -> dict[str, list[dict[str, Any]]]:
    """Detections of some samples, with `steps` different scores, or all of them different."""
    category = {each["token"]: each["name"] for each in tables["category"]}
    of_instance = {each["token"]: category[each["category_token"]] for each in tables["instance"]}
    attributes = {each["token"]: each["name"] for each in tables["attribute"]}
    known = {name: token for token, name in attributes.items()}
    evaluated = dict(NUSCENES.classes or {})
    names = sorted(set(evaluated.values()))
    like = {name: next(key for key, value in evaluated.items() if value == name) for name in names}
    middle = {sample: np.zeros(2) for sample in samples}
    many: dict[str, list[dict[str, Any]]] = {sample: [] for sample in samples}
    for each in tables["sample_annotation"]:
        if each["sample_token"] in many:
            many[each["sample_token"]].append(each)
    found: dict[str, list[dict[str, Any]]] = {}
    for sample in sorted(samples):
        boxes: list[dict[str, Any]] = []
        for each in many[sample]:
            middle[sample] += np.array(each["translation"][:2]) / len(many[sample])
        for each in many[sample]:
            name = evaluated.get(of_instance[each["instance_token"]])
            away = math.dist(each["translation"][:2], middle[sample])
            if name is None or rng.random() < min(0.7, 0.1 + away / 120):
                continue
            spread = rng.choice((0.1, 0.4, 1.5))
            if rng.random() < 0.07:
                name = rng.choice(names)
            for again in range(1 + (rng.random() < 0.1)):
                place = [value + rng.gauss(0, spread) * (axis < 2) for axis, value in enumerate(each["translation"])]
                boxes.append(
                    nuscenes_box(sample, name, place, each, rng, steps, attributes_of(like[name], known), again)
                )
            if rng.random() < 0.1:
                place = [value + rng.uniform(-30, 30) * (axis < 2) for axis, value in enumerate(each["translation"])]
                boxes.append(nuscenes_box(sample, name, place, each, rng, steps, attributes_of(like[name], known), 0))
        found[sample] = boxes[:500]
    return found


def nuscenes_box(
    sample: str, name: str, place: list[float], like: Mapping[str, Any], rng: random.Random, steps: int,
    attributes: list[str], again: int,
) -> dict[str, Any]:  # fmt: skip
    turn = rng.gauss(0, 0.3) + (math.pi if rng.random() < 0.05 else 0.0)
    w, x, y, z = like["rotation"]
    c, s = math.cos(turn / 2), math.sin(turn / 2)
    score = rng.random() if not steps else rng.randint(1, steps) / steps
    return {
        "sample_token": sample,
        "translation": place,
        "size": [value * rng.uniform(0.8, 1.2) for value in like["size"]],
        "rotation": [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w],
        "velocity": [rng.gauss(0, 2), rng.gauss(0, 2)],
        "detection_name": name,
        "detection_score": score * (0.8 if again else 1.0),
        "attribute_name": rng.choice(attributes) if attributes else "",
    }


def of_argoverse2(folder: Path, python: str, work: Path) -> Iterator[bool]:
    """Compare with the API on logs, inside its region of interest and everywhere."""
    source = work / "logs"
    logs = sorted(path.parent for path in folder.rglob("annotations.feather"))
    labels: list[pa.Table] = []
    for log in logs:
        shutil.copytree(log, source / "val" / log.name)
        rows = feather.read_table(log / "annotations.feather").replace_schema_metadata()
        labels.append(rows.append_column("log_id", pa.array([log.name] * len(rows))))
        plane_of_the_ground(source / "val" / log.name)
    together = pa.concat_tables(labels)
    feather.write_feather(together, work / "labels.feather")
    ingest(source, work / "dataset")
    dataset = open_dataset(work / "dataset")
    for steps in (0, 20):
        boxes = argoverse2_boxes(together, np.random.default_rng(steps), steps)
        file = work / f"{steps}.feather"
        feather.write_feather(boxes, file)
        for everywhere in (True, False):
            title = f"{f'{steps} different scores' if steps else 'all scores different'}, "
            title += "everywhere" if everywhere else "in the region of interest"
            other = theirs(python, "argoverse2", source / "val", work / "labels.feather", file, *["all"] * everywhere)
            yield compared(title, ours(dataset, file, everywhere=everywhere), other, len(boxes))


def plane_of_the_ground(log: Path) -> None:
    """The API wants a raster of heights, which says nothing of what is evaluated."""
    for file in (log / "map").glob("*___img_Sim2_city.json"):
        name = next((log / "map").glob("log_map_archive_*")).stem.split("____")[1].split("_city")[0]
        np.save(log / "map" / f"{log.name}_ground_height_surface____{name}.npy", np.zeros((2, 2), dtype=np.float16))
        file.chmod(0o644)


def argoverse2_boxes(labels: pa.Table, rng: np.random.Generator, steps: int) -> pa.Table:
    """Detections of logs, in the frames of their egos."""
    away = np.hypot(labels["tx_m"].to_numpy(), labels["ty_m"].to_numpy())
    kept = labels.take(np.flatnonzero(rng.random(len(labels)) > np.minimum(0.7, 0.1 + away / 200)))
    false = kept.take(np.flatnonzero(rng.random(len(kept)) < 0.2))
    parts: list[pa.Table] = []
    classes = np.array(sorted(set(labels["category"].to_pylist())))
    for rows, least, most in ((kept, 0.1, 1.5), (false, 5.0, 20.0)):
        count = len(rows)
        turn = rng.normal(0, 0.3, count) + np.pi * (rng.random(count) < 0.05)
        w, z = (rows[name].to_numpy() for name in ("qw", "qz"))
        c, s = np.cos(turn / 2), np.sin(turn / 2)
        spread = rng.uniform(least, most, count)
        category = np.array(rows["category"].to_pylist(), dtype=object)
        wrong = rng.random(count) < 0.07
        category[wrong] = rng.choice(classes, int(wrong.sum()))
        score = rng.random(count) if not steps else rng.integers(1, steps + 1, count) / steps
        columns: dict[str, Any] = {
            "log_id": rows["log_id"], "timestamp_ns": rows["timestamp_ns"], "category": pa.array(category.tolist()),
            "qw": c * w - s * z, "qx": np.zeros(count), "qy": np.zeros(count), "qz": c * z + s * w, "score": score,
        }  # fmt: skip
        for name in ("length_m", "width_m", "height_m"):
            columns[name] = rows[name].to_numpy() * rng.uniform(0.8, 1.2, count)
        for name, share in (("tx_m", 1.0), ("ty_m", 1.0), ("tz_m", 0.3)):
            columns[name] = rows[name].to_numpy() + share * spread * rng.normal(0, 1, count)
        parts.append(pa.table(columns))
    return pa.concat_tables(parts)


def of_fixtures(folder: Path, python: str, work: Path) -> Iterator[bool]:
    """Compare with the API on what its own tests evaluate: boxes of logs whose ego stays where it is."""
    labels = feather.read_table(folder / "labels.feather").replace_schema_metadata()
    for log in sorted(set(labels["log_id"].to_pylist())):
        target = work / "logs" / "val" / log
        (target / "map").mkdir(parents=True)
        mine = labels.filter(pc.equal(labels["log_id"], log))
        feather.write_feather(mine.drop_columns(["log_id", "score"]), target / "annotations.feather")
        times = sorted(set(mine["timestamp_ns"].to_pylist()))
        still = {"timestamp_ns": times, **{name: [float(name == "qw")] * len(times) for name in
                 ("qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")}}  # fmt: skip
        feather.write_feather(pa.table(still), target / "city_SE3_egovehicle.feather")
        nothing = {"lane_segments": {}, "drivable_areas": {}, "pedestrian_crossings": {}}
        (target / "map" / f"log_map_archive_{log}____PIT_city_0.json").write_text(json.dumps(nothing))
    ingest(work / "logs", work / "dataset")
    dataset = open_dataset(work / "dataset")
    for file in sorted(folder.glob("detections*.feather")):
        other = theirs(python, "argoverse2", work / "logs" / "val", folder / "labels.feather", file, "all")
        boxes = len(feather.read_table(file))
        yield compared(file.name, ours(dataset, file, everywhere=True), other, boxes)


if __name__ == "__main__":
    main()
