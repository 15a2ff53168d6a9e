"""What a notebook shows of an evaluation: the sentences first, then the tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from scenicq.evaluate.evaluation import Evaluation, ModelsEvaluation
from scenicq.evaluate.pages import write_pages
from scenicq.evaluate.rows import Table, models_table, tables
from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath, any_path

__all__ = ["Judgement"]


@dataclass(frozen=True, slots=True)
class Judgement:
    """A model judged on the frames of a query, or several models.

    Attributes:
        evaluation: All figures, of one model or of several.
        dataset: What it was judged on.
    """

    evaluation: Evaluation | ModelsEvaluation
    dataset: Dataset

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to tell: one sentence a role, two for ranked results, and one about simulated runs.

        Where there are several models, it is one sentence for each pair and role.
        """
        if isinstance(self.evaluation, ModelsEvaluation):
            return tuple(each.sentence for each in self.evaluation.pairs)
        found: list[str] = []
        for each in self.evaluation.scenarios:
            found += [one.sentence for one in (*each.headline, *each.weighted)]
            if each.simulated is not None:
                found.append(each.simulated.sentence)
        return tuple(found)

    def report(self, folder: str | Path, *, sensors: str | Path | None = None) -> AnyPath:
        """Write pages with the worst frames first, as `scenicq evaluate --report`.

        Args:
            folder: New, empty, or with an older report; or a new one elsewhere, as `s3://bucket/report`.
            sensors: The folder that the paths of sensor files start from.

        Returns:
            The page to begin with.

        Raises:
            DataError: target-exists, or target-unwritable.
        """
        return write_pages(self.evaluation, self.dataset, any_path(folder), None if sensors is None else Path(sensors))

    def __repr__(self) -> str:
        """The sentences."""
        return "\n".join(self.sentences)

    def _repr_html_(self) -> str:
        parts = [f"<p>{escape(sentence)}</p>" for sentence in self.sentences]
        if isinstance(self.evaluation, ModelsEvaluation):
            parts.append(_shown(models_table(self.evaluation)))
            models = self.evaluation.models
        else:
            models = {"": self.evaluation}
        for name, evaluation in models.items():
            parts += [f"<h4>{escape(name)}</h4>"] if name else []
            parts += [_shown(each) for one in evaluation.scenarios for each in tables(one, evaluation.within)]
        return "".join(parts)


def _shown(table: Table) -> str:
    title, head, rows = table
    lines = "".join(_line("td", row) for row in rows)
    return f"<table><caption>{escape(title)}</caption>{_line('th', head)}{lines}</table>"


def _line(tag: str, cells: Sequence[str]) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"
