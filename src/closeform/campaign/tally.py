"""Counts over the cases of a study, chunk after chunk, in memory that does not grow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.search.phases import labels, tally
from closeform.search.schedule import Search

NAMED = 10  # number of failed cases that a message lists
DONE = "done"


@dataclass(frozen=True, eq=False)
class Settled:
    """Outcomes of some cases (C,).

    `time` [s] at which each was done, nan if it never was, and its `leg`, then -1; the cases in which each
    requirement is `kept`; the same time and leg by the step [s] of sampled detection; all `times` for a
    histogram; and `also` other columns.
    """

    time: Floats
    leg: Any
    kept: dict[str, Any]
    sampled: dict[float, tuple[Floats, Any]]
    times: Floats
    also: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def met(self) -> dict[str, Any]:
        """Cases (C,) in which each requirement is met."""
        return {DONE: self.leg >= 0, **self.kept}

    @cached_property
    def good(self) -> Any:
        """Cases (C,) in which all requirements are met."""
        return np.all(list(self.met.values()), axis=0)

    @classmethod
    def joined(cls, parts: Sequence[Settled]) -> Self:
        """Concatenate the outcomes of several chunks."""
        one = parts[0]
        return cls(
            np.concatenate([part.time for part in parts]),
            np.concatenate([part.leg for part in parts]),
            {what: np.concatenate([part.kept[what] for part in parts]) for what in one.kept},
            {
                step: (
                    np.concatenate([part.sampled[step][0] for part in parts]),
                    np.concatenate([part.sampled[step][1] for part in parts]),
                )
                for step in one.sampled
            },
            np.concatenate([part.times for part in parts]),
            {name: np.concatenate([part.also[name] for part in parts]) for name in one.also},
        )


@dataclass
class Met:
    """Number of cases in which a requirement is met, and the first cases in which it is not."""

    count: int = 0
    unmet: list[int] = field(default_factory=list)

    def add(self, first: int, met: Any) -> None:
        """Count further cases (C,), numbered from `first`."""
        self.count += int(np.count_nonzero(met))
        if len(self.unmet) < NAMED:
            self.unmet += (first + np.flatnonzero(~met)[: NAMED - len(self.unmet)]).tolist()


@dataclass
class Sampled:
    """Cases by phase for sampled detection, and the number whose first lock was stepped `over`."""

    phases: Any
    over: int = 0


@dataclass
class Tally:
    """Counts: cases by phase in the order of `labels`, by requirement `met`, with all met, and at samples."""

    phases: Any
    met: dict[str, Met] = field(default_factory=dict)
    good: Met = field(default_factory=Met)
    sampled: dict[float, Sampled] = field(default_factory=dict)
    pairs_met: dict[str, tuple[int, int]] = field(default_factory=dict)
    cases: int = 0

    @property
    def never(self) -> int:
        """Number of cases that were never done."""
        return self.cases - self.met[DONE].count

    @classmethod
    def of(cls, search: Search, parts: Iterable[Settled]) -> Self:
        """Count the cases of some chunks, in order."""
        empty = np.zeros(len(labels(search)), dtype=np.int64)
        found = cls(empty.copy())
        for part in parts:
            found.phases += tally(search, part.time, part.leg)
            for what, met in part.met.items():
                found.met.setdefault(what, Met()).add(found.cases, met)
            found.good.add(found.cases, part.good)
            for step, (time, leg) in part.sampled.items():
                sampled = found.sampled.setdefault(step, Sampled(empty.copy()))
                sampled.phases += tally(search, time, leg)
                late = (leg < 0) & (part.leg >= 0) | (time - part.time > step)
                sampled.over += int(late.sum())
            for name in part.also:
                if name.startswith("met_"):
                    cases, pairs = found.pairs_met.get(name, (0, 0))
                    each = part.also[name]
                    found.pairs_met[name] = cases + int((each > 0).sum()), pairs + int(each.sum())
            found.cases += len(part.leg)
        return found
