"""The tables of a dataset: the one place that names their columns.

Units: metres, radians, seconds, microseconds for time; positions in the frame of the label's map. Rows of `labels`,
`objects`, `memberships` and `sensors` are sorted by recording, time and frame (`objects` then by `ordinal`), so the
objects of one frame lie together and in the order of the labels. Columns marked * are computed at ingest.

These four tables are split into parts of whole recordings; parts of one number hold the same recordings.
"""

from __future__ import annotations

import json
from typing import TypeAlias

import pyarrow as pa

__all__ = [
    "ADDED",
    "ADDED_TABLES",
    "GEO_METADATA",
    "MEMBERSHIP_RADIUS_M",
    "SCHEMAS",
    "SCHEMA_VERSION",
    "SEGMENT_TABLES",
    "UPGRADABLE",
    "ArrowArray",
    "ArrowTable",
]

ArrowTable: TypeAlias = pa.Table
"""Rows of a table."""

ArrowArray: TypeAlias = pa.Array
"""A column of rows."""

SCHEMA_VERSION = 9
"""Changes with every change of a table that a reader could notice."""

UPGRADABLE = frozenset({2, 3, 4, 5, 6, 7, 8})
"""Older versions of which `scenicq index` makes this one: it computes anew what is computed."""

ADDED = {4: frozenset({"z", "pitch", "roll", "image_width", "image_height", "intrinsics", "camera_pose"})}
"""Columns of the source that came with a version (of egos with `ego_` before); older datasets know nothing there."""

ADDED_TABLES = {8: frozenset({"links"})}
"""Tables that came with a version; older datasets lack them."""

MEMBERSHIP_RADIUS_M = 2.0
"""`memberships` lists the regions within this distance: a position tolerance up to it can be prefiltered."""

_TEXT, _REAL, _COUNT = pa.string(), pa.float64(), pa.int32()


def _required(name: str, kind: pa.DataType) -> pa.Field:
    return pa.field(name, kind, nullable=False)


def _out_of_plane(prefix: str) -> list[pa.Field]:
    return [pa.field(f"{prefix}{name}", _REAL) for name in ("z", "pitch", "roll")]


def _motion(prefix: str) -> list[pa.Field]:
    return [
        pa.field(f"{prefix}motion_vx", _REAL),  # * the label's own velocity, else that of its track
        pa.field(f"{prefix}motion_vy", _REAL),  # *
        pa.field(f"{prefix}acceleration", _REAL),  # * along the heading
        pa.field(f"{prefix}yaw_rate", _REAL),  # *
        _required(f"{prefix}motion_derived", pa.bool_()),  # * whether the velocity is the track's
    ]


SEGMENT_TABLES = ("labels", "objects", "memberships", "sensors")
"""The tables that are split into parts."""

