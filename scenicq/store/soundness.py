"""Whether a whole dataset is sound: every table, what tables say of each other, and its maps."""

from __future__ import annotations

import numpy as np

from scenicq.errors import ScenicqError
from scenicq.geometry.map_traits import traits_of
from scenicq.geometry.network import Network
from scenicq.store.frame_index import frame_hashes, index_rows
from scenicq.store.manifest import Manifest
from scenicq.store.map_validation import check_lanes, check_regions
from scenicq.store.place import Place
from scenicq.store.regions import MapFiles
from scenicq.store.rules import PART_COLUMNS, check_frame_index, check_part
from scenicq.store.schema import SEGMENT_TABLES
from scenicq.store.validation import check_table, invalid, read_sound

__all__ = ["check_dataset"]


def check_dataset(place: Place, manifest: Manifest) -> None:
    """Read all of a dataset, one part at a time, and refuse it unless it is sound.

    Args:
        place: Where its files are.
        manifest: What its `dataset.json` says.

    Raises:
        DataError: dataset-invalid, with file, row and column; store-damaged.
    """
    _check_counts(manifest)
    mapped = MapFiles(tuple(map(place.file, manifest.tables["regions"])), manifest.map_groups)
    for table in ("regions", "lanes"):
        for part in manifest.tables[table]:
            rows = read_sound(table, place.file(part), part.path)
            if table == "regions":
                check_regions(rows, part.path, manifest.maps)
            else:
                check_lanes(rows, part.path)
    for name in manifest.maps:
        try:
            found = traits_of(Network(name, mapped.features(name)).features)
        except (ScenicqError, MemoryError):
            raise
        except Exception as error:  # noqa: BLE001 - whatever a map that nobody has made by our rules leads to
            invalid(manifest.tables["regions"][0].path, f"map {name} cannot be put together: {error}"[:200])
        if mapped.traits(name) not in (found, None):
            invalid("dataset.json", f"says of map {name} what its elements do not")
    hashes = [np.empty(0, np.uint64)]
    frames = 0
    recordings: set[str] = set()
    for number in range(len(manifest.tables["labels"])):
        parts = {table: manifest.tables[table][number] for table in SEGMENT_TABLES}
        rows = {
            table: check_table(table, place.file(part), part.path, PART_COLUMNS[table]) for table, part in parts.items()
        }
        names = {table: part.path for table, part in parts.items()}
        check_part(rows, names, manifest.named_maps)
        own = set(rows["labels"]["recording"].to_pylist())
        if own & recordings:
            invalid(names["labels"], "a recording is in two parts", column="recording")
        recordings |= own
        frames += len(rows["labels"])
        hashes.append(frame_hashes(rows["labels"]["frame"].to_pylist()))
    every = np.concatenate(hashes)
    if frames != manifest.total.frames:
        invalid("dataset.json", f"has {manifest.total.frames} frames, and the tables have {frames}")
    for part in manifest.tables["frame_index"]:
        check_frame_index(read_sound("frame_index", place.file(part), part.path), index_rows(every), part.path)


def _check_counts(manifest: Manifest) -> None:
    tables = manifest.tables
    counts = {table: len(tables[table]) for table in SEGMENT_TABLES}
    if len(set(counts.values())) != 1:
        told = ", ".join(f"{count} of {table}" for table, count in counts.items())
        invalid("dataset.json", f"parts of one number hold the same recordings, but there are {told}")
    for table in ("regions", "lanes", "frame_index"):
        if len(tables[table]) != 1:
            invalid("dataset.json", f"there are {len(tables[table])} files of {table}, not one")
