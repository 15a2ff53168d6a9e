"""Verdicts made of what a search found, in the words of the program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenicq.budget import Exhausted
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import Leaf, Value
from scenicq.forest.scenario import Scenario
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import describe_constraint, unobserved_motion
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import UNOBSERVED, Refuted, Undecided
from scenicq.match.search.first_fit import FailedBatch, FilledBatch, FirstFit
from scenicq.match.search.label_search import Failure, LabelSearch, Solution
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.store.labels import Label

__all__ = ["VerdictBuilder"]

_SHOWN = (float, tuple)
"""Kinds of values that a witness has."""
_UNDECIDED, _EXHAUSTED = 2_000_000, 1_000_000
"""Weights of verdicts that are unknown: above every depth that a search comes to."""


@dataclass(frozen=True, slots=True, eq=False)
class VerdictBuilder:
    """Names objects and random variables of one scenario.

    Attributes:
        scenario: The scenario.
        options: The options.
    """

    scenario: Scenario
    options: MatchOptions
    _keys: dict[Leaf, str] = field(default_factory=dict["Leaf", "str"], repr=False)

    def match(self, label: Label, solution: Solution) -> Match:
        """The match that a search found."""
        known = [
            (leaf, value)
            for group, outcome in solution.outcomes
            for leaf in group.group.variables
            if (value := outcome.values.get(leaf.identity)) is not None
        ]
        keys = self._named([leaf for leaf, _ in known])
        return Match(self.names(label, solution.assignment), _witness(keys, [value for _, value in known]))

    def of_batch(
        self, fit: FirstFit, batch: FilledBatch | FailedBatch, lookups: MapLookups | None
    ) -> Iterator[tuple[int, Match | NoMatch]]:
        """The verdicts of labels that first fit decides, with their places.

        Args:
            fit: The plan.
            batch: The labels.
            lookups: What is known of the map, if somebody reads more of a no than which constraint fails; a label of
                which there is no more to say then gets no verdict.
        """
        if isinstance(batch, FilledBatch):
            return self._matches(fit, batch)
        if lookups is not None:
            return self._failures(fit, batch, lookups)
        verdict = NoMatch(self._cause(Refuted(batch.constraint)))
        return ((row.number, verdict) for row in batch.rows)

    def _matches(self, fit: FirstFit, batch: FilledBatch) -> Iterator[tuple[int, Match]]:
        keys = self._named(batch.variables)
        owners = sorted(fit.ranks.items())
        ranks = [(self.scenario.objects[index].name, rank) for index, rank in owners]
        for row, numbers, values in zip(batch.rows, batch.numbers, batch.witnesses, strict=True):
            objects = row.label.objects
            names = {name: objects[numbers[rank] - 1].id if numbers[rank] else "ego" for name, rank in ranks}
            yield row.number, Match(names, _witness(keys, values))

    def _failures(self, fit: FirstFit, batch: FailedBatch, lookups: MapLookups) -> Iterator[tuple[int, NoMatch]]:
        outcomes = batch.outcomes(fit.ranks, self.options, lookups)
        for row, numbers, outcome in zip(batch.rows, batch.numbers, outcomes, strict=True):
            if isinstance(outcome, Refuted):
                assignment = {index: numbers[rank] for index, rank in fit.ranks.items() if rank < len(numbers)}
                yield row.number, NoMatch(self._cause(outcome), self.names(row.label, assignment))

    def without_match(self, label: Label, search: LabelSearch, ended: Exhausted | None) -> tuple[int, Verdict]:
        """The verdict of a search without a match, and its weight: an unknown outweighs every no.

        Args:
            label: The label.
            search: Its search.
            ended: What ended the search before all candidates were tried.
        """
        ego, failure = {self.scenario.ego: search.problem.ego}, search.failure
        if search.undecided is not None:
            return _UNDECIDED, self.open(label, search, search.undecided)
        if ended is not None:
            detail = ended.detail or f"more than {self.options.timeout_s:g} s"
            return _EXHAUSTED, Unknown(ended.reason, Cause("correspondence search", detail))
        if failure is None:
            return 0, self.excluded(
                label, search.problem.ego, Cause("correspondence", "no distinct label objects for all objects")
            )
        return failure.depth, NoMatch(self._cause(failure.outcome), self.names(label, ego | dict(failure.assignment)))

    def open(self, label: Label, search: LabelSearch, found: Failure) -> Unknown:
        """The verdict of a correspondence that a search leaves open."""
        reason = "" if isinstance(found.outcome, Refuted) else found.outcome.reason
        assignment = {self.scenario.ego: search.problem.ego} | dict(found.assignment)
        cause = self._cause(found.outcome)
        if reason == UNOBSERVED:
            seen = {index: search.problem.seen[number] for index, number in assignment.items()}
            cause = replace(cause, detail=unobserved_motion(self.scenario, seen, found.constraint))
        return Unknown(reason, cause, self.names(label, assignment))

    def excluded(self, label: Label, ego: int, cause: Cause) -> NoMatch:
        """What excludes a label before any object but the ego has a candidate."""
        return NoMatch(cause, self.names(label, {self.scenario.ego: ego}))

    def without_ego(self) -> NoMatch:
        """What excludes a label in which nothing can be the ego."""
        ego = self.scenario.objects[self.scenario.ego]
        detail = "the source has no ego" if self.options.ego == "label" else f"no {ego.category}"
        return NoMatch(Cause(f"{ego.name}.class", detail, ego.span, (ego.index,)))

    def names(self, label: Label, assignment: Mapping[int, int]) -> dict[str, str]:
        """A correspondence by names of objects and ids of label objects."""
        return {
            self.scenario.objects[index].name: label.objects[number - 1].id if number else "ego"
            for index, number in sorted(assignment.items())
        }

    def _cause(self, outcome: Refuted | Undecided) -> Cause:
        constraint = outcome.constraint
        what = describe_constraint(self.scenario, constraint)
        return Cause(what, outcome.detail, constraint.span, _about(constraint))

    def _named(self, variables: Sequence[Leaf]) -> list[str]:
        """What a witness calls random variables: their places in the program, numbered where several share one."""
        keys: list[str] = []
        counts: dict[str, int] = {}
        for leaf in variables:
            key = self._keys.get(leaf)
            if key is None:
                key = self._keys[leaf] = leaf.span.mark if leaf.span else type(leaf).__name__
            counts[key] = counts.get(key, 0) + 1
            keys.append(key if counts[key] == 1 else f"{key}#{counts[key]}")
        return keys


def _about(constraint: Constraint) -> tuple[int, ...]:
    """The objects that a constraint is about."""
    return (constraint.object,) if isinstance(constraint, Comparison) else constraint.requirement.objects


def _witness(keys: Sequence[str], values: Sequence[Value]) -> dict[str, WitnessValue]:
    return {key: value for key, value in zip(keys, values, strict=True) if isinstance(value, _SHOWN)}
