"""Random programs over random labels: every way says what the definition says (a short part of `frames_attack`)."""

import random
import sys
from collections import Counter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from frames import Maker, Number, both, compared, random_scene, some
from frames_attack import ALL, WAYS, dataset_of, differences


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(3)
def test_every_way_says_what_the_definition_says(seed, tmp_path, rounds):
    counts: Counter[str] = Counter()
    chance = random.Random(f"labels {seed}")
    scenes = [random_scene(chance) for _ in range(25)]
    dataset = dataset_of(scenes, tmp_path / "d")
    programs = max(2, rounds(16))
    for number in range(programs):
        program = Maker(random.Random(f"frames-{seed}-{number}")).program()
        assert differences(program, scenes, dataset, (*WAYS, ALL), f"{seed}", counts) == [], program.text
    told = [sum(counts[f"{way}: {said}"] for said in ("match", "no match")) for way in WAYS]
    assert all(told)
    assert programs < 16 or all(counts[f"{way}: match"] for way in WAYS)


def test_the_judge_knows_kleenes_logic():
    truths = (True, False, None)
    for one in truths:
        for other in truths:
            assert both([one, other]) is (False if False in (one, other) else None if None in (one, other) else True)
            assert some([one, other]) is (True if True in (one, other) else None if None in (one, other) else False)
    assert both(["either", False]) is False
    assert both(["either", None]) == "either"
    assert compared("<", Number(1.0), None, None) is None
    assert compared("<", Number(1.0, exact=False), Number(1.0), None) == "either"
