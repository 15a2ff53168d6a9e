"""What a program says about time as one machine: requirements, what ends a run, monitors and behaviors, over samples.

A mode says where a run stands: what is left of each requirement, and the step of each process. What is not observed at
a sample may hold or not, there in all that reads it alike; so of a run a set of modes is known, one for each way that
this may come out. A run is unknown only if two of these ways end differently. Where a behavior chooses, there is a run
for each choice, and any of them may match.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import assert_never

from scenicq.budget import Exhausted
from scenicq.errors import Span
from scenicq.forest.temporal import (
    Activity,
    Atom,
    Begin,
    BranchOnTimer,
    CheckSample,
    Choose,
    Dynamics,
    End,
    Formula,
    GiveUp,
    Goto,
    IfRuns,
    Leave,
    PutBehavior,
    Reject,
    StartTimer,
    Stop,
    Terminate,
    Test,
    Wait,
    operands,
    successors,
)  # fmt: skip
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.temporal.literals import Literal, literals_of
from scenicq.temporal.progression import HOLDS, LOST, Progression, Rest, accepts
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

__all__ = ["Advance", "Choices", "RunMachine", "Situation"]


_Place = tuple[int, tuple[tuple[int, int], ...]]
"""The step of a process, and its timers, each with the first place of a sample at which its time is over."""
_OVER: _Place = (-1, ())
"""A process that says nothing any more."""
_REJECTED: _Place = (-2, ())
"""One that has rejected the run."""
_REJECTS: _Place = (-3, ())
"""A behavior that rejects the run unless it ends with the sample: behaviors say what happens after it."""
_ASLEEP: _Place = (-4, ())
"""One of a scenario that does not run, or that overrides nothing now."""
_LISTED, _LEFT, _ENDED = 1, 2, 3
"""How a scenario runs: as those that its parent runs, after the parent has left it for others, or no more."""
_Later = Callable[[float], int]
"""The first place of a sample that is so many seconds later, and at least the next one."""
Choices = Mapping[tuple[int, int], int]
"""Which option each step of a process takes that is a choice."""


@dataclass(frozen=True, slots=True)
class _Mode:
    """What is left of each requirement, and the step of each process.

    Attributes:
        rests: What is left of the requirements, those of scenarios behind the others.
        places: Where processes are.
        running: Whether each scenario runs, and how.
        behaving: The objects whose behaviors have been overridden, each with the number of the one that it has now.
        saved: What the end of a scenario gives back: the scenario, the object, the behavior that it had.
    """

    rests: tuple[Rest, ...]
    places: tuple[_Place, ...]
    running: tuple[int, ...] = ()
    behaving: tuple[tuple[int, int], ...] = ()
    saved: tuple[tuple[int, int, int], ...] = ()

    @property
    def matches(self) -> bool:
        """Whether a run that ends in it is a match, as far as requirements and processes go."""
        return _REJECTED not in self.places and all(map(accepts, self.rests))

    @property
    def is_lost(self) -> bool:
        """Whether no run that goes on from it is a match."""
        return _REJECTED in self.places or _REJECTS in self.places or LOST in self.rests


_Modes = frozenset[_Mode]


@dataclass(slots=True)
class _Sample:
    """A mode on its way through a sample at which everything is known.

    Attributes:
        holds: Whether an atom holds.
        chosen: Which options are taken.
        here: The place of the sample, where a process has a timer.
        later: Places of later samples, there.
        met: Gets what each process does from here on; None where nobody asks.
    """

    holds: Callable[[int], bool]
    chosen: Choices
    here: int
    later: _Later | None
    rests: list[Rest]
    places: list[_Place]
    running: list[int]
    behaving: dict[int, int]
    saved: dict[tuple[int, int], int]
    met: list[tuple[Activity, ...]] | None = None

    def mode(self) -> _Mode:
        """The mode that it has come to."""
        saved = tuple(sorted((*key, process) for key, process in self.saved.items()))
        behaving = tuple(sorted(self.behaving.items()))
        return _Mode(tuple(self.rests), tuple(self.places), tuple(self.running), behaving, saved)


@dataclass(frozen=True, slots=True)
class Situation:
    """What is known of a run between two samples.

    Attributes:
        truth: Whether it is a match if it ends here.
        is_lost: Whether no run that goes on from here is a match.
        broken: What keeps it from matching if it ends here, in the program.
        lost_to: What keeps it from matching wherever it ends.
        undecided: Whether there are too many ways in which it may go on.
        reads: The numbers of the atoms that it reads at the next sample.
    """

    truth: int
    is_lost: bool
    broken: Span | None
    lost_to: Span | None
    undecided: bool
    reads: tuple[int, ...]
    modes: _Modes


@dataclass(frozen=True, slots=True)
class Advance:
    """What a sample makes of a situation.

    Attributes:
        situation: Its number after the sample; None where the run is over in any case.
        may_match: Whether the run may end here as a match.
        may_fail: Whether it may end here without being one.
        broken: What keeps it from being one, in the program.
    """

    situation: int | None
    may_match: bool = False
    may_fail: bool = False
    broken: Span | None = None


class _NotObserved(Exception):
    """An atom that has no value."""

    def __init__(self, atom: int) -> None:
        super().__init__()
        self.atom = atom


class _ToChoose(Exception):
    """A choice that is open: the number of the process and of its step, and of how many."""

    def __init__(self, step: tuple[int, int], count: int) -> None:
        super().__init__()
        self.step, self.count = step, count


@dataclass(eq=False)
class RunMachine:
    """A program made ready to be followed.

    Attributes:
        dynamics: The program.
        situations: All that have been met so far; a run begins in the first.
        atoms: The numbers of the atoms that the program reads.
        timed: Whether a process has a timer: then a situation is one of a single run.
        chooses: Whether a process chooses: then a run may go on as several.
    """

    dynamics: Dynamics
    situations: list[Situation] = field(init=False, default_factory=list[Situation])
    atoms: tuple[int, ...] = field(init=False)
    timed: bool = field(init=False)
    chooses: bool = field(init=False)
    _progression: Progression = field(init=False, default_factory=Progression)
    _literals: dict[int, Literal] = field(init=False)
    _numbers: dict[_Modes, int] = field(init=False, default_factory=dict["_Modes", int])
    _known: dict[tuple[int, tuple[int, ...], bool, int], tuple[Advance, ...]] = field(
        init=False, default_factory=dict["tuple[int, tuple[int, ...], bool, int]", "tuple[Advance, ...]"]
    )
    _ways: dict[tuple[_Mode, tuple[int, ...], bool, int], tuple[tuple[_Mode, bool], ...]] = field(
        init=False, default_factory=dict["tuple[_Mode, tuple[int, ...], bool, int]", "tuple[tuple[_Mode, bool], ...]"]
    )

    def __post_init__(self) -> None:
        """Begin."""
        dynamics = self.dynamics
        ends = [each for each in dynamics.terminations if each.condition is not None]
        self._before = [each.condition.number for each in ends if each.condition and not each.simulation]
        self._behind = [each.condition.number for each in ends if each.condition and each.simulation]
        formulas = [each.formula for each in dynamics.every_requirement]
        self._of_formulas = [frozenset(_atoms(each)) for each in formulas]
        counts = [len(each.requirements) for each in dynamics.scenarios]
        firsts = [len(dynamics.requirements), *(len(dynamics.requirements) + n for n in accumulate(counts))]
        self._own_rests = [range(*ends) for ends in pairwise(firsts)]
        self._scenario_of = {
            process: number for number, each in enumerate(dynamics.scenarios) for process in each.processes
        }
        self._overriding = {number for number, each in enumerate(dynamics.processes) if each.overrides}
        self._of_processes = _reads(dynamics, self._of_formulas, self._own_rests)
        every = {*self._before, *self._behind}.union(*self._of_formulas, *(s for m in self._of_processes for s in m))
        self.atoms = tuple(sorted(every))
        steps = [step for process in dynamics.processes for step in process.steps]
        self._composing = [number for number, each in enumerate(dynamics.processes) if each.composes]
        self._monitors = [
            number for number, each in enumerate(dynamics.processes) if each.object is None and not each.composes
        ]
        self._behaviors = [number for number, each in enumerate(dynamics.processes) if each.object is not None]
        self._literals = dict(enumerate(literals_of(dynamics.conditions)))
        self.timed = any(isinstance(step, StartTimer) for step in steps)
        self.chooses = any(isinstance(step, Choose) for step in steps)
        self._rests = tuple(map(self._progression.add, formulas))
        self.begin()

    def begin(self) -> None:
        """Forget all situations but the first."""
        for known in (self.situations, self._numbers, self._known, self._ways):
            known.clear()
        dynamics = self.dynamics
        asleep = self._scenario_of.keys() | self._overriding
        places = tuple([_ASLEEP if each in asleep else (0, ()) for each in range(len(dynamics.processes))])
        top = len(dynamics.requirements)
        rests = (*self._rests[:top], *(HOLDS for _ in self._rests[top:]))
        self._situation(frozenset((_Mode(rests, places, (0,) * len(dynamics.scenarios)),)))

    def advance(
        self, situation: int, values: Mapping[int, int], *, due: bool, here: int = 0, later: _Later | None = None
    ) -> tuple[Advance, ...]:
        """What a sample makes of a situation, for each way in which the run may choose there.

        Args:
            situation: Its number.
            values: The truth value of each atom at the sample.
            due: Whether the time of `terminate after` is over there.
            here: The place of the sample, where a process has a timer.
            later: Places of later samples, there.
        """
        reads = self.situations[situation].reads
        key = situation, tuple([values[atom] for atom in reads]), due, here
        if key not in self._known:
            found = self.ways(situation, values, due=due, here=here, later=later)
            self._known[key] = tuple(dict.fromkeys(advance for advance, _ in found))
        return self._known[key]

    def ways(
        self, situation: int, values: Mapping[int, int], *, due: bool, here: int = 0, later: _Later | None = None
    ) -> Iterator[tuple[Advance, Choices]]:
        """What a sample makes of a situation, with what the run chooses there; arguments are those of `advance`."""
        modes, reads = self.situations[situation].modes, self.situations[situation].reads
        told = tuple([values[atom] for atom in reads])
        stack: list[Choices] = [{}]
        while stack:
            chosen = stack.pop()
            try:
                yield self._advanced(modes, reads, told, chosen, due=due, here=here, later=later), chosen
            except _ToChoose as choice:
                stack += [{**chosen, choice.step: option} for option in range(choice.count)]

    def _advanced(
        self,
        modes: _Modes,
        reads: tuple[int, ...],
        told: tuple[int, ...],
        chosen: Choices,
        *,
        due: bool,
        here: int,
        later: _Later | None,
    ) -> Advance:
        values = dict(zip(reads, told, strict=True))
        going: set[_Mode] = set()
        ended: set[_Mode] = set()
        try:
            for mode in modes:
                for after, over in self._ways_of(mode, told, values, chosen, due=due, here=here, later=later):
                    (ended if over else going).add(after)
        except Exhausted:
            return Advance(self._undecided())
        if len(going) > LIMITS.run_modes:
            return Advance(self._undecided())
        failed = frozenset(each for each in ended if not self._matches(each))
        return Advance(
            self._situation(frozenset(going)) if going else None,
            len(failed) < len(ended),
            bool(failed),
            self._broken(failed),
        )

    def _ways_of(
        self, mode: _Mode, told: tuple[int, ...], values: Mapping[int, int], chosen: Choices, *, due: bool, here: int,
        later: _Later | None,
    ) -> tuple[tuple[_Mode, bool], ...]:  # fmt: skip
        """The modes that a sample may lead to from one, each with whether the run is over."""
        key = mode, told, due, here
        if chosen or key not in self._ways:
            found: set[tuple[_Mode, bool]] = set()
            stack: list[dict[int, bool]] = [{}]
            tried = 0
            while stack:
                assumed = stack.pop()
                tried += 1
                if tried > LIMITS.observation_ways:
                    raise limit_exceeded("observation_ways")
                try:
                    holds = self._holding(values, assumed)
                    found.add(self._step(mode, holds, chosen, due=due, here=here, later=later))
                except _NotObserved as error:
                    stack += [{**assumed, error.atom: True}, {**assumed, error.atom: False}]
            if chosen:
                return tuple(found)
            self._ways[key] = tuple(found)
        return self._ways[key]

    def _holding(self, values: Mapping[int, int], assumed: Mapping[int, bool]) -> Callable[[int], bool]:
        """Whether an atom holds, which is known or assumed; what is assumed of one is so of all that are alike."""

        def holds(atom: int) -> bool:
            value = values[atom]
            if value != UNKNOWN:
                return value == TRUE
            literal = self._literals.get(atom, Literal(atom))
            if literal.atom not in assumed:
                raise _NotObserved(literal.atom)
            return assumed[literal.atom] == literal.positive

        return holds

    def _step(
        self, mode: _Mode, holds: Callable[[int], bool], chosen: Choices, *, due: bool, here: int,
        later: _Later | None, met: list[tuple[Activity, ...]] | None = None,
    ) -> tuple[_Mode, bool]:  # fmt: skip
        """The mode after a sample at which everything is known, and whether the run is over."""
        now = self._entered(mode, holds, chosen, here, later, met)
        if _REJECTS in mode.places:
            now.places = [_REJECTED if place == _REJECTS else place for place in mode.places]
            return now.mode(), due or any(map(holds, self._before))
        over = due
        for number in () if over else self._composing:
            over = self._run(number, now) or over
        # these stop the monitors before they run
        over = over or any(map(holds, self._before))
        if over or _REJECTED in now.places:
            return now.mode(), over
        for number in self._awake(now, self._monitors):
            over = self._run(number, now) or over
        over = over or any(map(holds, self._behind))
        # behaviors run one after the other, to the first one that ends the run or loses it
        for number in () if over else self._behaviors:
            before = now.places[number]
            if before == _ASLEEP or not self._behaves(number, now):
                continue
            over = self._run(number, now)
            if now.places[number] == _REJECTED != before:
                now.places[number] = _REJECTS
            if over or now.places[number] == _REJECTS:
                break
        return now.mode(), over

    def _entered(
        self, mode: _Mode, holds: Callable[[int], bool], chosen: Choices, here: int, later: _Later | None,
        met: list[tuple[Activity, ...]] | None = None,
    ) -> _Sample:  # fmt: skip
        """A mode at a sample, which the program's own requirements have read."""
        top = len(self.dynamics.requirements)
        rests = [self._progression.after(rest, holds) for rest in mode.rests[:top]]
        saved = {(scenario, index): process for scenario, index, process in mode.saved}
        return _Sample(
            holds, chosen, here, later, [*rests, *mode.rests[top:]], list(mode.places), list(mode.running),
            dict(mode.behaving), saved, met,
        )  # fmt: skip

    def _awake(self, now: _Sample, monitors: list[int]) -> list[int]:
        """The monitors whose scenarios run and are not left."""
        own = self._scenario_of
        return [each for each in monitors if each not in own or now.running[own[each]] == _LISTED]

    def _behaves(self, number: int, now: _Sample) -> bool:
        """Whether a behavior is the one that its object has now."""
        owner = self.dynamics.processes[number].object
        assert owner is not None
        return now.behaving.get(owner, number if number not in self._overriding else -1) == number

    def doing(
        self, situation: int, values: Mapping[int, int], chosen: Choices, *, due: bool, here: int = 0,
        later: _Later | None = None, last: bool = False,
    ) -> tuple[tuple[Activity, ...] | None, ...]:  # fmt: skip
        """What each process does from a sample on, if the run goes on; None where that is not known.

        Arguments are those of `advance`, what is chosen, and whether it is the last sample.
        """
        count = len(self.dynamics.processes)
        hopeful: set[tuple[tuple[Activity, ...], ...]] = set()
        lost: set[tuple[tuple[Activity, ...], ...]] = set()
        for mode in self.situations[situation].modes:
            stack: list[dict[int, bool]] = [{}]
            tried = 0
            while stack:
                assumed = stack.pop()
                tried += 1
                if tried > LIMITS.observation_ways:
                    return (None,) * count
                met: list[tuple[Activity, ...]] = [()] * count
                try:
                    after, over = self._step(
                        mode, self._holding(values, assumed), chosen, due=due, here=here, later=later, met=met
                    )
                except _NotObserved as error:
                    stack += [{**assumed, error.atom: True}, {**assumed, error.atom: False}]
                except Exhausted:
                    return (None,) * count
                else:
                    if not over:
                        runs = [
                            tuple(
                                [each for each in told if after.running[each.scenario : each.scenario + 1] != (_ENDED,)]
                            )
                            for told in met
                        ]
                        may_match = self._matches(after) if last else not after.is_lost
                        (hopeful if may_match else lost).add(tuple(runs))
        ways = [*(hopeful or lost)]
        return tuple(
            ways[0][number] if ways and all(each[number] == ways[0][number] for each in ways) else None
            for number in range(count)
        )

    def _run(self, number: int, now: _Sample) -> bool:
        """Lead a process through a sample; whether it ends the run."""
        steps = self.dynamics.processes[number].steps
        at, timers = now.places[number][0], dict(now.places[number][1])
        # who goes through more steps than there are never gets to the next sample
        for _ in range(len(steps) + 1 if at >= 0 else 0):
            step = steps[at]
            match step:
                case Test():
                    at = step.then if now.holds(step.condition.number) else step.otherwise
                case Goto():
                    at = step.then
                case StartTimer():
                    due = now.here + 1 if now.later is None else now.later(step.after_s)
                    timers[step.timer] = max(due, timers.get(step.timer, 0)) if step.extends else due
                    at = step.then
                case BranchOnTimer():
                    at = step.then if timers[step.timer] <= now.here else step.otherwise
                case Choose():
                    if (number, at) not in now.chosen:
                        raise _ToChoose((number, at), len(step.options))
                    at = step.options[now.chosen[number, at]]
                case IfRuns():
                    at = step.then if now.running[step.scenario] in (_LISTED, _LEFT) else step.otherwise
                case Begin() | CheckSample() | Stop() | Leave() | PutBehavior():
                    self._directed(step, now)
                    at = step.then
                case Wait():
                    if now.met is not None:
                        now.met[number] = step.activities
                    # of a timer whose time is over nothing but that is known any more
                    running = [(timer, timers[timer]) for timer in step.timers if timer in timers]
                    now.places[number] = step.then, tuple([(key, at if at > now.here else 0) for key, at in running])
                    return False
                case Terminate():
                    now.places[number] = _OVER
                    return True
                case Reject():
                    now.places[number] = _REJECTED
                    return False
                case End():
                    now.places[number] = _OVER
                    return False
                case GiveUp():
                    raise limit_exceeded("scenario_starts")
                case _:
                    assert_never(step)
        if at >= 0:
            now.places[number] = _REJECTED
        return False

    # --- scenarios within the program

    def _directed(self, step: Begin | CheckSample | Stop | Leave | PutBehavior, now: _Sample) -> None:
        """Begin, go on with or end scenarios, or what they override."""
        match step:
            case Begin():
                scenario = step.scenario
                self._close(scenario, now)
                now.saved = {key: each for key, each in now.saved.items() if key[0] != scenario}
                for number in self._own_rests[scenario]:
                    if now.rests[number] != LOST:
                        now.rests[number] = self._rests[number]
                for number in self.dynamics.scenarios[scenario].processes:
                    _awaken(number, now)
                now.running[scenario] = _LISTED
            case CheckSample():
                for number in self._own_rests[step.scenario]:
                    now.rests[number] = self._progression.after(now.rests[number], now.holds)
            case Stop():
                self._stop(step.scenario, now)
            case Leave():
                for number, each in enumerate(self.dynamics.scenarios):
                    if each.parent == step.scenario and now.running[number] == _LISTED:
                        # no sample is read any more by what it requires
                        self._close(number, now)
                        now.running[number] = _LEFT
            case PutBehavior():
                before = now.behaving.get(step.object, self._first_behavior(step.object))
                now.saved.setdefault((step.scenario, step.object), before)
                self._behave(step.object, step.process, now)
                if step.process >= 0:
                    _awaken(step.process, now)

    def _first_behavior(self, owner: int) -> int:
        """The behavior that an object has unless it is overridden; -1 for none."""
        own = [each for each in self._behaviors if self.dynamics.processes[each].object == owner]
        return next((each for each in own if each not in self._overriding), -1)

    def _behave(self, owner: int, process: int, now: _Sample) -> None:
        """An object behaves in another way; what must be shown of the way before has time again when that goes on."""
        before = now.behaving.get(owner, self._first_behavior(owner))
        if before >= 0 and before != process:
            at, timers = now.places[before]
            now.places[before] = self.dynamics.processes[before].afresh.get(at, at), timers
        now.behaving[owner] = process

    def _stop(self, scenario: int, now: _Sample) -> None:
        """End a scenario if it runs, those that it runs first."""
        order: list[int] = []
        stack = [scenario] if now.running[scenario] in (_LISTED, _LEFT) else []
        while stack:
            order.append(stack.pop())
            stack += [
                number for number, each in enumerate(self.dynamics.scenarios)
                if each.parent == order[-1] and now.running[number] == _LISTED
            ]  # fmt: skip
        for each in reversed(order):
            for key in [key for key in now.saved if key[0] == each]:
                self._behave(key[1], now.saved.pop(key), now)
            self._close(each, now)
            now.running[each] = _ENDED

    def _close(self, scenario: int, now: _Sample) -> None:
        """What a scenario requires must hold by now, and says nothing any more."""
        for number in self._own_rests[scenario]:
            now.rests[number] = HOLDS if accepts(now.rests[number]) else LOST

    def _matches(self, mode: _Mode) -> bool:
        """Whether a run that ends in a mode is a match."""
        return mode.matches and all(mode.running[each] for each in self.dynamics.needs)

    def _situation(self, modes: _Modes) -> int:
        if modes not in self._numbers:
            if self.situations and len(self.situations) >= LIMITS.run_situations:
                return self._undecided()
            self._numbers[modes] = len(self.situations)
            matching = [self._matches(mode) for mode in modes]
            truth = int(TRUE if all(matching) else UNKNOWN if any(matching) else FALSE)
            lost = all(mode.is_lost for mode in modes)
            reads = tuple(sorted({atom for mode in modes for atom in self._reads(mode)}))
            broken = self._broken(modes) if truth == FALSE else None
            lost_to = self._broken(modes, for_good=True) if lost else None
            self.situations.append(Situation(truth, lost, broken, lost_to, undecided=False, reads=reads, modes=modes))
        return self._numbers[modes]

    def _undecided(self) -> int:
        none = _Modes()
        if none not in self._numbers:
            self._numbers[none] = len(self.situations)
            self.situations.append(
                Situation(int(UNKNOWN), is_lost=False, broken=None, lost_to=None, undecided=True, reads=(), modes=none)
            )
        return self._numbers[none]

    def _reads(self, mode: _Mode) -> Iterator[int]:
        yield from (*self._before, *self._behind)
        for atoms, rest in zip(self._of_formulas, mode.rests, strict=True):
            if any(rest):
                yield from atoms
        for steps, place in zip(self._of_processes, mode.places, strict=True):
            if place[0] >= 0:
                yield from steps[place[0]]

    def _broken(self, modes: _Modes, *, for_good: bool = False) -> Span | None:
        """What keeps runs in some modes from matching: what does so in all of them, else in the first."""
        if not modes:
            return None
        ways = [self._causes(mode, for_good=for_good) for mode in modes]
        common = set[int](ways[0]).intersection(*ways[1:])
        number = min(common or {min(each) for each in ways if each} or {-1})
        if number < 0:
            return None
        said = [*self.dynamics.every_requirement, *self.dynamics.processes]
        return said[number].span

    def _causes(self, mode: _Mode, *, for_good: bool) -> list[int]:
        found = [n for n, rest in enumerate(mode.rests) if rest == LOST or not (for_good or accepts(rest))]
        rejecting = (_REJECTED, _REJECTS) if for_good else (_REJECTED,)
        return found + [len(mode.rests) + n for n, place in enumerate(mode.places) if place in rejecting]


