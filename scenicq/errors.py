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
    "plain",
    "plain_json",
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
    "unknown-model": "a world model or module that is not known here",
    "specifier-conflict": "two specifiers give the same property",
    "specifier-cycle": "specifiers depend on each other in a circle",
    "specifier-missing": "a specifier needs a property that nothing gives",
    "wrong-type": "a value of another type is needed",
    "wrong-arity": "a call with too many or too few arguments",
    "wrong-value": "a value outside of what makes sense",
    "random-branch": "control flow depends on a random value",
    "no-ego": "the program needs an ego object and defines none",
    "unsupported-construct": "Scenic, but not part of what can be matched",
    "unsupported-region": "a region of a kind that cannot be used here",
    "soft-requirement": "a requirement that need not hold, so that it excludes nothing",
    "not-recorded": "a value that the program records and no result can carry",
    "impossible-requirement": "a requirement that no scene satisfies",
    "budget-exceeded": "the program takes too many steps or too much memory",
    "runtime-error": "evaluating the program failed",
    "no-map": "without a map, objects may be anywhere and head anywhere where the program says nothing else",
    "map-lacks": "the map of the dataset has no element of the needed kind",
    "option-invalid": "an option has a value that cannot be used",
    # the data
    "unknown-class": "an object class that no taxonomy lists",
    "dataset-unrecognised": "no importer recognises the source",
    "dataset-ambiguous": "several importers recognise the source",
    "dataset-empty": "the source holds no frame",
    "file-missing": "a file that the source must have is not there",
    "file-invalid": "a file cannot be read as what it should be",
    "record-invalid": "one record of the source is not sound",
    "assumed": "what the source does not say, and is taken for granted",
    "not-read": "what the source holds, and no dataset of ours has a place for",
    "map-missing": "a map that the labels refer to is not there",
    "map-does-not-fit": "vehicles do not lie on the lanes of a map, or do not head along them, or its sides are wrong",
    "map-invalid": "an element of a map is not sound",
    "store-missing": "the folder is not a dataset of ours",
    "store-version": "the dataset was written by another version",
    "store-unreachable": "where a dataset or results lie does not answer, or not to whoever asks",
    "store-damaged": "a file of the dataset is missing or changed",
    "dataset-invalid": "a table of the dataset holds what no dataset may",
    "sql-invalid": "a question in SQL that the database refuses",
    "target-exists": "the target is there already",
    "target-busy": "another run writes to the target",
    "target-unwritable": "the target cannot be written",
    "resources-exhausted": "the system gives no more memory, files or processes",
    "deadline-passed": "the time that a run may take was over before all frames were decided, or a scene drawn",
    "results-incomplete": "results do not say of every frame whether it matches, or nobody knows whether they do",
    "results-version": "results were written by a newer version",
    "ranking-cut": "a ranking has not looked at all that may be among the closest",
    "predictions-invalid": "a predicted box has a value that makes no sense",
    "predictions-doubtful": "predictions look like a placeholder, or their benchmark's own evaluation refuses them",
    "predictions-duplicate": "a predicted box or frame is there more than once",
    "predictions-missing": "a frame of the dataset has no predictions",
    "predictions-unmatched": "predictions are of a frame that the dataset does not have",
    "predictions-frame": "predicted boxes do not lie in the frame of reference that their format has",
    "no-verdict": "recordings tell too little for a verdict, or of too few of the objects in question",
    "one-correspondence": "results name one object in each role of a frame, and others may play it, too",
    "parameter-coincides": "frames that match differ from all others in a parameter",
    "objects-uncounted": "the rules of a benchmark leave out objects that play roles",
    "heights-unknown": "distances are those in the plane: the dataset does not know all heights",
    "no-density": "a probability density does not exist, or could not be computed",
    "engine-failed": "what runs a query on other processes or machines is not there, or stopped",
    # the solvers
    "solver-missing": "the solver cannot be loaded",
    "solver-failed": "the solver cannot be started",
    # the answers
    "frame-excluded": "what a frame shows is not what the program allows",
    "unseen-action": "an action or behavior of which no recording shows anything",
    "never-compared": "the program sets what no label of the dataset has",
    "class-absent": "the program has a role for a class that no label object of the dataset has",
    "no-tracks": "a program over time, and objects of which nothing says that they are the same in several labels",
    # what compiles but cannot be meant
    "angle-without-deg": "an angle of more than a full turn, which may be meant in degrees",
    "exact-number": "a measured number that is compared with `==`",
    "facing-object": "an object that is taken for a heading",
    "heading-implied": "a place that also gives a heading to what may face anywhere",
    "range-reversed": "a range whose first end is above its second",
    "requirement-always": "a requirement that holds in every scene",
    "requirement-never": "a requirement that holds in no scene",
    "angle-without-abs": "an angle with a sign that is compared as if it had none",
    "choice-of-two": "a choice of two numbers where what lies between them may be meant",
    "condition-alone": "a condition on a line of its own, which asks nothing",
    "ego-twice": "two objects that are both made the ego",
    "speed-beyond-roads": "a speed that no road sees, which may be meant in km/h",
    "speed-negative": "a speed below 0, which no label has",
    "unit-in-comment": "a number beside which a comment names another unit than it is taken in",
    "truth-compared": "a truth value that is compared as if it were a number",
    "angle-sum": "the sum of two headings where their difference may be meant",
    "angle-difference": "a difference of two directions, which jumps by a full turn",
    "measured-from-ego": "what is measured from the ego where another object may be meant",
    "default-view": "what cannot be seen under a view that the program does not set",
    "exact-place": "one point beside another object, to within a small tolerance",
    "mutated-place": "a place or direction that noise without bound takes back",
    "unbounded-number": "a requirement that a random number without bounds always lets hold",
    "box-cannot-fit": "a region that is too small for the object that must lie in it",
    "class-folded": "a class that coarse classes do not tell from others",
    "unknown-property": "a property that no class has and nothing reads",
    "unused-variable": "a variable that nothing reads",
}
"""Every diagnostic code with its meaning."""

CONTROL = re.compile(
    "[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)
"""What moves a terminal's cursor, changes its colours or turns text round, except a new line."""


def plain(text: str) -> str:
    """A text of somebody else's as it is safe on a terminal: control characters are shown, not obeyed."""
    return CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def plain_json(text: str) -> str:
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
        """The same without the file's folder: what results call the place, wherever one stands."""
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
