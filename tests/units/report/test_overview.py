"""The funnel of a report."""

import re
from collections import Counter

from scenicq.query.execution.results import Funnel
from scenicq.report.overview import funnel_section


def rows(markup):
    return [
        (re.sub("<[^>]+>", "", name), number, "<svg" in rest)
        for name, number, rest in re.findall(
            r'<tr><th scope="row">(.*?)</th><td class="count">(.*?)</td><td class="share">(.*?)</td></tr>', markup
        )
    ]


def test_of_frames_it_counts_frames():
    funnel = Funnel(frames=40, candidates=20, with_roles=10, matches=4, unknowns=1)
    assert rows(funnel_section(funnel, "")) == [
        ("frames", "40", True),
        ("after the prefilter", "20", True),
        ("with an object for every role", "10", True),
        ("matches", "4", True),
        ("unknown", "1", True),
    ]


def test_over_time_it_counts_what_intervals_come_from():
    counted = Counter({"starts": 9, "recordings": 2, "bindings": 5, "cut off": 3})
    broken = Counter({"require always ego.speed < 9": 2})
    funnel = Funnel(frames=40, candidates=20, matches=1, over_time=counted, broken=broken)
    markup = funnel_section(funnel, "")
    assert rows(markup) == [
        ("frames of 2 recordings", "40", True),
        ("after the prefilter", "20", True),
        ("frames that match the initial scene", "9", True),
        ("ways to give the objects tracks from there on", "5", False),
        ("ways cut off, as the recording or a track ends before the program", "3", False),
        ("intervals that match", "1", False),
        ("intervals that are unknown", "0", False),
    ]
    assert "require always ego.speed &lt; 9" in markup
