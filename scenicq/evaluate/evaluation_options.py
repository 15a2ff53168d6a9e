"""The options of an evaluation, each declared once, for the command and for Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypedDict, Unpack, get_args

from scenicq.evaluate.clusters import CLUSTER_KEYS
from scenicq.evaluate.comparison import MARGIN
from scenicq.evaluate.detection import DISTANCES, DetectionDistances, Missing
from scenicq.option_values import (
    MARGIN_OPTION,
    SCORE,
    SEED,
    FileName,
    OneOf,
    Option,
    Text,
    declared_options,
    read_values,
)

__all__ = ["EVALUATION_OPTIONS", "EvaluationOptions", "EvaluationTexts", "read_evaluation_options"]

_COUNTS = "What counts"


# fmt: off
class EvaluationTexts(TypedDict, total=False):
    """The options of `scenicq evaluate` that say what is judged and how, in the order of its help.

    None stands for the default where the type has it.
    """

    distance_m: Annotated[float | str | Mapping[str, float], Option(
        DISTANCES, "M[,CLASS=M]",
        "Centre distance within which an object counts as found: 0.5, 1, 2 or 4 metres; for some classes another one: "
        "2,pedestrian=0.5.", _COUNTS, ("--distance",), meaning=DetectionDistances.of, default="2")]
    least_score: Annotated[float | None, Option(
        SCORE, "S", "Score from which a detection counts, but for average precision; all by default.",
        _COUNTS, ("--min-score",))]
    missing: Annotated[Missing, Option(
        OneOf(get_args(Missing)), None,
        "What a frame without detections is: an error, a frame in which nothing was found, or left out.",
        _COUNTS, default="error")]
    simulated: Annotated[Path | str | None, Option(
        FileName(), "FILE",
        "Simulated runs to set beside it: CSV with `scenario` (the name of a results file) and `failed` or `score` "
        "(the share missed, 0 to 1). Where `recording` or `frame` says what a run rebuilds, both are compared pair by "
        "pair, too, and simulation narrows the interval as far as it foretells what is missed.", _COUNTS)]
    cluster: Annotated[str | None, Option(
        Text("the name of a parameter, or `recording`"), "KEY",
        "What errors may go by: recordings with one value of this parameter count as one, such as those of a drive; or "
        f"`recording`.  [default: the first of {', '.join(CLUSTER_KEYS)} that all frames have, else recording]",
        _COUNTS)]
    margin: Annotated[float, Option(
        MARGIN_OPTION, "SHARE", "What is missed more often by less than this counts as no worse.",
        _COUNTS, default=MARGIN)]
    seed: Annotated[int, Option(SEED, "N", "Seed of the resamples.", _COUNTS, default=0)]
# fmt: on


EVALUATION_OPTIONS = declared_options(EvaluationTexts)
"""The options of an evaluation by name."""


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """What is judged, and how.

    Attributes:
        distance_m: Centre distances within which objects count as found.
        least_score: Score from which a prediction counts; None for all.
        missing: What a frame without predictions is.
        simulated: A file of simulated runs.
        cluster: The parameter whose values recordings of one cluster share; None to find one.
        margin: What is missed more often by less than this share counts as no worse.
        seed: Seed of the resamples.
    """

    distance_m: DetectionDistances
    least_score: float | None
    missing: Missing
    simulated: Path | None
    cluster: str | None
    margin: float
    seed: int


def read_evaluation_options(**given: Unpack[EvaluationTexts]) -> EvaluationOptions:
    """The options of an evaluation.

    Args:
        given: What somebody wrote; the rest is as on the command line.

    Raises:
        DataError: option-invalid.
    """
    usual = {name: option.default for name, option in EVALUATION_OPTIONS.items()}
    return EvaluationOptions(**read_values(EVALUATION_OPTIONS, {**usual, **given}))
