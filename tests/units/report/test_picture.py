"""Pictures show what is so: boxes where the labels have them, allowed places that hold the witness."""

import itertools
import math
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import shapely

from scenicq.geometry.boxes import corners
from scenicq.geometry.outlines import outline
from scenicq.geometry.regions import DifferenceOf, Disc, IntersectionOf, PolygonSet, Rectangle, Sector, UnionOf
from scenicq.match.verdict import Match
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.report.backdrop import Backdrop
from scenicq.report.distances import draw_distances, measured_distances
from scenicq.report.outlines import allowed_headings, allowed_place
from scenicq.report.picture import Shot, caption, draw, view_of
from scenicq.report.placement import Placement
from scenicq.report.png import can_make_png, png
from scenicq.report.scene import draw_text, observe_roles
from scenicq.report.svg import Plane, element, escape
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject

from .reading import Drawn

MATCHES = [
    ("02-pedestrian-crosses/{}", "01_pedestrian_facing_ego.scenic"),
    ("03-busy-intersection/{}", "02_crossing_cars.scenic"),
    ("04-against-traffic/{}", "03_against_traffic.scenic"),
    ("05-two-lane-traffic/{}", "04_two_lane_traffic.scenic"),
    ("06-cut-in/{}", "05_cut_in_from_right.scenic"),
]
PIXEL_M = 0.06
"""Metres of a pixel of the pictures here, at least."""
LARGE = (-1000.0, -1000.0, 1000.0, 1000.0)


def _shots(shoot, pattern, scenario):
    found = [shoot(pattern.format(f"{number:02}"), scenario) for number in range(0, 26, 1)]
    return [(shot, backdrop) for shot, backdrop in found if isinstance(shot.verdict, Match)]


@pytest.mark.parametrize("frame", ["01-quiet-street/00", "03-busy-intersection/10", "05-two-lane-traffic/20"])
def test_drawn_corners_are_the_labels_to_a_pixel(shoot, frame):
    shot, backdrop = shoot(frame)
    drawn = Drawn(draw(shot, backdrop, half=40))
    expected = {thing.id: thing for thing in (*shot.label.objects, shot.label.ego)}
    seen = 0
    for group in drawn.with_class("box"):
        thing = expected[drawn.title(group).split(", ")[0]]
        (outline_,) = [e for e in group.iter() if e.get("class") == "outline"]
        (points,) = drawn.pieces(outline_)
        wanted = corners(thing.x, thing.y, thing.heading, thing.width, thing.length)
        assert np.abs(points - wanted).max() < PIXEL_M / 2
        (nose,) = [e for e in group.iter() if e.get("class") == "nose"]
        ((_, tip),) = drawn.pieces(nose)
        ahead = tip - (thing.x, thing.y)
        assert math.atan2(-ahead[0], ahead[1]) == pytest.approx(thing.heading, abs=0.05)
        seen += 1
    near = [t for t in expected.values() if max(abs(t.x - shot.label.ego.x), abs(t.y - shot.label.ego.y)) < 40]
    assert seen >= len(near) > 1


def test_the_picture_has_the_scale_that_it_says(shoot):
    shot, backdrop = shoot("03-busy-intersection/10")
    drawn = Drawn(draw(shot, backdrop, half=40))
    inner = next(e for e in drawn.root.iter() if e.get("class") == "picture")
    assert [float(v) for v in inner.get("viewBox").split()][2:] == [8000, 8000]
    (bar,) = drawn.with_class("scale")
    ends = [float(v) for v in re.findall(r"[MH](-?\d+)", bar.get("d"))]
    (told,) = [e.text for e in drawn.with_class("furniture") if e.text.endswith(" m")]
    assert ends[1] - ends[0] == 100 * float(told.removesuffix(" m"))


