"""A study in files: chunks flown by a runner and taken by a store, from where the last one stopped."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, Protocol

from closeform.campaign import chunk
from closeform.campaign.cases import Cases, Range
from closeform.campaign.chunk import Chunk
from closeform.campaign.chunks import Stored
from closeform.campaign.threads import in_threads

Progress = Callable[[int, int], None]


class Runner(Protocol):
    """What flies chunks, on this machine or on many."""

    def __call__(self, cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
        """The chunks of some ranges of cases, as they are done."""
        ...


def local(cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
    """Chunks flown on all cores of this machine."""
    for _, done in in_threads(partial(chunk.flown, cases.prepared()), ranges):
        yield done


def fly(chunks: Stored, runner: Runner, progress: Progress) -> Any:
    """Fly what is missing of a study; `progress` is told how many cases are flown, and how many met all."""
    flown = chunks.flown
    met = sum(entry["met"] for entry in chunks.whole.values())
    progress(flown, met)
    for done in runner(chunks.cases, chunks.missing):
        chunks.take(done)
        flown, met = flown + done.last - done.first, met + done.met
        progress(flown, met)
    return chunks.cases.campaign(chunks)
