"""`--where` and `--sort`: which matches are results, and in what order, by the values that the program records.

A condition is read with Scenic's own grammar and evaluated over three truth values, node by node: names of recorded
values, numbers, texts, comparisons, `and`, `or`, `not`, and nothing else. A value that is null makes it unknown, and a
match of which it is unknown is left out, and counted. What is no match is no matter of it.
"""

from __future__ import annotations

import contextlib
import heapq
import operator
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

from msgspec import UNSET, structs

from scenicq.errors import DataError, Diagnostic, ScenarioError, Source, Span, similar
from scenicq.match.verdict import Match
from scenicq.query.execution.recorded_columns import ColumnKind, RecordedColumn
from scenicq.query.execution.records import Record, SeriesRecord, recorded_fields
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import Funnel, RecordedCell, Result, SelectionCounts
from scenicq.syntax import ast
from scenicq.syntax.parser import parse

__all__ = ["ResultSelection", "SortKey", "WhereCondition", "read_sort", "read_where"]

_COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "==": operator.eq, "!=": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_NUMBERS = ("minimum", "maximum", "mean")
_PARTS = ("first", "last", *_NUMBERS)

_Shown = TypeVar("_Shown", Result, Record)
"""A result, or one as it is written."""
Cells = Mapping[str, RecordedCell]
"""Values by their names, the parts of what is recorded over an interval as `gap.minimum`."""
_Read = Callable[[Cells], RecordedCell]


@dataclass(frozen=True, slots=True)
class WhereCondition:
    """A condition on what results carry.

    Attributes:
        text: As it was given.
        truth: What it is of some values; None where that is unknown.
    """

    text: str
    truth: Callable[[Cells], bool | None]


@dataclass(frozen=True, slots=True)
class SortKey:
    """A value by which matches are ordered.

    Attributes:
        text: As it was given.
        name: The value, or a part of one.
        descending: Whether the greatest comes first.
    """

    text: str
    name: str
    descending: bool

    def of(self, cells: Cells) -> tuple[bool, float]:
        """What is compared: matches without a value come last."""
        value = cells.get(self.name)
        if value is None or isinstance(value, str | tuple):
            return True, 0.0
        return False, -float(value) if self.descending else float(value)


@dataclass(slots=True)
class ResultSelection:
    """Some of the matches, in an order; what is no match stays, behind the matches where these are ordered.

    Attributes:
        where: Which matches are shown; all if None.
        sort: The order; that of the dataset if None.
        limit: How many are shown at most.
        shown, others, unclear: How many matches are shown, do not meet the condition, and may meet it.
        beyond: How many are left out because they come behind the limit.
        last: The match with which the limit ended the query, where no order asks for all of them.
    """

    where: WhereCondition | None = None
    sort: SortKey | None = None
    limit: int | None = None
    shown: int = 0
    others: int = 0
    unclear: int = 0
    beyond: int = 0
    last: Result | Record | None = field(default=None)

    @classmethod
    def read(
        cls, where: str | None, sort: str | None, columns: Sequence[RecordedColumn], limit: int | None = None
    ) -> ResultSelection:
        """The selection that a user asks for.

        Args:
            where: The condition; None for all matches.
            sort: What they are ordered by; None for the order of the dataset.
            columns: What is recorded; see `read_where`.
            limit: How many are shown at most.

        Raises:
            DataError: option-invalid: there is no such value.
        """
        return cls(
            None if where is None else read_where(where, columns),
            None if sort is None else read_sort(sort, columns),
            limit,
        )

    def chosen(self) -> SelectionCounts:
        """What was chosen, once the results are taken."""
        where, sort = ("" if each is None else each.text for each in (self.where, self.sort))
        return SelectionCounts(where, sort, self.shown, self.others, self.unclear, self.beyond, self.limit)

    def summary_of(self, whole: ResultSummary, results: int) -> ResultSummary:
        """What the results that are shown say of themselves.

        Args:
            whole: What all of them say.
            results: How many are there.
        """
        chosen = self.chosen()
        return structs.replace(
            whole,
            complete=whole.complete and not chosen.left_out,
            results=results,
            where=chosen.where or UNSET,
            sort=chosen.sort or UNSET,
            left_out=whole.left_out + chosen.left_out,
            variables=whole.variables if results else {},
        )

    def applied(
        self, results: Generator[Result], funnel: Funnel, between: Callable[[Generator[Result]], Generator[Result]]
    ) -> Generator[Result]:
        """The results of a query that are shown, in their order; then the funnel says which they are.

        Args:
            results: All results of the query.
            funnel: What counts them.
            between: What becomes of those that meet the condition before they are ordered.
        """

        def filtered() -> Generator[Result]:
            with contextlib.closing(results):
                yield from self.filtered(results)
            funnel.limited = cast("Result | None", self.last)

        left = between(filtered())
        with contextlib.closing(left):
            yield from self.ordered(left)
        funnel.chosen = self.chosen()

    def filtered(self, results: Iterable[_Shown]) -> Iterator[_Shown]:
        """The results that meet the condition; without an order, up to the limit."""
        for each in results:
            if not _matches(each):
                yield each
                continue
            truth = True if self.where is None else self.where.truth(cells_of(each))
            if truth is None:
                self.unclear += 1
            elif not truth:
                self.others += 1
            else:
                self.shown += 1
                yield each
                if self.sort is None and self.shown == self.limit:
                    self.last = each
                    return

    def ordered(self, results: Iterable[_Shown]) -> Iterator[_Shown]:
        """The results in order, once all are there; with a limit, no more than so many matches are in memory."""
        if self.sort is None:
            yield from results
            return
        key, rest, matches = self.sort, list[_Shown](), 0

        def matching() -> Iterator[tuple[tuple[bool, float], int, _Shown]]:
            nonlocal matches
            for each in results:
                if _matches(each):
                    # equal ones stay in their order
                    yield key.of(cells_of(each)), matches, each
                    matches += 1
                else:
                    rest.append(each)

        if self.limit is None:
            chosen = sorted(matching(), key=lambda each: each[:2])
        else:
            chosen = heapq.nsmallest(self.limit, matching(), key=lambda each: each[:2])
        self.beyond, self.shown = matches - len(chosen), len(chosen)
        yield from (each for *_, each in chosen)
        yield from rest


