"""The direction of the road, by the referee's own map."""

import math

from made_scenes import EPS, Item, feature, street
from road_map import RoadMap


class TestRoadDirection:
    @staticmethod
    def degrees(x: float, y: float, features: list[Item] | None = None) -> list[int]:
        road_map = RoadMap(street() if features is None else features)
        return sorted(round(math.degrees(h)) % 360 for h in road_map.directions(x, y))

    def test_containing_lane(self) -> None:
        assert self.degrees(2, 5) == [0]
        assert self.degrees(-1, 5) == [180]

    def test_choice_inside_an_intersection(self) -> None:
        assert self.degrees(2.5, 106.25) == [0, 270]
        assert self.degrees(6, 106) == [270]

    def test_nearest_of_overlapping_lanes_elsewhere(self) -> None:
        lanes = [item for item in street() if item["properties"]["kind"] == "lane"]
        assert self.degrees(2.5, 106.25, lanes) == [270]
        assert self.degrees(2.25, 106.5, lanes) == [0]
        assert self.degrees(2.5, 106.5, lanes) == [0, 270]

    def test_nearest_lane_within_reach(self) -> None:
        assert self.degrees(28 - EPS, 0) == [0]
        assert self.degrees(-24 + EPS, 0) == [180]
        assert self.degrees(28 + EPS, 0) == []

    def test_corner_of_a_centerline_is_a_tie(self) -> None:
        bend = feature("lane", "bend", (0, 0, 10, 10), centerline=[[[5, 0], [5, 5], [10, 5]]])
        assert self.degrees(4, 6, [bend]) == [0, 270]
        assert self.degrees(4, 4, [bend]) == [0]

    def test_lane_without_centerline_has_no_direction(self) -> None:
        assert self.degrees(5, 5, [feature("lane", "bare", (0, 0, 10, 10))]) == []
