"""Chunks of a study: cases as arrays, or as Parquet files with a manifest, evaluated on all cores."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from closeform.campaign.cases import Cases, Columns, Range
from closeform.storage.manifest import append, entries, rewrite
from closeform.storage.result_folder import digest

LIBRARIES = ("closeform", "numpy", "numba", "scipy", "pyarrow")
FEW = ("first", "second", "phase", "round", "leg", "status", "reason")  # columns with few distinct values

Found = TypeVar("Found")
Progress = Callable[[int, int], None]  # numbers of finished cases, and of those with all requirements met


class Chunk(NamedTuple):
    """Cases from `first` to `last`, exclusive: their table as a Parquet file, and its SHA-256.

    `met`: the number of cases in which all requirements are met.
    """

    first: int
    last: int
    data: Any
    digest: str
    met: int

    @classmethod
    def of(cls, cases: Cases, first: int, last: int) -> Chunk:
        """Evaluate some cases of a study."""
        columns = cases.columns(first, last)
        data = encoded(cases.stored(first, last, columns))
        met = int(cases.good(last - first, columns).sum())
        return cls(first, last, data, hashlib.sha256(data).hexdigest(), met)


def encoded(columns: Columns) -> Any:
    """Return columns as the bytes of a Parquet file; nan becomes null."""
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table({name: arrow(values) for name, values in columns.items()})
    few = [name for name in table.column_names if name in FEW or table[name].type == "bool"]
    sink = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, sink, compression="lz4", use_dictionary=few, store_schema=False)
    return sink.getvalue()


def arrow(values: Any) -> Any:
    """Return an array of numbers, rows of numbers or words as a Parquet column."""
    import pyarrow

    if not isinstance(values, np.ndarray):
        return values
    if values.ndim == 2:
        return pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(values.ravel()), values.shape[1])
    return pyarrow.array(values, from_pandas=values.dtype.kind == "f")


def array(values: Any) -> Any:
    """Return a Parquet column as an array, as `Cases.evaluate` returned it."""
    import pyarrow

    if pyarrow.types.is_list(values.type) or pyarrow.types.is_fixed_size_list(values.type):
        return values.flatten().to_numpy(zero_copy_only=False).reshape(len(values), -1)
    found = values.to_numpy(zero_copy_only=False)
    if pyarrow.types.is_integer(values.type) and values.null_count:
        return np.where(np.isnan(found), -1, found).astype(values.type.to_pandas_dtype())
    return found


@dataclass(frozen=True, eq=False)
class Part(Mapping[str, Any]):
    """Columns of a chunk by name, each of which `load` reads at its first use."""

    names: tuple[str, ...]
    load: Callable[[str], Any]
    held: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Any:
        if name not in self.held:
            self.held[name] = self.load(name)
        return self.held[name]

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def part_in(file: Path) -> Part:
    """Return the columns of a Parquet file."""
    import pyarrow.parquet

    opened = pyarrow.parquet.ParquetFile(file)

    def load(name: str) -> Any:
        return array(opened.read([name], use_threads=False)[name].combine_chunks())

    return Part(tuple(opened.schema_arrow.names), load)


@dataclass(frozen=True, eq=False)
class Held:
    """Chunks as arrays in memory, for the Python interface."""

    cases: Cases
    count: int
    columns: dict[int, Columns] = field(default_factory=dict)

    def take(self, first: int, columns: Columns) -> None:
        """Keep a chunk, without the columns that seed and case reproduce."""
        self.columns[first] = {
            name: values for name, values in columns.items() if name not in self.cases.drawn
        }

    def part(self, cases: range) -> Columns:
        """Return the columns of the cases of one chunk."""
        return self.columns[cases.start]


class ChunkError(ValueError):
    """Chunks that a study cannot continue from; the message is one line with the remedy."""


@dataclass(frozen=True, eq=False)
class Stored:
    """Chunks as Parquet files in a `folder`; the `manifest` has a line with the SHA-256 of each.

    The first line of the manifest identifies the study. Cases of another study are never added to it.
    """

    cases: Cases
    count: int
    folder: Path
    manifest: Path
    whole: dict[int, dict[str, Any]] = field(default_factory=dict)

    def begin(self, overwrite: bool = False) -> list[str]:
        """Continue from the chunks of a manifest, or begin a new one; return a message per damaged chunk.

        Chunks of another study are deleted with `overwrite`; without, they raise ChunkError.
        """
        known, identity = entries(self.manifest), self.identity
        if known and known[0] != identity:
            if not overwrite:
                raise ChunkError(differences(identity, known[0], len(known) - 1))
            known = []
        if not known:
            self.manifest.unlink(missing_ok=True)
            shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(exist_ok=True)
        damaged = []
        for entry in known[1:]:
            file = self.folder / name_of(entry["first"])
            if file.is_file() and digest(file) == entry["sha256"]:
                self.whole[entry["first"]] = entry
            else:
                damaged.append(f"{file.name} is damaged or missing")
        rewrite(self.manifest, [identity, *self.whole.values()])
        return damaged

    @property
    def identity(self) -> dict[str, Any]:
        """Inputs and versions that identify the study, so that chunks of different studies are not mixed."""
        scenario = self.cases.scenario
        return {
            "scenario": scenario.digest,
            "files": scenario.inputs.digests if scenario.inputs is not None else {},
            "seed": self.cases.seed,
            "cases": self.count,
            "chunk": self.cases.chunk_size(self.count),
            **versions(),
        }

    @property
    def missing(self) -> Iterator[Range]:
        """Ranges of the cases that remain to be evaluated, chunk by chunk."""
        for cases in self.cases.ranges(self.count):
            if cases.start not in self.whole:
                yield cases.start, cases.stop

    @property
    def done(self) -> int:
        """Number of cases in complete chunks."""
        return sum(entry["last"] - entry["first"] for entry in self.whole.values())

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of each file, by its path in the result folder."""
        return {
            f"{self.folder.name}/{name_of(first)}": entry["sha256"] for first, entry in self.whole.items()
        }

    def take(self, chunk: Chunk) -> None:
        """Write a chunk atomically and enter it in the manifest."""
        file = self.folder / name_of(chunk.first)
        partial = file.with_suffix(".partial")
        try:
            with partial.open("wb") as opened:
                opened.write(chunk.data)
                opened.flush()
                os.fsync(opened.fileno())
            partial.rename(file)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
        entry = {"first": chunk.first, "last": chunk.last, "sha256": chunk.digest, "met": chunk.met}
        append(self.manifest, entry)
        self.whole[chunk.first] = entry

    def part(self, cases: range) -> Columns:
        """Return the columns of the cases of one chunk, each read from its file at its first use."""
        return part_in(self.folder / name_of(cases.start))

    def complete(self, runner: Runner, progress: Progress) -> Any:
        """Evaluate the missing cases with a runner and return the statistics of all."""
        done, met = self.done, sum(entry["met"] for entry in self.whole.values())
        progress(done, met)
        for chunk in runner(self.cases, self.missing):
            self.take(chunk)
            done, met = done + chunk.last - chunk.first, met + chunk.met
            progress(done, met)
        return self.cases.campaign(self)


