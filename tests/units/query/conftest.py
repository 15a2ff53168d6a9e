"""A dataset of scenes of many programs."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "match"))
from nudged_scenes import dataset_of
from programs import PROGRAMS

from scenicq.store.dataset import Dataset


@pytest.fixture(scope="session")
def program_scenes(tmp_path_factory) -> Dataset:
    """Scenes of every small program, as they are and nudged."""
    return dataset_of(PROGRAMS, tmp_path_factory.mktemp("programs"))
