"""What a condition surely and possibly is without what is not observed: by all its completions."""

import itertools
import random

import pytest

from scenicq.forest import build
from scenicq.forest.condition import condition
from scenicq.forest.nodes import ArithmeticOp, CompareOp, Constant, Feature, LogicOp, Select
from scenicq.forest.unobserved import certain_and_possible, with_any_value
from scenicq.forest.walk import features, leaves

SEEN = [Feature(0, name, "scalar") for name in "ab"]
UNSEEN = [Feature(1, name, "scalar") for name in "uv"]
NUMBERS = (-1.0, 0.0, 1.0, 2.0)


def unobserved(feature: Feature) -> bool:
    return feature.object == 1


def number(chance: random.Random, depth: int):
    if depth == 0 or chance.random() < 0.5:
        return chance.choice((*SEEN, *UNSEEN, build.constant(chance.choice(NUMBERS))))
    parts = [number(chance, depth - 1) for _ in range(2)]
    if chance.random() < 0.3:
        return Select(truth(chance, depth - 1), tuple(parts))
    return build.arithmetic(chance.choice((ArithmeticOp.MIN, ArithmeticOp.MAX, ArithmeticOp.ADD)), *parts)


def truth(chance: random.Random, depth: int):
    kind = chance.random()
    if depth == 0 or kind < 0.4:
        return build.compare(chance.choice(list(CompareOp)), number(chance, depth), number(chance, depth))
    parts = [truth(chance, depth - 1) for _ in range(3)]
    if kind < 0.6:
        return Select(parts[0], (parts[1], parts[2]))
    if kind < 0.7:
        return build.opposite(parts[0])
    if kind < 0.8:
        return build.compare(chance.choice((CompareOp.EQ, CompareOp.NE)), parts[0], parts[1])
    return build.logic(chance.choice((LogicOp.AND, LogicOp.OR)), *parts)


def value(root, given):
    found = condition(root, given)
    assert isinstance(found, Constant)
    return bool(found.value)


@pytest.mark.parametrize("seed", range(150))
@pytest.mark.one_in(24)
def test_what_is_sure_holds_for_all_completions_and_what_is_impossible_for_none(seed):
    root = truth(random.Random(seed), 3)
    certain, possible = certain_and_possible(root, unobserved)
    assert not any(owner == 1 for owner, _ in features(certain, possible))
    for seen in itertools.product(NUMBERS, repeat=2):
        known = {(0, name): each for name, each in zip("ab", seen, strict=True)}
        completions = {
            value(root, known | {(1, "u"): u, (1, "v"): v})
            for u, v in itertools.product((*NUMBERS, 99.0, -99.0), repeat=2)
        }
        assert not value(certain, known) or completions == {True}
        assert value(possible, known) or completions == {False}


def repeated(chance: random.Random, depth: int):
    """A condition of a few comparisons, asked for and denied again and again, with bounds that say of each other."""
    if depth == 0:
        bound = build.constant(chance.choice(NUMBERS))
        unseen = UNSEEN[chance.random() < 0.5]
        order = (CompareOp.LT, CompareOp.LE, CompareOp.GT, CompareOp.GE)
        one = build.compare(chance.choice(order), *chance.choice(((unseen, bound), (bound, unseen))))
        return build.opposite(one) if chance.random() < 0.3 else one
    parts = [repeated(chance, depth - 1) for _ in range(2)]
    if chance.random() < 0.2:
        return build.compare(chance.choice((CompareOp.EQ, CompareOp.NE)), *parts)
    if chance.random() < 0.2:
        return Select(parts[0], (parts[1], repeated(chance, depth - 1)))
    return build.logic(chance.choice((LogicOp.AND, LogicOp.OR)), *parts)


@pytest.mark.parametrize("seed", range(300))
@pytest.mark.one_in(4)
def test_what_is_asked_for_twice_is_told_exactly(seed):
    root = repeated(random.Random(seed), 2)
    known = {(0, "a"): 1.0, (0, "b"): 0.0}
    numbers = (-2.0, *(each + half for each in NUMBERS for half in (0.0, 0.5)))
    completions = {value(root, known | {(1, "u"): u, (1, "v"): v}) for u, v in itertools.product(numbers, repeat=2)}
    found = {value(each, known) for each in certain_and_possible(root, unobserved)}
    assert found == completions


@pytest.mark.parametrize(
    ("condition_", "sure", "possible"),
    [
        (build.compare(CompareOp.LT, UNSEEN[0], build.constant(1.0)), False, True),
        (build.logic(LogicOp.OR, build.compare(CompareOp.LT, UNSEEN[0], SEEN[0]),
                     build.compare(CompareOp.LE, SEEN[0], SEEN[1])), True, True),
        (Select(build.compare(CompareOp.LT, UNSEEN[0], SEEN[0]),
                (build.compare(CompareOp.EQ, SEEN[0], build.constant(1.0)),
                 build.compare(CompareOp.LT, SEEN[0], SEEN[1]))), True, True),
        (build.compare(CompareOp.LT, build.arithmetic(ArithmeticOp.MIN, UNSEEN[0], SEEN[0]), SEEN[1]), True, True),
        (build.compare(CompareOp.GT, SEEN[0], build.arithmetic(ArithmeticOp.MAX, UNSEEN[0], SEEN[1])), False, False),
        (build.compare(CompareOp.EQ, build.arithmetic(ArithmeticOp.MIN, UNSEEN[0], SEEN[0]), SEEN[1]), False, False),
        (build.compare(CompareOp.NE, SEEN[0], build.arithmetic(ArithmeticOp.MAX, UNSEEN[0], SEEN[1])), True, True),
        (build.compare(CompareOp.EQ, build.arithmetic(ArithmeticOp.MAX, UNSEEN[0], SEEN[0]), SEEN[1]), False, True),
    ],
)  # fmt: skip
def test_unknown_only_where_it_makes_a_difference(condition_, sure, possible):
    known = {(0, "a"): 1.0, (0, "b"): 2.0}
    assert tuple(value(each, known) for each in certain_and_possible(condition_, unobserved)) == (sure, possible)


def test_any_value_is_the_same_one_in_an_expression():
    root = build.compare(CompareOp.LT, build.add(UNSEEN[0], UNSEEN[1]), build.add(UNSEEN[0], SEEN[0]))
    free = with_any_value(root, unobserved)
    assert len(leaves(free)) == 2
    assert features(free) == {(0, "a")}