# evaluates some ranges of cases, on this machine or on a cluster, and yields their chunks as they finish
Runner = Callable[[Cases, Iterable[Range]], Iterator[Chunk]]


def local(cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
    """Yield chunks evaluated on all cores of this machine."""
    for _, chunk in in_threads(partial(Chunk.of, cases.prepared()), ranges):
        yield chunk


def in_threads(task: Callable[[int, int], Found], ranges: Iterable[Range]) -> Iterator[tuple[Range, Found]]:
    """Yield each range of cases with the result of `task`, as they finish; few run at once."""
    workers = os.cpu_count() or 1
    waiting = iter(ranges)
    with ThreadPoolExecutor(workers) as pool:
        under_way: dict[Future[Found], Range] = {}
        try:
            while True:
                for one in islice(waiting, workers + 1 - len(under_way)):
                    under_way[pool.submit(task, *one)] = one
                if not under_way:
                    return
                for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                    yield under_way.pop(done), done.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def name_of(first: int) -> str:
    """Return the file name of a chunk from its first case."""
    return f"{first:09d}.parquet"


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and the libraries on which the numbers depend."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def differences(asked: Mapping[str, Any], known: Mapping[str, Any], chunks: int) -> str:
    """Return how the requested study differs from the existing one, and the remedy."""
    words = {"scenario": "another scenario", "files": "other input files"}
    lines = [
        words.get(name) or f"{name} {known.get(name)}, not {value}"
        for name, value in asked.items()
        if known.get(name) != value
    ]
    return (
        f"holds {chunks} chunk{'s' * (chunks != 1)} of an unfinished study of {', '.join(lines)}; "
        "repeat the same study to continue it, or add --overwrite to start again"
    )
