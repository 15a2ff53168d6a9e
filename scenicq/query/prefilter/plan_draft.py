"""Steps and stages of a plan while it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from scenicq.errors import Span

__all__ = ["Draft", "Stage", "Step", "blamed_step"]


@dataclass(frozen=True, slots=True)
class Step:
    """A necessary condition of a frame.

    Attributes:
        what: What it is about, in the words of the program.
        detail: What a frame that misses it lacks.
        span: Where the program says it.
    """

    what: str
    detail: str
    span: Span | None


@dataclass(frozen=True, slots=True)
class Stage:
    """SQL that decides some steps for the frames that the stages before have left.

    Attributes:
        table: The table that it makes: `f`, the number of each frame left, and `missed`, the number of the first step
            missed or null.
        statements: To be run in order.
    """

    table: str
    statements: tuple[str, ...]


@dataclass(slots=True)
class Draft:
    """A plan on the way."""

    steps: list[Step] = field(default_factory=list[Step])
    columns: str = ""
    stages: list[Stage] = field(default_factory=list[Stage])

    def step(self, what: str, span: Span | None, detail: str = "") -> int:
        """Number of a new step."""
        self.steps.append(Step(what, detail, span))
        return len(self.steps) - 1

    @property
    def last(self) -> str:
        """The table of the last stage."""
        return self.stages[-1].table

    def stage(self, statements: Sequence[str], blamed: Sequence[tuple[str, int]], joined: str = "") -> None:
        """Add a stage: what a frame `s` must not be, with the number of the step that it then misses."""
        table = f"stage{len(self.stages)}"
        final = (
            f"CREATE OR REPLACE TEMP TABLE {table} AS SELECT s.f, {blamed_step(blamed)} AS missed "
            f"FROM {self.last} s {joined} WHERE s.missed IS NULL"
        )
        self.stages.append(Stage(table, (*statements, final)))


def blamed_step(blamed: Sequence[tuple[str, int]]) -> str:
    """The number of the first condition that holds, null if none does."""
    if not blamed:
        return "NULL::SMALLINT"
    return f"(CASE {' '.join(f'WHEN {sql} THEN {step}' for sql, step in blamed)} END)::SMALLINT"
