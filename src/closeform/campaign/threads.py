"""Parallel evaluation of chunks on all cores of this machine, in threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import TypeVar

from closeform.campaign.cases import Range

Found = TypeVar("Found")


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
