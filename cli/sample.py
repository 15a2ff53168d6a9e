"""`scenicq sample`: scenes drawn from a scenario."""

from __future__ import annotations

from pathlib import Path

import click

from scenicq.compiler.element_lookups import LaneRule
from scenicq.compiler.program import compile_scenario
from scenicq.errors import printable_json
from scenicq.exporters.sample import PATIENCE_S, sample_labels, sample_record, write_sample
from scenicq.option_values import SEED, Count, read_values
from scenicq.query.execution.option_texts import QUERY_OPTIONS, read_built_ins
from scenicq.query.execution.program_files import SiblingFiles
from scenicq.store.remote_path import AnyPath

from .check import networks_of
from .manual import Manual
from .option_type import OptionType
from .options import add_options
from .path_type import ANY_PATH, LOCAL_PATH
from .programs import PROGRAM_TEXT, SCENARIO, given_program
from .streams import say

__all__ = ["sample"]


@click.command(
    cls=Manual,
    arguments={
        "SCENARIO": SCENARIO,
        "DATASET": "A folder that `scenicq ingest` made, for its map.",
    },
    epilog="\b\nExamples:\n"
    "  scenicq sample crossing.scenic -n 5 --seed 0\n"
    "  scenicq sample crossing.scenic dataset -n 100 -o scenes",
)
@click.argument("scenario", metavar="SCENARIO", type=click.Path(), required=False)
@click.argument("dataset", metavar="[DATASET]", type=click.Path(), required=False)
@PROGRAM_TEXT
@add_options(QUERY_OPTIONS, "run_scenario", "params")
@click.option("--map", "map_file", metavar="FILE", type=LOCAL_PATH, help="A GeoJSON or OpenDRIVE map.")
@click.option("-n", "--number", metavar="N", type=OptionType(Count()), default=1, help="Scenes to draw.")
@click.option("--seed", metavar="N", type=OptionType(SEED), default=0, help="The same seed gives the same scenes.")
@click.option(
    "--waive",
    metavar="LIST",
    default="",
    help="Built-in requirements that need not hold: visibility, containment, collision.",
)
@add_options(QUERY_OPTIONS, "timeout", default=PATIENCE_S, help="Seconds of the processor for one scene.")
@add_options(QUERY_OPTIONS, "scenic", "map_defaults", "lanes")
@add_options(QUERY_OPTIONS, "initial", help="Ignore behaviors and other dynamic parts.")
@click.option("-o", "--output", metavar="DIR", type=ANY_PATH,
              help="Write an interchange folder with labels and map, to be ingested, here or elsewhere.")  # fmt: skip
@click.pass_context
def sample(ctx: click.Context, scenario: str | None, dataset: str | None, *, program: str | None,
           run_scenario: str | None, params: tuple[tuple[str, str], ...], map_file: Path | None, number: int, seed: int,
           waive: str, timeout: float, scenic: str | None, map_defaults: bool, lanes: LaneRule, initial: bool,
           output: AnyPath | None) -> None:  # fmt: skip
    """Draw scenes from a scenario, as labels.

    Scenes have the distribution of the program, given that all requirements hold, also those that Scenic adds. They
    lie on the first map of the dataset, or on the map that is given, or on the one that the program names with `param
    map = localPath('FILE')`, or else on a small built-in street. Each is a line of JSON.
    """
    source, (target,), model = given_program(ctx, program, (scenario, dataset))
    read = read_values(QUERY_OPTIONS, {"scenic": scenic, "params": params})
    version = read["scenic"]
    network = next(networks_of(target, map_file, source, version))
    compiled = compile_scenario(
        source,
        network,
        version=version,
        initial=initial,
        loader=SiblingFiles(Path(source.name)),
        model=model,
        map_defaults=map_defaults,
        lanes=lanes,
        scenario=run_scenario,
        params=dict(read["params"]),
    )
    labels = sample_labels(compiled, number, seed, read_built_ins(waive), timeout_s=timeout)
    if output is not None:
        write_sample(labels, network, Path(source.name.strip("<>")).stem, output)
        return
    for label in labels:
        say(printable_json(sample_record(label)))
