"""Scenic's road network as features of the interchange format, so that both sides use the same polygons."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from shapely.geometry import mapping, shape

sys.path.append(str(Path(__file__).parents[3] / "scenicq" / "importers"))

import opendrive_worker

CRACK = 5e-4
"""Half of the metres between neighbouring sidewalks that Scenic closes."""


def features_of(network: Any) -> list[dict[str, Any]]:
    """Every element of a network of Scenic's driving domain, as the importer writes it, with the cracks closed."""
    found: list[dict[str, Any]] = []
    for feature in opendrive_worker.features_of(network, opendrive_worker.Directions(ElementTree.Element("OpenDRIVE"))):
        if feature["properties"]["kind"] in ("sidewalk", "shoulder"):
            feature["geometry"] = mapping(shape(feature["geometry"]).buffer(CRACK))
        found.append(feature)
    return found