def _matches(result: Result | Record) -> bool:
    return isinstance(result.verdict, Match) or result.verdict == "match"


def cells_of(result: Result | Record) -> Cells:
    """What a result carries, by names; over an interval by those of its parts."""
    found: dict[str, RecordedCell] = {}
    if isinstance(result, Result):
        told = recorded_fields(result.recorded or {}, series=result.interval is not None)
    else:
        told = result.recorded or {}
    for name, value in told.items():
        if isinstance(value, SeriesRecord):
            found.update({f"{name}.{part}": getattr(value, part) for part in _PARTS})
        else:
            found[name] = value
    return found


def _kinds(columns: Sequence[RecordedColumn]) -> dict[str, ColumnKind]:
    found: dict[str, ColumnKind] = {}
    for each in columns:
        if each.series:
            found.update({f"{each.name}.{part}": "number" if part in _NUMBERS else each.kind for part in _PARTS})
        else:
            found[each.name] = each.kind
    return found


def read_sort(text: str, columns: Sequence[RecordedColumn]) -> SortKey:
    """The order that `NAME` or `NAME:desc` asks for.

    Raises:
        DataError: option-invalid: there is no such value, or it is no number.
    """
    name, _, way = text.partition(":")
    if way not in ("", "asc", "desc"):
        raise _refused(f"--sort goes up or down, not `{way}`", None, f"write `{name}` or `{name}:desc`")
    if _known("--sort", name, columns, None) not in ("number", "truth"):
        raise _refused(f"`{name}` is no number: --sort cannot order by it", None, "record a number, and order by that")
    return SortKey(text, name, way == "desc")


def read_where(text: str, columns: Sequence[RecordedColumn]) -> WhereCondition:
    """The condition that a text holds.

    Args:
        text: An expression over names of recorded values.
        columns: What the program records.

    Raises:
        DataError: option-invalid: it is none.
    """
    try:
        module = parse(Source("--where", f"{text}\n"), 3)
    except ScenarioError as error:
        raise DataError([_as_option(each) for each in error.diagnostics]) from None
    match module.body:
        case (ast.ExpressionStatement(value=value),):
            return WhereCondition(text, _truth(value, columns))
        case _:
            raise _refused("--where takes one condition", None, "as in --where 'gap < 5 and not near'")


