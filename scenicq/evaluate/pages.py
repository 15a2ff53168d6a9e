"""The report of an evaluation: the figures, and the worst frames as pictures with both boxes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenicq.evaluate.comparison import Share
from scenicq.evaluate.detection import Detection
from scenicq.evaluate.evaluation import Evaluation, ModelsEvaluation, ScenarioEvaluation, WorstFrame
from scenicq.evaluate.rows import Table, balance_table, frame_counts, models_table, overview, tables, worst_table
from scenicq.geometry.boxes import corners
from scenicq.geometry.camera import box_corners, box_edges
from scenicq.report.backdrop import Backdrop
from scenicq.report.camera_pictures import SpaceBox, camera_image, space_box
from scenicq.report.frames import format_time
from scenicq.report.page import page
from scenicq.report.picture import View, ground, plane_of
from scenicq.report.scene import draw_object
from scenicq.report.sensors import Sensor, SensorFiles, can_make_thumbnails, roots_of
from scenicq.report.svg import Plane, element, escape, points_path
from scenicq.report.templates import markup
from scenicq.report.write import new_report
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label
from scenicq.store.remote_path import AnyPath

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["SHOWN", "write_pages"]

SHOWN = 30
"""Frames of each scenario that are shown as pictures."""

_NEAREST, _FARTHEST = 25.0, 60.0
_IMAGE = (720, 450)
"""Pixels of a camera's image at most: enough to see boxes on it."""
_FAR_M = 100.0
"""Boxes farther away than this are not drawn over the image of a camera."""
_ASKED = "asked"
"""The class of what is in question, for the style."""
_SIGNS = (
    "Pictures: label objects are green where they were found, red where they were missed, dotted where they do not "
    "count; those in question have thick lines; predictions are dashed. Over images of cameras the same boxes are "
    "drawn where the dataset knows the calibration and the heights of the boxes; cameras that show what is in question "
    "come first."
)


def write_pages(
    evaluation: Evaluation | ModelsEvaluation, dataset: Dataset, folder: AnyPath, sensors: Path | None = None
) -> AnyPath:
    """Write a page into a folder; an earlier report there is replaced when the new one is complete.

    Args:
        evaluation: What to show, of one model or of several.
        dataset: The labels.
        folder: Where to.
        sensors: The folder that the paths of sensor files start from; only the dataset's own by default.

    Returns:
        The page.

    Raises:
        DataError: target-exists, or target-unwritable.
    """
    with new_report(folder) as work:
        roots = roots_of(dataset, sensors)
        files = SensorFiles(roots, folder, work, can_make_thumbnails(), inside=True, size=_IMAGE)
        text = _text(evaluation, dataset, files)
        (work / "index.html").write_text(text, encoding="utf-8", newline="\n")
    return folder / "index.html"


def _cell(text: str) -> str:
    """A cell of a table: a figure breaks before its interval at most."""
    return text.replace(" %", "\u00a0%").replace(", ", ",\u00a0").replace("< ", "<\u00a0")


def _table(shown: Table, graphs: Sequence[str] = (), links: Sequence[str] = ()) -> Markup:
    """A table of texts.

    Args:
        shown: The table.
        graphs: A last cell of each row; none of them where there are none.
        links: The anchor that the first cell of each row leads to, where there are any.
    """
    title, head, rows = shown
    names = [name.lower() for name in head] + ["0 to 100 %"] * bool(graphs)
    return markup(
        "evaluation", "shown", title=title[:1].upper() + title[1:], head=names,
        rows=[[*map(_cell, row)] for row in rows], graphs=graphs, links=links,
    )  # fmt: skip


def _whiskers(share: Share, other: Share | None) -> str:
    """Two shares with their intervals, one over the other: the objects in question, then the others."""
    drawn: list[str] = [element("path", d="M0 12H100", class_="track")]
    for each, kind, height in ((share, "own", 7), (other, "other", 17)):
        if each is not None and not math.isnan(each.rate):
            low, high = (100 * each.rate if math.isnan(end) else 100 * end for end in each.interval)
            path = f"M{low:.1f} {height}H{high:.1f}"
            drawn.append(element("path", d=path, class_=kind))
            drawn.append(element("path", d=f"M{100 * each.rate:.1f} {height}h0", class_=f"{kind} rate"))
    return element("svg", *drawn, viewBox="-3 0 106 24", preserveAspectRatio="none", class_="whiskers",
                   aria_hidden="true")  # fmt: skip


