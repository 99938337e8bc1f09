"""Task for a remote worker, made of text and numbers alone, and its reply."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from time import perf_counter
from typing import NamedTuple

from closeform.campaign import chunk
from closeform.campaign.campaign import asked
from closeform.campaign.cases import Cases
from closeform.campaign.chunk import Chunk
from closeform.campaign.chunks import versions
from closeform.scenario import ScenarioError, parse

_building = Lock()


class Task(NamedTuple):
    """Study as sent to a worker: scenario `text`, its `file` name, the files that it names, and the seed.

    `each`: the number of cases at each point of a sweep; `made_with`: the versions of the sender.
    """

    text: str
    file: str
    inputs: tuple[tuple[str, bytes], ...]
    seed: int
    each: int
    made_with: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, cases: Cases) -> Task:
        """Return the task of evaluating some cases of a kind."""
        one = cases.scenario
        inputs = tuple(one.inputs.copies.items()) if one.inputs is not None else ()
        return cls(
            one.text,
            Path(one.file).name,
            inputs,
            cases.seed,
            getattr(cases, "each", 1),
            tuple(versions().items()),
        )


class Reply(NamedTuple):
    """Chunks and the `seconds` that they took, or the reasons why there are none, line by line."""

    chunks: tuple[Chunk, ...]
    refused: tuple[str, ...] = ()
    seconds: float = 0.0


def fly(task: Task, ranges: tuple[tuple[int, int], ...]) -> Reply:
    """Evaluate some ranges of cases on this machine and return their chunks."""
    if lines := unlike(dict(task.made_with), versions()):
        return Reply((), (f"a worker has {lines}; install the same versions on all machines",))
    try:
        with _building:
            cases = cases_of(task).prepared()
        begin = perf_counter()
        found = (chunk.flown(cases, *one) for one in ranges)
        chunks = tuple(one._replace(data=one.data.to_pybytes()) for one in found)
        return Reply(chunks, seconds=perf_counter() - begin)
    except ScenarioError as error:
        return Reply((), tuple(error.lines))


def unlike(here: dict[str, str], there: dict[str, str]) -> str:
    """Return the differences between two sets of versions in words."""
    return ", ".join(
        f"{name} {there.get(name, 'missing')}, not {known}"
        for name, known in here.items()
        if there.get(name) != known
    )


@lru_cache(maxsize=4)
def cases_of(task: Task) -> Cases:
    """Return the cases of a task, built once for all of its chunks."""
    with TemporaryDirectory(prefix="closeform-") as folder:
        for name, held in task.inputs:
            (Path(folder) / name).parent.mkdir(exist_ok=True)
            (Path(folder) / name).write_bytes(held)
        try:
            scenario = parse(task.text, str(Path(folder) / task.file), "study")
        except ScenarioError as error:
            lines = [line.replace(f"{folder}/", "").removeprefix(f"{task.file}: ") for line in error.lines]
            raise ScenarioError(task.file, lines) from None
        return asked(replace(scenario, file=task.file), task.each, task.seed)[0]
