"""Why a frame matches, or what keeps it from matching, in the words of the program.

For a match: the correspondence and the values that prove it, each at its place in the program. For anything else: the
correspondence that comes closest, each constraint that it breaks with the label's value and what was allowed, and the
smallest tolerance under which the frame would match.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenicq.errors import CannotEvaluate, Diagnostic, Span, render
from scenicq.forest.groups import Group
from scenicq.match.explanation import (
    Finding,
    LabelSearch,
    MatchPlan,
    Refuted,
    Satisfied,
    Undecided,
    describe_constraint,
    encode_groups,
)
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.query.execution.own_lanes import OwnLanes, show_standing
from scenicq.query.execution.results import ObjectLanes
from scenicq.query.explain.changes import show_tolerance
from scenicq.query.explain.margins import SatisfiedConstraint, margins
from scenicq.query.explain.nearest_miss import NearestMiss, closest, narrow_advice
from scenicq.query.explain.violations import Violation, violations
from scenicq.smt.smtlib import to_smtlib
from scenicq.store.labels import Label

__all__ = ["REASONS", "Explanation", "GroupScript", "Proof", "explain", "explain_match", "show_explanation"]

_WIDEST = 60
REASONS = {
    "unobserved": "the label does not tell what the program asks",
    "timeout": "the time for one frame was over (--timeout)",
    "budget": "there are more possibilities than a limit allows",
    "nonlinear": "the built-in solver cannot decide products and rotations of random values like these",
    "precision": "the answer of the solver does not hold when it is evaluated",
    "unsupported": "no formula for solvers can say it",
    "crash": "the process that decided it died",
    "garbage": "the solver gave no answer that can be read",
}
"""What the reasons of `Unknown` mean; other reasons are sentences already."""


@dataclass(frozen=True, slots=True)
class Proof:
    """A random variable of the program with the value that it must have had."""

    span: Span | None
    value: WitnessValue


@dataclass(frozen=True, slots=True)
class GroupScript:
    """A group of constraints as SMT-LIB 2.

    Attributes:
        name: What the group is about, fit for a file name.
        text: The script, or a comment where the group has none; the verdict is in a comment.
    """

    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a verdict is as it is.

    Attributes:
        frame: The frame.
        verdict: The verdict.
        correspondence: The one that matches, else the one that comes closest, else a partial one.
        proofs: The values that prove a match, in the order of the program.
        margins: What a match shows of each feature and requirement, in the order of the program.
        violations: What the closest correspondence breaks, or what is not decided of it; the first to blame first.
        closest: The smallest tolerance under which the frame would match; None if it matches, or if none would do.
        formulas: The groups under that correspondence.
        lanes: In which lanes its roles stand whose lanes the program asks for, by name.
    """

    frame: str
    verdict: Verdict
    correspondence: Mapping[str, str]
    proofs: tuple[Proof, ...] = ()
    margins: tuple[SatisfiedConstraint, ...] = ()
    violations: tuple[Violation, ...] = ()
    closest: NearestMiss | None = None
    formulas: tuple[GroupScript, ...] = ()
    lanes: Mapping[str, ObjectLanes] = field(default_factory=dict[str, ObjectLanes])


def explain(matcher: Matcher, label: Label, *, formulas: bool = False) -> Explanation:
    """Explain the verdict on a label.

    Args:
        matcher: The matcher.
        label: The label.
        formulas: Whether to write the groups as formulas, too.
    """
    finding = matcher.examine(label)
    if isinstance(finding.verdict, Match):
        return _of_match(matcher, label, finding, finding.verdict, formulas=formulas)
    nearest = closest(matcher, label)
    if nearest is None or not isinstance(nearest.finding.verdict, Match):
        return _without_match(matcher, label, finding, formulas=formulas)
    nearest = narrow_advice(matcher, label, nearest)
    assert isinstance(nearest.finding.verdict, Match)
    found = replace(nearest.finding, search=_again(matcher, nearest.finding))
    return Explanation(
        label.frame,
        finding.verdict,
        nearest.finding.verdict.correspondence,
        violations=_violations(matcher, found),
        closest=nearest,
        formulas=_formulas(matcher, found) if formulas else (),
        lanes=OwnLanes(matcher.scenario).of_label(label, nearest.finding.verdict.correspondence),
    )