def _as_option(told: Diagnostic) -> Diagnostic:
    return Diagnostic("option-invalid", told.message, told.span, told.label, hints=told.hints)


def _truth(node: ast.Expression, columns: Sequence[RecordedColumn]) -> Callable[[Cells], bool | None]:
    """What a condition is of some values."""
    match node:
        case ast.BoolOp():
            parts = [_truth(each, columns) for each in node.values]
            decisive = node.operator == "or"
            return lambda cells: _joined([part(cells) for part in parts], decisive=decisive)
        case ast.UnaryOp(operator="not"):
            part = _truth(node.operand, columns)

            def opposite(cells: Cells) -> bool | None:
                truth = part(cells)
                return None if truth is None else not truth

            return opposite
        case ast.ComparisonChain():
            links, left = list[Callable[[Cells], bool | None]](), node.left
            for link in node.comparisons:
                links.append(_comparison(left, link, columns))
                left = link.right
            return lambda cells: _joined([part(cells) for part in links], decisive=False)
        case _:
            kind, read = _value(node, columns)
            if kind != "truth":
                raise _refused("--where needs a condition", node.span, "compare it, as in `gap < 5`", "no truth value")
            return lambda cells: cast("bool | None", read(cells))


def _joined(truths: Sequence[bool | None], *, decisive: bool) -> bool | None:
    if decisive in truths:
        return decisive
    return None if None in truths else not decisive


def _comparison(
    left: ast.Expression, link: ast.ComparisonLink, columns: Sequence[RecordedColumn]
) -> Callable[[Cells], bool | None]:  # fmt: skip
    if link.operator not in _COMPARE:
        raise _refused(f"`{link.operator}` cannot stand in --where", link.span, f"there is {', '.join(_COMPARE)}")
    (one, read), (other, read_other) = _value(left, columns), _value(link.right, columns)
    if one != other:
        raise _refused(f"a {one} is compared with a {other}", link.span, "compare values of one kind")
    if one != "number" and link.operator not in ("==", "!="):
        raise _refused(f"a {one} is neither less nor greater", link.span, "`==` and `!=` compare it")
    compare = _COMPARE[link.operator]

    def truth(cells: Cells) -> bool | None:
        a, b = read(cells), read_other(cells)
        return None if a is None or b is None else compare(a, b)

    return truth


def _value(node: ast.Expression, columns: Sequence[RecordedColumn]) -> tuple[ColumnKind, _Read]:
    """What stands in a condition for a value: its kind, and what reads it."""
    match node:
        case ast.LiteralValue(value=bool() as value):
            return "truth", lambda _: value
        case ast.LiteralValue(value=int() | float() as value):
            return "number", lambda _: value
        case ast.LiteralValue(value=str() as value):
            return "text", lambda _: value
        case ast.UnaryOp(operator="-", operand=ast.LiteralValue(value=int() | float() as value)):
            return "number", lambda _: -value
        case ast.Name() | ast.Attribute(value=ast.Name()):
            name = node.id if isinstance(node, ast.Name) else f"{cast(ast.Name, node.value).id}.{node.name}"
            return _known("--where", name, columns, node.span), lambda cells: cells.get(name)
        case _:
            raise _refused("this cannot stand in --where", node.span,
                           "there are names of recorded values, numbers, texts, comparisons, `and`, `or` and `not`",
                           "not a name, number or text")  # fmt: skip


def _known(option: str, name: str, columns: Sequence[RecordedColumn], span: Span | None) -> ColumnKind:
    """The kind of a recorded value.

    Raises:
        DataError: option-invalid: there is none of that name.
    """
    kinds = _kinds(columns)
    if name in kinds:
        return kinds[name]
    if any(each.name == name and each.series for each in columns):
        parts = ", ".join(f"`{name}.{part}`" for part in _PARTS)
        raise _refused(f"`{name}` has a value at each sample of an interval", span, f"there is {parts}")
    near = similar(name, kinds)
    hint = f"it records `{near}`" if near else f"it records {', '.join(f'`{each}`' for each in kinds)}" if kinds else (
        "`record (distance to other) as gap` records a value"
    )  # fmt: skip
    raise _refused(f"{option}: the program records no `{name}`", span, hint, "not recorded")


def _refused(message: str, span: Span | None, hint: str, label: str = "") -> DataError:
    return DataError(Diagnostic("option-invalid", message, span, label, hints=(hint,)))