@pytest.mark.parametrize(("pattern", "scenario"), MATCHES)
@pytest.mark.one_in(2)
def test_allowed_places_and_headings_hold_what_matches(shoot, pattern, scenario):
    shots = _shots(shoot, pattern, scenario)
    assert shots
    places = headings = 0
    for shot, backdrop in shots:
        drawn = Drawn(draw(shot, backdrop))
        for role in shot.roles:
            for path in drawn.with_class("place", role.colour):
                here = shapely.Point(role.member.x, role.member.y)
                assert drawn.area(path).distance(here) < PIXEL_M, drawn.title(path)
                places += 1
            allowed = allowed_headings(shot.scenario, role.index, observe_roles(shot.roles))
            if allowed is not None:
                turns = [(role.member.heading - low) % math.tau <= high - low + 0.01 for low, high in allowed]
                assert any(turns) or any(
                    abs(math.remainder(role.member.heading - low, math.tau)) < 0.01 for low, _ in allowed
                )
                headings += 1
    assert places >= len(shots)
    assert headings >= len(shots)


def test_an_allowed_place_moves_with_the_ego(shoot):
    shot, backdrop = shoot("05-two-lane-traffic/18", "04_two_lane_traffic.scenic")
    assert isinstance(shot.verdict, Match)
    drawn = Drawn(draw(shot, backdrop, half=60))
    (oncoming,) = drawn.with_class("place", "local", "c2")
    ego = shot.label.ego
    west, south, east, north = drawn.area(oncoming).bounds
    # offset by (Range(-10, -1), Range(0, 50)); the ego drives north
    assert (west, south) == pytest.approx((ego.x - 10, ego.y), abs=0.02)
    assert (east, north) == pytest.approx((ego.x - 1, ego.y + 50), abs=0.02)


def test_what_excludes_a_frame_is_red_and_told(shoot):
    shot, backdrop = shoot("05-two-lane-traffic/15", "04_two_lane_traffic.scenic", why=True)
    drawn = Drawn(draw(shot, backdrop))
    (place,) = drawn.with_class("place", "blamed")
    assert drawn.title(place) == "where oncoming may be"
    oncoming = next(role.member for role in shot.roles if role.name == "oncoming")
    assert drawn.area(place).distance(shapely.Point(oncoming.x, oncoming.y)) > 1
    (box,) = drawn.with_class("box", "blamed")
    assert "oncoming" in drawn.title(box)
    told = [text for kind, text in caption(shot) if kind == "no"]
    assert any("oncoming.position" in text and "04_two_lane_traffic.scenic:12" in text for text in told)


def test_the_view_region_is_drawn(shoot):
    shot, backdrop = shoot("04-against-traffic/15", "03_against_traffic.scenic")
    drawn = Drawn(draw(shot, backdrop, half=60))
    (view,) = drawn.with_class("view")
    area = drawn.area(view)
    assert area.area == pytest.approx(math.radians(135) / 2 * 50**2, rel=0.01)
    ego = shot.label.ego
    assert area.distance(shapely.Point(ego.x, ego.y)) < 0.02


def test_hidden_points_are_crosses(shoot):
    shot, backdrop = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    assert isinstance(shot.verdict, Match)
    assert Drawn(draw(shot, backdrop)).with_class("hidden-point") == []
    ego = shot.label.ego
    moved = replace(shot.verdict, witness={"a:1:2": (ego.x + 3.0, ego.y - 4.0), "b:1:2": 0.5})
    (cross,) = Drawn(draw(replace(shot, verdict=moved), backdrop)).with_class("hidden-point")
    x, y = Plane((math.floor(ego.x), math.floor(ego.y))).at(ego.x + 3, ego.y - 4)
    assert cross.get("d").startswith(f"M{x - 60} {y - 60}")


def test_geometry_is_cut_to_the_view(shoot):
    shot, backdrop = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    drawn = Drawn(draw(shot, backdrop, half=25))
    west, south, east, north = view_of(shot.label, shot.roles, 25).drawn
    for path in (e for group in drawn.with_class("map") for e in group.iter() if e.get("d")):
        points = np.concatenate(drawn.pieces(path))
        assert (points > (west - 1, south - 1)).all()
        assert (points < (east + 1, north + 1)).all()


