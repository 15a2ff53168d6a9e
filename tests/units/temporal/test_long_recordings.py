"""Of long recordings no more is read than runs may come to, and nothing hangs on it."""

import random
from dataclasses import replace

import pytest
from interval_definition import Sample, random_program, recording_of
from interval_queries import found_by_query

from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

SAMPLES = 520


def _trace(draw):
    """Three tracks that go to and fro, each of which is not seen for a while now and then."""
    seen = {track: [draw.randint(-6, 6), draw.randint(-6, 6)] for track in ("ego", "t0", "t1", "t2")}
    hidden = dict.fromkeys(seen, 0)
    trace, time = [], 0.0
    for _ in range(SAMPLES):
        time += draw.choice([0.25, 0.5, 0.5, 0.75, 2.0])
        for track, place in seen.items():
            if draw.random() < 0.3:
                axis = draw.randrange(2)
                place[axis] = max(-7, min(7, place[axis] + draw.choice([-1, 1])))
            if track != "ego" and not hidden[track] and draw.random() < 0.02:
                hidden[track] = draw.randint(1, 9)
            hidden[track] = max(0, hidden[track] - 1)
        there = {track: tuple(map(float, place)) for track, place in seen.items() if not hidden[track]}
        trace.append(Sample(round(time, 2), there))
    return trace


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_the_prefilter_changes_nothing(tmp_path, seed, rounds):
    draw = random.Random(seed)
    traces = {f"r{number}": _trace(draw) for number in range(2)}
    write_dataset(tmp_path / "d", [recording_of(*each) for each in traces.items()], {}, name="d")
    total = 0
    for round_ in range(rounds(16)):
        program = random_program(draw)
        while program.start is None or program.monitors:
            program = random_program(draw)
        # what is seldom: the prefilter leaves few labels
        program.after_s = draw.choice([0.5, 1.0, 2.0, 3.0])
        time = IntervalOptions()
        if round_ % 2:
            program = replace(program, requirements=[], ends=[], after_s=None, hidden=False)
            time = IntervalOptions(min_duration_s=draw.choice([0.0, 0.5, 1.0]), gap_s=draw.choice([0.4, 1.5, 2.5]))
        with_it, without = (
            found_by_query(tmp_path / "d", program, time=time, prefilter=each) for each in (True, False)
        )
        assert with_it == without, program.text()
        total += len(with_it)
    assert total > rounds(100)
