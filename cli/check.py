"""`scenicq check`: whether a scenario is sound, and how it is read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Literal

import click

from scenicq.compiler.program import compile_scenario
from scenicq.errors import DataError, Diagnostic, ScenarioError, ScenicqError, Source
from scenicq.forest.scenario import Scenario
from scenicq.forest.show import show_forest
from scenicq.forest.show_modes import show_modes
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network
from scenicq.lint.impossible import impossible_requirements
from scenicq.lint.program import LINTED_MAPS, lint
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import build_groups, describe_constraint
from scenicq.match.problem.preprocess import prepare_scenario
from scenicq.option_values import read_values
from scenicq.query.execution.never_compared import coverage
from scenicq.query.execution.option_texts import QUERY_OPTIONS
from scenicq.query.execution.program_files import SiblingFiles
from scenicq.query.execution.program_map import about_dataset, is_about_map, program_network, read_network
from scenicq.store.atomic_files import write_whole
from scenicq.store.dataset import Dataset
from scenicq.store.said_values import said_types

from .datasets import open_checked
from .main import ERROR
from .manual import Manual
from .options import add_options
from .output import writing
from .path_type import LOCAL_PATH
from .programs import PROGRAM_TEXT, SCENARIO, given_program
from .report import as_json, count, show
from .streams import say
from .user_folders import map_cache

__all__ = ["check", "networks_of"]


def networks_of(
    dataset: str | None,
    map_file: Path | None,
    source: Source,
    version: Literal[1, 2, 3] | None,
    warnings: list[Diagnostic] | None = None,
) -> Iterator[Network]:
    """The maps to compile against: of the dataset, the one given, the one that the program names, or the street.

    With a list for warnings, the street also stands in for a map that the program names and that cannot be had.
    """
    if dataset is not None and map_file is not None:
        hint = "give one of them"
        raise DataError(
            Diagnostic(
                "option-invalid", "`--map` is for checks without a dataset, which has maps of its own", hints=(hint,)
            )
        )
    if dataset is not None:
        opened = open_checked(dataset)
        yield from (opened.network(name) for name in opened.maps)
    elif map_file is not None:
        with map_cache() as cache:
            yield read_network(map_file, cache)
    else:
        try:
            with map_cache() as cache:
                named = program_network(source, Path(source.name).parent, version, cache)
        except DataError as error:
            if warnings is None:
                raise
            more = ("until then, the built-in street is used instead",)
            warnings += [replace(each, hints=(*each.hints, *more), severity="warning") for each in error.diagnostics]
            named = None
        yield named or street()


def _told(scenario: Scenario) -> str:
    roles = ", ".join(f"{owner.name}: {owner.category}" for owner in scenario.objects)
    mine = {owner.name for owner in scenario.objects}
    others = {owner.name: owner.category for each in scenario.variants for owner in each.every_object}
    more = ", ".join(f"{name}: {category}" for name, category in others.items() if name not in mine)
    roles += f"; in some runs also {more}" if more else ""
    written = sum(requirement.built_in is None for requirement in scenario.requirements)
    over_time = len(scenario.dynamics.requirements) if scenario.dynamics is not None else 0
    timed = f" and {over_time} over time" if over_time else ""
    soft = f" and {len(scenario.soft)} soft" if scenario.soft else ""
    recorded = f", {count(len(scenario.records), 'recorded value')}" if scenario.records else ""
    return (
        f"ok on map {scenario.map}: {count(len(scenario.objects), 'object')} ({roles}), "
        f"{count(written, 'requirement')}{timed}{soft}{recorded}, read as Scenic {scenario.version}"
    )


Details = list[Callable[[Scenario], list[str]]]


def _groups(scenario: Scenario) -> list[str]:
    """The groups of jointly dependent constraints in dependency order, all positions and headings observed."""
    scenario, seen = prepare_scenario(scenario), frozenset({"position", "heading"})
    signature = (*(seen for _ in scenario.objects), frozenset[str](scenario.params))
    groups = build_groups(scenario, signature, MatchOptions())
    return [
        f"{number}. " + ", ".join(describe_constraint(scenario, each) for each in group.constraints)
        for number, group in enumerate(groups, 1)
    ]


@dataclass(slots=True)
class _Drawing:
    """Draws the modes of a program over the first map.

    Attributes:
        file: Where to.
        is_done: Whether that has been done.
    """

    file: Path
    is_done: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no name of a picture.

        Raises:
            DataError: option-invalid.
        """
        if self.file.suffix.lower() != ".svg":
            message = f"modes are drawn as SVG, and the name {self.file} does not end in .svg"
            raise DataError(Diagnostic("option-invalid", message, hints=("give a name such as modes.svg",)))

    def __call__(self, scenario: Scenario) -> list[str]:
        """Draw, and say nothing.

        Raises:
            DataError: target-unwritable.
        """
        from scenicq.report.mode_picture import draw_modes  # noqa: PLC0415 - takes long to load

        if not self.is_done:
            self.is_done = True
            with writing(self.file):
                write_whole(self.file, draw_modes(scenario))
        return []


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a check takes into account besides the program.

    Attributes:
        options: Classes and ego.
        dataset: Whose labels tell what is compared, if any.
        real: Whether the maps are real ones, rather than a street that stands in.
        strict: Whether warnings of what cannot be meant are errors.
        model: The world model of a program that imports none.
        map_defaults: Whether the world model places and turns what the program does not.
        run_scenario: Which scenario of the program runs.
        params: Values of global parameters.
    """

    options: MatchOptions
    dataset: Dataset | None
    real: bool
    strict: bool
    model: str | None
    map_defaults: bool
    run_scenario: str | None
    params: Mapping[str, float | str]


def _found(
    source: Source, networks: Iterator[Network], version: int | None, initial: bool, details: Details, asked: _Asked
) -> tuple[list[str], list[Diagnostic]]:
    """Check the program on each map: a line for each that the scenario fits, and every diagnostic once.

    A map that lacks what the scenario needs is no error where another map has it.
    """
    lines: list[str] = []
    errors: list[Diagnostic] = []
    lacking: list[Diagnostic] = []
    rest: list[Diagnostic] = []
    compiled: list[tuple[Scenario, Network | None]] = []
    attributes = None if asked.dataset is None else cache(partial(said_types, asked.dataset))
    for network in networks:
        try:
            loader = SiblingFiles(Path(source.name))
            scenario = compile_scenario(
                source,
                network,
                version=version,
                initial=initial,
                behaviors="motion",
                loader=loader,
                model=asked.model,
                map_defaults=asked.map_defaults,
                scenario=asked.run_scenario,
                params=asked.params,
                label_attributes=attributes,
            )
        except ScenarioError as error:
            if asked.dataset is not None:
                error = about_dataset(error, asked.dataset, network.name)
            (lacking if is_about_map(error) else errors).extend(error.diagnostics)
            continue
        compiled.append((scenario, network if asked.real else None))
        lines += [_told(scenario), *(f"  {line}" for part in details for line in part(scenario))]
        rest += [*scenario.warnings, *scenario.ignored]
    if compiled:
        written = [scenario.as_written or scenario for scenario, _ in compiled]
        impossible = impossible_requirements(written, real=asked.real)
        errors += impossible
        lines = [] if impossible else lines
        rest += [replace(each, severity="warning") for each in lacking]
        remarks = lint(source, compiled[:LINTED_MAPS], asked.options, properties=asked.dataset is None)
        if asked.dataset is not None:
            scenarios = [prepare_scenario(scenario) for scenario, _ in compiled]
            remarks = [*coverage(asked.dataset, scenarios, asked.options).warnings, *remarks]
        never = {each.span for each in errors}
        remarks = [each for each in remarks if each.span not in never]
        rest += [replace(each, severity="error") for each in remarks] if asked.strict else remarks
    else:
        # maps that all lack the same need not all be told
        errors += {each.span: each for each in reversed(lacking)}.values()
    return lines, list(dict.fromkeys([*errors, *rest]))


@click.command(
    cls=Manual,
    arguments={
        "SCENARIO": SCENARIO,
        "DATASET": "A folder that `scenicq ingest` made: the program is read on each of its maps.",
    },
    exits={0: "the program is sound"},
    epilog="\b\nExamples:\n"
    "  scenicq check crossing.scenic\n"
    "  scenicq check crossing.scenic dataset\n"
    "  scenicq check crossing.scenic --map town.geojson --format json",
)
@click.argument("scenario", metavar="SCENARIO", type=click.Path(), required=False)
@click.argument("dataset", metavar="[DATASET]", type=click.Path(), required=False)
@PROGRAM_TEXT
@add_options(QUERY_OPTIONS, "run_scenario", "params")
@click.option("--map", "map_file", metavar="FILE", type=LOCAL_PATH, help="A GeoJSON or OpenDRIVE map.")
@add_options(QUERY_OPTIONS, "scenic", "map_defaults")
@add_options(QUERY_OPTIONS, "initial", help="Ignore behaviors and other dynamic parts.")
@click.option("--forest", is_flag=True, help="Print the expression forest.")
@click.option(
    "--modes",
    is_flag=True,
    help="Print the modes that monitors, behaviors and scenarios may be in, and where each leads.",
)
@click.option("--draw-modes", "drawing", metavar="FILE", type=LOCAL_PATH,
              help="Draw these modes, and write them to a file: .svg.")  # fmt: skip
@click.option("--groups", is_flag=True, help="Print the groups of jointly dependent constraints, in order.")
@add_options(QUERY_OPTIONS, "classes", help="Look at the program as `match` does with these classes.")
@add_options(QUERY_OPTIONS, "strict", help="What compiles but cannot be meant, or is never compared, is an error.")
@click.option(
    "--format",
    "format_",
    type=click.Choice(["text", "json"]),
    default="text",
    help="json gives the diagnostics as a list.",
)
@click.pass_context
def check(ctx: click.Context, scenario: str | None, dataset: str | None, *, program: str | None,
          run_scenario: str | None, params: tuple[tuple[str, str], ...], map_file: Path | None, scenic: str | None,
          map_defaults: bool, initial: bool, forest: bool, modes: bool, drawing: Path | None, groups: bool,
          classes: Literal["fine", "coarse"], strict: bool, format_: str) -> None:  # fmt: skip
    """Say whether a scenario is sound, and how it is read.

    It warns of what compiles but cannot be meant, such as an angle of 90 without `deg`, and with a dataset also of what
    its labels never have. A comment `# scenicq: ignore[CODE]` on the line silences a warning.

    The program is compiled against each map of the dataset, the map that is given, the one that it names with `param
    map = localPath('FILE')`, or else a small built-in street.
    """
    lines: list[str] = []
    details: Details = [show_forest] * forest + [show_modes] * modes + [_groups] * groups
    if drawing is not None:
        details.append(_Drawing(drawing))
    try:
        read = read_values(QUERY_OPTIONS, {"scenic": scenic, "params": params})
        version, warnings = read["scenic"], list[Diagnostic]()
        source, (target,), model = given_program(ctx, program, (scenario, dataset))
        networks = networks_of(target, map_file, source, version, warnings)
        opened = None if target is None else open_checked(target)
        asked = _Asked(
            MatchOptions(classes=classes),
            opened,
            opened is not None or map_file is not None,
            strict,
            model,
            map_defaults,
            run_scenario,
            dict(read["params"]),
        )
        lines, diagnostics = _found(source, networks, version, initial, details, asked)
        diagnostics += warnings
    except ScenicqError as error:
        if format_ == "text":
            raise
        diagnostics = list(error.diagnostics)
    if format_ == "json":
        say(json.dumps([as_json(diagnostic) for diagnostic in diagnostics], indent=1))
    else:
        show(diagnostics)
        for line in lines:
            say(line)
    if any(diagnostic.severity == "error" for diagnostic in diagnostics):
        ctx.exit(ERROR)
