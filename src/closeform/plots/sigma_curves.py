"""Clearance of pairs in sigmas, against time, from the relative states and covariances of two spacecraft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from closeform.arrays import Floats, instance, number, sequence
from closeform.motion.path import Path
from closeform.plots.closest import COLOURS, DASHES
from closeform.plots.fonts import plain
from closeform.plots.inputs import crafts, texts
from closeform.plots.palette import CONFLICT
from closeform.plots.style import (
    SMALL,
    chart,
    clock,
    common_time,
    headline,
    instants,
    legend,
    say_scale,
    time_axes,
    zone_band,
)
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.zone import Zone

BRIEF = 1e-6  # s, so short that the state does not change: clearance at an instant
WIDE = 30.0  # times the minimum: a wider range has a logarithmic scale


@dataclass(frozen=True, eq=False)
class Deviations:
    """Relative states (T, 6) of two spacecraft at `times` (T,), and their covariances (T, 6, 6)."""

    path: Path
    times: Floats
    states: Floats
    covariances: Floats

    @classmethod
    def of(cls, path: Path, other: Path, errors: Any, other_errors: Any) -> Deviations:
        """Sample two paths; raise ValueError if they share no time or an argument has the wrong type."""
        start, end = common_time(path, other)
        times = instants(start, end, path, other)
        covariances = np.zeros((len(times), 6, 6))
        for name, one, craft in (("errors", errors, path), ("other_errors", other_errors, other)):
            if one is not None:
                covariances += instance(name, one, Uncertainty).covariance(craft, times)
        return cls(path, times, path.state(times) - other.state(times), covariances)

    def sigmas(self, zone: Zone) -> Floats:
        """Return the clearance of a zone in sigmas (T,), inf if the zone is out of reach of any error."""
        still = self.path.orbit.coast(self.states, BRIEF)
        there = self.path.orbit.coast(np.zeros(6), BRIEF)
        places = np.zeros_like(self.covariances)  # velocity errors have no effect in so short a time
        places[:, :3, :3] = self.covariances[:, :3, :3]
        errors = [Uncertainty(one) for one in places]
        return np.asarray(clearance_in_sigmas(still, there, zone, errors).sigmas)


def sigmas(
    path: Path | Sequence[Path],
    other: Path | Sequence[Path],
    zone: Zone | Sequence[Zone],
    errors: Uncertainty | Sequence[Uncertainty | None] | None,
    other_errors: Uncertainty | Sequence[Uncertainty | None] | None = None,
    asked: float | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the clearance in sigmas of one or more pairs against time; a dot marks the exact minimum.

    Parameters
    ----------
    path, other : Path or sequence of Path
        Paths of one spacecraft each, or P paths each, in one orbit; pair k consists of both paths k.
    zone : Zone or sequence of Zone
        One zone for all pairs, or one for each.
    errors : Uncertainty, sequence of these, or None
        Uncertainty of the first spacecraft of each pair: one for all or one for each.
    other_errors : Uncertainty, sequence of these, or None, default None
        Uncertainty of the second spacecraft.
    asked : float, no unit, optional
        Required clearance in sigmas; the range below it is shaded.
    names : sequence of str, optional
        Names of the pairs.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the numbers of paths, zones, errors or names differ, two paths share no time, no error of any size
        causes a conflict, `asked` is not above 0, or an argument has the wrong type.
    """
    firsts, seconds = crafts("path", path), crafts("other", other)
    if not firsts or len(firsts) != len(seconds):
        raise ValueError(f"path, other: {len(firsts)} and {len(seconds)} craft; give pairs")
    count = len(firsts)
    zones = each("zone", zone, count, Zone)
    if asked is not None and not 0.0 < number("asked", asked) < np.inf:
        raise ValueError(f"asked: must be finite and above 0, got {asked:g}")
    own = [
        each(name, given, count, Uncertainty, type(None))
        for name, given in (("errors", errors), ("other_errors", other_errors))
    ]
    if not any(one is not None for some in own for one in some):
        raise ValueError("errors: no spacecraft has any; give an Uncertainty for one of each pair")
    called = [f"pair {k}" for k in range(count)] if names is None else texts("names", names, count, "pairs")

    figure, axes = chart(5.9, 1.05)
    pairs = list(zip(firsts, seconds, zones, *own, strict=True))
    start = min(max(one.start, two.start) for one, two, *_ in pairs)
    end = max(min(one.end, two.end) for one, two, *_ in pairs)
    ticks = clock(firsts[0], start, end)
    lines, words, known = [], [], []
    for k, (one, two, around, own_errors, their_errors) in enumerate(pairs):
        found = Deviations.of(one, two, own_errors, their_errors)
        least = clearance_in_sigmas(one, two, around, own_errors, their_errors)
        values = found.sigmas(around)
        known.append((least, called[k], values))
        look: dict[str, Any] = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]}
        shown = np.where(np.isfinite(values), values, np.nan)
        lines.append(axes.plot(ticks(found.times), shown, linewidth=2.4 if k == 0 else 1.8, **look)[0])
        if np.isfinite(least.time):
            short = asked is not None and least.sigmas < asked
            tint = CONFLICT if short else look["color"]
            axes.plot(ticks(least.time), least.sigmas, "o", color=tint, markersize=8, zorder=5, clip_on=False)
        words.append(f"{called[k]}: {least.sigmas:.3g} sigma at {ticks.text(least.time)}")
    finite = [one for one in known if np.isfinite(one[0].time)]
    if not finite:
        raise ValueError(
            "errors: none of any size brings two of these craft together; there is nothing to show"
        )
    scale(axes, [values for *_, values in known], asked)
    if asked is not None:
        zone_band(axes, asked)
        axes.text(
            0.008,
            asked,
            f"required: {asked:g}",
            transform=axes.get_yaxis_transform(),
            va="bottom",
            fontsize=SMALL,
            color="#9a6a00",
        )
    axes.set_ylabel("clearance [sigma]")
    time_axes([axes], ticks, start, end)
    legend(figure, lines, words, ncols=min(2, count))
    least, who, _ = min(finite, key=lambda one: one[0].sigmas)
    plain(headline(figure, f"Clear by {least.sigmas:.2f} sigma at least: {who} at {ticks.text(least.time)}"))
    return figure


def each(name: str, given: Any, count: int, *kinds: Any) -> list[Any]:
    """Return an argument as a list of one value per pair, or raise ValueError."""
    some = list(sequence(name, given, *kinds)) if isinstance(given, list | tuple) else [given] * count
    for one in some:
        instance(name, one, *kinds)
    if len(some) != count:
        raise ValueError(f"{name}: {len(some)} for {count} pairs; give one, or one for each")
    return some


def scale(axes: Any, curves: list[Any], asked: float | None) -> None:
    """Set the range from 0 to the maximum; logarithmic if the range is wide."""
    every = np.concatenate(curves)
    every = every[np.isfinite(every)]
    low, top = float(every.min()), float(every.max())
    if low > 0.0 and top > WIDE * low:
        axes.set_yscale("log")
        axes.set_ylim(0.7 * min(low, asked or low), 1.4 * top)
        axes.yaxis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
        say_scale(axes, "logarithmic")
    else:
        axes.set_ylim(0.0, 1.08 * max(top, asked or 0.0))
