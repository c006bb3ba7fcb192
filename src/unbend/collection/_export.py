"""Export of a collection as one table."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from unbend.collection._store import SMALL, Store
from unbend.io import atomic_write


def export(store: Store, path: str | os.PathLike[str]) -> int:
    """Write every row to a .parquet or .csv file, a batch at a time; return how many there are."""
    import pyarrow as pa
    from pyarrow import csv
    from pyarrow.parquet import ParquetWriter

    count = 0
    with atomic_write(path) as file:
        if Path(path).suffix.lower() == ".parquet":
            with ParquetWriter(file, store.schema) as writer:
                for batch in store.batches(store.schema.names):
                    writer.write_batch(batch)
                    count += len(batch)
            return count
        for batch in store.batches([*SMALL, "version", "descriptor"]):
            table = _spread(pa.Table.from_batches([batch]), "descriptor")
            csv.write_csv(table, file, csv.WriteOptions(include_header=not count))
            count += len(batch)
    return count


def _spread(table: Any, name: str) -> Any:
    """Replace a column of lists by one column for each of their numbers."""
    place = table.schema.get_field_index(name)
    width = table.schema.field(name).type.list_size
    flat = table.column(name).combine_chunks().flatten().to_numpy().reshape(-1, width)
    table = table.remove_column(place)
    for i in range(width):
        table = table.append_column(f"{name}_{i}", [flat[:, i]])
    return table