def _dots(own: float, others: float) -> str:
    """Two shares, one over the other: the objects in question, then the others."""
    unknown = (math.nan, math.nan)
    return _whiskers(Share(math.nan, math.nan, own, unknown), Share(math.nan, math.nan, others, unknown))


def _counted(count: int, what: str, several: str) -> str:
    return f"{count} {what if count == 1 else several}"


_TITLE = "Detections on the frames that match"


def _text(evaluation: Evaluation | ModelsEvaluation, dataset: Dataset, files: SensorFiles) -> Markup:
    """The whole page."""
    sentences: list[str] = []
    pairs = None
    if isinstance(evaluation, Evaluation):
        models = [_Model("", evaluation, dataset, files)]
    else:
        graphs = [_whiskers(each.share, each.other) for each in evaluation.pairs]
        sentences, pairs = [each.sentence for each in evaluation.pairs], _table(models_table(evaluation), graphs)
        models = [
            _Model(name, each, dataset, files, f"model-{number}")
            for number, (name, each) in enumerate(evaluation.models.items())
        ]
    body = markup(
        "evaluation", "body", title=_TITLE, models=models, warnings=evaluation.warnings, sentences=sentences,
        pairs=pairs,
    )  # fmt: skip
    return page(_TITLE, [body], script=False)