def _awaken(process: int, now: _Sample) -> None:
    """Begin a process, unless it has rejected the run."""
    if now.places[process] not in (_REJECTED, _REJECTS):
        now.places[process] = (0, ())


def _reads(
    dynamics: Dynamics, of_formulas: Sequence[frozenset[int]], own_rests: Sequence[range]
) -> list[list[frozenset[int]]]:
    """For each process the numbers of the atoms that may be read at one sample, by the step at which it goes on."""
    # what else is read where a process comes to a step: by whole processes that begin with it, and by formulas
    found: list[list[frozenset[int]]] = []
    for own, process in enumerate(dynamics.processes):
        mine: list[frozenset[int]] = []
        for first in range(len(process.steps)):
            atoms: set[int] = set()
            seen = {(own, first), (own, process.afresh.get(first, first))}
            stack = list(seen)
            while stack:
                number, at = stack.pop()
                step = dynamics.processes[number].steps[at]
                after = [(number, each) for each in successors(step)]
                match step:
                    case Test():
                        atoms.add(step.condition.number)
                    case Begin() | CheckSample():
                        atoms.update(*(of_formulas[each] for each in own_rests[step.scenario]))
                    case _:
                        pass
                begun: tuple[int, ...] = ()
                if isinstance(step, Begin):
                    begun = dynamics.scenarios[step.scenario].processes
                elif isinstance(step, PutBehavior):
                    begun = (step.process,) if step.process >= 0 else ()
                after += [(each, 0) for each in begun]
                new = [each for each in after if each not in seen]
                seen.update(new)
                stack += new
            mine.append(frozenset(atoms))
        found.append(mine)
    return found


def _atoms(formula: Formula) -> Iterator[int]:
    stack = [formula]
    while stack:
        node = stack.pop()
        stack.extend(operands(node))
        if isinstance(node, Atom):
            yield node.number
