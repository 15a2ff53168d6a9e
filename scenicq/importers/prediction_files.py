"""Files of predictions: nuScenes detection results, Argoverse 2 detections, and the interchange format with scores."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.fields import replace_non_finite
from scenicq.importers.prediction_checks import NEEDED, check_predictions, duplicate_error
from scenicq.importers.predictions import ARGOVERSE2, NUSCENES, PLAIN, Predictions, Protocol
from scenicq.store.schema import ArrowTable
from scenicq.store.unpacked import Bound, check_claims, decoded_bytes, feather_batches, text_columns

__all__ = ["read_predictions"]

Reals = NDArray[np.float64]
T = TypeVar("T")
_Number = float | None
"""Null, or NaN as some programs write it, is checked with the other numbers, and told with the frame."""

_compute: Any = import_module("pyarrow.compute")
"""A module whose functions no stubs know."""

_HINT = (
    "known are nuScenes detection results (.json), Argoverse 2 detections (.feather), and labels of the interchange "
    "format whose objects have a `score` (.jsonl or .parquet)"
)
_NUMBERS = ("x", "y", "heading", "width", "length", "height", "vx", "vy", "score", "z")
_MOST_ATTRIBUTES = 100


class _Detection(msgspec.Struct):
    """A box of nuScenes detection results."""

    translation: tuple[_Number, _Number, _Number]
    size: tuple[_Number, _Number, _Number]
    rotation: tuple[float, float, float, float]
    detection_name: str
    detection_score: _Number
    velocity: tuple[_Number, _Number] = (None, None)
    attribute_name: str = ""


class _Results(msgspec.Struct):
    """nuScenes detection results, those of each sample left as they are written."""

    results: dict[str, msgspec.Raw]
    meta: msgspec.Raw = msgspec.Raw(b"null")


class _Object(msgspec.Struct, rename={"category": "class"}):
    """An object of the interchange format."""

    category: str
    position: tuple[_Number, _Number]
    width: _Number
    length: _Number
    score: _Number
    heading: _Number = None
    yaw: _Number = None
    height: _Number = None
    velocity: tuple[_Number, _Number] | None = None
    z: _Number = None


class _Line(msgspec.Struct):
    """A label of the interchange format, as far as its predictions go."""

    id: str
    objects: list[_Object]


def read_predictions(path: Path) -> Predictions:
    """Read a file of predictions; its extension says which format it is.

    Raises:
        DataError: file-missing; file-invalid; predictions-invalid where a value makes no sense; predictions-duplicate
            where a frame or a box is there twice.
    """
    match path.suffix.lower():
        case ".json":
            found = _nuscenes(path)
        case ".feather":
            found = _argoverse2(path)
        case ".jsonl":
            found = _lines(path)
        case ".parquet":
            found = _parquet(path)
        case _:
            message = f"{path}: its name does not say which kind of predictions it holds"
            raise DataError(Diagnostic("file-invalid", message, hints=(_HINT,)))
    # the pool keeps what the file's table took, twice the room of the boxes
    pa.default_memory_pool().release_unused()
    check_predictions(found)
    return found


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror or error}")) from None


def _invalid(path: Path, why: object) -> DataError:
    text = " ".join(str(why).split())
    return DataError(Diagnostic("file-invalid", f"{path} holds no predictions: {text}", hints=(_HINT,)))


def _decoded(decoder: msgspec.json.Decoder[T], text: bytes) -> T:
    """What a JSON text says; NaN and infinities, which are no JSON but often written, are null."""
    try:
        return decoder.decode(text)
    except msgspec.ValidationError:
        raise
    except msgspec.DecodeError:
        plain = replace_non_finite(text, b"null")
        if plain == text:
            raise
        return decoder.decode(plain)


class _Gathered:
    """Boxes one after the other."""

    def __init__(self) -> None:
        self.frames: list[str] = []
        self.classes: dict[str, int] = {}
        self._frame: list[NDArray[np.int32]] = []
        self._category: list[NDArray[np.int32]] = []
        self._values: list[Reals] = []
        self._attributes: dict[str, int] = {}
        self._attribute: list[NDArray[np.int8]] = []

    def add(
        self,
        frame: str,
        classes: Iterable[str],
        rows: Sequence[Sequence[_Number]],
        attributes: Sequence[str] | None = None,
    ) -> None:
        """A frame with its boxes: columns as in `_NUMBERS`, None for nan; an empty attribute is none.

        Raises:
            ValueError: There are more attributes than anybody names.
        """
        numbers = [self.classes.setdefault(name, len(self.classes)) for name in classes]
        self._frame.append(np.full(len(rows), len(self.frames), dtype=np.int32))
        self._category.append(np.array(numbers, dtype=np.int32))
        self._values.append(np.array(rows, dtype=np.float64).reshape(-1, len(_NUMBERS)))
        told = [self._attributes.setdefault(name, len(self._attributes)) if name else -1 for name in attributes or ()]
        if len(self._attributes) > _MOST_ATTRIBUTES:
            raise ValueError(f"more than {_MOST_ATTRIBUTES} names of attributes")
        self._attribute.append(
            np.full(len(rows), -1, dtype=np.int8) if attributes is None else np.array(told, dtype=np.int8)
        )
        self.frames.append(frame)

    def predictions(self, path: Path, protocol: Protocol) -> Predictions:
        """All of them."""
        none = np.zeros(0, dtype=np.int32)
        values = np.concatenate([np.zeros((0, len(_NUMBERS))), *self._values])
        self._values.clear()
        columns: dict[str, Any] = {name: np.ascontiguousarray(values[:, place]) for place, name in enumerate(_NUMBERS)}
        return Predictions(
            name=str(path),
            protocol=protocol,
            frames=self.frames,
            frame=np.concatenate([none, *self._frame]),
            classes=list(self.classes),
            category=np.concatenate([none, *self._category]),
            attributes=list(self._attributes),
            attribute=np.concatenate([none.astype(np.int8), *self._attribute]),
            **columns,
        )


def _nuscenes(path: Path) -> Predictions:
    try:
        whole = _decoded(msgspec.json.Decoder(_Results), _bytes(path))
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise _invalid(path, error) from None
    decoder = msgspec.json.Decoder(list[_Detection])
    gathered = _Gathered()
    for sample, text in whole.results.items():
        try:
            boxes = decoder.decode(text)
            gathered.add(
                sample,
                [box.detection_name for box in boxes],
                [_nuscenes_row(box) for box in boxes],
                [box.attribute_name for box in boxes],
            )
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise _invalid(path, f"sample {sample}: {error}") from None
    return replace(gathered.predictions(path, NUSCENES), has_meta=bytes(whole.meta) != b"null")


def _nuscenes_row(box: _Detection) -> tuple[_Number, ...]:
    a, b, c, d = box.rotation
    norm = a * a + b * b + c * c + d * d
    yaw = math.atan2(2 * (a * d + b * c), norm - 2 * (c * c + d * d)) if norm > 0 else math.nan
    x, y, z = box.translation
    return (x, y, yaw - math.pi / 2, *box.size, *box.velocity, box.detection_score, z)


def _lines(path: Path) -> Predictions:
    gathered, decoder = _Gathered(), msgspec.json.Decoder(_Line)
    for number, line in enumerate(_bytes(path).splitlines(), 1):
        if line.strip():
            try:
                label = _decoded(decoder, line)
            except (msgspec.MsgspecError, ValueError, RecursionError) as error:
                raise _invalid(path, f"line {number}: {error}") from None
            rows = [_line_row(box) for box in label.objects]
            gathered.add(label.id, [box.category for box in label.objects], rows)
    return gathered.predictions(path, PLAIN)


def _line_row(box: _Object) -> tuple[_Number, ...]:
    heading = box.heading
    if heading is None and box.yaw is not None:
        heading = box.yaw - math.pi / 2
    velocity = box.velocity or (None, None)
    return (*box.position, heading, box.width, box.length, box.height, *velocity, box.score, box.z)


def _table(path: Path) -> ArrowTable:
    data = _bytes(path)
    try:
        bound = Bound(path, len(data))
        if path.suffix.lower() == ".feather":
            schema, batches = feather_batches(data, bound)
            table = pa.Table.from_batches(batches, schema)
        else:
            with pq.ParquetFile(pa.BufferReader(data)) as parquet:
                check_claims(parquet, bound)
                texts = text_columns(parquet)
            table = pq.read_table(pa.BufferReader(data), read_dictionary=texts)
        for column in table.columns:
            for chunk in column.chunks:
                bound.add(decoded_bytes(chunk))
        plain = [field.type.value_type if pa.types.is_dictionary(field.type) else field.type for field in table.schema]
        return table.cast(pa.schema(list(zip(table.schema.names, plain, strict=True))))
    except (pa.ArrowException, OSError) as error:
        raise _invalid(path, error) from None


def _argoverse2(path: Path) -> Predictions:
    table = _table(path)
    turn = ("qw", "qx", "qy", "qz")
    sizes = ("width_m", "length_m", "height_m")
    needed = ("log_id", "timestamp_ns", "category", "score", "tx_m", "ty_m", *sizes, *turn)
    _require(path, table, needed)
    frames, frame = _frames_of(table, ("log_id", "timestamp_ns"))
    classes, category = _codes(path, table["category"])
    a, b, c, d = (_reals(path, table, name) for name in turn)
    yaw = np.arctan2(2 * (a * d + b * c), a * a + b * b - c * c - d * d)
    yaw[(a * a + b * b + c * c + d * d) == 0] = np.nan
    unknown = np.full(len(yaw), np.nan)
    return Predictions(
        name=str(path),
        protocol=ARGOVERSE2,
        frames=frames,
        frame=frame,
        classes=classes,
        category=category,
        x=_reals(path, table, "tx_m"),
        y=_reals(path, table, "ty_m"),
        heading=yaw,
        width=_reals(path, table, "width_m"),
        length=_reals(path, table, "length_m"),
        height=_reals(path, table, "height_m"),
        vx=unknown,
        vy=unknown,
        score=_reals(path, table, "score"),
        z=_reals(path, table, "tz_m"),
        attributes=[],
        attribute=np.full(len(yaw), -1, dtype=np.int8),
        of_ego=True,
    )


def _frames_of(table: ArrowTable, names: Sequence[str]) -> tuple[list[str], NDArray[np.int32]]:
    """The names of frames in the order in which they come, and the number of the frame of each row."""
    texts = [_compute.cast(table[name], pa.string()) for name in names]
    joined = _compute.binary_join_element_wise(*texts, "/") if len(texts) > 1 else texts[0]
    encoded = joined.combine_chunks().dictionary_encode()
    return encoded.dictionary.to_pylist(), encoded.indices.to_numpy(zero_copy_only=False).astype(np.int32)


def _codes(path: Path, column: Any) -> tuple[list[str], NDArray[np.int32]]:
    """Distinct texts, and the number of each row's."""
    if column.null_count:
        raise _invalid(path, "a class is missing")
    encoded = _compute.cast(column, pa.string()).combine_chunks().dictionary_encode()
    return encoded.dictionary.to_pylist(), encoded.indices.to_numpy(zero_copy_only=False).astype(np.int32)


