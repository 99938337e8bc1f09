"""Parts of the pairs of many spacecraft, searched on all cores."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.zones.pair_zones import PairZones, pairs_of
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.conflicts.sieve import Sieve

CHUNK = 32_768  # pairs that one thread takes at a time
AHEAD = 2 * (os.cpu_count() or 1)
MANY = 2000  # number of spacecraft from which a sieve is tried: fewer avoid compiling its kernel
LONG = 150  # steps of some hundredths of a second from which a progress bar is shown
KEPT = 1 << 23  # number of pairs left by a sieve from which they are searched before the sieve continues


def sieve_of(paths: Path, zones: Zone | PairZones) -> Sieve | None:
    """Return the sieve of many spacecraft, or None if it does not pay."""
    if len(paths) < MANY or isinstance(paths.orbit, ChiefOrbit):
        return None
    from closeform.conflicts.sieve import Sieve  # imported here: few users need its kernel

    return Sieve.of(paths, zones)


def rounds(
    sieve: Sieve | None, count: int, pool: ThreadPoolExecutor, begin: float, before: float
) -> Iterator[tuple[float, float, Iterable[tuple[Any, Any]]]]:
    """Yield the parts of the search among `count` spacecraft for conflicts that begin in [begin, before).

    Each item is a span [since, until) and parts of pairs i (M,), j (M,) that include all pairs with
    conflicts that begin in the span. Pairs may recur with a later span.
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
    """Yield parts of the pairs i, j, each once, of arrays of codes i N + j."""
    return chunks(*np.divmod(np.unique(np.concatenate(codes)), count))


def chunks(first: Any, second: Any) -> Iterator[tuple[Any, Any]]:
    """Yield parts of pairs."""
    for k in range(0, len(first), CHUNK):
        yield np.ascontiguousarray(first[k : k + CHUNK]), np.ascontiguousarray(second[k : k + CHUNK])


def ahead(pool: ThreadPoolExecutor, jobs: Any, search: Any) -> Iterator[Any]:
    """Yield the results of the jobs in order, a limited number in progress; a single job needs no thread."""
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
    """Return the steps, with a progress bar if there are many."""
    if count < LONG:
        return steps
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    return track(steps, "screening pairs", total=count, console=console, disable=not console.is_terminal)
