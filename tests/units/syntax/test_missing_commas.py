"""A comma that is missing between two specifiers is named."""

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street

EGO_3, EGO_2 = "ego = new Car\n", "ego = Car on road\n"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (EGO_3 + "c = new Car on road facing 30 deg", "a comma separates specifiers: write `road, ...`"),
        (EGO_3 + "c = new Car at (1, 2) facing 30 deg", "a comma separates specifiers: write `, facing ...`"),
        (EGO_3 + "c = new Car ahead of ego by 5 with width 2", "a comma separates specifiers: write `, with ...`"),
        (EGO_2 + "c = Car on road facing 30 deg", "a comma separates specifiers: write `road, facing ...`"),
        (EGO_2 + "spot = OrientedPoint on curb\nc = Car at spot facing 1", "write `spot, facing ...`"),
    ],
)
def test_a_missing_comma_is_named(text, hint):
    with pytest.raises(ScenarioError) as caught:
        compile_scenario(Source("p.scenic", f"model scenic.domains.driving.model\n{text}\n"), street())
    assert hint in str(caught.value)


def test_a_class_without_new_is_still_told_what_scenic_3_writes():
    with pytest.raises(ScenarioError) as caught:
        compile_scenario(Source("p.scenic", "ego = new Object\nother = Object at (1, 2)\n"), street())
    assert "Scenic 3 writes `new Object ...`" in str(caught.value)
