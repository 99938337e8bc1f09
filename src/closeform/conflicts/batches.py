"""Rounds: which pairs of many craft are searched, some at a time, on all cores."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.motion.path import Path
from closeform.zones.pair_zones import PairZones, pairs_of
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.conflicts.sieve import Sieve

CHUNK = 32_768  # pairs that one thread takes at a time
AHEAD = 2 * (os.cpu_count() or 1)
MANY = 2000  # craft from which on a sieve is tried: fewer do without its kernel
LONG = 150  # steps of some hundredths of a second from which on a progress bar is shown
KEPT = 1 << 23  # pairs that a sieve leaves from which on they are searched before others are looked for


def sieve_of(paths: Path, zones: Zone | PairZones) -> Sieve | None:
    """The sieve of many craft, if it pays."""
    if len(paths) < MANY:
        return None
    from closeform.conflicts.sieve import Sieve  # few need its kernel

    return Sieve.of(paths, zones)


def rounds(
    sieve: Sieve | None, count: int, pool: ThreadPoolExecutor, begin: float, before: float
) -> Iterator[tuple[float, float, Iterable[tuple[Any, Any]]]]:
    """All that need be searched of `count` craft for stays that begin in [begin, before).

    Each time a span [since, until), and pairs i (M,), j (M,), some at a time, among which are all with stays
    that begin in it.  Pairs may come again with a later span.
    """
    if sieve is None:
        steps = -(-count * (count - 1) // 2 // CHUNK)
        yield begin, before, with_progress(pairs_of(count, CHUNK), steps)
        return
    left, since = [np.empty(0, dtype=np.int64)], begin
    spans = list(sieve.spans(begin, before))
    found = ahead(pool, with_progress(spans, len(spans) * count // CHUNK), sieve.near)
    for (_, last), codes in zip(spans, found, strict=True):
        left.append(codes)
        if sum(map(len, left)) > KEPT and last < spans[-1][1]:
            until = float(sieve.times[last])
            yield since, until, pairs_by_code(left, count)
            left, since = left[:1], until
    yield since, before, pairs_by_code(left, count)


def pairs_by_code(codes: Any, count: int) -> Iterator[tuple[Any, Any]]:
    """Pairs i, j, some at a time, each once, of arrays of codes i N + j."""
    return chunks(*np.divmod(np.unique(np.concatenate(codes)), count))


def chunks(first: Any, second: Any) -> Iterator[tuple[Any, Any]]:
    """Pairs, some at a time."""
    for k in range(0, len(first), CHUNK):
        yield np.ascontiguousarray(first[k : k + CHUNK]), np.ascontiguousarray(second[k : k + CHUNK])


def ahead(pool: ThreadPoolExecutor, jobs: Any, search: Any) -> Iterator[Any]:
    """Results of the jobs in order, few of them under way at once; a single one is not worth a thread."""
    first = list(islice(rest := iter(jobs), 2))
    if len(first) == 1:
        yield search(*first[0])
        return
    waiting: deque[Any] = deque()
    for job in chain(first, rest):
        waiting.append(pool.submit(search, *job))
        if len(waiting) > AHEAD:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def with_progress(steps: Iterable[Any], count: int) -> Iterable[Any]:
    """The steps, behind a progress bar where there are many."""
    if count < LONG:
        return steps
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return track(steps, "screening pairs", total=count, console=console, disable=not console.is_terminal)
