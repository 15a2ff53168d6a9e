"""Changes a file of a dataset at random: as what it is (JSON, XML, CSV, columns, messages) or as bytes.

Everything depends on the given `random.Random` alone, so a seed names a case.
"""

from __future__ import annotations

import copy
import gzip
import json
import os
import random
import re
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import feather

from scenicq.importers.tfrecord import crc32c

JUNK: list[Any] = [
    *(None, True, False, 0, -1, 1, 1.5, -0.0, 1e308, -1e-308, float("nan"), float("inf"), 10**400, 2**63),
    *(2**31, -(2**63), "", "x", "ego", "nan", "-1e999", "\ud800", "\0", "\u202e", "../../../../etc/passwd", "a" * 5000),
    *([], [None], [[]], [0], [0, 0], [1e9, 1e9, 1e9], [[0, 0], [0, 0]], {}, {"x": []}, {"token": "x"}),
]  # fmt: skip
TOKENS = [
    *(b"", b"\0", b"\xff" * 8, b"\x7f\xff\xff\xff", b"-1", b"1e999", b"nan", b"null", b"[]", b"{}", b'"', b"<", b">"),
    *(b"\n", b",", b" ", b"\xef\xbb\xbf", b"99999999999999999999", b"0.0", b"../../x", b"\xed\xa0\x80", b"&x;", b"\r"),
]
UNFIT = (
    *(ValueError, KeyError, IndexError, OverflowError, RecursionError, EOFError, OSError),
    *(struct.error, zlib.error, ET.ParseError, pa.ArrowException),
)
"""What is raised where a file is no longer what its name says, or junk does not fit."""

NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")


def mutate_source(root: Path, outside: Path, random: random.Random) -> None:
    """Change one to three things of a source: a file's content, or which files there are.

    Args:
        root: A copy that may be spoiled.
        outside: A file outside of it, to which a link may lead.
        random: Decides.
    """
    for _ in range(random.choice([1, 1, 2, 3])):
        files = sorted(path for path in root.rglob("*") if path.is_file() and not path.is_symlink())
        if not files:
            return
        file = random.choice(files)
        if random.random() < 0.06:
            _misplace(file, outside, random)
        else:
            file.write_bytes(mutate_content(file.name, file.read_bytes(), random))


def mutate_content(name: str, content: bytes, random: random.Random) -> bytes:
    """The content of a file, changed."""
    if random.random() < 0.35:
        return mutate_bytes(content, random)
    try:
        changed = _kind(name)(content, random)
    except UNFIT:
        return mutate_bytes(content, random)
    return mutate_bytes(changed, random) if random.random() < 0.05 else changed


def mutate_bytes(content: bytes, random: random.Random) -> bytes:
    """Some bytes changed, put in, taken out, doubled; or a number of a text replaced."""
    for _ in range(random.choice([1, 1, 2, 5])):
        start = random.randrange(len(content) + 1)
        end = min(len(content), start + random.choice([0, 1, 1, 2, 4, 8, 64, 1000, 10**9]))
        match random.randrange(6):
            case 0:
                content = content[:start] + random.choice(TOKENS) + content[end:]
            case 1:
                content = content[:start] + random.randbytes(random.choice([1, 2, 4, 8, 100])) + content[end:]
            case 2:
                content = content[:start] + content[start:end] * random.choice([2, 3, 50]) + content[end:]
            case 3 if start < len(content):
                content = content[:start] + bytes([content[start] ^ 1 << random.randrange(8)]) + content[start + 1 :]
            case 4 if numbers := list(NUMBER.finditer(content)):
                found = random.choice(numbers)
                new = random.choice([b"0", b"-1", b"1e300", b"nan", b"1e999", b"9" * 30, b"1e5", b""])
                content = content[: found.start()] + new + content[found.end() :]
            case _:
                other = random.randrange(len(content) + 1)
                content = content[:start] + content[other : other + end - start] + content[end:]
        content = content[: 1 << 22]
    return content


def _kind(name: str) -> Callable[[bytes, random.Random], bytes]:
    kinds = {
        ".json": _json,
        ".geojson": _json,
        ".jsonl": _json_lines,
        ".gz": _gzip,
        ".xml": _xml,
        ".osm": _xml,
        ".xodr": _xml,
        ".csv": _table,
        ".txt": _table,
        ".feather": _feather,
        ".parquet": _parquet,
    }
    return _records if ".tfrecord" in name else kinds.get(Path(name).suffix, mutate_bytes)