def explain_match(matcher: Matcher, label: Label, correspondence: Mapping[str, str]) -> Explanation | None:
    """Explain why a label matches by one correspondence; None where it does not.

    Args:
        matcher: The matcher.
        label: The label.
        correspondence: The label object of each role, by their names.
    """
    finding = matcher.examine(label, correspondence)
    if not isinstance(finding.verdict, Match) or dict(finding.verdict.correspondence) != dict(correspondence):
        return None
    return _of_match(matcher, label, finding, finding.verdict, formulas=False)


def _of_match(matcher: Matcher, label: Label, finding: Finding, verdict: Match, *, formulas: bool) -> Explanation:
    assert finding.search is not None
    assert finding.plan is not None
    return Explanation(
        label.frame,
        verdict,
        verdict.correspondence,
        _proofs(finding),
        margins(matcher, finding.search, finding.plan, finding.assignment),
        formulas=_formulas(matcher, finding) if formulas else (),
        lanes=OwnLanes(matcher.scenario).of_label(label, verdict.correspondence),
    )


def _again(matcher: Matcher, finding: Finding) -> LabelSearch | None:
    """The search of a finding with the matcher's own options."""
    old = finding.search
    return None if old is None else LabelSearch(matcher.scenario, matcher.options, old.problem, matcher.ask)


def _without_match(matcher: Matcher, label: Label, finding: Finding, *, formulas: bool) -> Explanation:
    """No tolerance helps: say what excludes the correspondence that came furthest, or what is not decided of it."""
    match finding.verdict:
        case NoMatch():
            cause, shown = finding.verdict.cause, finding.verdict.partial
        case Unknown():
            cause, shown = finding.verdict.cause, finding.verdict.correspondence
        case Match():
            raise AssertionError("a match is explained by its witness")
    failure = finding.search.failure if finding.search is not None else None
    found: tuple[Violation, ...] = ()
    if failure is not None and finding.search is not None and isinstance(finding.verdict, NoMatch):
        found = violations(matcher, finding.search, failure.group, failure.assignment)
    if not found and isinstance(finding.verdict, Unknown):
        found = (Violation(cause.what, "is not decided", cause.detail, cause.span, finding.verdict.reason),)
    elif not found:
        found = (Violation(cause.what, "is not met", cause.detail, cause.span),)
    lanes = OwnLanes(matcher.scenario).of_label(label, shown)
    return Explanation(label.frame, finding.verdict, shown, violations=found, lanes=lanes)


def _proofs(finding: Finding) -> tuple[Proof, ...]:
    assert finding.search is not None
    assert finding.plan is not None
    found: list[Proof] = []
    for plan in finding.plan.groups:
        outcome = finding.search.decide(plan, finding.assignment)
        if isinstance(outcome, Satisfied):
            for leaf in plan.group.variables:
                value = outcome.values.get(leaf.identity)
                if isinstance(value, float):
                    found.append(Proof(leaf.span, value))
                elif isinstance(value, tuple):
                    found.append(Proof(leaf.span, (value[0], value[1])))
    return tuple(sorted(found, key=lambda proof: proof.span.start if proof.span else -1))


def _violations(matcher: Matcher, finding: Finding) -> tuple[Violation, ...]:
    attempt, plan = finding.search, finding.plan
    assert attempt is not None
    assert plan is not None
    found: list[Violation] = []
    for each in plan.groups:
        outcome = attempt.decide(each, finding.assignment)
        if isinstance(outcome, Refuted):
            found += violations(matcher, attempt, each.group, finding.assignment)
        elif isinstance(outcome, Undecided):
            what = describe_constraint(matcher.scenario, outcome.constraint)
            span, reason = outcome.constraint.span, outcome.reason
            found.append(Violation(what, "is not decided", outcome.detail, span, reason))
    return tuple(found)


def _formulas(matcher: Matcher, finding: Finding) -> tuple[GroupScript, ...]:
    attempt, plan = finding.search, finding.plan
    assert attempt is not None
    assert plan is not None
    return tuple(
        _formula(matcher, attempt, plan, number, finding.assignment) for number, _ in enumerate(plan.groups, 1)
    )


