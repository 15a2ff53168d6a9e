from typing import Literal

from pyarrow import Table

def write_feather(df: Table, dest: str, compression: Literal["zstd", "lz4", "uncompressed"] | None = None) -> None: ...