@pytest.mark.parametrize(
    ("region", "inside", "outside"),
    [
        (Disc((3.0, 4.0), 5.0), (7.9, 4.0), (8.1, 4.0)),
        (Sector((0.0, 0.0), 10.0, 0.0, math.radians(90)), (0.0, 9.99), (5.0, 4.0)),
        (Sector((0.0, 0.0), 10.0, 0.0, math.radians(300)), (-8.0, -2.0), (0.0, -1.0)),
        (Rectangle((0.0, 0.0), math.pi / 2, 2.0, 10.0), (4.9, 0.9), (0.9, 4.9)),
        (UnionOf((Disc((0.0, 0.0), 1.0), Disc((9.0, 0.0), 1.0))), (9.5, 0.0), (5.0, 0.0)),
        (IntersectionOf((Disc((0.0, 0.0), 2.0), Disc((3.0, 0.0), 2.0))), (1.5, 0.0), (0.0, 0.0)),
        (DifferenceOf(Disc((0.0, 0.0), 4.0), Disc((0.0, 0.0), 2.0)), (3.0, 0.0), (1.0, 0.0)),
        (PolygonSet((shapely.box(0, 0, 1, 1), shapely.box(5, 5, 6, 6)), "two"), (5.5, 5.5), (3.0, 3.0)),
    ],
)
def test_outlines_of_regions(region, inside, outside):
    shape = shapely.union_all(outline(region, LARGE))
    assert shape.covers(shapely.Point(inside))
    assert not shape.covers(shapely.Point(outside))


def test_a_place_is_cut_to_what_is_drawn(shoot):
    shot, _ = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    place = allowed_place(shot.scenario, shot.scenario.ego, {}, (0.0, -10.0, 5.0, 10.0))
    assert place is not None
    assert place.fixed
    assert shapely.box(0, -10, 5, 10).buffer(0.01).covers(shapely.union_all(place.shapes))


def test_hostile_texts_are_shown_as_text(shoot):
    _, backdrop = shoot("01-quiet-street/00")
    evil = "</title><script>alert('\"')</script>\x00&amp;"
    ego = LabelObject("ego", "Car", "", 0.0, 0.0, 0.0)
    thing = LabelObject(evil, "Car", evil, 5.0, 5.0, 1.0, 2.0, 4.0, attributes={})
    shot, _ = shoot("01-quiet-street/00")
    label = Label(evil, evil, 0, "crossroads", ego, (thing, replace(thing, id="dot", heading=None)))
    text = draw(replace(shot, label=label), backdrop)
    drawn = Drawn(text)
    assert "<script" not in text
    (box,) = [e for e in drawn.with_class("box", "other") if e.find("{*}circle") is None]
    assert drawn.title(box).startswith(evil.replace("\x00", "\ufffd"))
    assert drawn.with_class("nominal")


def test_escaping_of_attributes():
    assert element("a", href="\"'<>&") == '<a href="&quot;&#39;&lt;&gt;&amp;"></a>'
    assert escape("\x1b[31m\x00") == "\ufffd[31m\ufffd"
    assert element("g", hidden=False, class_=None, data_x=True) == "<g data-x></g>"


@pytest.mark.skipif(not can_make_png(), reason="the extra scenicq[png] is not installed")
def test_png(shoot):
    shot, backdrop = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    assert png(draw(shot, backdrop, pixels=200, style="light")).startswith(b"\x89PNG")


def test_the_picture_of_the_readme_is_what_the_tool_draws(shoot, request):
    shot, backdrop = shoot("03-busy-intersection/11", "02_crossing_cars.scenic")
    file = Path(__file__).parents[3] / "sample_data" / "crossing_cars.svg"
    drawn = draw(shot, backdrop)
    if request.config.getoption("--update-golden"):
        file.write_text(drawn, encoding="utf-8")
    assert file.read_text(encoding="utf-8") == drawn, "`make golden` draws it again"