class _Model:
    """What a page shows of one model.

    Args:
        name: Its name; "" where it is the only one.
        evaluation: Its figures.
        dataset: The labels.
        files: Sensor files and their thumbnails.
        anchor: What the anchors of its parts begin with.
    """

    def __init__(
        self, name: str, evaluation: Evaluation, dataset: Dataset, files: SensorFiles, anchor: str = ""
    ) -> None:
        self.name, self.anchor = name, anchor
        self._evaluation, self._dataset, self._files = evaluation, dataset, files
        self._prefix = f"{anchor}-" if anchor else ""
        self._backdrops: dict[str, Backdrop] = {}
        shown = {worst.frame for each in evaluation.scenarios for worst in each.worst[:SHOWN]}
        self._labels = {label.frame: label for label in dataset.labels(shown)}

    @property
    def origin(self) -> dict[str, str]:
        """What was judged on what, and what its benchmark says."""
        found = self._evaluation
        score = f", score {found.least_score:g} or more" if found.least_score else ""
        told = f"{found.predictions} on {found.dataset}: found within {found.within}{score}"
        return {"told": told, "benchmark": "" if found.benchmark is None else found.benchmark.sentence}

    def sections(self) -> list[Markup]:
        """All scenarios, after a table of them where they are several."""
        found = self._evaluation.scenarios
        summary = [self._overview()] if len(found) > 1 else []
        return [*summary, *(part for each in found for part in self._scenario(each))]

    def _overview(self) -> Markup:
        """All scenarios in one table, with links to each."""
        shown = overview(self._evaluation)
        place = {each.name: number for number, each in enumerate(self._evaluation.scenarios)}
        return _table(shown, links=[self._section(place[row[0]]) for row in shown[2]])

    def _scenario(self, each: ScenarioEvaluation) -> Iterator[Markup]:
        balances = [
            _table(
                balance_table(one), [_dots(*shares) for covariate in one.covariates for _, *shares in covariate.parts]
            )
            for one in each.balances
        ]
        graphs = {
            "missed": [_whiskers(one.share, one.other) for one in (*each.roles, each.all_objects)],
            "slices": [_whiskers(one.share, one.other) for one in each.slices],
        }
        shares = [_table(shown, graphs.get(shown[0], ())) for shown in tables(each, self._evaluation.within)]
        worst = each.worst[:SHOWN]
        yield markup(
            "evaluation", "scenario", anchor=self._section(self._evaluation.scenarios.index(each)), each=each,
            counts=frame_counts(each), balances=balances, shares=shares, signs=_SIGNS,
            worst=_table(worst_table(each, SHOWN), links=[self._anchor(each, one) for one in worst]),
        )  # fmt: skip
        for one in worst:
            yield self._frame(each, one)

    def _section(self, scenario: int) -> str:
        return f"{self._prefix}scenario-{scenario}"

    def _anchor(self, each: ScenarioEvaluation, one: WorstFrame) -> str:
        place = next(number for number, other in enumerate(each.worst) if other is one)
        return f"{self._prefix}frame-{self._evaluation.scenarios.index(each)}-{place}"

    def _frame(self, each: ScenarioEvaluation, one: WorstFrame) -> Markup:
        label = self._labels[one.frame]
        told = f"{one.recording}, {format_time(label.timestamp_us)}: {one.missed} of {one.of} missed, "
        told += _counted(one.false, "false box", "false boxes")
        return markup(
            "evaluation", "frame", anchor=self._anchor(each, one), name=one.frame, told=told,
            picture=self._picture(each, label), images=self._images(each, label),
        )  # fmt: skip

    def _images(self, each: ScenarioEvaluation, label: Label) -> list[tuple[Sensor, str]]:
        """The images of a frame's cameras, those first that show the most objects in question."""
        boxes = list(self._boxes(each, label)) if label.cameras else []
        asked = [box for box in boxes if box.kind.endswith(_ASKED)]

        def shown(sensor: Sensor) -> int:
            camera = label.cameras.get(sensor.channel)
            return 0 if camera is None else sum(len(box_edges(camera, box.corners)) > 0 for box in asked)

        found = [sensor for sensor in self._files.find(label.sensors) if sensor.thumbnail]
        return [
            (sensor, camera_image(sensor, label.cameras.get(sensor.channel), boxes))
            for sensor in sorted(found, key=shown, reverse=True)
        ]

    def _kind(self, each: ScenarioEvaluation, number: int) -> str:
        """The style of a label object."""
        counts = self._evaluation.detection.object_class[number] >= 0
        kind = "missed" if each.missed[number] else "found" if counts else "uncounted"
        return f"{kind} {_ASKED}" if each.mine[number] else kind

    def _boxes(self, each: ScenarioEvaluation, label: Label) -> Iterator[SpaceBox]:
        """Label objects and predictions in space, those in question last."""
        detection = self._evaluation.detection
        frame = detection.frames.numbers[label.frame]
        numbers = np.flatnonzero(detection.objects.frame == frame).tolist()
        pairs = sorted(zip(numbers, label.objects, strict=True), key=lambda pair: bool(each.mine[pair[0]]))
        for number, member in pairs:
            box = space_box(member, self._kind(each, number), f"{member.id}, {member.category}")
            if box is not None and detection.distance[number] < _FAR_M:
                yield box
        found = detection.predictions
        for number, told in _shown(detection, frame, self._evaluation.least_score):
            place = found.x[number], found.y[number], found.z[number]
            size = found.width[number], found.length[number], found.height[number]
            away = math.dist(place[:2], (label.ego.x, label.ego.y))
            if np.isfinite((*place, *size)).all() and away < _FAR_M:
                yield SpaceBox(box_corners(place, size, found.heading[number], 0.0, 0.0), "prediction", told)

    def _picture(self, each: ScenarioEvaluation, label: Label) -> str:
        if label.map not in self._backdrops:
            self._backdrops[label.map] = Backdrop(self._dataset.network(label.map))
        detection = self._evaluation.detection
        frame = detection.frames.numbers[label.frame]
        numbers = np.flatnonzero(detection.objects.frame == frame)
        far = detection.distance[numbers][each.mine[numbers]].max(initial=0.0)
        plane = plane_of(label)
        view = View((label.ego.x, label.ego.y), min(_FARTHEST, max(_NEAREST, 1.25 * float(far))))
        left, top, width, _ = view.box(plane)
        boxes = [draw_object(label.ego, plane)] if label.has_ego else []
        for number, member in zip(numbers.tolist(), label.objects, strict=True):
            boxes.append(element("g", draw_object(member, plane), class_=self._kind(each, number)))
        return element(
            "svg",
            element("title", escape(label.frame)),
            ground(plane, view.bounds) + self._backdrops[label.map].draw(plane, view.drawn),
            *boxes,
            *_predictions(detection, frame, plane, self._evaluation.least_score),
            class_="frame-picture",
            role="img",
            viewBox=f"{left} {top} {width} {width}",
            width=600,
            height=600,
        )


def _shown(detection: Detection, frame: int, least: float) -> Iterator[tuple[int, str]]:
    """The predictions of a frame that are shown, with what is said of them."""
    found = detection.predictions
    numbers: list[int] = np.flatnonzero((detection.frame == frame) & (found.score >= least)).tolist()
    for number in numbers:
        category = detection.classes[int(detection.prediction_class[number])]
        yield number, f"predicted {category}, score {found.score[number]:.2f}"


def _predictions(detection: Detection, frame: int, plane: Plane, least: float) -> Iterator[str]:
    found = detection.predictions
    for number, told in _shown(detection, frame, least):
        outline = corners(found.x[number], found.y[number], found.heading[number], found.width[number],
                          found.length[number])  # fmt: skip
        path = points_path(plane.to_picture(outline).tolist(), closed=True)
        yield element("g", element("title", escape(told)), element("path", d=path), class_="prediction")
