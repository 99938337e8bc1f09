"""Execution of a study by the workers of a Dask scheduler; this process alone writes the results."""

from __future__ import annotations

import json
import logging
import pickle
import re
import socket
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from itertools import chain, islice
from pathlib import Path
from threading import Lock
from typing import Any

from closeform.campaign.cases import Cases, Range
from closeform.campaign.chunks import Chunk, versions
from closeform.scenario import ScenarioError
from closeform.storage.result_folder import FolderError

ANSWER = 5.0  # s to wait for an answer of the scheduler
PATIENCE = 30.0  # s to wait without any worker
FETCHES = 10  # times PATIENCE to wait for the reply of a finished task
AHEAD = 2  # tasks, each of one chunk, for each thread of the workers
DEATHS = 3  # failures of workers on the same task before the study stops

ADDRESS = re.compile(r"(?:tcp|tls)://(\[[^]]+\]|[^:/]+):(\d{1,5})/?")
_building = Lock()


class ClusterError(FolderError):
    """Scheduler or workers that cannot be used or are lost; the message is one line with the remedy."""


class Cluster:
    """Dask scheduler, given by its address or by the file that it writes."""

    def __init__(self, scheduler: str) -> None:
        """Connect to the scheduler.

        Raises ClusterError if it does not respond, or a worker has other versions.
        """
        address = address_of(scheduler)
        try:
            import dask
            import distributed
        except ImportError:
            line = "needs dask.distributed; pip install 'closeform[cluster]'"
            raise ClusterError(f"--scheduler: {line}") from None
        self.name, self.distributed = scheduler, distributed
        for name in ("distributed", *logging.root.manager.loggerDict):
            if name.startswith("distributed") or name == "asyncio":
                logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported by ClusterError
        tls = dask.config.get("distributed.comm.tls.ca-file", None)
        if address.startswith("tls://") and not tls:
            line = "needs certificates; name them in Dask's configuration, distributed.comm.tls"
            raise ClusterError(f"--scheduler: {address} {line}")
        try:
            self.client = distributed.Client(address, timeout=2 * ANSWER, set_as_default=False)
        except Exception as error:
            what = " ".join(str(error).split())[:200]
            raise ClusterError(f"--scheduler: {address}: {what}; is it a Dask scheduler?") from error
        self.check()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):
            self.client.close(timeout=ANSWER)

    def check(self) -> None:
        """Raise ClusterError for workers with other versions, whose results could differ."""
        try:
            answers = self.client.run(versions, on_error="return")
        except Exception as error:
            raise self.gone() from error
        for worker, theirs in answers.items():
            if not isinstance(theirs, dict):
                what = f"worker {worker} cannot run closeform ({type(theirs).__name__})"
                raise ClusterError(f"--scheduler: {what}; install the same version there")
            if lines := unlike(versions(), theirs):
                raise ClusterError(
                    f"--scheduler: worker {worker} has {lines}; give all machines the same versions"
                )

    def __call__(self, cases: Cases, ranges: Iterable[Range]) -> Iterator[Chunk]:
        """Yield the chunks of the given ranges of cases as they finish; a lost worker costs only time."""
        study, waiting, again = pickle.dumps(cases), iter(ranges), list[Range]()
        under_way: dict[Any, Range] = {}
        deaths: dict[Range, int] = {}
        alone = time.monotonic()
        while True:
            threads = self.threads()
            alone = time.monotonic() if threads else alone
            if time.monotonic() - alone > PATIENCE:
                raise self.deserted()
            free = max(AHEAD * max(threads, 1) - len(under_way), 0)
            for some in islice(chain(again, waiting), free):
                under_way[self.client.submit(evaluate, study, versions(), some, pure=False)] = some
            again = again[free:]
            if not under_way:
                return
            for future in self.ended(under_way):
                some = under_way.pop(future)
                answer = self.answer(future)
                if answer is None:
                    deaths[some] = deaths.get(some, 0) + 1
                    if deaths[some] >= DEATHS:
                        which = f"cases {some[0]} to {some[1] - 1}"
                        raise ClusterError(f"--scheduler: workers die at {which}; check their logs")
                    again.append(some)
                else:
                    yield answer

    def threads(self) -> int:
        """Return the number of threads of all workers."""
        try:
            return sum(self.client.nthreads().values())
        except Exception as error:
            raise self.gone() from error

    def ended(self, under_way: Iterable[Any]) -> list[Any]:
        """Return the tasks that have finished or failed; none after a second.

        A task is "lost" until another worker repeats it: its worker died before its reply was fetched.
        """
        futures = list(under_way)
        with suppress(Exception), self.client.as_current():  # a time-out, or an error of a lost scheduler
            self.distributed.wait(futures, timeout=1.0, return_when="FIRST_COMPLETED")
        if self.client.status != "running" or any(one.status == "cancelled" for one in futures):
            raise self.gone()
        return [one for one in futures if one.status in ("finished", "error")]

    def answer(self, future: Any) -> Chunk | None:
        """Return the reply of a finished task; None if its workers died too often.

        All workers may have died since; then no worker has the reply, and none repeats the task.
        """
        try:
            for _ in range(FETCHES):
                with suppress(TimeoutError):
                    found: Chunk = future.result(timeout=PATIENCE)
                    return found
                if not self.threads():
                    raise self.deserted()
            raise self.gone()
        except (ClusterError, ScenarioError):
            raise
        except self.distributed.KilledWorker:
            return None
        except Exception as error:
            if self.client.status != "running" or future.status != "error":  # the reply was never received
                raise self.gone() from error
            what = " ".join(str(error).split())[:200]
            raise ClusterError(f"--scheduler: a worker failed: {what}; check its log") from error

    def deserted(self) -> ClusterError:
        """Return the error of a scheduler without workers."""
        return ClusterError(f"--scheduler: {self.name} has no workers; start some")

    def gone(self) -> ClusterError:
        """Return the error of a scheduler that no longer responds."""
        return ClusterError(f"--scheduler: {self.name} no longer responds; start it again")


