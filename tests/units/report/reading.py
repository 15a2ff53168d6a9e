"""Reads pictures back: path data as points of the map."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import shapely

NAMESPACE = "{http://www.w3.org/2000/svg}"


class Drawn:
    """A picture, parsed."""

    def __init__(self, text):
        self.root = ET.fromstring(text)
        x, y = map(float, self.root.get("data-origin").split())
        self.origin = np.array((x, y))

    def with_class(self, *names):
        """All elements that have all of these classes."""
        return [e for e in self.root.iter() if set(names) <= set((e.get("class") or "").split())]

    def title(self, element):
        return element.findtext(f"{NAMESPACE}title")

    def pieces(self, element):
        """The subpaths of a path in metres of the map."""
        found = []
        for first, rest in re.findall(r"M(-?\d+ -?\d+)(?:l([-\d ]+)|h0)z?", element.get("d")):
            start = np.array([int(each) for each in first.split()])
            steps = np.array([int(each) for each in rest.split()] or [0, 0]).reshape(-1, 2)
            points = np.concatenate([[start], start + np.cumsum(steps, axis=0)])
            found.append(points / (100.0, -100.0) + self.origin)
        return found

    def area(self, element):
        """The polygon that a path fills: rings the other way round are holes."""
        rings = [shapely.Polygon(piece) for piece in self.pieces(element) if len(piece) > 2]
        outer = [r for r in rings if r.exterior.is_ccw]
        holes = [r for r in rings if not r.exterior.is_ccw]
        return shapely.union_all(outer).difference(shapely.union_all(holes)) if outer else shapely.Polygon()
