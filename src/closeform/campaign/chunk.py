"""Chunk of a study: some cases as the bytes of a Parquet file, and the inverse conversion."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from closeform.campaign.cases import Cases, Columns

FEW = ("first", "second", "phase", "round", "leg", "status", "reason")  # columns with few distinct values


class Chunk(NamedTuple):
    """Cases from `first` to `last`, exclusive: their table as a Parquet file, and its SHA-256.

    `met`: the number of cases in which all requirements are met.
    """

    first: int
    last: int
    data: Any
    digest: str
    met: int


def flown(cases: Cases, first: int, last: int) -> Chunk:
    """Evaluate some cases of a study and return them as a chunk."""
    columns = cases.flown(first, last)
    data = encoded(cases.stored(first, last, columns))
    return Chunk(first, last, data, hashlib.sha256(data).hexdigest(), int(cases.good(columns).sum()))


def encoded(columns: Columns) -> Any:
    """Return columns as the bytes of a Parquet file; nan becomes null."""
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({name: column(values) for name, values in columns.items()})
    few = [name for name in table.column_names if name in FEW or table[name].type == "bool"]
    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, sink, compression="lz4", use_dictionary=few, store_schema=False)
    return sink.getvalue()


def column(values: Any) -> Any:
    """Return an array of numbers, rows of numbers or words as a Parquet column."""
    import pyarrow

    if not isinstance(values, np.ndarray):
        return values
    if values.ndim == 2:
        return pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(values.ravel()), values.shape[1])
    return pyarrow.array(values, from_pandas=values.dtype.kind == "f")


def decoded(data: Any, names: Sequence[str]) -> Columns:
    """Return the named columns that a Parquet file has, as `Cases.fly` returned them."""
    import pyarrow.parquet

    file = pyarrow.parquet.ParquetFile(data)
    table = file.read([name for name in names if name in file.schema_arrow.names], use_threads=False)
    return {name: array(table[name].combine_chunks()) for name in table.column_names}


def array(values: Any) -> Any:
    """Return a Parquet column as an array."""
    import pyarrow

    if pyarrow.types.is_list(values.type) or pyarrow.types.is_fixed_size_list(values.type):
        return values.flatten().to_numpy(zero_copy_only=False).reshape(len(values), -1)
    found = values.to_numpy(zero_copy_only=False)
    if pyarrow.types.is_integer(values.type) and values.null_count:
        return np.where(np.isnan(found), -1, found).astype(values.type.to_pandas_dtype())
    return found
