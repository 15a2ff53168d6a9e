"""The report of an ingest: what was left out or assumed of a source, as messages and as counts.

Every problem is counted, and the first ones of a kind are kept as messages. With `--strict`, the first problem is an
error.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from msgspec import structs

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.folders import readable
from scenicq.store.manifest import Omission
from scenicq.store.segment import SourceProblem

__all__ = ["MOST_MESSAGES", "Report"]

MOST_MESSAGES = 20
"""Messages that are kept of one kind of problem."""
_MOST_ELEMENTS, _LONGEST_ELEMENT = 200, 200
"""Kinds of elements that have counts of their own, and characters of their names: a source may make up any number."""
_LONG = re.compile(r"`([^`]{80})[^`]{20,}`")
"""A name that is too long for a message."""


class Report:
    """Collects the problems of one ingest.

    Counts are complete. Messages are not, so that a source with a million bad records needs no more memory than one
    with a few.
    """

    def __init__(self, *, strict: bool = False) -> None:
        """Start without problems.

        Args:
            strict: Whether the first problem ends the ingest.
        """
        self._strict = strict
        self._counts: Counter[tuple[bool, str, str, str]] = Counter()
        self._problems: list[SourceProblem] = []
        self._messages_of: Counter[tuple[str, str]] = Counter()
        self._elements = 0

    def leave_out(self, what: str, code: str, message: str, *, hints: tuple[str, ...] = ()) -> None:
        """Report that something is left out.

        Args:
            what: Its kind: "recording", "label", "object", "map element" ...
            code: A key of `CODES`.
            message: The fact with file, line and identifiers.
            hints: Statements that one can act on.

        Raises:
            DataError: The ingest is strict.
        """
        self._add(SourceProblem(what, code, "", False, message, hints))

    def keep(self, what: str, code: str, message: str, *, name: str = "", hints: tuple[str, ...] = ()) -> None:
        """Report that something is kept although it has a defect.

        Args:
            what: The kind of what has the defect.
            code: A key of `CODES`.
            message: The fact.
            name: What several have in common, such as the unknown class; they are counted together, with one message.
            hints: Statements that one can act on.

        Raises:
            DataError: The ingest is strict.
        """
        self._add(SourceProblem(what, code, name, True, message, hints))

    def assume(self, what: str, name: str, message: str, *, hints: tuple[str, ...] = ()) -> None:
        """Report a value that is taken because the source says none; with one message, and no error if strict.

        Args:
            what: The kind of what has it: "recording", "map" ...
            name: The assumption, in a few words.
            message: The fact with its file and line.
            hints: Statements that one can act on.
        """
        self._add(SourceProblem(what, "assumed", name, True, message, hints), strict=False)

    def count_unread(self, element: str, count: int = 1) -> None:
        """Count elements that are sound and that a dataset cannot hold; no error if strict.

        Args:
            element: Their name in the format.
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

    def merge(self, counts: Iterable[tuple[str, str, str, bool, int]], problems: Iterable[SourceProblem]) -> None:
        """Add the `tally` and the `problems` of another report, as if they had been reported here."""
        before = {key for key in self._counts if key[0] and key[3]}
        for problem in problems:
            if _key(problem) not in before and self._messages_of[problem.what, problem.code] < MOST_MESSAGES:
                self._problems.append(problem)
                self._messages_of[problem.what, problem.code] += 1
        for what, code, name, kept, count in counts:
            if code == "not-read":
                self.count_unread(name, count)
            else:
                self._counts[kept, what, code, name] += count

    @property
    def tally(self) -> tuple[tuple[str, str, str, bool, int], ...]:
        """How often each problem occurred: what, code, name, kept, count."""
        return tuple((entry.what, entry.code, entry.name, entry.kept, entry.count) for entry in self.counts)

    @property
    def problems(self) -> tuple[SourceProblem, ...]:
        """The first problems of each kind."""
        return tuple(self._problems)

    @property
    def counts(self) -> tuple[Omission, ...]:
        """How often each problem occurred, sorted."""
        return tuple(
            Omission(what, code, count, name, kept) for (kept, what, code, name), count in sorted(self._counts.items())
        )

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """Warnings: the messages, then for each kind with more problems than messages how many there were."""
        more = [
            Diagnostic(code, f"{total} {what}s like this in all", severity="warning")
            for (what, code), kept in sorted(self._messages_of.items())
            if kept >= MOST_MESSAGES and (total := self._total(what, code)) > MOST_MESSAGES
        ]
        return (*(Diagnostic(p.code, p.message, hints=p.hints, severity="warning") for p in self._problems), *more)

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
        if self._messages_of[kind] < MOST_MESSAGES:
            self._messages_of[kind] += 1
            self._problems.append(problem)


def _key(problem: SourceProblem) -> tuple[bool, str, str, str]:
    return problem.kept, problem.what, problem.code, problem.name