SCHEMAS: dict[str, pa.Schema] = {
    # One row a frame.
    "labels": pa.schema(
        [
            _required("frame", _TEXT),
            _required("recording", _TEXT),
            _required("timestamp_us", pa.int64()),
            _required("map", _TEXT),
            _required("ego_class", _TEXT),
            _required("ego_source_class", _TEXT),
            _required("ego_x", _REAL),
            _required("ego_y", _REAL),
            pa.field("ego_heading", _REAL),
            pa.field("ego_width", _REAL),
            pa.field("ego_length", _REAL),
            pa.field("ego_height", _REAL),
            pa.field("ego_vx", _REAL),
            pa.field("ego_vy", _REAL),
            pa.field("ego_track", _TEXT),
            pa.field("ego_attributes", _TEXT),  # JSON; null where there is none
            *_out_of_plane("ego_"),
            *_motion("ego_"),
            _required("ego_road_directions", pa.list_(_REAL)),  # * of every lane at the position; empty: undefined
            pa.field("ego_lane", _TEXT),  # * the lane at the position; of several the one with the nearest centreline
            # * number of the last lane of its track among the map's elements, where that tells more than its heading
            pa.field("ego_last_lane", _REAL),
            pa.field("params", _TEXT),  # JSON; null where there is none
            _required("object_count", _COUNT),
            _required("first_object", _COUNT),  # where its rows begin in the part of `objects` of the same number
            _required("sensor_count", _COUNT),
            _required("first_sensor", _COUNT),
            _required("class_counts", pa.map_(_TEXT, _COUNT)),  # * tree class -> label objects of exactly that class
        ]
    ),
    # One row a label object; the ego is in `labels`.
    "objects": pa.schema(
        [
            _required("frame", _TEXT),
            _required("recording", _TEXT),
            _required("timestamp_us", pa.int64()),
            _required("ordinal", _COUNT),  # order in the source
            _required("id", _TEXT),
            _required("class", _TEXT),
            _required("source_class", _TEXT),
            _required("x", _REAL),
            _required("y", _REAL),
            pa.field("heading", _REAL),
            pa.field("width", _REAL),
            pa.field("length", _REAL),
            pa.field("height", _REAL),
            pa.field("vx", _REAL),
            pa.field("vy", _REAL),
            pa.field("track", _TEXT),
            pa.field("attributes", _TEXT),
            *_out_of_plane(""),
            *_motion(""),
            pa.field("ego_right", _REAL),  # * position in the ego's frame; null where the ego has no heading
            pa.field("ego_ahead", _REAL),  # *
            _required("ego_distance", _REAL),  # *
            pa.field("relative_heading", _REAL),  # * heading minus the ego's, in (-pi, pi]
            # * along and beside the ego's course, with how much less and more that may be; null without an end
            *(pa.field(f"ego_{axis}{end}", _REAL) for axis in ("along", "beside") for end in ("", "_less", "_more")),
            _required("road_directions", pa.list_(_REAL)),  # *
            pa.field("lane", _TEXT),  # *
            pa.field("last_lane", _REAL),  # *
        ]
    ),
    # * One row for each region near an object's position; the ego's object id is "ego".
    "memberships": pa.schema(
        [
            _required("frame", _TEXT),
            _required("object", _TEXT),
            _required("kind", _TEXT),
            _required("region", _TEXT),
            _required("distance", _REAL),  # 0 inside and on the boundary
            # in a lane or a section of one how far it leads from the heading of who is there; 0 for who has none
            pa.field("turn", _REAL),
            # the same of a section with a line of its own, by that line; more than pi where it has no direction
            pa.field("section_turn", _REAL),
        ]
    ),
    # One row a map element, in the order of the map.
    "regions": pa.schema(
        [
            _required("map", _TEXT),
            _required("id", _TEXT),
            _required("kind", _TEXT),
            _required("geometry", pa.binary()),  # WKB
            _required("properties", _TEXT),  # JSON: all that a network is built from
        ]
    ),
    # One row a lane, for queries; `regions` is the truth.
    "lanes": pa.schema(
        [
            _required("map", _TEXT),
            _required("id", _TEXT),
            pa.field("centerline", pa.binary()),  # WKB MultiLineString in driving direction
            pa.field("left", _TEXT),
            pa.field("right", _TEXT),
            _required("predecessors", pa.list_(_TEXT)),
            _required("successors", pa.list_(_TEXT)),
        ]
    ),
    # * One row for each way from an element of a map to another: the region that each is in `memberships`.
    "links": pa.schema(
        [
            _required("map", _TEXT),
            _required("kind", _TEXT),  # of the first: `lane_section` of a lane that the map does not cut, too
            _required("region", _TEXT),
            _required("link", _TEXT),  # the attribute that leads to the other
            _required("target", _TEXT),
            # of a lane ahead, how many metres behind the end of the first it begins; null of all other links
            pa.field("begins", _REAL),
        ]
    ),
    # One row a sensor file. Cameras: all four are known, or none.
    "sensors": pa.schema(
        [
            _required("frame", _TEXT),
            _required("channel", _TEXT),
            _required("path", _TEXT),
            pa.field("image_width", _COUNT),
            pa.field("image_height", _COUNT),
            _required("intrinsics", pa.list_(_REAL)),  # fx, fy, cx, cy in pixels; empty: unknown
            _required("camera_pose", pa.list_(_REAL)),  # x, y, z, and a quaternion w, x, y, z, frame of the map
        ]
    ),
    # One row a frame, in order of `hash`: where to find a frame without reading the names of all.
    "frame_index": pa.schema([_required("hash", pa.uint64()), _required("row", pa.int64())]),
}
"""Name of each table, which is also its folder and its SQL view, with its columns as a `pyarrow.Schema`."""

GEO_METADATA = json.dumps(
    {
        "version": "1.1.0",
        "primary_column": "geometry",
        # The frame is the map's own, in metres: no coordinate reference system describes it.
        "columns": {"geometry": {"encoding": "WKB", "geometry_types": [], "crs": None, "edges": "planar"}},
    },
    separators=(",", ":"),
)
"""Value of the `geo` key by which GeoParquet readers recognise the geometry column of `regions`."""
