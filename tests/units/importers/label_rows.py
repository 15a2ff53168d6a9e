"""The labels of a recording that was made by column, for checks that look at single labels."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from scenicq.store.columns import OUT_OF_PLANE, MemberColumns, RecordingColumns
from scenicq.store.labels import Label, LabelObject, OutOfPlane

__all__ = ["labels_of"]


def labels_of(columns: RecordingColumns) -> list[Label]:
    """The labels, in order; `columns_of` of them gives the columns."""
    egos, objects = list(_members(columns.egos)), list(_members(columns.objects))
    counts, sensors = columns.object_counts.tolist(), columns.sensor_counts.tolist()
    labels: list[Label] = []
    first = file = 0
    for number, frame in enumerate(columns.frames):
        last, end = first + counts[number], file + sensors[number]
        labels.append(
            Label(
                frame=frame,
                recording=columns.name,
                timestamp_us=columns.times_us[number],
                map=columns.map,
                ego=egos[number],
                objects=tuple(objects[first:last]),
                params=json.loads(columns.params[number] or "{}"),
                sensors=dict(zip(columns.channels[file:end], columns.paths[file:end], strict=True)),
                cameras={
                    channel: camera
                    for channel, camera in zip(columns.channels[file:end], columns.cameras[file:end], strict=False)
                    if camera is not None
                },
            )
        )
        first, file = last, end
    return labels


def _members(members: MemberColumns) -> Iterator[LabelObject]:
    reals = (members.x, members.y, members.heading, members.width, members.length, members.height)
    rows = zip(*(column.tolist() for column in reals), strict=True)
    speeds = zip(members.vx.tolist(), members.vy.tolist(), strict=True)
    spaces = _spaces(members)
    for number, ((x, y, *others), velocity) in enumerate(zip(rows, speeds, strict=True)):
        heading, width, length, height = (None if math.isnan(value) else value for value in others)
        yield LabelObject(
            id=members.id[number],
            category=members.category[number],
            source_class=members.source_class[number],
            x=x,
            y=y,
            heading=heading,
            width=width,
            length=length,
            height=height,
            velocity=None if math.isnan(velocity[0]) else velocity,
            track=members.track[number],
            attributes=json.loads(members.attributes[number] or "{}"),
            out_of_plane=spaces[number],
        )


def _spaces(members: MemberColumns) -> list[OutOfPlane | None]:
    columns = [getattr(members, name) for name in OUT_OF_PLANE]
    unknown = [math.nan] * len(members.x)
    rows = zip(*(unknown if values is None else values.tolist() for values in columns), strict=True)
    return [
        None if all(map(math.isnan, row)) else OutOfPlane(*(None if math.isnan(value) else value for value in row))
        for row in rows
    ]
