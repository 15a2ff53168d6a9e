"""Connected components: a partition in which sharing, directly or through others, is being together."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from scenicq.forest.components import connected_components


def test_what_shares_nothing_is_by_itself():
    assert connected_components([[], ["a"], [], ["b"]]) == [[0], [1], [2], [3]]


def test_sharing_through_others_counts():
    assert connected_components([["a"], ["c"], ["b"], ["a", "b"]]) == [[0, 2, 3], [1]]


@given(st.lists(st.frozensets(st.integers(0, 12), max_size=3), max_size=15))
def test_parts_are_the_closure_of_sharing(used):
    parts = connected_components(used)
    assert sorted(number for part in parts for number in part) == list(range(len(used)))
    assert parts == sorted(sorted(part) for part in parts)
    keys = [frozenset().union(*(used[number] for number in part)) for part in parts]
    # no two parts share anything, and none falls apart
    assert sum(map(len, keys)) == len(frozenset().union(*keys))
    for part in parts:
        reached, todo = {part[0]}, [part[0]]
        while todo:
            number = todo.pop()
            near = [other for other in part if used[other] & used[number] and other not in reached]
            reached.update(near)
            todo += near
        assert reached == set(part)
