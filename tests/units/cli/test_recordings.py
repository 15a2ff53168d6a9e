"""What first drafts are told over real recordings, where they are on the machine."""

import re
import time
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.nearest_miss import nearest_misses
from scenicq.store.dataset import open_dataset

ROOT = Path(__file__).parents[3]
REAL = ROOT.parent / "shared" / "data"
MAP = REAL / "boston" / "maps" / "boston-seaport.geojson"
CROSSING = ROOT / "sample_data" / "scenarios" / "02_crossing_cars.scenic"
TWO_CARS = "model scenic.domains.driving.model\nego = new Car on road\nnew Car on road"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not REAL.exists(), reason="the recordings are not on this machine"),
]


def opened(name, tmp_path_factory, **options):
    target = tmp_path_factory.mktemp("recordings") / name
    ingest(REAL / name, target, **options)
    return target


@pytest.fixture(scope="module")
def boston(tmp_path_factory):
    """707 frames without speeds."""
    return opened("boston", tmp_path_factory)


@pytest.fixture(scope="module")
def mini(tmp_path_factory):
    """404 frames whose tracks tell speeds."""
    return opened("nuscenes-mini", tmp_path_factory, maps=[MAP])


@pytest.fixture(scope="module")
def argoverse(tmp_path_factory):
    """312 frames whose names are UUIDs."""
    return opened("argoverse2", tmp_path_factory)


@pytest.fixture
def ask(run, tmp_path, monkeypatch):
    """Frames that match a program, and what was said."""
    monkeypatch.chdir(tmp_path)

    def asked(text, dataset, *more):
        Path("p.scenic").write_text(f"{text}\n")
        done = run("match", "p.scenic", dataset, "--format", "ids", *more)
        return done.stdout.split(), done.stderr, done.exit_code

    return asked


@pytest.mark.parametrize("value", ["speed Range(50, 60)", "spede Range(50, 60)"])
def test_a_property_that_no_label_has_excludes_nothing_and_is_told(boston, ask, value):
    found, told, code = ask(f"{TWO_CARS}, with {value}", boston)
    assert found == ask(TWO_CARS, boston)[0] != []
    assert code == 0
    name = value.split()[0]
    assert f"warning[never-compared]: `Car#2.{name}` is never compared: no label of `Car` in the dataset has it" in told
    assert " --> p.scenic:3:18" in told
    assert "the labels have of `Car`: heading" in told
    assert ("`speed` is spelled nearly like it, which the labels do not have either" in told) is (name == "spede")
    assert ask(f"{TWO_CARS}, with {value}", boston, "--strict")[::2] == ([], 2)


def test_a_speed_that_labels_have_is_compared_and_a_misspelt_one_is_told(mini, argoverse, ask):
    for dataset in (mini, argoverse):
        found, told, code = ask(f"{TWO_CARS}, with speed Range(50, 60)", dataset)
        assert (found, code, "never-compared" in told) == ([], 1, False)
        assert "`Car#2.speed` not compared" in told
        found, told, _ = ask(f"{TWO_CARS}, with spede Range(50, 60)", dataset)
        assert found == ask(TWO_CARS, dataset)[0] != []
        assert "`Car#2.spede` is never compared" in told
        assert "`speed` is spelled nearly like it\n" in told


def test_a_bicycle_that_is_folded_into_cars_is_told(argoverse, ask):
    text = "model scenic.domains.driving.model\nego = new Car on road\nnew Bicycle on road"
    found, told, _ = ask(text, argoverse, "--classes", "coarse")
    assert found == ask(TWO_CARS, argoverse, "--classes", "coarse")[0] != []
    assert "warning[class-folded]: p.scenic:3:1: with coarse classes `Bicycle` matches every `Car`" in told
    assert ask(text, argoverse, "--classes", "coarse", "--strict")[::2] == ([], 2)
    fine, told, _ = ask(text, argoverse, "--classes", "fine")
    assert (len(fine) < len(found), "class-folded" in told) == (True, False)


def test_frames_that_come_near_are_found_in_seconds_and_by_the_tolerance_that_is_told(boston, run):
    """Over 700 frames; each of the separate minima is enough as the option takes it, and a little less is not."""
    query = Query(open_dataset(boston), read_program(CROSSING), QueryOptions(solver="portable"))
    assert query.dataset.manifest.total.frames == 707
    begun = time.process_time()
    near = nearest_misses(query, 3)
    assert time.process_time() - begun < 20
    assert len(near) == 3
    for result in near:
        told = re.search(r"would match with ((position|heading)=([\d.]+)(deg)?(,\S+)?)$", result.verdict.cause.detail)
        assert told
        step = 0.002 if told[2] == "position" else 0.02
        less = f"{told[2]}={float(told[3]) - step:.3f}{told[4] or ''}{told[5] or ''}"
        for tolerance, enough in ((told[1], True), (less, False)):
            found = run("match", CROSSING, boston, "--format", "ids", "--tolerance", tolerance).stdout.split()
            assert (result.frame in found) is enough, tolerance
