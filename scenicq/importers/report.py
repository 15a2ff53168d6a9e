"""What an importer could not take as it is: told once, counted always, refused where the user wants it strict."""

from __future__ import annotations

from collections import Counter

from scenicq.errors import DataError, Diagnostic
from scenicq.store.manifest import LeftOut

__all__ = ["Report"]

_TOLD = 20


class Report:
    """Collects the problems of one ingest.

    Only the first messages of a kind are kept, so a source with a million bad records needs no more memory than one
    with a few; the counts are complete.
    """

    def __init__(self, *, strict: bool = False) -> None:
        """Start without problems.

        Args:
            strict: Whether the first problem ends the ingest.
        """
        self._strict = strict
        self._counts: Counter[tuple[bool, str, str, str]] = Counter()
        self._told: list[Diagnostic] = []
        self._told_of: Counter[tuple[str, str]] = Counter()

    def left_out(self, what: str, code: str, message: str, *, hints: tuple[str, ...] = ()) -> None:
        """Something is not taken.

        Args:
            what: "recording", "label", "object", "map element" ...
            code: A key of `CODES`.
            message: The fact with its place: file, line, identifiers.
            hints: Statements that one can act on.

        Raises:
            DataError: The ingest is strict.
        """
        self._add((False, what, code, ""), Diagnostic(code, message, hints=hints, severity="warning"))

    def kept(self, what: str, code: str, message: str, *, name: str = "", hints: tuple[str, ...] = ()) -> None:
        """Something is taken with a defect.

        Args:
            what: What has the defect.
            code: A key of `CODES`.
            message: The fact.
            name: What several have in common, such as the unknown class: counted by it, told once.
            hints: Statements that one can act on.

        Raises:
            DataError: The ingest is strict.
        """
        key = (True, what, code, name)
        if name and key in self._counts:
            self._counts[key] += 1
        else:
            self._add(key, Diagnostic(code, message, hints=hints, severity="warning"))

    @property
    def counts(self) -> tuple[LeftOut, ...]:
        """How often each problem occurred, in an order that depends on nothing else."""
        return tuple(
            LeftOut(what, code, count, name, kept) for (kept, what, code, name), count in sorted(self._counts.items())
        )

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """Warnings: the first of each kind, then how many there were where more than those were kept."""
        more = [
            Diagnostic(code, f"{self._total(what, code)} {what}s like this in all", severity="warning")
            for (what, code), told in sorted(self._told_of.items())
            if told > _TOLD
        ]
        return (*self._told, *more)

    def _total(self, what: str, code: str) -> int:
        return sum(count for (_, *key, _name), count in self._counts.items() if key == [what, code])

    def _add(self, key: tuple[bool, str, str, str], diagnostic: Diagnostic) -> None:
        if self._strict:
            raise DataError(Diagnostic(diagnostic.code, diagnostic.message, hints=diagnostic.hints))
        self._counts[key] += 1
        _, what, code, _ = key
        self._told_of[what, code] += 1
        if self._told_of[what, code] <= _TOLD:
            self._told.append(diagnostic)
