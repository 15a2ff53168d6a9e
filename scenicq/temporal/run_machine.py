"""What a program says about time as one machine: requirements, what ends a run, monitors and behaviors, over samples.

A mode says where a run stands: what is left of each requirement, and the step of each process. What is not observed at
a sample may hold or not, there in all that reads it alike; so of a run a set of modes is known, one for each way that
this may come out. A run is unknown only if two of these ways end differently. Where a behavior chooses, there is a run
for each choice, and any of them may match.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import assert_never

from scenicq.budget import Exhausted
from scenicq.errors import Span
from scenicq.forest.temporal import (
    Arm,
    Atom,
    Choose,
    Due,
    Dynamics,
    End,
    Formula,
    Goto,
    Process,
    Reject,
    Terminate,
    Test,
    Wait,
    operands,
    successors,
)  # fmt: skip
from scenicq.limits import LIMITS, exhausted
from scenicq.temporal.literals import Literal, literals_of
from scenicq.temporal.progression import LOST, Progression, Rest, accepts
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

__all__ = ["Advance", "RunMachine", "Situation"]


_Place = tuple[int, tuple[tuple[int, int], ...]]
"""The step of a process, and its timers, each with the first place of a sample at which its time is over."""
_OVER: _Place = (-1, ())
"""A process that says nothing any more."""
_REJECTED: _Place = (-2, ())
"""One that has rejected the run."""
_REJECTS: _Place = (-3, ())
"""A behavior that rejects the run unless it ends with the sample: behaviors say what happens after it."""
_Later = Callable[[float], int]
"""The first place of a sample that is so many seconds later, and at least the next one."""


@dataclass(frozen=True, slots=True)
class _Mode:
    """What is left of each requirement, and the step of each process."""

    rests: tuple[Rest, ...]
    places: tuple[_Place, ...]

    @property
    def matches(self) -> bool:
        """Whether a run that ends in it is a match."""
        return _REJECTED not in self.places and all(map(accepts, self.rests))

    @property
    def is_lost(self) -> bool:
        """Whether no run that goes on from it is a match."""
        return _REJECTED in self.places or _REJECTS in self.places or LOST in self.rests


_Modes = frozenset[_Mode]


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


_Choices = Mapping[tuple[int, int], int]
"""Which option each step of a process takes that is a choice."""


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
        formulas = [each.formula for each in dynamics.requirements]
        self._of_formulas = [frozenset(_atoms(each)) for each in formulas]
        self._of_processes = [_reads(each) for each in dynamics.processes]
        every = {*self._before, *self._behind}.union(*self._of_formulas, *(s for m in self._of_processes for s in m))
        self.atoms = tuple(sorted(every))
        steps = [step for process in dynamics.processes for step in process.steps]
        self._monitors = [number for number, each in enumerate(dynamics.processes) if each.object is None]
        self._behaviors = [number for number, each in enumerate(dynamics.processes) if each.object is not None]
        self._literals = dict(enumerate(literals_of(dynamics.conditions)))
        self.timed = any(isinstance(step, Arm) for step in steps)
        self.chooses = any(isinstance(step, Choose) for step in steps)
        self._rests = tuple(map(self._progression.add, formulas))
        self.begin()

    def begin(self) -> None:
        """Forget all situations but the first."""
        for known in (self.situations, self._numbers, self._known, self._ways):
            known.clear()
        self._situation(frozenset((_Mode(self._rests, ((0, ()),) * len(self.dynamics.processes)),)))

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
            modes = self.situations[situation].modes
            found: list[Advance] = []
            stack: list[dict[tuple[int, int], int]] = [{}]
            while stack:
                chosen = stack.pop()
                try:
                    found.append(self._advanced(modes, reads, key[1], chosen, due=due, here=here, later=later))
                except _ToChoose as choice:
                    stack += [{**chosen, choice.step: option} for option in range(choice.count)]
            self._known[key] = tuple(dict.fromkeys(found))
        return self._known[key]

    def _advanced(
        self,
        modes: _Modes,
        reads: tuple[int, ...],
        told: tuple[int, ...],
        chosen: _Choices,
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
        failed = frozenset(each for each in ended if not each.matches)
        return Advance(
            self._situation(frozenset(going)) if going else None,
            len(failed) < len(ended),
            bool(failed),
            self._broken(failed),
        )

    def _ways_of(
        self, mode: _Mode, told: tuple[int, ...], values: Mapping[int, int], chosen: _Choices, *, due: bool, here: int,
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
                    raise exhausted("observation_ways")
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
        self, mode: _Mode, holds: Callable[[int], bool], chosen: _Choices, *, due: bool, here: int,
        later: _Later | None,
    ) -> tuple[_Mode, bool]:  # fmt: skip
        """The mode after a sample at which everything is known, and whether the run is over."""
        rests = tuple([self._progression.after(rest, holds) for rest in mode.rests])
        if _REJECTS in mode.places:
            lost = tuple([_REJECTED if place == _REJECTS else place for place in mode.places])
            return _Mode(rests, lost), due or any(map(holds, self._before))
        # these stop the monitors before they run
        if due or any(map(holds, self._before)):
            return _Mode(rests, mode.places), True
        places = list(mode.places)
        over = False
        for number in self._monitors:
            places[number], terminates = self._run(number, places[number], holds, chosen, here, later)
            over = over or terminates
        over = over or any(map(holds, self._behind))
        # behaviors run one after the other, to the first one that ends the run or loses it
        for number in () if over else self._behaviors:
            before = places[number]
            places[number], over = self._run(number, before, holds, chosen, here, later)
            if places[number] == _REJECTED != before:
                places[number] = _REJECTS
            if over or places[number] == _REJECTS:
                break
        return _Mode(rests, tuple(places)), over

    def activities(
        self, situation: int, values: Mapping[int, int], *, here: int = 0, later: _Later | None = None
    ) -> tuple[Span | None, ...] | None:
        """What each process does from a sample on, in the program; None where that is not known, or to be chosen.

        Arguments are those of `advance`.
        """
        modes = self.situations[situation].modes
        if len(modes) != 1:
            return None
        met: list[Span | None] = []
        try:
            for number, place in enumerate(next(iter(modes)).places):
                met.append(None)
                self._run(number, place, self._holding(values, {}), {}, here, later, met)
        except (_NotObserved, _ToChoose):
            return None
        return tuple(met)

    def _run(
        self, number: int, place: _Place, holds: Callable[[int], bool], chosen: _Choices, here: int,
        later: _Later | None, met: list[Span | None] | None = None,
    ) -> tuple[_Place, bool]:  # fmt: skip
        """Where a process goes on after a sample, and whether it ends the run; what it does last of what is met."""
        steps = self.dynamics.processes[number].steps
        at, timers = place[0], dict(place[1])
        # who goes through more steps than there are never gets to the next sample
        for _ in range(len(steps) + 1 if at >= 0 else 0):
            step = steps[at]
            match step:
                case Test():
                    at = step.then if holds(step.condition.number) else step.otherwise
                case Goto():
                    at = step.then
                case Arm():
                    due = here + 1 if later is None else later(step.after_s)
                    timers[step.timer] = max(due, timers.get(step.timer, 0)) if step.extends else due
                    at = step.then
                case Due():
                    at = step.then if timers[step.timer] <= here else step.otherwise
                case Choose():
                    if (number, at) not in chosen:
                        raise _ToChoose((number, at), len(step.options))
                    at = step.options[chosen[number, at]]
                case Wait():
                    if met is not None:
                        met[-1] = step.activity
                    # of a timer whose time is over nothing but that is known any more
                    running = [(timer, timers[timer]) for timer in step.timers if timer in timers]
                    return (step.then, tuple([(timer, at if at > here else 0) for timer, at in running])), False
                case Terminate():
                    return _OVER, True
                case Reject():
                    return _REJECTED, False
                case End():
                    return _OVER, False
                case _:
                    assert_never(step)
        return place if at < 0 else _REJECTED, False

    def _situation(self, modes: _Modes) -> int:
        if modes not in self._numbers:
            if self.situations and len(self.situations) >= LIMITS.run_situations:
                return self._undecided()
            self._numbers[modes] = len(self.situations)
            matching = [mode.matches for mode in modes]
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
        said = [*self.dynamics.requirements, *self.dynamics.processes]
        return said[number].span

    def _causes(self, mode: _Mode, *, for_good: bool) -> list[int]:
        found = [n for n, rest in enumerate(mode.rests) if rest == LOST or not (for_good or accepts(rest))]
        rejecting = (_REJECTED, _REJECTS) if for_good else (_REJECTED,)
        return found + [len(mode.rests) + n for n, place in enumerate(mode.places) if place in rejecting]


def _reads(process: Process) -> list[frozenset[int]]:
    """The numbers of the atoms that a process may read at one sample, by the step at which it goes on."""
    found: list[frozenset[int]] = []
    for first in range(len(process.steps)):
        seen, stack = {first}, [first]
        atoms: set[int] = set()
        while stack:
            step = process.steps[stack.pop()]
            if isinstance(step, Test):
                atoms.add(step.condition.number)
            after = successors(step)
            new = [each for each in after if each not in seen]
            seen.update(new)
            stack += new
        found.append(frozenset(atoms))
    return found


def _atoms(formula: Formula) -> Iterator[int]:
    stack = [formula]
    while stack:
        node = stack.pop()
        stack.extend(operands(node))
        if isinstance(node, Atom):
            yield node.number