def test_roles_of_one_area_make_no_pattern(shoot):
    shot, backdrop = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    text = draw(shot, backdrop)
    areas = Drawn(text).with_class("place", "fixed")
    assert len(areas) == 3
    assert "<pattern" not in text
    assert len(Drawn(text).pieces(areas[1])) == 1, "the intersection is one outline"


def test_distances_of_requirements_are_drawn(crossroads, tmp_path):
    program = tmp_path / "far.scenic"
    program.write_text(
        "model scenic.domains.driving.model\nego = new Car\nother = new Car\n"
        "require 3 < (distance from ego to other) < 40\nrequire (distance from other to intersection) < 50\n"
        "require (distance from ego to other) > 1\n"
    )
    dataset = open_dataset(crossroads)
    query = Query(dataset, read_program(program), QueryOptions())
    found = next(each for each in query.results() if each.recording == "05-two-lane-traffic")
    (label,) = dataset.labels([found.frame])
    scenario, network = query.compile(label.map)
    shot = Shot(label, scenario, found.verdict)
    ways = measured_distances(scenario, observe_roles(shot.roles), LARGE)
    other = shot.roles[1].member
    assert len(ways) == 2, "each distance once"
    assert ways[0] == ((label.ego.x, label.ego.y), (other.x, other.y))
    intersection = shapely.union_all(outline(network.region("intersection"), LARGE))
    assert math.dist(*ways[1]) == pytest.approx(intersection.distance(shapely.Point(other.x, other.y)))
    text = draw(shot, Backdrop(network), half=100)
    told = [each.text for each in Drawn(text).with_class("metres")]
    assert f"{math.dist(*ways[0]):.1f} m" in told
    assert len(Drawn(text).with_class("distance")) == len(told) == 1 + (math.dist(*ways[1]) > 5)


def test_no_box_hides_a_length(shoot):
    """The ego is 5 m from the intersection: in the middle of that line stands its own dark box."""
    shot, backdrop = shoot("03-busy-intersection/09", "02_crossing_cars.scenic")
    drawn = Drawn(draw(shot, backdrop, half=50))
    (length,), (line,) = drawn.with_class("metres"), drawn.with_class("distance")
    (x0, y0), (x1, y1) = (map(int, pair.split()) for pair in line.get("d").removeprefix("M").split("L"))
    assert abs(y1 - y0) > abs(x1 - x0)
    assert length.get("text-anchor") == "end"
    assert min(x0, x1) - int(length.get("x")) > 100  # centimetres; the ego is 2 m wide


@pytest.mark.parametrize("size", [100, 200, 300])
@pytest.mark.parametrize(("to_east", "to_north"), [(40, 10), (10, 40), (40, 0), (0, -40)])
def test_lengths_of_distances_alongside_do_not_hide_one_another(to_east, to_north, size):
    ends = [(part * to_east, part * to_north) for part in (1.0, 1.05, 1.1)]
    texts = Drawn(
        '<svg data-origin="0 0">'
        + draw_distances([((0.0, 0.0), end) for end in ends], Plane((0.0, 0.0)), Placement(), size)
        + "</svg>"
    ).with_class("metres")
    spans = []
    for text in texts:
        wide, x = 0.5 * size * len(text.text), int(text.get("x"))
        right = x if text.get("text-anchor") == "end" else x + wide / 2
        spans.append((right - wide, right, int(text.get("y"))))
    assert [text.text for text in texts] == [f"{math.hypot(*end):.1f} m" for end in ends]
    for (left, right, y), (start, end, line) in itertools.combinations(spans, 2):
        assert right <= start or end <= left or abs(y - line) >= 0.7 * size


@pytest.mark.parametrize("half", [50, 100])
def test_people_are_large_enough_to_be_seen(shoot, half):
    shot, backdrop = shoot("02-pedestrian-crosses/10")
    drawn = Drawn(draw(shot, backdrop, half=half))
    dots = drawn.with_class("dot")
    assert dots
    assert len(dots) == len(drawn.with_class("person"))
    # of a picture of 900 pixels at least six
    assert all(2 * int(dot.get("r")) / (2 * half * 100) * 900 >= 6 for dot in dots)


