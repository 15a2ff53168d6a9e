"""What is done with intervals does not depend on whether the objects of a frame are named after their tracks."""

import json
import re

import pytest

from scenicq.importers.ingest import ingest

PROGRAM = """ego = new Object in CircularRegion((0, 0), 20), facing Range(0, 360) deg
other = new Object at (Range(9, 12), Range(-1, 1)), facing Range(-1, 1) deg
require always (distance to other) < 20
terminate when other.position.x > 11
"""


def box(name, track, x):
    place = {"position": [x, 0.0], "heading": 0.0, "length": 4.0, "width": 2.0}
    return {"id": name, "track": track, "class": "Car", **place}


def _dataset(folder, name_of):
    source = folder / "source"
    source.mkdir(parents=True)
    labels = [
        {
            "id": f"{recording}{number}", "recording": recording, "timestamp_us": 500_000 * number, "map": "town",
            "ego": box("ego", "e", 0.0),
            "objects": [box(name_of(number), "t", 9.5 + 0.5 * number), box(name_of(number + 7), "u", 300.0 + number)],
        }
        for recording in "pq"
        for number in range(5)
    ]  # fmt: skip
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    header = {"name": "d", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    ingest(source, folder / "d")
    return folder / "d"


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--rank",),
        ("--rank", "--format", "csv"),
        ("--rank", "--all-matches"),
        ("--sample", "1", "--diverse", "--rank"),
        ("--near", "1"),
        ("--report", "REPORT"),
        ("--export", "paths", "EXPORT"),
    ],
)
@pytest.mark.one_in(8)
@pytest.mark.slow
def test_objects_that_are_named_anew_in_each_frame(run, tmp_path, words):
    texts = []
    for kind, name_of in (("same", {**dict.fromkeys(range(5), "t"), **dict.fromkeys(range(7, 12), "u")}.get),
                          ("other", "box{}".format)):  # fmt: skip
        folder = _dataset(tmp_path / kind, name_of)
        (tmp_path / f"{kind}.scenic").write_text(PROGRAM)
        more = [str(tmp_path / kind / word) if word.isupper() else word for word in words]
        done = run("match", tmp_path / f"{kind}.scenic", folder, *more)
        assert done.exit_code == 0, done.stderr
        lines = done.stdout.replace(f"{kind}.scenic", "p.scenic")
        texts.append(re.sub("d@[0-9a-f]{8}", "d", lines))
    assert texts[0] == texts[1]
    assert texts[0]
    if "--rank" in words and "csv" not in words:
        logs = [json.loads(line)["log_density"] for line in texts[0].splitlines()]
        assert None not in logs, texts
