"""Comparison of methods on the same pairs: conflicts found and time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from peers.motion import Array
from tables import Table, seconds, times
from timing import side_by_side

OURS = "closeform.screen"
TOUCH = 1e-5  # s: ends that the methods find to about a microsecond
COLUMNS = ["method", "pairs", "time per pair", "spread", "relative time", "conflicts", "missed"]
MISSED = (
    "The time of closeform includes the construction of the paths. Missed: conflicts of closeform "
    "that the method does not find, among the pairs that it searched; after a +, conflicts that "
    "only the method finds."
)


@dataclass
class Method:
    """Method that searches the first `craft` spacecraft against all later ones."""

    run: Callable[[], Any]
    craft: int
    stays: Callable[[Any], Array]  # what `run` returned as rows (i, j, start, end) [s]


@dataclass
class Comparison:
    table: Table
    per_pair: dict[str, float]  # seconds


def pairs_among(count: int, craft: int) -> int:
    """Return the number of pairs i < j < count with i < craft."""
    return craft * (2 * count - craft - 1) // 2


def as_found(rows: Array) -> Array:
    """Return conflict rows unchanged; samples are 1 s apart."""
    return rows


def from_screening(screening: Any) -> Array:
    return np.column_stack([screening.pairs, screening.start, screening.end])


def unmatched(stays: Array, others: Array) -> int:
    """Return the number of conflicts that overlap none of the others of the same pair."""
    known: dict[tuple[float, float], list[tuple[float, float]]] = {}
    for i, j, start, end in others.tolist():
        known.setdefault((i, j), []).append((start, end))
    return sum(
        all(end < begin - TOUCH or finish + TOUCH < start for begin, finish in known.get((i, j), ()))
        for i, j, start, end in stays.tolist()
    )


def compare(title: str, methods: dict[str, Method], count: int, repeats: int, notes: list[str]) -> Comparison:
    """Run and time the methods on `count` spacecraft."""
    found = {name: method.stays(method.run()) for name, method in methods.items()}  # and compile
    timings = side_by_side({name: method.run for name, method in methods.items()}, repeats)
    per_pair = {name: timings[name].median / pairs_among(count, m.craft) for name, m in methods.items()}
    rows = []
    for name, method in methods.items():
        truth = found[OURS][found[OURS][:, 0] < method.craft]
        missed, more = unmatched(truth, found[name]), unmatched(found[name], truth)
        rows.append(
            [
                name,
                f"{pairs_among(count, method.craft):,}",
                seconds(per_pair[name]),
                f"±{timings[name].spread:.0%}",
                times(per_pair[name] / per_pair[OURS]),
                f"{len(found[name]):,}",
                "" if name == OURS else f"{missed}" + (f" +{more}" if more else ""),
            ]
        )
    conflicting = len(np.unique(found[OURS][:, :2], axis=0)) / pairs_among(count, count)
    notes = [f"{conflicting:.2%} of the pairs are in conflict.", *notes]
    return Comparison(Table(title, COLUMNS, rows, notes), per_pair)
