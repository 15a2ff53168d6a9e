"""Diagnostics: what went wrong, where, and what to do about it.

One value (`Diagnostic`), one renderer (`render`), one family of exceptions. This module knows nothing of scenarios,
datasets or terminals; every other module of the package may import it.
"""

from __future__ import annotations

import re
import unicodedata
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property

__all__ = [
    "CODES",
    "CONTROL",
    "CannotEvaluate",
    "DataError",
    "Diagnostic",
    "Note",
    "ScenarioError",
    "ScenicqError",
    "SolverError",
    "Source",
    "Span",
    "printable",
    "printable_json",
    "render",
    "similar",
]

CODES: dict[str, str] = {
    # the program
    "parse-error": "the text is not Scenic",
    "mixed-versions": "one program uses the spellings of two versions of Scenic",
    "unknown-name": "a name is used that nothing defines",
    "unknown-attribute": "a value has no attribute of that name",
    "unknown-specifier": "no specifier is spelled like this",
    "unknown-model": "a world model or module is not known here",
    "specifier-conflict": "two specifiers give the same property",
    "specifier-cycle": "specifiers depend on each other in a circle",
    "specifier-missing": "a specifier needs a property that nothing gives",
    "wrong-type": "a value has another type than is needed here",
    "wrong-arity": "a call has too many or too few arguments",
    "wrong-value": "a value is outside of what makes sense",
    "random-branch": "control flow depends on a random value",
    "no-ego": "the program needs an ego object and defines none",
    "unsupported-construct": "the text is Scenic, but not of the part that can be matched",
    "unsupported-region": "a region of this kind cannot be used here",
    "soft-requirement": "a requirement with a probability need not hold, so it excludes nothing",
    "not-recorded": "the program records a value that no result can carry",
    "impossible-requirement": "no scene satisfies a requirement",
    "budget-exceeded": "the program takes too many steps or too much memory",
    "runtime-error": "evaluating the program failed",
    "no-map": "there is no map: where the program says nothing else, objects may be anywhere and head anywhere",
    "map-lacks": "the map of the dataset has no element of the needed kind",
    "option-invalid": "an option has a value that cannot be used",
    # the data
    "unknown-class": "no taxonomy lists a class of objects",
    "dataset-unrecognised": "no importer recognises the source",
    "dataset-ambiguous": "several importers recognise the source",
    "dataset-empty": "the source holds no frame",
    "file-missing": "a file that the source must have is not there",
    "file-invalid": "a file is not what it should be",
    "record-invalid": "one record of the source is not sound",
    "assumed": "the source leaves something open, and a usual value is taken for it",
    "not-read": "the source has something that a dataset cannot hold",
    "map-missing": "the labels refer to a map that is not there",
    "map-does-not-fit": "vehicles are off the lanes of a map or head across them, or left and right are swapped",
    "map-invalid": "an element of a map is not sound",
    "store-missing": "the folder is not a dataset of ours",
    "store-version": "the dataset was written by another version",
    "store-unreachable": "the place of a dataset or of results does not answer, or refuses access",
    "store-damaged": "a file of the dataset is missing or changed",
    "dataset-invalid": "a table of the dataset breaks a rule that all datasets keep",
    "sql-invalid": "the database refuses a question in SQL",
    "target-exists": "the target exists already",
    "target-busy": "another run writes to the target",
    "target-unwritable": "the target cannot be written",
    "resources-exhausted": "the system gives no more memory, files or processes",
    "deadline-passed": "time ran out before all frames were decided, or before a scene was drawn",
    "results-incomplete": "results leave some frames out, or do not say whether they do",
    "results-version": "results were written by a newer version",
    "ranking-cut": "a ranking has not looked at every frame that may be among the closest",
    "predictions-invalid": "a predicted box has a value that makes no sense",
    "predictions-doubtful": "predictions look like placeholders, or the benchmark's own evaluation refuses them",
    "predictions-duplicate": "a predicted box or frame is there more than once",
    "predictions-missing": "a frame of the dataset has no predictions",
    "predictions-unmatched": "predictions name a frame that the dataset does not have",
    "predictions-frame": "predicted boxes are not in the frame of reference of their format",
    "no-verdict": "the recordings say too little for a verdict, or have too few of the objects in question",
    "one-correspondence": "results name one object for each role of a frame, although others may play it",
    "parameter-coincides": "all frames that match differ from all others in a parameter",
    "objects-uncounted": "the rules of a benchmark leave out objects that play roles",
    "heights-unknown": "the dataset does not know all heights, so distances are measured in the plane",
    "no-density": "a probability density does not exist, or could not be computed",
    "engine-failed": "the engine that should run a query on other processes or machines is not there, or stopped",
    # the solvers
    "solver-missing": "the solver cannot be loaded",
    "solver-failed": "the solver cannot be started",
    # the answers
    "frame-excluded": "a frame shows something that the program does not allow",
    "frame-undecided": "nothing decides whether a frame shows what the program allows",
    "unseen-action": "no recording can show an action or behavior",
    "never-compared": "the program sets a property that no label of the dataset has",
    "class-absent": "the program has a role for a class that no label object of the dataset has",
    "no-tracks": "the program is about time, but nothing says which objects of different labels are the same",
    # what compiles but cannot be meant
    "angle-without-deg": "an angle is more than a full turn, so it may be meant in degrees",
    "deviation-without-deg": "how an object is turned from the road is a plain number, and so in radians",
    "exact-number": "a measured number is compared with `==`",
    "facing-object": "an object stands where a heading is expected",
    "heading-implied": "a specifier of the place also gives a heading, to an object that may face anywhere",
    "range-reversed": "the first end of a range is above the second",
    "requirement-always": "a requirement holds in every scene",
    "requirement-never": "a requirement holds in no scene",
    "angle-without-abs": "an angle with a sign is compared as if it had none",
    "choice-of-two": "two numbers are the only choices, where a range between them may be meant",
    "condition-alone": "a condition stands on a line of its own, and requires nothing",
    "ego-twice": "two objects are both made the ego",
    "speed-beyond-roads": "a speed is above all that roads see, so it may be meant in km/h",
    "speed-negative": "a speed is below 0, which no label has",
    "unit-in-comment": "the comment beside a number names another unit than Scenic takes it in",
    "truth-compared": "a truth value is compared as if it were a number",
    "angle-sum": "two headings are added, where their difference may be meant",
    "angle-difference": "two directions are subtracted, and their difference jumps by a full turn",
    "measured-from-ego": "something is measured from the ego, where another object may be meant",
    "default-view": "something must be out of view, but the program does not say how far and wide the view is",
    "exact-place": "an object must be at one point beside another, to within a small tolerance",
    "mutated-place": "a place or direction is given, and noise without bounds takes it back",
    "unbounded-number": "a requirement always holds for some value of a random number without bounds",
    "box-cannot-fit": "a region is too small for the object that must lie in it",
    "class-folded": "coarse classes do not tell a class from others",
    "unknown-property": "no class has a property, and nothing reads it",
    "unused-variable": "nothing reads a variable",
}
"""Every diagnostic code with its meaning."""

