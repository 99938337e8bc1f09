"""Chunks of a study: the finished cases, as arrays or as files with a manifest."""

from __future__ import annotations

import os
import platform
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from sys import maxsize
from typing import Any, Protocol

from closeform.campaign.cases import Cases, Columns, Range
from closeform.campaign.chunk import Chunk, decoded
from closeform.scenario.changes import changes
from closeform.scenario.quantity import shown
from closeform.storage.manifest import append, entries, rewrite
from closeform.storage.result_folder import digest

LIBRARIES = ("closeform", "numpy", "numba", "scipy", "pyarrow")
NAMED = 3  # number of differing keys that a message lists


class CaseChunks(Protocol):
    """Cases of a study in chunks."""

    @property
    def count(self) -> int:
        """Number of cases."""
        ...

    def read(self, *names: str, within: Range | None = None) -> Iterator[tuple[int, Columns]]:
        """Iterate over chunks: the number of the first case, and the named columns that exist.

        With `within`, only the chunks that overlap this range of cases.
        """
        ...


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

    def read(self, *names: str, within: Range | None = None) -> Iterator[tuple[int, Columns]]:
        """Iterate over the named columns of each chunk."""
        for first in touching(self.columns, self.cases.in_chunk(self.count), within):
            columns = self.columns[first]
            yield first, {name: columns[name] for name in names if name in columns}


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
        """Inputs and versions that identify the study, so that no other is mixed with it."""
        scenario = self.cases.scenario
        return {
            "text": scenario.text,
            "files": scenario.inputs.digests if scenario.inputs is not None else {},
            "seed": self.cases.seed,
            "cases": self.count,
            "chunk": self.cases.in_chunk(self.count),
            **versions(),
        }

    @property
    def missing(self) -> Iterator[Range]:
        """Ranges of the cases that remain to be evaluated, chunk by chunk."""
        size = self.cases.in_chunk(self.count)
        for first in range(0, self.count, size):
            if first not in self.whole:
                yield first, min(first + size, self.count)

    @property
    def flown(self) -> int:
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

    def read(self, *names: str, within: Range | None = None) -> Iterator[tuple[int, Columns]]:
        """Iterate over the named columns of each chunk, read from its file."""
        for first in touching(self.whole, self.cases.in_chunk(self.count), within):
            yield first, decoded(self.folder / name_of(first), names)


def touching(chunks: Iterable[int], size: int, within: Range | None) -> list[int]:
    """Return the first cases of the chunks that overlap a range of cases, in order."""
    begin, end = within or (0, maxsize)
    return [first for first in sorted(chunks) if first < end and first + size > begin]


def name_of(first: int) -> str:
    """Return the file name of a chunk from its first case."""
    return f"{first:09d}.parquet"


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and the libraries on which the numbers depend."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def differences(asked: Mapping[str, Any], known: Mapping[str, Any], chunks: int) -> str:
    """Return how the requested study differs from the existing one, and the remedy."""
    differing = {name: value for name, value in asked.items() if known.get(name) != value}
    keys, lines = list[str](), list[str]()
    if "text" in differing:
        keys = changes(known.get("text", ""), differing.pop("text"))
        lines.append(f"another scenario: {some(keys)}")
    if "files" in differing:
        before, after = known.get("files", {}), differing.pop("files")
        files = (shown(name) for name in {**before, **after} if before.get(name) != after.get(name))
        lines.append(f"other contents of {', '.join(files)}")
    plain = (f"{name} {known.get(name)}, not {value}" for name, value in differing.items())
    lines += [one for one in plain if f"study.{one}" not in keys[:NAMED]]
    return (
        f"holds {chunks} chunk{'s' * (chunks != 1)} of an unfinished study of {', '.join(lines)}; "
        "repeat the same study to continue it, or add --overwrite to start again"
    )


def some(keys: Sequence[str]) -> str:
    """Return the first of the keys that differ, and the number of the others."""
    more = f" and {len(keys) - NAMED} more" * (len(keys) > NAMED)
    return ", ".join(keys[:NAMED]) + more or "only comments or layout differ"