def test_captions_fit(shoot):
    shot, backdrop = shoot("03-busy-intersection/10")
    name = "WMWMWMWM-0510-35b0-a2fa-b4cea13a6d76"
    label = replace(shot.label, frame=f"{name}/315973165959643000", recording=name, map=name)
    root = Drawn(draw(replace(shot, label=label), backdrop)).root
    width = float(root.get("viewBox").split()[2])
    for each in Drawn(draw(replace(shot, label=label), backdrop)).with_class("caption"):
        assert len(each.text) * 0.69 * float(each.get("font-size")) < width


@pytest.mark.parametrize("size", [150, 300, 450])
@pytest.mark.parametrize("apart", [0.5, 2.0, 4.0])
def test_names_of_roles_near_each_other_do_not_overlap(shoot, apart, size):
    shot, _ = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    member = shot.roles[0].member
    roles = tuple(
        replace(role, member=replace(member, x=member.x + apart * number, y=member.y - 0.7 * apart * number))
        for number, role in enumerate(shot.roles)
    )
    plane = Plane((math.floor(member.x), math.floor(member.y)))
    (west, north), (east, south) = plane.at(member.x - 40, member.y + 40), plane.at(member.x + 40, member.y - 40)
    placement = Placement((west, east), (north, south))
    texts = list(ET.fromstring(f"<g>{draw_text(roles, plane, placement, size)}</g>"))
    assert [each.text for each in texts] == [role.name for role in roles]
    for one, other in itertools.combinations(texts, 2):
        across = 0.34 * size * (len(one.text) + len(other.text))
        aside = abs(int(one.get("x")) - int(other.get("x"))), abs(int(one.get("y")) - int(other.get("y")))
        assert aside[0] >= across or aside[1] >= size


@pytest.mark.parametrize("size", [150, 300])
@pytest.mark.parametrize("turn", range(0, 360, 30))
def test_no_name_stands_on_a_length(shoot, size, turn):
    shot, _ = shoot("03-busy-intersection/10", "02_crossing_cars.scenic")
    ego, other = shot.roles[0], shot.roles[1]
    away = math.radians(turn)
    moved = replace(other.member, x=ego.member.x + 8 * math.cos(away), y=ego.member.y + 8 * math.sin(away))
    roles = (ego, replace(other, member=moved))
    plane = Plane((math.floor(ego.member.x), math.floor(ego.member.y)))
    placement = Placement((-4000.0, 4000.0), (-4000.0, 4000.0))
    ways = [((ego.member.x, ego.member.y), (moved.x, moved.y))]
    drawn = draw_distances(ways, plane, placement, size) + draw_text(roles, plane, placement, size)
    spans = []
    for text in ET.fromstring(f"<g>{drawn}</g>").iter("text"):
        wide, x = 0.6 * size * len(text.text), int(text.get("x"))
        right = x if text.get("text-anchor") == "end" else x + wide / 2
        spans.append((right - wide, right, int(text.get("y"))))
    for (left, right, y), (start, end, line) in itertools.combinations(spans, 2):
        assert right <= start or end <= left or abs(y - line) >= 0.7 * size


def test_small_roles_have_a_ring(shoot):
    shot, backdrop = shoot("02-pedestrian-crosses/10", "01_pedestrian_facing_ego.scenic", why=True)
    assert {role.name for role in shot.roles} == {"ego", "pedestrian"}
    (ring,) = Drawn(draw(shot, backdrop, half=50)).with_class("ring")
    pedestrian = shot.roles[1]
    assert "c1" in ring.get("class").split()
    x, y = Plane((math.floor(shot.label.ego.x), math.floor(shot.label.ego.y))).at(
        pedestrian.member.x, pedestrian.member.y
    )
    assert (ring.get("cx"), ring.get("cy")) == (str(x), str(y))
