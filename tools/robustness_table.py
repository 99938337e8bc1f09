"""Compute the table of docs/search_robustness.md: largest errors without a lost pair in 10^7.

    python tools/robustness_table.py --cases 10000000        # whole table and picture
    python tools/robustness_table.py pointing rate            # some rows

The pairs are those of `examples/s04.toml`, case by case. Errors have one size and random directions or signs,
as in a study with "craft.pointing_error" = { shell = ["X", "X"] }, "craft.slew_rate_error" and
"craft.start_offset" = { choice = ["-X", "X"] }. The tool runs all cases with errors at which some fail. It
bisects the smallest error of the failed cases, and runs all cases again just below it.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

import closeform as cf
from closeform.campaign.draws import drawn, spread, uniform
from closeform.confidence import estimate
from closeform.scenario import load
from closeform.scenario.study import Draw

DOCS = Path(__file__).parents[1] / "docs"
SCENARIO = load(DOCS.parent / "examples" / "s04.toml")
SEED = SCENARIO.study.seed
DEGREE = np.pi / 180
AT_ONCE = 131_072
HALVINGS = 30


def of_study(key: str, draw: Draw, size: int) -> Callable[[int, int], Any]:
    """Return the samples of a study for each spacecraft (C, 2), or vectors (C, 2, 3) by `size`."""
    return lambda first, last: spread(draw, draw.numbers(key), uniform(SEED, key, 2, first, last), size)


def nothing(first: int, last: int) -> Any:
    return np.zeros((last - first, 2))


@dataclass(frozen=True)
class Row:
    """Error type: name and unit, sampling, and sizes in increasing order.

    The table reports shares for `sizes`; at the first of them some of 10^7 pairs fail.
    """

    name: str
    unit: str
    draw: Callable[[int, int], Any]
    errors: Callable[[Any, Any], cf.SearchErrors]
    least: float
    sizes: tuple[float, ...]


ROWS = {
    "pointing": Row(
        "pointing, each craft, constant",
        "deg",
        of_study("craft.pointing_error", Draw(shell=("1 rad", "1 rad")), 3),
        lambda way, size: cf.SearchErrors(pointing=DEGREE * size[:, None, None] * way),
        0.01,
        (3.0, 5.0, 7.0, 10.0),
    ),
    "rate": Row(
        "slew rate, each craft",
        "%",
        of_study("craft.slew_rate_error", Draw(choice=("-1 %", "1 %")), 1),
        lambda way, size: cf.SearchErrors(slew_rate=size[:, None] * way),
        1e-3,
        (1.0, 2.0, 3.0, 5.0),
    ),
    "start": Row(
        "start, each early or late",
        "s",
        of_study("craft.start_offset", Draw(choice=("-1 s", "1 s")), 1),
        lambda way, size: cf.SearchErrors(start=size[:, None] * way),
        0.01,
        (60.0, 90.0, 120.0, 180.0),
    ),
    "ramp of one": Row(
        "slew acceleration, one craft",
        "deg/s²",
        nothing,
        lambda way, size: cf.SearchErrors(slew_acceleration=np.stack([way[:, 0] + np.inf, DEGREE * size], 1)),
        10.0,
        (0.015, 0.01, 0.007, 0.005),
    ),
    "ramps alike": Row(
        "slew acceleration, both alike",
        "deg/s²",
        nothing,
        lambda way, size: cf.SearchErrors(slew_acceleration=DEGREE * size[:, None] + way),
        10.0,
        (1e-4,),
    ),
    "range": Row(
        "range, of all sensors",
        "m",
        nothing,
        lambda way, size: cf.SearchErrors(range=size[:, None] + way),
        1e5,
        (2000.0, 1500.0, 1000.0, 500.0),
    ),
}


def lost(row: Row, size: float, cases: int) -> tuple[Any, Any]:
    """Return states (F, 6) of the cases that never lock with errors of one size, and their samples."""
    states, ways = [], []
    for first in range(0, cases, AT_ONCE):
        last = min(first + AT_ONCE, cases)
        craft = drawn(SCENARIO, SEED, first, last)
        state = craft[:, 1] - craft[:, 0]
        way = row.draw(first, last)
        never = fails(row, state, way, np.full(last - first, size))
        states.append(state[never])
        ways.append(way[never])
    return np.concatenate(states), np.concatenate(ways)


def fails(row: Row, states: Any, ways: Any, sizes: Any) -> Any:
    found = cf.lock_times(SCENARIO.plan, states[:, :3], states[:, 3:], row.errors(ways, sizes))
    return found.leg < 0


def greatest(row: Row, cases: int) -> tuple[float, int]:
    """Return the largest error, to two digits, without failures, and the failures at the first size."""
    size = row.sizes[0]
    states, ways = lost(row, size, cases)
    count = len(states)
    while len(states):
        low, high = np.full(len(states), np.log(row.least)), np.full(len(states), np.log(size))
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            bad = fails(row, states, ways, np.exp(middle))
            low, high = np.where(bad, low, middle), np.where(bad, middle, high)
        worst = low.min() if row.least < size else low.max()
        size = two_digits(float(np.exp(worst)), up=row.least > size)
        states, ways = lost(row, size, cases)
    return size, count


def two_digits(value: float, up: bool) -> float:
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(f"{unit * (np.ceil(value / unit) if up else np.floor(value / unit)):.2g}")


def draw_picture(shares: dict[str, list[tuple[float, int]]], safe: dict[str, float], cases: int) -> None:
    """Draw the share of lost pairs against the size of each error; a line where no pair is lost."""
    from closeform.plots.drawing.palette import AFTER, CONFLICT, INK
    from closeform.plots.drawing.style import dress, headline, sheet
    from closeform.plots.drawing.text import SMALL, TEXT

    names = [name for name in shares if len(shares[name]) > 1]
    figure = sheet(4.0)
    for k, (name, axes) in enumerate(zip(names, figure.subplots(1, len(names)), strict=True)):
        dress(axes)
        sizes, counts = np.array([one for one in shares[name] if one[1] > 0], dtype=float).T
        found = [estimate(int(count), cases) for count in counts]
        low, high = [one.low for one in found], [one.high for one in found]
        axes.vlines(sizes, low, high, color=AFTER, linewidth=4.0, alpha=0.35)
        axes.plot(sizes, counts / cases, "o-", color=AFTER, markersize=6)
        axes.axvline(safe[name], color=CONFLICT, linewidth=1.5, linestyle="--")
        axes.set_yscale("log")
        axes.set_ylim(0.3 / cases, 1.0)
        if ROWS[name].least > safe[name]:
            axes.invert_xaxis()
        what, _, whose = ROWS[name].name.partition(", ")
        axes.set_xlabel(f"{what}\n[{ROWS[name].unit}]\n{whose}", fontsize=SMALL, color=INK)
        if k:
            axes.set_yticklabels([])
        else:
            axes.set_ylabel("never lock", fontsize=TEXT, color=INK)
    headline(figure, f"Share of {cases:,} pairs that never lock; dashed: none of {10 * cases:,}")
    figure.savefig(DOCS / "images" / "robustness.png")


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Compute the largest errors at which the search of S04 finds all of many pairs."
    )
    parser.add_argument("rows", nargs="*", default=list(ROWS), help=f"of {', '.join(ROWS)}")
    parser.add_argument("--cases", type=int, default=10_000_000)
    given = parser.parse_args()
    mpl.use("agg")
    shares: dict[str, list[tuple[float, int]]] = {}
    safe: dict[str, float] = {}
    some = max(1, given.cases // 10)
    for name in given.rows:
        row, begun = ROWS[name], time.perf_counter()
        safe[name], count = greatest(row, given.cases)
        shares[name] = [(size, len(lost(row, size, some)[0])) for size in row.sizes]
        told = ", ".join(f"{size:g} {row.unit}: {number}" for size, number in shares[name])
        print(
            f"{row.name}: 0 of {given.cases} lost at {safe[name]:g} {row.unit}, {count} at {row.sizes[0]:g}"
        )
        print(f"    of {some}: {told}  ({time.perf_counter() - begun:.0f} s)", flush=True)
    if len(given.rows) > 1:
        draw_picture(shares, safe, some)


if __name__ == "__main__":
    main()