def _misplace(file: Path, outside: Path, random: random.Random) -> None:
    content = file.read_bytes()
    if (way := random.randrange(6)) == 5:
        file.with_name(f"{file.stem}-2{file.suffix}").write_bytes(content)
        return
    file.unlink()
    match way:
        case 0:
            file.mkdir()
        case 1:
            file.symlink_to(outside)
        case 2:
            os.mkfifo(file)
        case 3:
            file.with_name(os.fsdecode(b"\xff\n" + os.fsencode(file.name))).write_bytes(content)
        case _:
            pass


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every (container, key) of a JSON value."""
    found: list[tuple[Any, Any]] = []
    stack = [value]
    while stack:
        container = stack.pop()
        keys = list(container) if isinstance(container, dict) else range(len(container))
        found += [(container, key) for key in keys]
        stack += [container[key] for key in keys if isinstance(container[key], dict | list)]
    return found


def _spoil(whole: Any, random: random.Random) -> Any:
    for _ in range(random.choice([1, 1, 1, 3, 10])):
        found = _places(whole) if isinstance(whole, dict | list) else []
        if not found:
            return random.choice(JUNK)
        container, key = random.choice(found[:60] if random.random() < 0.4 else found)
        here = container[key]
        match random.randrange(7):
            case 0:
                del container[key]
            case 1:
                other, place = random.choice(found)
                container[key] = copy.deepcopy(other[place]) if place in _keys(other) else None
            case 2 if isinstance(here, list):
                container[key] = (here * random.choice([2, 100]))[:2000]
            case 3 if isinstance(here, list):
                random.shuffle(here)
            case 4 if isinstance(here, int | float):
                container[key] = here * random.choice([-1, 0, 1e-9, 1e6, 1e150])
            case 5 if isinstance(here, str):
                container[key] = here + random.choice(["x", "\ud800", "/../..", "\n", "\0", " "])
            case _:
                container[key] = copy.deepcopy(random.choice(JUNK))
    return whole


def _keys(container: Any) -> Any:
    return container if isinstance(container, dict) else range(len(container))


def _json(content: bytes, random: random.Random) -> bytes:
    if random.random() < 0.02:
        depth = random.choice([100, 2000, 200_000])
        return b"[" * depth + content + b"]" * random.choice([0, depth])
    return json.dumps(_spoil(json.loads(content), random)).encode()


def _json_lines(content: bytes, random: random.Random) -> bytes:
    # Few lines take less time, and find as much.
    lines = content.splitlines()[: random.choice([1, 8, 30])]
    number = random.randrange(len(lines))
    lines[number] = _json(lines[number], random)
    if random.random() < 0.1:
        lines.insert(random.randrange(len(lines)), random.choice(lines))
    return b"\n".join(lines) + b"\n"


def _gzip(content: bytes, random: random.Random) -> bytes:
    if random.random() < 0.02:
        return gzip.compress(b"\0" * (300 << 20), 1)
    return gzip.compress(_json_lines(gzip.decompress(content), random), 1)


def _xml(content: bytes, random: random.Random) -> bytes:
    root = ET.fromstring(content)
    for _ in range(random.choice([1, 1, 2, 6])):
        parents = [element for element in root.iter() if len(element)]
        if not parents:
            break
        parent = random.choice(parents)
        number = random.randrange(len(parent))
        element = parent[number]
        value = random.choice(["", "-1", "nan", "1e999", "x", "1e30", "0", "9" * 40, "../../x", "true"])
        match random.randrange(8):
            case 0:
                parent.remove(element)
            case 1:
                parent.insert(0, copy.deepcopy(element))
            case 2:
                parent.append(copy.deepcopy(random.choice(list(root.iter()))))
            case 3 if element.attrib:
                element.set(random.choice(list(element.attrib)), value)
            case 4 if element.attrib:
                del element.attrib[random.choice(list(element.attrib))]
            case 5:
                other = random.choice(list(root.iter()))
                if parent not in other.iter():
                    parent[number] = other
            case 6:
                element.tag = random.choice(["x", parent.tag, random.choice(list(root.iter())).tag])
            case _:
                element.text = value
    made = ET.tostring(root)[: 1 << 22]
    if random.random() < 0.05:
        made = b'<!DOCTYPE a [<!ENTITY x "yyyyyyyyyy"><!ENTITY z "&x;&x;&x;">]>' + made.replace(b"1", b"&z;", 1)
    return made


def _table(content: bytes, random: random.Random) -> bytes:
    mark = b"," if b"," in content else b" "
    rows = [line.split(mark) for line in content.splitlines()]
    junk = [b"", b"nan", b"-1", b"1e999", b"x", b'"', b"9" * 30, b"1e9", b"inf", b"\xff", b"0", b" ", b"../x", b"\0"]
    for _ in range(random.choice([1, 1, 3])):
        row = random.choice(rows)
        match random.randrange(5):
            case 0 if row:
                del row[random.randrange(len(row))]
            case 1:
                row.insert(random.randrange(len(row) + 1), random.choice(junk))
            case 2:
                rows.append(list(row))
            case 3:
                random.shuffle(rows)
            case _ if row:
                row[random.randrange(len(row))] = random.choice(junk)
            case _:
                pass
    return b"\n".join(mark.join(row) for row in rows) + b"\n"


def _columns(table: pa.Table, random: random.Random) -> pa.Table:
    for _ in range(random.choice([1, 1, 2])):
        name = random.choice(table.column_names)
        index = table.column_names.index(name)
        values = table[name].to_pylist()
        place = random.randrange(len(values)) if values else 0
        match random.randrange(8):
            case 0:
                table = table.drop_columns([name])
            case 1:
                table = table.slice(0, random.choice([0, 1, place]))
            case 2:
                table = table.append_column(name, table[name])
            case 3:
                kinds = [pa.int8(), pa.float16(), pa.float32(), pa.string(), pa.binary(), pa.uint64(), pa.bool_()]
                table = table.set_column(index, name, table[name].cast(random.choice(kinds), safe=False))
            case 4:
                table = table.set_column(index, name, pa.array([[value] for value in values]))
            case 5:
                table = table.set_column(index, name, table[name].dictionary_encode())
            case 6:
                table = pa.concat_tables([table, table.slice(place, 1), table.slice(0, 1)])
            case _ if values:
                values[place] = random.choice(
                    [None, float("nan"), float("inf"), -1, 0, 2**62, "", "../x", 1e300, "9" * 99]
                )
                table = table.set_column(index, name, pa.array(values, table.schema.field(name).type))
            case _:
                pass
    return table


def _feather(content: bytes, random: random.Random) -> bytes:
    sink = pa.BufferOutputStream()
    table = pa.ipc.open_file(content).read_all()
    table.validate(full=True)  # what was damaged before would end this process
    table = _columns(table, random)
    feather.write_feather(table, sink, compression=random.choice(["uncompressed", "lz4", "zstd"]))
    return sink.getvalue().to_pybytes()


def _parquet(content: bytes, random: random.Random) -> bytes:
    sink = pa.BufferOutputStream()
    table = _columns(pq.read_table(pa.BufferReader(content)), random)
    pq.write_table(table, sink, compression=random.choice(["none", "snappy", "zstd", "gzip"]))
    return sink.getvalue().to_pybytes()


def _records(content: bytes, random: random.Random) -> bytes:
    """TFRecords: one message changed and framed anew, mostly with true checksums."""
    found: list[bytes] = []
    position = 0
    while position + 12 <= len(content):
        length = int.from_bytes(content[position : position + 8], "little")
        found.append(content[position + 12 : position + 12 + length])
        position += 16 + length
    number = random.randrange(len(found))
    found[number] = _message(found[number], random, 4)
    if random.random() < 0.1:
        found.append(random.choice(found))
    return b"".join(_framed(record) for record in found)


def _framed(record: bytes) -> bytes:
    head = struct.pack("<Q", len(record))
    return b"".join([head, _masked(head), record, _masked(record)])


def _masked(content: bytes) -> bytes:
    crc = crc32c(content)
    return struct.pack("<I", (((crc >> 15) | (crc << 17)) + 0xA282EAD8) & 0xFFFFFFFF)


def _message(content: bytes, random: random.Random, depth: int) -> bytes:
    """A message of protocol buffers with a field changed; most often deep inside."""
    fields: list[tuple[int, int, bytes]] = []
    position = 0
    while position < len(content):
        key, position = _varint(content, position)
        width = {1: 8, 5: 4}.get(key & 7, 0)
        if key & 7 == 2:
            width, position = _varint(content, position)
        if key & 7 == 0:
            end = _varint(content, position)[1]
            width = end - position
        if not width and key & 7 not in (0, 2):
            raise ValueError("no message")
        fields.append((key >> 3, key & 7, content[position : position + width]))
        position += width
    if not fields:
        raise ValueError("an empty message")
    number = random.randrange(len(fields))
    inner = [place for place, (_, kind, value) in enumerate(fields) if kind == 2 and len(value) > 1]
    if depth and inner and random.random() < 0.75:
        number = random.choice(inner)
        tag, kind, value = fields[number]
        try:
            fields[number] = tag, kind, _message(value, random, depth - 1)
        except (ValueError, IndexError):
            fields[number] = tag, kind, mutate_bytes(value, random)
    else:
        tag, kind, value = fields[number]
        reals = [0.0, -1.0, float("nan"), float("inf"), 1e300, 1e-300, 1e8]
        match random.randrange(6):
            case 0:
                del fields[number]
            case 1:
                fields.insert(random.randrange(len(fields)), random.choice(fields))
            case 2:
                fields[number] = random.choice([1, 2, 3, 5, 6, 8, 11, 2**28]), kind, value
            case 3:
                fields[number] = tag, 0, _as_varint(random.choice([0, 1, 2, 2**31, 2**63, 2**64 - 1]))
            case 4:
                fields[number] = tag, 1, struct.pack("<d", random.choice(reals))
            case _:
                fields[number] = tag, 5, struct.pack("<f", random.choice([x for x in reals if not 1e38 < x < 1e301]))
    return b"".join(
        _as_varint(tag << 3 | kind) + (_as_varint(len(value)) if kind == 2 else b"") + value
        for tag, kind, value in fields
    )


def _varint(content: bytes, position: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = content[position]
        position += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return value, position


def _as_varint(value: int) -> bytes:
    made = bytearray()
    while value > 127:
        made.append(value & 127 | 128)
        value >>= 7
    return bytes([*made, value])
