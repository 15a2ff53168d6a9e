"""The sample street with parked cars, ingested once; only to be read."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.store.dataset import Dataset, open_dataset


@pytest.fixture(scope="session")
def street(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("street") / "street"
    ingest(Path(__file__).parents[3] / "sample_data" / "parked", folder)
    return open_dataset(folder)
