"""Verdicts, in the words of the program, from what first fit and the search for a correspondence found.

The search knows objects, label objects and constraints by their numbers; a verdict has their names, and says where in
the program a constraint stands.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from scenicq.budget import Exhausted
from scenicq.forest.groups import Comparison, Constraint
from scenicq.forest.nodes import Leaf, Value
from scenicq.forest.scenario import Scenario
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import describe_constraint, unobserved_motion
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import UNOBSERVED, Refuted, Undecided
from scenicq.match.search.first_fit import FailedBatch, FilledBatch, FirstFit, OpenBatch
from scenicq.match.search.label_search import Failure, LabelSearch, Solution
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.store.labels import Label

__all__ = ["VerdictBuilder"]

_WITNESS_TYPES = (float, tuple)
"""The kinds of values that a witness has: numbers and points."""
_UNDECIDED_WEIGHT, _EXHAUSTED_WEIGHT = 2_000_000, 1_000_000
"""Weights of unknown verdicts, above every depth of a search: a no weighs the depth that it came to."""


@dataclass(frozen=True, slots=True, eq=False)
class VerdictBuilder:
    """Makes the verdicts of one scenario.

    Attributes:
        scenario: The scenario.
        options: The options.
    """

    scenario: Scenario
    options: MatchOptions
    _marks: dict[Leaf, str] = field(default_factory=dict["Leaf", "str"], repr=False)

    def match(self, label: Label, solution: Solution) -> Match:
        """The match by a correspondence that the search found."""
        known = [
            (leaf, value)
            for group, outcome in solution.outcomes
            for leaf in group.group.variables
            if (value := outcome.values.get(leaf.identity)) is not None
        ]
        keys = self._witness_keys([leaf for leaf, _ in known])
        return Match(self.names(label, solution.assignment), _witness(keys, [value for _, value in known]))

    def batch_verdicts(
        self, fit: FirstFit, batch: FilledBatch | FailedBatch | OpenBatch, lookups: MapLookups | None
    ) -> Iterator[tuple[int, Verdict]]:
        """The verdicts of the labels that first fit decides.

        Args:
            fit: The plan of first fit.
            batch: Labels that all match, that all fail at one constraint, or that are all open.
            lookups: What is known of the map, to say in detail why a label is no match. None: the constraint is enough.

        Yields:
            The label's number among those that were asked about, and its verdict. With lookups, a label gets none
            where the detail is not clear: it is then searched by itself.
        """
        if isinstance(batch, FilledBatch):
            return self._batch_matches(fit, batch)
        if isinstance(batch, OpenBatch):
            return self._batch_unknowns(fit, batch)
        if lookups is not None:
            return self._detailed_failures(fit, batch, lookups)
        verdict = NoMatch(self._cause(Refuted(batch.constraint)))
        return ((row.number, verdict) for row in batch.rows)

    def _batch_matches(self, fit: FirstFit, batch: FilledBatch) -> Iterator[tuple[int, Match]]:
        keys = self._witness_keys(batch.variables)
        ranks = [(self.scenario.objects[index].name, rank) for index, rank in sorted(fit.ranks.items())]
        for row, numbers, values in zip(batch.rows, batch.numbers, batch.witnesses, strict=True):
            objects = row.label.objects
            names = {name: objects[numbers[rank] - 1].id if numbers[rank] else "ego" for name, rank in ranks}
            yield row.number, Match(names, _witness(keys, values))

    def _batch_unknowns(self, fit: FirstFit, batch: OpenBatch) -> Iterator[tuple[int, Unknown]]:
        for place, (row, numbers, group) in enumerate(zip(batch.rows, batch.numbers, batch.groups, strict=True)):
            names = [*batch.observed(place)]
            assignment = {index: numbers[rank] for index, rank in fit.ranks.items()}
            seen = {index: names[rank] for index, rank in fit.ranks.items()}
            outcome = Undecided((group.doubtful or group.constraints)[0], UNOBSERVED)
            yield row.number, self._unknown(row.label, assignment, seen, outcome)

    def _detailed_failures(
        self, fit: FirstFit, batch: FailedBatch, lookups: MapLookups
    ) -> Iterator[tuple[int, NoMatch]]:
        outcomes = batch.outcomes(fit.ranks, self.options, lookups)
        for row, numbers, outcome in zip(batch.rows, batch.numbers, outcomes, strict=True):
            if isinstance(outcome, Refuted):
                assignment = {index: numbers[rank] for index, rank in fit.ranks.items() if rank < len(numbers)}
                yield row.number, NoMatch(self._cause(outcome), self.names(row.label, assignment))

    def weigh_failed_search(
        self, label: Label, search: LabelSearch, exhausted: Exhausted | None
    ) -> tuple[int, NoMatch | Unknown]:
        """The verdict of a search that found no match, after its weight.

        A label is searched once for each ego that it may have; the verdict of the greatest weight is the label's. An
        unknown outweighs every no, for the label may match with that ego. A no weighs what its search came to.

        Args:
            label: The label.
            search: Its search.
            exhausted: The limit that ended the search before all candidates were tried, if one did.
        """
        ego, failure = {self.scenario.ego: search.problem.ego}, search.failure
        if search.undecided is not None:
            return _UNDECIDED_WEIGHT, self.undecided(label, search, search.undecided)
        if exhausted is not None:
            detail = exhausted.detail or f"more than {self.options.timeout_s:g} s"
            return _EXHAUSTED_WEIGHT, Unknown(exhausted.reason, Cause("correspondence search", detail))
        if failure is None:
            cause = Cause("correspondence", "no distinct label objects for all objects")
            return 0, self.without_candidates(label, search.problem.ego, cause)
        return failure.depth, NoMatch(self._cause(failure.outcome), self.names(label, ego | dict(failure.assignment)))

    def undecided(self, label: Label, search: LabelSearch, failure: Failure) -> Unknown:
        """The verdict of a correspondence of which the search can say neither that it matches nor that it does not."""
        assignment = {self.scenario.ego: search.problem.ego} | dict(failure.assignment)
        seen = {index: search.problem.seen[number] for index, number in assignment.items()}
        return self._unknown(label, assignment, seen, failure.outcome)

    def _unknown(
        self, label: Label, assignment: Mapping[int, int], seen: Mapping[int, Container[str]],
        outcome: Refuted | Undecided,
    ) -> Unknown:  # fmt: skip
        reason = "" if isinstance(outcome, Refuted) else outcome.reason
        cause = self._cause(outcome)
        if reason == UNOBSERVED:
            cause = replace(cause, detail=unobserved_motion(self.scenario, seen, outcome.constraint))
        return Unknown(reason, cause, self.names(label, assignment))

    def without_candidates(self, label: Label, ego: int, cause: Cause) -> NoMatch:
        """The verdict of a label that is excluded before any role but the ego is filled."""
        return NoMatch(cause, self.names(label, {self.scenario.ego: ego}))

    def without_ego(self) -> NoMatch:
        """The verdict of a label in which nothing can play the ego."""
        ego = self.scenario.objects[self.scenario.ego]
        detail = "the source has no ego" if self.options.ego == "label" else f"no {ego.category}"
        return NoMatch(Cause(f"{ego.name}.class", detail, ego.span, (ego.index,)))

    def names(self, label: Label, assignment: Mapping[int, int]) -> dict[str, str]:
        """A correspondence, from numbers: names of roles, with the ids of the label objects that play them."""
        return {
            self.scenario.objects[index].name: label.objects[number - 1].id if number else "ego"
            for index, number in sorted(assignment.items())
        }

    def _cause(self, outcome: Refuted | Undecided) -> Cause:
        constraint = outcome.constraint
        description = describe_constraint(self.scenario, constraint)
        return Cause(description, outcome.detail, constraint.span, _constrained_objects(constraint))

    def _witness_keys(self, variables: Sequence[Leaf]) -> list[str]:
        """What a witness calls random variables: line and column in the program, numbered where several share them."""
        keys: list[str] = []
        counts: dict[str, int] = {}
        for leaf in variables:
            key = self._marks.get(leaf)
            if key is None:
                key = self._marks[leaf] = leaf.span.mark if leaf.span else type(leaf).__name__
            counts[key] = counts.get(key, 0) + 1
            keys.append(key if counts[key] == 1 else f"{key}#{counts[key]}")
        return keys


def _constrained_objects(constraint: Constraint) -> tuple[int, ...]:
    return (constraint.object,) if isinstance(constraint, Comparison) else constraint.requirement.objects


def _witness(keys: Sequence[str], values: Sequence[Value]) -> dict[str, WitnessValue]:
    return {key: value for key, value in zip(keys, values, strict=True) if isinstance(value, _WITNESS_TYPES)}