CONTROL = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)
"""What moves a terminal's cursor, changes its colours or turns text round, except a new line."""


def printable(text: str) -> str:
    """A text of somebody else's as it is safe on a terminal: control characters are shown, not obeyed."""
    return CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def printable_json(text: str) -> str:
    """JSON as it is safe on a terminal; what it says is the same."""
    return CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


@dataclass(frozen=True)
class Source:
    """A text that diagnostics point into.

    Attributes:
        name: What the text is called in messages, usually the file's name as the user gave it.
        text: The text.
    """

    name: str
    text: str

    @property
    def file_name(self) -> str:
        """The name without folders; what is no text of it is escaped, as results name it."""
        return self.name.replace("\\", "/").rpartition("/")[2].encode(errors="backslashreplace").decode()

    @cached_property
    def line_starts(self) -> tuple[int, ...]:
        """Offsets at which the lines start."""
        starts = [0]
        for number, character in enumerate(self.text):
            if character == "\n":
                starts.append(number + 1)
        return tuple(starts)

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of an offset, both counted from 1."""
        line = bisect_right(self.line_starts, offset) - 1
        return line + 1, offset - self.line_starts[line] + 1

    def line(self, number: int) -> str:
        """The text of a line (counted from 1), without its end."""
        start = self.line_starts[number - 1]
        end = self.line_starts[number] if number < len(self.line_starts) else len(self.text)
        return self.text[start:end].rstrip("\r\n")


@dataclass(frozen=True, slots=True)
class Span:
    """A half-open range of characters of a source."""

    source: Source = field(repr=False)
    start: int
    end: int

    @property
    def place(self) -> str:
        """`file:line:column` of the start."""
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    @property
    def mark(self) -> str:
        """`place` without the folder: how results name the place, whatever folder a command runs in."""
        line, column = self.source.position(self.start)
        return f"{self.source.file_name}:{line}:{column}"

    @property
    def text(self) -> str:
        """The characters of the span."""
        return self.source.text[self.start : self.end]


@dataclass(frozen=True, slots=True)
class Note:
    """A second place that explains a diagnostic."""

    span: Span
    text: str


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One fact that the user must know.

    Attributes:
        code: A key of `CODES`.
        message: The fact, one line, no full stop.
        span: The smallest text that must change, if the fact is about a text.
        label: Why this place, printed beside the caret.
        notes: Other places.
        hints: Statements that one can act on.
        severity: "error", "warning" or "note".
    """

    code: str
    message: str
    span: Span | None = None
    label: str = ""
    notes: tuple[Note, ...] = ()
    hints: tuple[str, ...] = ()
    severity: str = "error"

    def __post_init__(self) -> None:
        assert self.code in CODES, self.code


