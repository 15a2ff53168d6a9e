"""No difference is made across labels that have no ego."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset


@pytest.mark.parametrize("there", list(itertools.product([True, False], repeat=4)))
@pytest.mark.one_in(3)
def test_no_difference_crosses_a_label_without_an_ego(there: tuple[bool, ...], tmp_path: Path) -> None:
    """An ego has a derived speed exactly where the label before or after has one, too."""
    labels = tuple(
        Label(
            f"f{n}", "r", n * 500_000, "m", LabelObject("ego", "Car" if is_there else "", "car", 3.0 * n, 0.0, 0.0), ()
        )
        for n, is_there in enumerate(there)
    )
    write_dataset(tmp_path / "d", [Recording("r", "m", labels)], {}, name="d")
    with open_dataset(tmp_path / "d").connect() as connection:
        rows = connection.execute("SELECT ego_motion_vx FROM labels ORDER BY timestamp_us").fetchall()
    beside = [False, *there, False]
    known = [here and (before or after) for before, here, after in zip(beside[:-2], there, beside[2:], strict=True)]
    assert [speed is not None for (speed,) in rows] == known
