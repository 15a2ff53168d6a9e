"""What an importer could not take as it is: told once, counted always, refused where the user wants it strict."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from msgspec import structs

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.folders import readable
from scenicq.store.manifest import LeftOut
from scenicq.store.segment import SourceProblem

__all__ = ["MOST_TOLD", "Report"]

MOST_TOLD = 20
"""Messages of a kind that are kept."""
_MOST_ELEMENTS, _LONGEST_ELEMENT = 200, 200
"""Kinds of elements that are counted apart, and characters of what they are called: a source may make up any number."""
_LONG = re.compile(r"`([^`]{80})[^`]{20,}`")
"""A name of more characters than a message should show."""


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
        self._told: list[SourceProblem] = []
        self._told_of: Counter[tuple[str, str]] = Counter()
        self._elements = 0

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
        self._add(SourceProblem(what, code, "", False, message, hints))

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
        self._add(SourceProblem(what, code, name, True, message, hints))

    def assumed(self, what: str, name: str, message: str, *, hints: tuple[str, ...] = ()) -> None:
        """Something that the source does not say is taken for granted: told once, and no problem of a strict ingest.

        Args:
            what: "recording", "map" ...
            name: What is assumed, in a few words.
            message: The fact with its place.
            hints: Statements that one can act on.
        """
        self._add(SourceProblem(what, "assumed", name, True, message, hints), strict=False)

    def not_read(self, element: str, count: int = 1) -> None:
        """Something that the source holds, sound as it is, is passed over: counted, and no problem of a strict ingest.

        Args:
            element: What it is, in the words of the format.
            count: How many there are.
        """
        if not count:
            return
        element = readable(element)[:_LONGEST_ELEMENT]
        if (key := (False, "element", "not-read", element)) not in self._counts:
            self._elements += 1
            if self._elements > _MOST_ELEMENTS:
                key = (False, "element", "not-read", "others")
        self._counts[key] += count

    def merge(self, counts: Iterable[tuple[str, str, str, bool, int]], told: Iterable[SourceProblem]) -> None:
        """Take in the `tally` and the `told` of another report, as if its problems had been reported here."""
        before = {key for key in self._counts if key[0] and key[3]}
        for problem in told:
            if _key(problem) not in before and self._told_of[problem.what, problem.code] < MOST_TOLD:
                self._told.append(problem)
                self._told_of[problem.what, problem.code] += 1
        for what, code, name, kept, count in counts:
            if code == "not-read":
                self.not_read(name, count)
            else:
                self._counts[kept, what, code, name] += count

    @property
    def tally(self) -> tuple[tuple[str, str, str, bool, int], ...]:
        """How often each problem occurred: what, code, name, kept, count."""
        return tuple((entry.what, entry.code, entry.name, entry.kept, entry.count) for entry in self.counts)

    @property
    def told(self) -> tuple[SourceProblem, ...]:
        """The first problems of each kind."""
        return tuple(self._told)

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
            Diagnostic(code, f"{total} {what}s like this in all", severity="warning")
            for (what, code), told in sorted(self._told_of.items())
            if told >= MOST_TOLD and (total := self._total(what, code)) > MOST_TOLD
        ]
        return (*(Diagnostic(p.code, p.message, hints=p.hints, severity="warning") for p in self._told), *more)

    def _total(self, what: str, code: str) -> int:
        return sum(count for (_, *key, _name), count in self._counts.items() if key == [what, code])

    def _add(self, problem: SourceProblem, *, strict: bool = True) -> None:
        message = _LONG.sub(r"`\1...`", readable(problem.message))
        problem = structs.replace(problem, name=readable(problem.name), message=message)
        if self._strict and strict:
            raise DataError(Diagnostic(problem.code, problem.message, hints=problem.hints))
        known = problem.name and _key(problem) in self._counts
        self._counts[_key(problem)] += 1
        if known:
            return
        kind = problem.what, problem.code
        if self._told_of[kind] < MOST_TOLD:
            self._told_of[kind] += 1
            self._told.append(problem)


def _key(problem: SourceProblem) -> tuple[bool, str, str, str]:
    return problem.kept, problem.what, problem.code, problem.name
