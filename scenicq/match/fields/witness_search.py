"""A search for a witness: draws of the random variables, and steps from the best towards what the label observes.

A yes needs one witness; a no needs the whole space, so this search refutes nothing. It draws within the ranges that
observation leaves to the hidden variables, and among the outcomes left to choices. The best draws descend by damped
Gauss-Newton steps on their residuals, with slopes that hold the headings of fields. The next draws lie around the best
(cross-entropy method), and some anywhere. Plain evaluation replays every witness. All searches for one label share one
budget (`scenicq.budget.Trials`); each may take a part of what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import Exhausted, Trials, trials_left
from scenicq.errors import CannotEvaluate
from scenicq.forest.nodes import Identity, Index, Leaf, PointIn, Value
from scenicq.limits import LIMITS, limit_exceeded
from scenicq.match.fields.constraint_network import ConstraintNetwork
from scenicq.match.fields.contractor import BoxSet
from scenicq.match.fields.damped_steps import damped_steps
from scenicq.match.fields.steps_back import DrawsBack
from scenicq.match.fields.trials import Trial, TrialDraws, TrialSpace
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.evaluation import replay
from scenicq.match.problem.outcome import Satisfied
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["AGAIN", "QUICK", "THOROUGH", "Effort", "OutcomeTable", "find_witness", "search_witness"]

OutcomeTable = tuple[Sequence[object], NDArray[np.intp]]
"""Joint outcomes of some choices: their identities, and the option of each by outcome, shape (outcomes, choices).

An option is -1 where it does not matter.
"""


@dataclass(frozen=True, slots=True)
class Effort:
    """How much work one search may do.

    Attributes:
        draws: Draws that a round tries at once.
        best: How many of the best draws descend; the next draws lie around them.
        rounds: Rounds at most.
        descents: Steps of each descent at most.
        idle: The search ends after so many rounds in a row without progress.
    """

    draws: int
    best: int
    rounds: int
    descents: int
    idle: int


QUICK = Effort(96, 8, 6, 3, 1)
THOROUGH = Effort(384, 24, 4, 6, 2)
AGAIN = (QUICK, QUICK, QUICK, THOROUGH, THOROUGH)
"""Searches in a row, each with its own draws. Where fields turn often, luck finds many a way, so more tries help."""
_CLOSER = 0.45
"""Each round spreads its draws by this factor of the round before."""
_PROGRESS = 0.7
"""A round made no progress if the least residual stays above this share of the least one before."""
_ANEW = 0.15
"""The probability that a draw near the best draws a choice, or a field's heading, again."""
_OTHER = 0.5
"""The probability that a heading that is drawn again may differ from the field's first one."""
_ANYWHERE = 4
"""One of so many draws after the first round lies anywhere."""
_ALIKE = 0.02
"""Two headings of a field count as alike if they round to the same multiple of so many radians."""
_SHARE = 4
"""A search may use the trials that are left, divided by this."""
_STEP = 1e-5
"""By how much a coordinate is moved to see what changes."""
_PLENTY = 4
"""Where there are conditions on numbers alone, so many times the draws are made; the least broken ones stay."""
_JUMP = 1e3
"""A slope this steep is a jump of a field's heading, and counts as 0."""
_FEW, _NARROW = 4, 0.01
"""The first round has so few draws if no coordinate has a wider range than this and no field is asked."""

_Numbers = NDArray[np.float64]
_Indices = NDArray[np.intp]


def find_witness(
    start: BoxSet, *efforts: Effort, outcomes: Sequence[OutcomeTable] = (), seed: int = 0
) -> Satisfied | None:
    """A witness of a group, or None if none was found.

    Args:
        start: One case: where the random variables can be.
        efforts: How much each of the searches is worth that are made one after the other.
        outcomes: What choices may come out as; others may come out as anything.
        seed: The seed of the first one's draws.
    """
    trials, space = trials_left(), TrialSpace(start)
    for number, effort in enumerate(efforts or (QUICK,), seed):
        search = _Search(space, effort, outcomes, trials, number)
        found = None
        with suppress(CannotEvaluate, Exhausted):
            found = search.run()
        if found is not None:
            return found
        trials.left -= search.tried
    return None


def search_witness(
    items: Sequence[Item],
    tolerance: Tolerance,
    *efforts: Effort,
    outcomes: Sequence[OutcomeTable] = (),
    seed: int = 0,
) -> Satisfied | None:
    """Narrow the ranges that constraints leave, and search there for a witness; None if none is found."""
    start = BoxSet.start(ConstraintNetwork(items, tolerance), {}).narrowed()
    return find_witness(start, *efforts, outcomes=outcomes, seed=seed) if start.size else None