def _require(path: Path, table: ArrowTable, names: Iterable[str]) -> None:
    missing = [name for name in names if name not in table.column_names]
    if missing:
        raise _invalid(path, f"it lacks the columns {', '.join(f'`{name}`' for name in missing)}")


def _reals(path: Path, table: ArrowTable, name: str) -> Reals:
    """A column of numbers; nan where it has none, or is not there."""
    if name not in table.column_names:
        return np.full(len(table), np.nan)
    try:
        column = _compute.cast(table[name], pa.float64())
    except pa.ArrowException as error:
        raise _invalid(path, f"`{name}`: {error}") from None
    values: Reals = column.to_numpy()
    return np.ascontiguousarray(values)


def _parquet(path: Path) -> Predictions:
    """Labels with a list of objects each, or one row a box with a column for each value."""
    table = _table(path)
    known: list[str] | None = None
    if "objects" in table.column_names:
        _require(path, table, ("id", "objects"))
        table, known = _unnested(path, table)
    _require(path, table, ("frame", "class", *NEEDED))
    frames, frame = _frames_of(table, ("frame",))
    if known is not None:
        numbers = {name: number for number, name in enumerate(known)}
        frame = np.array([numbers[name] for name in frames], dtype=np.int32)[frame] if frames else frame
        frames = known
    classes, category = _codes(path, table["class"])
    columns: dict[str, Any] = {name: _reals(path, table, name) for name in _NUMBERS}
    none = np.full(len(frame), -1, dtype=np.int8)
    return Predictions(str(path), PLAIN, frames, frame, classes, category, attributes=[], attribute=none, **columns)


def _unnested(path: Path, table: ArrowTable) -> tuple[ArrowTable, list[str]]:
    """One row a box of labels with lists of objects, and the names of all labels."""
    names: list[str] = _compute.cast(table["id"], pa.string()).to_pylist()
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise duplicate_error(str(path), f"frame {twice} is there more than once")
    objects = table["objects"].combine_chunks()
    try:
        boxes = pa.Table.from_struct_array(objects.flatten())
        rows = boxes.append_column(
            "frame", _compute.take(pa.array(names, pa.string()), _compute.list_parent_indices(objects))
        )
        for pair, ends in (("position", ("x", "y")), ("velocity", ("vx", "vy"))):
            if pair in rows.column_names:
                for place, name in enumerate(ends):
                    rows = rows.append_column(name, _compute.list_element(rows[pair], place))
        if "heading" not in rows.column_names and "yaw" in rows.column_names:
            rows = rows.append_column("heading", _compute.subtract(rows["yaw"], math.pi / 2))
    except (pa.ArrowException, AttributeError, TypeError) as error:
        raise _invalid(path, f"`objects` are no boxes: {error}") from None
    return rows, names