def _formula(
    matcher: Matcher, attempt: LabelSearch, plan: MatchPlan, number: int, assignment: Mapping[int, int]
) -> GroupScript:
    group: Group = plan.groups[number - 1].group
    about = [describe_constraint(matcher.scenario, item) for item in group.constraints]
    first = "".join(c if c.isalnum() or c in "._-" else "-" for c in about[0])[:40].strip("-")
    outcome = attempt.decide(plan.groups[number - 1], assignment)
    verdict = {Satisfied: "sat", Refuted: "unsat", Undecided: "unknown"}[type(outcome)]
    try:
        problem = encode_groups([attempt.items(group, assignment)], matcher.options).problem
        text = to_smtlib(problem, matcher.options.precision)
    except CannotEvaluate as error:
        text = f"; no formula: {error}\n"
    head = "".join(f"; {line}\n" for line in (*about, f"verdict: {verdict}"))
    return GroupScript(f"{number:02}-{first}", head + text)


def show_explanation(explanation: Explanation) -> str:
    """An explanation as text, without a newline at the end."""
    verdict = explanation.verdict
    headline = {Match: "matches", NoMatch: "does not match", Unknown: "is undecided"}[type(verdict)]
    lines = [f"frame {explanation.frame} {headline}"]
    if isinstance(verdict, Unknown):
        lines[0] += f": {verdict.reason}"
    kind = "correspondence" if isinstance(verdict, Match) else "closest correspondence"
    if explanation.correspondence or isinstance(verdict, NoMatch):
        roles = ", ".join(f"{name} = {played}" for name, played in explanation.correspondence.items())
        lines.append(f"{kind}: {roles}")
    lines += [f"{name} is {show_standing(each)}" for name, each in explanation.lanes.items()]
    if explanation.proofs:
        lines += ["", "it matches with these values:", *_show_proofs(explanation.proofs)]
    if explanation.margins:
        lines += ["", "what the label shows:", *_show_margins(explanation.margins)]
    for violation in explanation.violations:
        lines += ["", _show_violation(violation)]
    if explanation.closest is not None:
        lines += ["", *_show_advice(explanation.closest)]
    elif isinstance(verdict, NoMatch):
        lines += ["", "no tolerance would make it match"]
    return "\n".join(lines)


def _show_advice(nearest: NearestMiss) -> list[str]:
    alone = [f"--tolerance {show_tolerance(each)}" for each in nearest.alone]
    if len(alone) == 1:
        return [f"it would match with {alone[0]}"]
    if alone:
        return ["it would match with any one of these:", *(f"  {each}" for each in alone)]
    told = f"it would match with --tolerance {show_tolerance(nearest.tolerance)}"
    return [told, "  (no part of it is enough alone; of all that are, it has the least widest part, 20 deg being 1 m)"]


def _show_proofs(proofs: Sequence[Proof]) -> list[str]:
    rows: list[tuple[str, ...]] = []
    for proof in proofs:
        value = proof.value
        shown = f"({value[0]:z.2f}, {value[1]:z.2f})" if isinstance(value, tuple) else f"{value:z.4g}"
        place = proof.span.place if proof.span else ""
        text = " ".join(proof.span.text.split()) if proof.span else ""
        rows.append((place, _short(text), shown))
    return _aligned(rows)


def _show_margins(told: Sequence[SatisfiedConstraint]) -> list[str]:
    return _aligned([(_short(each.what), each.value, each.allowed, each.spare) for each in told])


def _short(text: str) -> str:
    return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 3]}..."


def _aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  " + "  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    ]


def _show_violation(violation: Violation) -> str:
    role, dot, end = violation.what.rpartition(".")
    if dot and end == "class":
        message = f"no label object can play `{role}`"
    else:
        message = f"`{violation.what}` {violation.value}".rstrip()
    code, verdict = "frame-excluded", "excluded"
    if violation.reason:
        code, verdict = "frame-undecided", "undecided"
        message += f": {REASONS.get(violation.reason, violation.reason)}"
    if violation.span is None:
        return f"{verdict}: {message}" + (f"\n  {violation.allowed}" if violation.allowed else "")
    return render(Diagnostic(code, message, violation.span, violation.allowed, severity=verdict))