class _Search:
    """A search of one group."""

    def __init__(
        self, space: TrialSpace, effort: Effort, outcomes: Sequence[OutcomeTable], trials: Trials, seed: int
    ) -> None:
        self.space = space
        self.tried = 0
        self.most = trials.left / _SHARE
        self.effort = effort
        self.rng = np.random.default_rng(seed)
        self.tables = [
            ([(column, space.hidden[variable]) for column, variable in enumerate(variables)
              if isinstance(variable, Identity) and variable in space.hidden], picks)
            for variables, picks in outcomes
        ]  # fmt: skip
        self.replayed = 0
        self.back = DrawsBack(space.ways_back, space, self._evenly, self.rng)

    def run(self) -> Satisfied | None:
        """Search, as long as it is worth it."""
        before, idle = np.inf, 0
        draws, elite = self._anywhere(self._first_count()), None
        for number in range(1, self.effort.rounds + 1):
            tried = self._try(draws)
            found = self._witness(tried)
            if found is None and self.space.fields and len(self.space.moving):
                # how good a draw is shows where it leads
                led = self._try(self._one_step(tried))
                found = self._witness(led)
                tried = tried.beside(led)
            best = self._best(tried)
            if found is not None or best is None:
                return found
            elite = self._better(elite, best)
            for _ in range(self.effort.descents if len(self.space.moving) else 0):
                left = float(best.residuals.missing.min())
                best = self._best_step(best)
                found = self._witness(best)
                if found is not None:
                    return found
                elite = self._better(elite, best)
                if float(best.residuals.missing.min()) > _PROGRESS * left:
                    break
            least = float(elite.residuals.missing.min())
            idle = idle + 1 if least > _PROGRESS * before else 0
            before = min(before, least)
            if self.replayed >= LIMITS.witness_replays or idle == self.effort.idle:
                break
            draws = self._draw_near(elite.draws, _CLOSER**number)
        return None

    def _try(self, draws: TrialDraws) -> Trial:
        """What draws come out as.

        Raises:
            Exhausted: This search has had its share.
        """
        if self.tried >= self.most:
            raise limit_exceeded("witness_trials")
        self.tried += 1
        return self.space.run(draws)

    # --- draws

    def _first_count(self) -> int:
        wide = bool((self.space.high - self.space.low > _NARROW).any()) or bool(self.space.fields)
        return self.effort.draws if wide else _FEW

    def _anywhere(self, count: int) -> TrialDraws:
        """Draws over all ranges; most begin where a way along fields leads to what is observed."""
        draws = self._evenly(count)
        self.back.put_into(draws)
        return draws

    def _evenly(self, count: int) -> TrialDraws:
        """Evenly over all that there is, as far as conditions on numbers alone allow."""
        return self.space.least_broken(self._draw((_PLENTY if self.space.plain else 1) * count), count)

    def _draw(self, count: int) -> TrialDraws:
        """Evenly over all that there is."""
        parts = [each.draw(self.rng, count) for each in self.space.hidden.values()]
        shares = self.rng.random((len(self.space.fields), count))
        # where lanes overlap, a generator takes the first
        shares[:, ::2] = 0.0
        shares[:, 1::4] *= self.rng.random(shares[:, 1::4].shape) < _OTHER
        draws = TrialDraws(np.concatenate([np.empty((0, count)), *parts]), shares)
        self._choose(draws.places, np.arange(count))
        return draws

    def _choose(self, places: _Numbers, some: NDArray[np.intp]) -> None:
        """Give the choices of some draws a random outcome of those that are left, in place."""
        for variables, picks in self.tables:
            if not (variables and len(picks)):
                continue
            rows = picks[self.rng.integers(len(picks), size=len(some))]
            for column, variable in variables:
                chosen = rows[:, column]
                places[variable.rows.start, some[chosen >= 0]] = chosen[chosen >= 0]

    def _draw_near(self, best: TrialDraws, spread: float) -> TrialDraws:
        """The best again, others around them, and some anywhere."""
        count, first = self.effort.draws, best.places.shape[1]
        near = best.take(np.arange(count - count // _ANYWHERE) % first)
        size = near.places.shape[1]
        width = np.where(np.isfinite(self.space.high - self.space.low), self.space.high - self.space.low, 1.0)
        off = self.rng.standard_normal((len(self.space.moving), size)) * spread * width[self.space.moving]
        # of every other draw only the heading of one field is another
        still = np.zeros(size, dtype=np.bool_)
        still[1::2] = True
        still[:first] = True
        off[:, still] = 0.0
        near.places[self.space.moving] += off
        for each in self.space.hidden.values():
            if each.is_whole:
                moved = self._some((size,), still)
                near.places[each.rows, moved] = each.draw(self.rng, size)[:, moved]
        self._choose(near.places, np.flatnonzero(self._some((size,), still)))
        anew = self._some(near.shares.shape, still)
        if self.space.fields:
            one = np.flatnonzero(still[first:]) + first
            anew[self.rng.integers(len(self.space.fields), size=len(one)), one] = True
        number = int(np.count_nonzero(anew))
        near.shares[anew] = self.rng.random(number) * (self.rng.random(number) < _OTHER)
        more = self._anywhere(count // _ANYWHERE)
        return near.beside(more)

    def _some(self, shape: tuple[int, ...], still: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Mark at random what is drawn again; nothing is in draws that stand still."""
        return (self.rng.random(shape) < _ANEW) & ~still

    def _best(self, tried: Trial) -> Trial | None:
        """The best draws; None if none has a value."""
        missing = tried.residuals.missing
        order = np.argsort(missing, kind="stable")
        order = order[np.isfinite(missing[order])]
        some = self._unlike(tried, order)[: self.effort.best]
        return tried.take(some) if len(some) else None

    def _unlike(self, tried: Trial, order: _Indices) -> _Indices:
        """The order without repeats: where choices and headings agree, only the first draw stays."""
        alike = np.concatenate([tried.draws.places[self.space.whole], np.round(tried.headings / _ALIKE)])[:, order]
        if not len(alike):
            return order
        _, first = np.unique(alike, axis=1, return_index=True)
        return order[np.sort(first)]

    def _better(self, elite: Trial | None, trial: Trial) -> Trial:
        """The best of two sets of draws."""
        if elite is None:
            return trial
        both = elite.beside(trial)
        best = self._best(both)
        return best or elite

    def _witness(self, tried: Trial) -> Satisfied | None:
        """The first draw without residuals that plain evaluation confirms."""
        missing = tried.residuals.missing
        for number in np.flatnonzero(missing <= 0)[: LIMITS.witness_replays - self.replayed].tolist():
            self.replayed += 1
            values: dict[Identity, Value] = {
                identity: _value(each.leaf, tried.draws.places[each.rows, number])
                for identity, each in self.space.hidden.items()
            }
            pointing = dict(zip(map(id, self.space.fields), tried.headings[:, number].tolist(), strict=True))
            if replay(list(self.space.network.items), values, self.space.network.tolerance, SLACK, pointing):
                return Satisfied(values)
        return None

    # --- descent

    def _one_step(self, tried: Trial) -> TrialDraws:
        """Each draw after one step towards what is observed."""
        each = np.where(np.isfinite(tried.residuals.each), tried.residuals.each, 0.0)
        step = damped_steps(self._slopes(tried), each, self._at_ends(tried.draws.places))[0]
        count: int = tried.draws.places.shape[1]
        led = tried.draws.take(np.arange(count))
        led.places[self.space.moving] += step
        return led

    def _best_step(self, tried: Trial) -> Trial:
        """Each draw after the best of several damped steps, even if its residual grows, as fields turn there."""
        rows = cast(_Indices, np.arange(tried.draws.places.shape[1]))
        each = np.where(np.isfinite(tried.residuals.each), tried.residuals.each, 0.0)
        moves = damped_steps(self._slopes(tried), each, self._at_ends(tried.draws.places))
        many = tried.draws.take(np.tile(rows, len(moves)))
        many.places[self.space.moving] += np.concatenate(moves, axis=1)
        after = self._try(many)
        missing = after.residuals.missing.reshape(len(moves), -1)
        best = cast(_Indices, np.where(np.isfinite(missing), missing, np.inf).argmin(axis=0))
        chosen = best * len(rows) + rows
        return after.take(chosen)

    def _slopes(self, tried: Trial) -> _Numbers:
        """How residuals change with each coordinate that moves, (n, residuals, coordinates)."""
        places, count = tried.draws.places, tried.draws.places.shape[1]
        moving = self.space.moving
        many = tried.draws.take(np.tile(cast(_Indices, np.arange(count)), len(moving)))
        step = np.where(places[moving] + _STEP > self.space.high[moving], -_STEP, _STEP)
        for number, row in enumerate(moving.tolist()):
            many.places[row, number * count : (number + 1) * count] += step[number]
        # so little changes no field's heading: none is asked again
        after = self.space.run(many, np.tile(tried.headings, len(moving))).residuals.each
        after = after.reshape(-1, len(moving), count)
        slopes = (after - tried.residuals.each[:, None]) / step
        return np.where(np.isfinite(slopes) & (np.abs(slopes) < _JUMP), slopes, 0.0).transpose(2, 0, 1)

    def _at_ends(self, places: _Numbers) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which coordinates are at their lower, or upper, ends, (coordinates, n)."""
        own = places[self.space.moving]
        return own <= self.space.low[self.space.moving] + SLACK, own >= self.space.high[self.space.moving] - SLACK


def _value(leaf: Leaf, place: _Numbers) -> Value:
    numbers: list[float] = place.tolist()
    if isinstance(leaf, PointIn):
        return numbers[0], numbers[1]
    return float(round(numbers[0])) if isinstance(leaf, Index) else numbers[0]
