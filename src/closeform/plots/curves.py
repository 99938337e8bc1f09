"""A curve for each craft against time."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from closeform.arrays import Floats
from closeform.plots.fonts import plain, short_names
from closeform.plots.palette import colours
from closeform.plots.style import DASHED, SMALL, Clock, chart, headline, plain_unit, time_axes

NAMED = 12  # craft up to which each curve has a name, at its end


def curves(
    times: Floats,
    values: Floats,
    what: str,
    said: str,
    names: Sequence[str] | None = None,
    planned: Floats | None = None,
) -> Figure:
    """Values (N, T) at times (T,) [s], none below 0, of N craft; those `planned` (N, T) are dashed."""
    called, ticks = short_names(names, len(values)), Clock(plain_unit(float(times[-1] - times[0])), None)
    figure, axes = chart(5.2, beside=1.1)
    for k, tint in enumerate(colours(len(values))):
        axes.plot(ticks(times), values[k], color=tint, linewidth=1.8)
        if planned is not None:
            axes.plot(ticks(times), planned[k], color=tint, linewidth=1.2, linestyle=DASHED)
        if len(values) <= NAMED:
            place = (float(ticks(times[-1])), float(values[k, -1]))
            plain(axes.annotate(called[k], place, (5, -4), textcoords="offset points", fontsize=SMALL))
    axes.set_ylim(0.0, None)
    axes.set_ylabel(what)
    time_axes([axes], ticks, float(times[0]), float(times[-1]))
    plain(headline(figure, said))
    return figure
