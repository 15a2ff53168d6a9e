"""Halves of blocks hold the rows of the whole, each once and in order, and leave recordings whole."""

import pytest

from scenicq.query.prefilter.executor import Block


def pieces(block):
    if not block.divisible:
        return [block]
    first, second = block.halves()
    return [*pieces(first), *pieces(second)]


@pytest.mark.parametrize("end", [8, 9, 20])
def test_frames_are_halved_down_to_single_ones(end):
    found = pieces(Block("town", 1, 7, end))
    assert [(each.map, each.part, each.first, each.end) for each in found] == [
        ("town", 1, row, row + 1) for row in range(7, end)
    ]


@pytest.mark.parametrize("count", range(1, 8))
def test_recordings_stay_whole(count):
    # of a map's rows others may lie between
    runs = tuple((10 * number, 10 * number + 4 + number) for number in range(1, count + 1))
    whole = Block("town", 0, runs[0][0], runs[-1][1], ("a", "z"), runs)
    assert [(each.first, each.end, each.runs, each.recordings) for each in pieces(whole)] == [
        (first, end, ((first, end),), ("a", "z")) for first, end in runs
    ]
    for half in whole.halves() if count > 1 else ():
        assert (half.first, half.end) == (half.runs[0][0], half.runs[-1][1])
        assert abs(len(half.runs) - count / 2) < 1
