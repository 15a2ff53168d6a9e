"""`scenicq evaluate`: a model's detections on the frames of a scenario, against other frames."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import BinaryIO, Unpack

import click

from scenicq.errors import DataError, Diagnostic, printable_json
from scenicq.evaluate.evaluation import Evaluation, ModelsEvaluation, Results, name_models
from scenicq.evaluate.evaluation import evaluate_models as judge
from scenicq.evaluate.evaluation_options import EVALUATION_OPTIONS, EvaluationTexts
from scenicq.evaluate.pages import write_pages
from scenicq.evaluate.rows import (
    COLUMNS,
    Table,
    evaluation_record,
    frame_counts,
    models_record,
    models_rows,
    models_table,
    overview,
    tables,
)
from scenicq.query.execution.option_texts import read_options
from scenicq.query.execution.run import Query
from scenicq.report.write import check_target
from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

from .datasets import open_checked
from .formats import CsvRows
from .manual import Manual
from .options import add_options, by_topic
from .output import choose_format, destination, writing
from .path_type import ANY_PATH, LOCAL_PATH, chosen_file
from .programs import read_scenario
from .report import columns, printable, show
from .sources import SENSORS, sensor_root

__all__ = ["evaluate"]

_FORMATS = ("table", "json", "csv", "spreadsheet", "parquet")
_EXTENSIONS = {".json": "json"}


# fmt: off
@click.command(
    cls=Manual,
    arguments={
        "RESULTS...": "Programs (.scenic), which are matched, or files that `match -o` wrote, one a scenario: .jsonl, "
        ".csv or .parquet. Frames that the results leave undecided (--limit, --sample, --deadline) are left out. "
        "Results of `match --all-matches` name every object that can play a role; with other results, the further "
        "objects of a frame that matches are not compared.",
        "DATASET": "The dataset of the results.",
    },
    topics=by_topic(EVALUATION_OPTIONS, {
        "What counts": {"predictions"},
        "What comes out": {"format_", "output", "report", "sensors"},
    }),
    epilog="\b\nExamples:\n"
    "  scenicq evaluate parked.scenic dataset --predictions detections.json\n"
    "  scenicq evaluate parked.jsonl cutin.jsonl dataset --predictions detections.feather --simulated runs.csv\n"
    "  scenicq evaluate parked.jsonl dataset --predictions detections.jsonl --report pages -o figures.json",
)
@click.argument("results", metavar="RESULTS...", type=ANY_PATH, nargs=-1, required=True)
@click.argument("dataset", type=click.Path())
@click.option("--predictions", metavar="FILE", type=LOCAL_PATH, multiple=True, required=True,
              help="Detections of a model: nuScenes results (.json), Argoverse 2 (.feather), or labels of the "
              "interchange format whose objects have a `score` (.jsonl or .parquet). Given several times, each model "
              "is also compared with those before it, on the same objects.")
@add_options(EVALUATION_OPTIONS, *EVALUATION_OPTIONS)
@click.option("--format", "format_", metavar="NAME", type=click.Choice(_FORMATS),
              help="table, json, csv, spreadsheet (csv without formulas) or parquet.  [default: by the extension of "
              "FILE, else table]")
@click.option("-o", "--output", metavar="FILE", type=ANY_PATH, help="Write to a file, also to s3://...")
@click.option("--report", metavar="DIR", type=ANY_PATH,
              help="Write a page with pictures, too, the worst frames first: DIR/index.html, also in s3://...")
@SENSORS
def evaluate(results: tuple[AnyPath, ...], dataset: str, *, predictions: tuple[Path, ...], format_: str | None,
             output: AnyPath | None, report: AnyPath | None, sensors: Path | None,
             **options: Unpack[EvaluationTexts]) -> None:
    # fmt: on
    """Say whether a model fails on the frames that match.

    The objects that can play roles are compared with others of their classes that are alike in distance and visibility,
    of the same frame if there are some, else of the same recording, else of frames under the same parameters. Frames of
    one recording resemble each other: intervals (95 %) and tests are over recordings. Where these cannot tell, it says
    what is missing. The tests of one command are corrected for each other, those of several commands are not.
    """
    file = chosen_file(output)
    form = _format(format_, file)
    names = [each.stem for each in results]
    if len(set(names)) < len(names):
        message = "results files of one evaluation need different names"
        raise DataError(Diagnostic("option-invalid", message))
    if report is not None:
        check_target(report)
    if file is not None:
        target_of(file).check_writable()
    opened = open_checked(dataset)
    found = judge(
        {name: _asked(each, opened) for name, each in zip(names, results, strict=True)},
        opened,
        dict(zip(name_models(predictions), predictions, strict=True)),
        **options,
    )
    with destination(file) as sink, writing(file):
        _write(found, form, sink)
    show(found.warnings)
    if report is not None:
        write_pages(found.only or found, opened, report, sensor_root(opened, sensors))


def _asked(path: AnyPath, dataset: Dataset) -> Results:
    """Results, or a program to be matched."""
    return Query(dataset, read_scenario(str(path)), read_options()) if path.suffix == ".scenic" else path


def _format(name: str | None, file: AnyPath | None) -> str:
    if name is not None:
        return "parquet" if name == "parquet" and choose_format(name, file) else name
    if file is None:
        return "table"
    return _EXTENSIONS.get(file.suffix) or choose_format(None, file)


def _write(found: ModelsEvaluation, form: str, sink: BinaryIO) -> None:
    match form:
        case "json":
            record = models_record(found) if found.only is None else evaluation_record(found.only)
            content = json.dumps(record, ensure_ascii=False, indent=1, allow_nan=False)
            text = printable_json(content) + "\n"
        case "csv" | "spreadsheet":
            lines = io.StringIO(newline="")
            rows = CsvRows(lines, COLUMNS, spreadsheet=form == "spreadsheet")
            for row in models_rows(found):
                rows.write(row)
            text = lines.getvalue()
        case "parquet":
            _write_parquet(found, sink)
            return
        case _:
            text = _text(found)
    sink.write(text.encode(errors="backslashreplace"))


def _write_parquet(found: ModelsEvaluation, sink: BinaryIO) -> None:
    import pyarrow as pa  # noqa: PLC0415 - not needed for the other formats
    import pyarrow.parquet as pq  # noqa: PLC0415

    schema = pa.schema([(name, pa.string() if kind is str else pa.float64()) for name, kind in COLUMNS.items()])
    pq.write_table(pa.Table.from_pylist(list(models_rows(found)), schema=schema), sink)


def _text(found: ModelsEvaluation) -> str:
    if found.only is not None:
        return "\n".join(_model(found.only))
    lines = [*_titled(models_table(found)), ""]
    lines += [printable(each.sentence) for each in found.pairs]
    for name, each in found.models.items():
        lines += ["", printable(name), "", *_model(each)]
    return "\n".join(lines)


def _titled(table: Table) -> list[str]:
    title, head, rows = table
    return [title, *columns([head, *rows])]


def _model(found: Evaluation) -> list[str]:
    lines: list[str] = []
    if len(found.scenarios) > 1:
        lines += [*_titled(overview(found)), ""]
    for each in found.scenarios:
        lines.append(f"{each.name}: {frame_counts(each)}")
        for table in tables(each, found.within):
            lines += ["", *_titled(table)]
        lines.append("")
        lines += [printable(one.sentence) for one in (*each.headline, *each.weighted)]
        lines += [printable(one.beside) for one in each.headline if one.asked]
        if each.simulated is not None:
            lines.append(printable(each.simulated.sentence))
        lines.append("")
    if found.benchmark is not None:
        lines += [found.benchmark.sentence, ""]
    return lines