def address_of(scheduler: str) -> str:
    """Return the address of a scheduler, given itself or in a file, after a test connection.

    Raises ClusterError if it does not respond.
    """
    if scheduler.endswith(".json"):
        try:
            address = str(json.loads(Path(scheduler).read_text(encoding="utf-8"))["address"])
        except OSError as error:
            what = (error.strerror or "cannot be read").lower()
            raise ClusterError(f"--scheduler: {scheduler}: {what}; check the path") from None
        except (ValueError, KeyError, TypeError):
            line = "is not a Dask scheduler file; give the file written by --scheduler-file"
            raise ClusterError(f"--scheduler: {scheduler}: {line}") from None
    else:
        address = scheduler
    parts = ADDRESS.fullmatch(address)
    if parts is None:
        line = "is not an address; give tcp://HOST:PORT, tls://HOST:PORT, or a scheduler file (*.json)"
        raise ClusterError(f"--scheduler: {address} {line}")
    try:
        socket.create_connection((parts[1].strip("[]"), int(parts[2])), ANSWER).close()
    except (OSError, OverflowError):
        line = f"does not respond within {ANSWER:g} s; start it, or check the address"
        raise ClusterError(f"--scheduler: {address} {line}") from None
    return address


def evaluate(study: bytes, made_with: dict[str, str], cases: Range) -> Chunk:
    """Return the chunk of some cases of a pickled study, evaluated on this machine."""
    if lines := unlike(made_with, versions()):
        raise ClusterError(f"--scheduler: a worker has {lines}; install the same versions on all machines")
    with _building:
        kind = restored(study)
    found = Chunk.of(kind, *cases)
    return found._replace(data=found.data.to_pybytes())


@lru_cache(maxsize=4)
def restored(study: bytes) -> Cases:
    """Return the cases of a pickled study, prepared once for all of its chunks."""
    found: Cases = pickle.loads(study)
    return found.prepared()


def unlike(here: dict[str, str], there: dict[str, str]) -> str:
    """Return the differences between two sets of versions as text."""
    return ", ".join(
        f"{name} {there.get(name, 'missing')}, not {known}"
        for name, known in here.items()
        if there.get(name) != known
    )
