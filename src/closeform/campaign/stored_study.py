"""Study in files: a runner evaluates chunks and a store writes them, continuing after an interruption."""

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
    """Function that evaluates chunks, on this machine or on a cluster."""

    def __call__(self, cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
        """Yield the chunks of some ranges of cases as they finish."""
        ...


def local(cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
    """Yield chunks evaluated on all cores of this machine."""
    for _, done in in_threads(partial(chunk.flown, cases.prepared()), ranges):
        yield done


def fly(chunks: Stored, runner: Runner, progress: Progress) -> Any:
    """Evaluate the missing cases of a study; `progress` receives the numbers of finished and of met cases."""
    flown = chunks.flown
    met = sum(entry["met"] for entry in chunks.whole.values())
    progress(flown, met)
    for done in runner(chunks.cases, chunks.missing):
        chunks.take(done)
        flown, met = flown + done.last - done.first, met + done.met
        progress(flown, met)
    return chunks.cases.campaign(chunks)
