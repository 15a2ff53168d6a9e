"""Halves of blocks hold the rows of the whole, each once and in order, and leave recordings whole."""

import pytest

from scenicq.query.prefilter.executor import Block, join_first


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


def joined(blocks, most):
    waiting, found = list(blocks), []
    while waiting:
        found.append(join_first(waiting, most))
    return found


def test_blocks_are_put_together_again_as_far_as_they_may_be_large():
    whole = Block("town", 1, 7, 47)
    cut = [Block("town", 1, first, first + 10) for first in range(7, 47, 10)]
    assert joined(cut, 100) == [whole]
    assert [(each.first, each.end) for each in joined(cut, 25)] == [(7, 27), (27, 47)]
    assert joined(cut, 0) == joined(cut, 19) == cut


def test_blocks_with_runs_keep_them():
    whole = Block("town", 0, 0, 9, None, ((0, 4), (4, 7), (7, 9)))
    assert joined(pieces(whole), 9) == [whole]


def test_recordings_on_several_maps_keep_theirs():
    runs, maps = ((0, 4), (4, 7), (7, 9), (9, 12)), ("a", "a", "b", "c")
    whole = Block("a", 0, 0, 12, None, runs, maps)
    assert [(each.map, each.runs) for each in pieces(whole)] == [
        (name, (run,)) for name, run in zip(maps, runs, strict=True)
    ]
    assert joined(pieces(whole), 12) == [whole]
    assert whole.by_map() == [
        Block("a", 0, 0, 7, None, runs[:2]),
        Block("b", 0, 7, 9, None, runs[2:3]),
        Block("c", 0, 9, 12, None, runs[3:]),
    ]


@pytest.mark.parametrize(
    "other",
    [
        Block("town", 1, 10, 20),
        Block("street", 0, 10, 20),
        Block("town", 0, 12, 20),
        Block("town", 0, 10, 20, ("a", "b")),
    ],
)
def test_blocks_that_do_not_follow_each_other_stay_apart(other):
    cut = [Block("town", 0, 0, 10), other]
    assert joined(cut, 1000) == cut
