"""Algorithm 1 of the query paper: does a label match a scenario?

    for each way to give the scenario's objects distinct label objects (search):
        for each group of jointly dependent features, in dependency order (constraints):
            put in what the label observes and decide whether the rest can be satisfied (ladder, else a solver)

`Matcher.match` is a pure function of scenario, label and options, but for the solver it may ask. Unknown never becomes
no: a group that nothing decides leaves the label undecided unless another correspondence matches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import cast

from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.groups import PARAMS, Comparison, Constraint, Group
from scenicq.forest.nodes import Identity, Leaf, PointIn, Value
from scenicq.forest.scenario import Scenario
from scenicq.match.surroundings import within_radius
from scenicq.match.constraints import Signature, build_groups, describe_constraint, twins
from scenicq.match.ground import replay
from scenicq.match.ladder import Item, Maybe, No, Outcome, Yes, condition_group, decide
from scenicq.match.observe import observe, observe_params
from scenicq.match.options import MatchOptions
from scenicq.match.search import Answer, Exhausted, Reporter, Slot, find_assignments, matchable
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.smt.answer import Sat, Solver, Unsat
from scenicq.smt.answer import Unknown as Undecided
from scenicq.smt.encode import Target, UnsupportedError, encode
from scenicq.store.classes import class_matches
from scenicq.store.labels import Label

__all__ = ["Matcher"]


@dataclass(frozen=True, slots=True)
class _Plan:
    """What does not depend on values: the groups of one signature, sorted by how many objects they are about."""

    groups: tuple[Group, ...]
    ego_only: tuple[Group, ...]
    unary: Mapping[int, tuple[Group, ...]]
    joint: tuple[Group, ...]
    twins: Mapping[int, int]


@dataclass(eq=False)
class Matcher:
    """A scenario made ready to be matched against labels of one map.

    Attributes:
        scenario: The scenario.
        options: The options.
        solver: Decides what the ladder does not; None makes those groups unknown.
    """

    scenario: Scenario
    options: MatchOptions = MatchOptions()
    solver: Solver | None = None
    _plans: dict[Signature, _Plan] = field(default_factory=dict["Signature", "_Plan"], repr=False)

    def match(self, label: Label, reporter: Reporter | None = None) -> Verdict:
        """Decide one label.

        Args:
            label: The label, of the map that the scenario was compiled for.
            reporter: Watches the correspondence search.
        """
        attempts = [_Attempt(self, label, ego, reporter) for ego in self._egos(label)]
        if not attempts:
            thing = self.scenario.objects[self.scenario.ego]
            return NoMatch(Cause(f"{thing.name}.class", f"no {thing.category}", thing.span, (thing.index,)))
        best: Verdict | None = None
        for attempt in attempts:
            verdict = attempt.run()
            if isinstance(verdict, Match):
                return verdict
            if best is None or (isinstance(verdict, Unknown) and not isinstance(best, Unknown)):
                best = verdict
        assert best is not None
        return best

    def _egos(self, label: Label) -> list[int]:
        if self.options.ego == "label":
            return [0]
        thing = self.scenario.objects[self.scenario.ego]
        things = (label.ego, *label.objects)
        return [number for number, each in enumerate(things) if number == 0 or class_matches(thing.category, each.category, self.options.classes)]

    def plan(self, signature: Signature) -> _Plan:
        """The groups for a signature, analysed once."""
        if signature not in self._plans:
            groups = build_groups(self.scenario, signature, self.options)
            ego = self.scenario.ego
            others = [tuple(index for index in group.objects if index != ego) for group in groups]
            self._plans[signature] = _Plan(
                groups,
                tuple(group for group, about in zip(groups, others, strict=True) if not about),
                {
                    thing.index: tuple(g for g, about in zip(groups, others, strict=True) if about == (thing.index,))
                    for thing in self.scenario.objects
                },
                tuple(group for group, about in zip(groups, others, strict=True) if len(about) > 1),
                twins(self.scenario, groups),
            )
        return self._plans[signature]

    def ask(self, items: Sequence[Sequence[Item]]) -> Outcome:
        """Decide groups together by the solver; the witness is replayed, and refined once if it does not hold."""
        flat = [item for group in items for item in group]
        blame = flat[0][0]
        try:
            encoding = encode([[(_target(c, self.options), node, value) for c, node, value in g] for g in items])
        except UnsupportedError as error:
            return Maybe(blame, f"unsupported: {error}")
        if self.solver is None:
            return Maybe(blame, "no solver")
        precision = self.options.precision
        for _ in range(2):
            answer = self.solver.check(encoding.problem, precision=precision, timeout_s=self.options.timeout_s)
            match answer:
                case Unsat():
                    return No(blame)
                case Undecided():
                    return Maybe(blame, answer.reason)
                case Sat():
                    values = encoding.values(answer.witness)
                    if replay(flat, values, self.options.tolerance, precision):
                        return Yes(values)
            precision /= 100
        return Maybe(blame, "precision")


def _target(constraint: Constraint, options: MatchOptions) -> Target:
    if not isinstance(constraint, Comparison):
        return Target(None, 0.0, 0.0)
    tolerance = options.tolerance
    match constraint.property:
        case "position" if tolerance.x is not None and tolerance.y is not None:
            return Target("box", tolerance.x, tolerance.y)
        case "position":
            return Target("disc", tolerance.position, 0.0)
        case "heading":
            return Target("angle", tolerance.heading, 0.0)
        case _:
            return Target("disc", tolerance.other, 0.0)


class _Attempt:
    """One label with one of its objects as the ego."""

    def __init__(self, matcher: Matcher, label: Label, ego: int, reporter: Reporter | None) -> None:
        self.matcher = matcher
        self.scenario = matcher.scenario
        self.options = matcher.options
        self.label = label
        self.reporter = reporter
        self.things = (label.ego, *label.objects)
        self.ego = ego
        self.params = observe_params(label)
        self.seen = [observe(thing) for thing in self.things]
        self.cache: dict[tuple[int, tuple[int, ...]], Outcome] = {}
        self.undecided: tuple[Maybe, dict[int, int]] | None = None
        self.failure: tuple[int, Cause, dict[int, int]] | None = None
        radius = self.options.radius
        center = (self.things[ego].x, self.things[ego].y)
        self.near = [
            radius is None or (thing.x - center[0]) ** 2 + (thing.y - center[1]) ** 2 <= radius * radius
            for thing in self.things
        ]
        self.disc = None if radius is None else (center, radius)

    # --- candidates

    def _candidates(self) -> dict[int, list[int]] | NoMatch:
        found: dict[int, list[int]] = {}
        start = 1 if self.options.ego == "label" else 0
        for thing in self.scenario.objects:
            if thing.index == self.scenario.ego:
                continue
            found[thing.index] = [
                number
                for number in range(start, len(self.things))
                if number != self.ego
                and self.near[number]
                and class_matches(thing.category, self.things[number].category, self.options.classes)
            ]
        slots = [Slot(index, tuple(options)) for index, options in found.items()]
        short = next((slot.name for slot in slots if not slot.candidates), None)
        if short is None and matchable(slots) is None:
            short = min(found, key=lambda index: len(found[index]))
        if short is not None:
            thing = self.scenario.objects[short]
            count = len(found[short])
            detail = f"{count} of this class, too few" if count else f"no {thing.category}"
            return NoMatch(Cause(f"{thing.name}.class", detail, thing.span, (short,)), self._names({}))
        spare = sum(self.near) - 1 - len(found)
        if self.options.exact and spare:
            return NoMatch(Cause("--exact", f"{spare} label objects are left over"), self._names({}))
        return found

    def _signatures(self, candidates: dict[int, list[int]]) -> list[tuple[Signature, dict[int, list[int]]]]:
        """Candidates split by what is observed of them; one signature in most datasets."""
        result: list[tuple[list[frozenset[str]], dict[int, list[int]]]] = [([], {})]
        for thing in self.scenario.objects:
            options = [self.ego] if thing.index == self.scenario.ego else candidates[thing.index]
            by_set: dict[frozenset[str], list[int]] = {}
            for number in options:
                by_set.setdefault(frozenset(self.seen[number]), []).append(number)
            result = [
                ([*sets, seen], {**chosen, thing.index: numbers})
                for sets, chosen in result
                for seen, numbers in by_set.items()
            ]
        params = frozenset(self.params)
        return [((*sets, params), chosen) for sets, chosen in result]

    # --- deciding groups

    def _observed(self, group: Group, assignment: Mapping[int, int]) -> dict[tuple[int, str], Value]:
        observed: dict[tuple[int, str], Value] = {
            (index, name): value
            for index in group.objects
            for name, value in self.seen[assignment[index]].items()
        }
        observed.update({(PARAMS, name): value for name, value in self.params.items()})
        return observed

    def _items(self, group: Group, assignment: Mapping[int, int]) -> list[Item]:
        items = condition_group(group, self._observed(group, assignment))
        return items if self.disc is None else within_radius(items, *self.disc)

    def _decide(self, group: Group, assignment: Mapping[int, int]) -> Outcome:
        key = (id(group), tuple(assignment[index] for index in group.objects))
        if key not in self.cache:
            self.cache[key] = self._decide_now(group, assignment)
        return self.cache[key]

    def _decide_now(self, group: Group, assignment: Mapping[int, int]) -> Outcome:
        try:
            items = self._items(group, assignment)
            if self.options.method == "smt":
                return self.matcher.ask([items])
            outcome = decide(items, self.options.tolerance)
            if isinstance(outcome, Maybe):
                outcome = self.matcher.ask([items])
        except CannotEvaluate as error:
            return Maybe(group.constraints[0], f"unsupported: {error}")
        return outcome

    def _note(self, outcome: Outcome, assignment: Mapping[int, int], depth: int) -> Answer:
        """Remember what failed furthest, and the first thing undecided."""
        if isinstance(outcome, Yes):
            return Answer.YES
        if isinstance(outcome, Maybe):
            if self.undecided is None:
                self.undecided = (outcome, dict(assignment))
            return Answer.UNKNOWN
        if self.failure is None or depth > self.failure[0]:
            self.failure = (depth, self._cause(outcome.constraint, outcome.detail), dict(assignment))
        return Answer.NO

    def _cause(self, constraint: Constraint, detail: str) -> Cause:
        about = (constraint.object,) if isinstance(constraint, Comparison) else constraint.requirement.objects
        return Cause(describe_constraint(self.scenario, constraint), detail, constraint.span, about)

    # --- the algorithm

    def run(self) -> Verdict:
        """Decide the label for this ego."""
        candidates = self._candidates()
        if isinstance(candidates, NoMatch):
            return candidates
        for signature, chosen in self._signatures(candidates):
            plan = self.matcher.plan(signature)
            run = self._monolithic if self.options.method == "monolithic" else self._modular
            try:
                verdict = run(plan, chosen)
            except Exhausted:
                cause = Cause("correspondence search", f"more than {self.options.budget:,} steps")
                return Unknown("budget", cause)
            if verdict is not None:
                return verdict
        if self.undecided is not None:
            outcome, assignment = self.undecided
            return Unknown(outcome.reason, self._cause(outcome.constraint, ""), self._names(assignment))
        if self.failure is None:
            return NoMatch(Cause("correspondence", "no distinct label objects for all objects"))
        _, cause, assignment = self.failure
        return NoMatch(cause, self._names(assignment))

    def _modular(self, plan: _Plan, candidates: dict[int, list[int]]) -> Match | None:
        """Algorithm 1; a match, or None with causes noted."""
        ego = {self.scenario.ego: self.ego}
        sure = True
        for group in plan.ego_only:
            answer = self._note(self._decide(group, ego), ego, 1)
            if answer is Answer.NO:
                self.undecided = None
                return None
            sure = sure and answer is Answer.YES
        slots, doubtful = self._filter(plan, candidates, ego)
        if slots is None:
            return None
        if sure:
            firm = [Slot(s.name, tuple(c for c in s.candidates if (s.name, c) not in doubtful)) for s in slots]
            found = self._search(plan, firm, ego, accept_unknown=False)
            if found is not None:
                return self._match(plan.groups, found)
        if self.undecided is not None and self._search(plan, slots, ego, accept_unknown=True) is None:
            self.undecided = None
        return None

    def _filter(
        self, plan: _Plan, candidates: dict[int, list[int]], ego: dict[int, int]
    ) -> tuple[list[Slot] | None, set[tuple[int, int]]]:
        """Candidates that pass the groups about them and the ego alone, and which of them are doubtful."""
        slots: list[Slot] = []
        doubtful: set[tuple[int, int]] = set()
        for index, options in candidates.items():
            if index == self.scenario.ego:
                continue
            kept: list[int] = []
            for number in options:
                assignment = {**ego, index: number}
                answers: list[Answer] = []
                for depth, group in enumerate(plan.unary[index]):
                    answers.append(self._note(self._decide(group, assignment), assignment, 2 + depth))
                    if answers[-1] is Answer.NO:
                        break
                if Answer.NO in answers:
                    continue
                kept.append(number)
                if Answer.UNKNOWN in answers:
                    doubtful.add((index, number))
            if not kept:
                self.undecided = None
                return None, doubtful
            slots.append(Slot(index, tuple(kept)))
        return slots, doubtful

    def _search(
        self, plan: _Plan, slots: list[Slot], ego: dict[int, int], *, accept_unknown: bool
    ) -> dict[int, int] | None:
        if not plan.joint:
            found = matchable(slots)
            return None if found is None else {**ego, **found}
        due: dict[int, list[Group]] = {}
        for group in plan.joint:
            for index in group.objects:
                due.setdefault(index, []).append(group)

        def check(slot: int, assignment: Mapping[int, int]) -> tuple[Answer, frozenset[int]]:
            for group in due.get(slot, ()):
                if all(index in assignment for index in group.objects):
                    answer = self._note(self._decide(group, assignment), assignment, 10 + len(assignment))
                    if answer is Answer.NO or (answer is Answer.UNKNOWN and not accept_unknown):
                        return Answer.NO, frozenset(group.objects)
            return Answer.YES, frozenset()

        assignments = find_assignments(
            slots, check, fixed=ego, twins=plan.twins, budget=self.options.budget, reporter=self.reporter
        )
        return next(assignments, None)

    def _monolithic(self, plan: _Plan, candidates: dict[int, list[int]]) -> Match | None:
        """The query paper's baseline (section 5.1): one formula for all features of each correspondence."""
        ego = {self.scenario.ego: self.ego}
        slots = [Slot(index, tuple(options)) for index, options in candidates.items() if index != self.scenario.ego]
        for assignment in find_assignments(slots, _accept, fixed=ego, budget=self.options.budget):
            items = [self._items(group, assignment) for group in plan.groups]
            outcome = self.matcher.ask(items) if items else Yes({})
            if isinstance(outcome, Yes):
                for group in plan.groups:
                    self.cache[id(group), tuple(assignment[i] for i in group.objects)] = outcome
                return self._match(plan.groups, assignment)
            self._note(outcome, assignment, 1)
        return None

    # --- results

    def _names(self, assignment: Mapping[int, int]) -> dict[str, str]:
        shown = {self.scenario.ego: self.ego, **assignment}
        return {
            self.scenario.objects[index].name: "ego" if number == 0 else self.things[number].id
            for index, number in sorted(shown.items())
        }

    def _match(self, groups: tuple[Group, ...], assignment: Mapping[int, int]) -> Match:
        witness: dict[str, WitnessValue] = {}
        for group in groups:
            outcome = self._decide(group, assignment)
            assert isinstance(outcome, Yes)
            for leaf in group.variables:
                value = self._witness(group, leaf, outcome.values, assignment)
                if value is not None:
                    place = leaf.span.place if leaf.span else type(leaf).__name__
                    number = sum(key.partition("#")[0] == place for key in witness) + 1
                    witness[place if number == 1 else f"{place}#{number}"] = value
        return Match(self._names(assignment), witness)

    def _witness(
        self, group: Group, leaf: Leaf, values: Mapping[Identity, Value], assignment: Mapping[int, int]
    ) -> WitnessValue | None:
        found = values.get(leaf.identity)
        if found is None and isinstance(leaf, PointIn):
            return None
        return cast("WitnessValue | None", found)


def _accept(slot: int, assignment: Mapping[int, int]) -> tuple[Answer, frozenset[int]]:
    return Answer.YES, frozenset()
