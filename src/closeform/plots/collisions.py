"""Figure of the collision probability against time: entry rate and cumulative probability."""

from __future__ import annotations

from math import floor, log10
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import instance, number
from closeform.motion.path import Path
from closeform.plots.fonts import plain
from closeform.plots.inputs import one_craft
from closeform.plots.palette import AFTER, ALTERNATIVE, CONFLICT, INK
from closeform.plots.style import DASHED, Clock, clock, column, headline, legend, plain_unit, sheet, time_axes
from closeform.uncertainty.probability import Probability

FAR = 5.0  # times the largest value: a limit above that is not shown


def collision(
    found: Probability, path: Path | None = None, limit: float | None = None, what: str = ""
) -> Figure:
    """Plot the mean rate of entries into the zone and, below it, the cumulative probability, against time.

    The lower curve is the probability of being inside at the start plus the expected number of entries so
    far. It is an upper bound on the probability of a conflict up to that time, and equals it if each case
    enters at most once. The mark at the end is the probability of ever being inside, with its interval.

    Parameters
    ----------
    found : Probability
        Result of `collision_probability` with the method "entries" or "bound", which compute the rate.
    path : Path, optional
        Path of either spacecraft, which defines the time axis by its start, end and orbit; default: the times
        at which the rate was computed.
    limit : float, no unit, optional
        Required maximum probability.
    what : str, default ""
        Name of the pair, placed at the start of the headline.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If `found` has no rate because of its method or because there are no entries, the path is a batch,
        `limit` is not a probability above 0, or an argument has the wrong type.
    """
    instance("found", found, Probability)
    if path is not None:
        one_craft("path", path)
    instance("what", what, str)
    if limit is not None and not 0.0 < number("limit", limit) <= 1.0:
        raise ValueError(f"limit: a probability above 0, up to 1, got {limit:g}")
    if len(found.rate_times) < 2 or not found.mean_entries > 0.0:
        raise ValueError(
            f'found: method "{found.method}" gave no rate of entries; give one of method="entries" above 0'
        )
    order = np.argsort(found.rate_times)
    start, end = (path.start, path.end) if path is not None else found.rate_times[order[[0, -1]]].tolist()
    ticks = clock(path, start, end) if path is not None else Clock(plain_unit(end - start), None)
    times, rates = found.rate_times[order], found.rates[order]
    times = np.concatenate([[min(start, times[0])], times, [max(end, times[-1])]])
    rates = np.concatenate([rates[:1], rates, rates[-1:]])
    steps = np.diff(times) * 0.5 * (rates[1:] + rates[:-1])
    so_far = np.concatenate([[0.0], np.cumsum(steps)])
    so_far = found.at_start + so_far * (found.mean_entries / so_far[-1])

    figure = sheet(7.2)
    above, below = column(figure, [1.0, 1.0], 1.05)
    unit = ticks.unit.name.removesuffix("s") if ticks.unit.name == "orbits" else ticks.unit.name
    size, power = scaled(float(rates.max()) * ticks.unit.size)
    rate = rates * ticks.unit.size / size
    above.fill_between(ticks(times), rate, color=CONFLICT, alpha=0.18, linewidth=0)
    above.plot(ticks(times), rate, color=CONFLICT, linewidth=2.0)
    above.set_ylim(0.0, None)
    above.set_ylabel(f"entries per {unit}{power}")

    most = max(so_far[-1], found.high)
    size, power = scaled(most)
    (line,) = below.plot(ticks(times), so_far / size, color=AFTER, linewidth=2.4)
    apart = [[max(found.value - found.low, 0.0) / size], [max(found.high - found.value, 0.0) / size]]
    look: dict[str, Any] = {
        "fmt": "D",
        "color": ALTERNATIVE,
        "markersize": 8,
        "capsize": 5,
        "clip_on": False,
        "zorder": 5,
    }
    mark = below.errorbar([ticks(end)], [found.value / size], apart, **look)
    handles: list[Any] = [line, mark]
    words = [
        "inside at the start, and entries so far",
        f"ever inside: {found.value:.4g} ({found.low:.4g} to {found.high:.4g})",
    ]
    if limit is not None:
        handles.append(below.axhline(limit / size, color=INK, linestyle=DASHED, linewidth=1.4))
        words.append(f"required: at most {limit:g}")
        most = max(most, limit) if limit < FAR * most else most
    below.set_ylim(0.0, 1.12 * most / size)
    below.set_ylabel(f"probability{power}")
    time_axes([above, below], ticks, start, end)
    legend(figure, handles, words, ncols=len(words), columnspacing=1.4)
    lead = f"{what}: p" if what else "P"
    highest = ticks.text(float(times[np.argmax(rates)]))
    plain(headline(figure, f"{lead}robability of collision {found.value:.4g}, most entries at {highest}"))
    return figure


def scaled(greatest: float) -> tuple[float, str]:
    """Return the power of ten in which numbers up to `greatest` are shown, and its axis label."""
    power = floor(log10(greatest))
    return (1.0, "") if -2 <= power < 4 else (10.0**power, f" [$10^{{{power}}}$]")