class ScenicqError(Exception):
    """Base of all errors that are the input's fault.

    Attributes:
        diagnostics: What is wrong, at least one.
    """

    def __init__(self, diagnostics: Diagnostic | Iterable[Diagnostic]) -> None:
        """Take one or several diagnostics."""
        single = isinstance(diagnostics, Diagnostic)
        self.diagnostics: tuple[Diagnostic, ...] = (diagnostics,) if single else tuple(diagnostics)
        super().__init__(self.diagnostics)

    def __str__(self) -> str:
        """What is wrong, in words; made when it is asked for, as errors that are caught on the way are many."""
        return "\n".join(render(diagnostic) for diagnostic in self.diagnostics)


class ScenarioError(ScenicqError):
    """The Scenic program is wrong or uses what is not supported."""


class DataError(ScenicqError):
    """A source, a map or a dataset on disk is wrong."""


class SolverError(ScenicqError):
    """A solver is missing or cannot be started."""


class CannotEvaluate(Exception):
    """A question that cannot be answered in the way that was tried; the message says which.

    It is no error of the input: whoever asked tries another way, or leaves it unknown, never a no.
    """


def _columns(text: str) -> int:
    """Width of a text on a terminal: wide characters take two columns, combining ones none."""
    return sum(0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)


def _excerpt(span: Span, label: str, mark: str, margin: int) -> list[str]:
    source = span.source
    line, column = source.position(span.start)
    whole = source.line(line)
    end = min(span.end - source.line_starts[line - 1], len(whole))
    before = whole[: column - 1].expandtabs(4)
    marked = whole[: max(end, column - 1)].expandtabs(4)
    width = max(1, _columns(marked) - _columns(before))
    last, _ = source.position(max(span.start, span.end - 1))
    more = f" (to line {last})" if last > line else ""
    carets = f"{' ' * _columns(before)}{mark * width} {label}{more}".rstrip()
    return [f"{line:>{margin}} | {whole.expandtabs(4)}", f"{' ' * margin} | {carets}"]


def render(diagnostic: Diagnostic) -> str:
    """Show a diagnostic as text: one headline, the place with carets, notes, hints."""
    lines = [f"{diagnostic.severity}[{diagnostic.code}]: {diagnostic.message}"]
    spans = [diagnostic.span] if diagnostic.span else []
    spans += [note.span for note in diagnostic.notes]
    numbers = [span.source.position(span.start)[0] for span in spans]
    margin = len(str(max(numbers, default=1)))
    pad = " " * margin
    if diagnostic.span:
        lines += [f"{pad}--> {diagnostic.span.place}", f"{pad} |"]
        lines += _excerpt(diagnostic.span, diagnostic.label, "^", margin)
    elif diagnostic.label:
        lines.append(f"{pad} = note: {diagnostic.label}")
    for note in diagnostic.notes:
        if diagnostic.span is None or note.span.source is not diagnostic.span.source:
            lines.append(f"{pad}::: {note.span.place}")
        lines.append(f"{pad} |")
        lines += _excerpt(note.span, note.text, "-", margin)
    lines += [f"{pad} = hint: {hint}" for hint in diagnostic.hints]
    return "\n".join(lines)


def similar(word: str, words: Iterable[str]) -> str:
    """The one of several words that a misspelt one was probably meant to be, or nothing."""
    return next(iter(get_close_matches(word, sorted(words), n=1, cutoff=0.7)), "")
