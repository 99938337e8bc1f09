"""Common style of all figures: units, clocks, charts and their axes, headlines and legends."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, NullFormatter

from closeform.arrays import Floats
from closeform.motion.arc import START
from closeform.motion.path import Path
from closeform.plots.drawing.inputs import one_craft
from closeform.plots.drawing.palette import CONFLICT, FAINT, INK, OTHER, ZONE
from closeform.plots.drawing.text import HALO, SMALL, TEXT, plain

WIDTH, DPI = 10.6, 150  # inches and dots per inch: 1590 pixels
LETTERS = 8.6  # characters of a headline per inch
BANNER = 0.3  # inches: height of a line of the headline
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.5))
FAR = 8.0  # maximum clearance ratio of a linear axis


@dataclass(frozen=True)
class Unit:
    """Display unit; `size` is its value in SI."""

    size: float
    name: str

    def text(self, value: float, digits: int = 4) -> str:
        """Return a value in SI as text with the unit."""
        return f"{value / self.size:.{digits}g} {self.name}"


def prefixed(greatest: float, name: str, prefixes: str = " mµn") -> Unit:
    """Return a unit with the prefix in which numbers up to `greatest` are above 0.1, if there is one."""
    sizes = {prefix: 1e-3**k for k, prefix in enumerate(prefixes)}
    known = [prefix for prefix, size in sizes.items() if greatest >= 0.1 * size]
    chosen = known[0] if known else prefixes[-1] if greatest > 0.0 else prefixes[1]
    return Unit(sizes[chosen], chosen.strip() + name)


def length_unit(longest: float) -> Unit:
    """Return the display unit of a length [m]: km from 10 km, mm below 0.1 m, otherwise m."""
    return Unit(1e3, "km") if longest >= 1e4 else prefixed(longest or 1.0, "m", " m")


def thrust_unit(greatest: float, basic: str = "m/s²") -> Unit:
    """Return the display unit for a maximum thrust [m/s^2 or N]."""
    return prefixed(greatest, basic)


def speed_unit(greatest: float) -> Unit:
    """Return the display unit for a maximum speed [m/s]."""
    return prefixed(greatest, "m/s", " m")


def length(value: float) -> str:
    """Return a length [m] as text with its unit."""
    return length_unit(value).text(value, 3)


def speed(value: float) -> str:
    """Return a speed [m/s] as text with its unit."""
    return speed_unit(value).text(value)


def rounded_down(most: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed a positive number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}{'s' * (count != 1)}"


def signed_percent(share: float) -> str:
    """Return a relative change as a signed percentage."""
    return f"{100 * share:+.3g} %".replace("-", "−")


@dataclass(frozen=True)
class Clock:
    """Time axis with its `unit`; `other` is the unit of the upper axis (None in deep space)."""

    unit: Unit
    other: Unit | None = None

    def __call__(self, time: Any) -> Any:
        """Return times [s] in the unit of the axis."""
        return np.asarray(time) / self.unit.size

    def text(self, time: float) -> str:
        """Return a time [s] as text with the unit of the axis."""
        return f"{time / self.unit.size:.2f} {self.unit.name}"


def plain_unit(duration: float) -> Unit:
    """Return the time unit (s, min, h or d) that suits a duration [s]."""
    for limit, unit in ((300.0, Unit(1.0, "s")), (3e4, Unit(60.0, "min")), (4e5, Unit(3600.0, "h"))):
        if duration <= limit:
            return unit
    return Unit(86400.0, "d")


def clock(path: Path, start: float, end: float) -> Clock:
    """Return the time axis of a path from `start` to `end` [s].

    It shows minutes (or a similar unit) with orbits on the upper axis; for four orbits or more, the two are
    swapped.
    """
    plain, period = plain_unit(end - start), path.orbit.period
    if not np.isfinite(period):
        return Clock(plain)
    orbits = Unit(period, "orbits")
    return Clock(orbits, plain) if end - start >= 4 * period else Clock(plain, orbits)


def instants(start: float, end: float, *paths: Path) -> Floats:
    """Return times [s] for smooth curves, including both sides of every joint between arcs."""
    orbits = max(((end - start) / path.orbit.period for path in paths), default=0.0)
    grid = np.linspace(start, end, int(np.clip(240 * orbits, 900, 6000)))
    joints = np.concatenate([path.arcs[:, START] for path in paths])
    joints = joints[(joints > start) & (joints <= end)]
    return np.unique(np.concatenate([grid, joints, np.nextafter(joints, -np.inf)]))


def common_time(path: Path, other: Path) -> tuple[float, float]:
    """Return the common start and end [s] of two paths; raise ValueError if there is none, or for batches."""
    one_craft("path", path)
    one_craft("other", other)
    start, end = max(path.start, other.start), min(path.end, other.end)
    if not start < end:
        raise ValueError(
            f"other: shares no time with path ({path.start:g} to {path.end:g} s and "
            f"{other.start:g} to {other.end:g} s)"
        )
    return start, end


class Sheet(Figure):
    """Figure that displays in a notebook without pyplot."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def sheet(height: float, width: float = WIDTH, layout: Any = "constrained") -> Figure:
    """Return an empty figure (inches) whose axes matplotlib arranges."""
    return Sheet(figsize=(width, height), dpi=DPI, facecolor="white", layout=layout)


def chart(height: float, shares: Sequence[float] = (1.0,), width: float = WIDTH) -> tuple[Figure, list[Axes]]:
    """Return a figure with stacked axes that share the horizontal axis, with heights in `shares`."""
    figure = sheet(height, width)
    made = figure.subplots(len(shares), 1, sharex=True, squeeze=False, height_ratios=list(shares))[:, 0]
    for axes in made:
        dress(axes)
    figure.align_ylabels(list(made))
    return figure, list(made)


def dress(axes: Axes) -> None:
    """Apply the common frame, grid and text sizes to axes."""
    axes.tick_params(labelsize=SMALL, colors=INK, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[:].set_color(OTHER)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(fontsize=TEXT, color=INK)


def other_axis(axes: Axes, where: str, functions: Any, what: str) -> None:
    """Add a second scale above axes or on their right."""
    made: Any
    if where == "top":
        made = axes.secondary_xaxis("top", functions=functions)
        made.set_xlabel(what, fontsize=SMALL, color=INK)
    else:
        made = axes.secondary_yaxis("right", functions=functions)
        made.set_ylabel(what, fontsize=SMALL, color=INK)
    made.tick_params(labelsize=SMALL, colors=INK, length=3)
    made.spines[:].set_color(OTHER)


def right_axis(axes: Axes, what: str, colour: str) -> Axes:
    """Add an axis on the right for a curve of another quantity, in the colour of that curve."""
    right = axes.twinx()
    right.tick_params(labelsize=SMALL, colors=colour, length=3)
    right.spines[:].set_visible(False)
    right.set_ylabel(what, fontsize=SMALL, color=colour)
    return right


def time_axes(column: Sequence[Axes], ticks: Clock, start: float, end: float, what: str = "time") -> None:
    """Set one time axis for stacked axes, with its second unit above the first."""
    for axes in column:
        axes.set_xlim(ticks(start), ticks(end))
    column[-1].set_xlabel(f"{what} [{ticks.unit.name}]")
    if ticks.other is not None:
        factor = ticks.unit.size / ticks.other.size
        functions = (lambda time: time * factor), (lambda time: time / factor)
        other_axis(column[0], "top", functions, f"time [{ticks.other.name}]")


def zone_band(axes: Axes, edge: float = 1.0, name: str = "") -> None:
    """Shade the keep-out zone: clearances below `edge`."""
    axes.axhspan(min(-1.0, -edge), edge, color=ZONE, alpha=0.2, linewidth=0)
    axes.axhline(edge, color=ZONE, linewidth=1.6)
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    if name:
        place |= {"va": "top", "fontsize": SMALL, "color": "#9a6a00", "path_effects": HALO, "zorder": 6}
        axes.annotate(name, (0.008, edge), (0, -5), **place)


def ratio_axis(axes: Axes, least: float, most: float) -> None:
    """Set the axis of clearance ratios from 0 to `most`, logarithmic above 1 if the range is wide."""
    bottom = 0.0 if least > 0.02 else -0.03  # keeps a line at 0 visible
    if most <= FAR:
        axes.set_ylim(bottom, 1.06 * max(most, 1.2))
        return
    axes.set_yscale("symlog", linthresh=1.0, linscale=0.7)
    axes.set_ylim(bottom, 1.2 * most)
    decades = 10.0 ** np.arange(np.ceil(np.log10(1.2 * most)))
    steps = (1, 2, 5) if len(decades) <= 3 else (1,)
    marks = [
        0.0,
        0.5,
        *(step * decade for decade in decades for step in steps if step * decade <= 1.2 * most),
    ]
    axes.set_yticks(marks, [f"{mark:g}" for mark in marks])
    axes.set_yticks([], minor=True)


def log_axis(axes: Axes) -> None:
    """Make the vertical axis logarithmic, with labels at 1, 2 and 5 in each decade."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def headline(figure: Figure, text: str) -> Text:
    """Add a headline, which wraps if it is long."""
    words = figure.suptitle(wrapped(figure, text), x=0.01, ha="left")
    words.set(fontsize=TEXT + 1, color=INK, fontweight="bold")
    return plain(words)


def wrapped(figure: Figure, text: str) -> str:
    """Return the lines of a headline, broken where they are wider than a figure."""
    room = int(LETTERS * figure.get_figwidth())
    return "\n".join(fill(line, room) for line in text.split("\n"))


def banner(figure: Figure, text: str, bad: bool = False) -> None:
    """Add text above the headline and extend the page for it; if `bad`, both are red."""
    wide, high = (float(side) for side in figure.get_size_inches())
    figure.set_size_inches(wide, high + BANNER * (1 + wrapped(figure, text).count("\n")))
    words = headline(figure, f"{text}\n{figure.get_suptitle()}")
    words.set_color(CONFLICT if bad else INK)


def legend(figure: Figure, handles: Sequence[Any], words: Sequence[str], **look: Any) -> Any:
    """Add a legend below the axes of a figure; labels that begin with `_` are kept."""
    style: dict[str, Any] = {
        "loc": "outside lower center",
        "frameon": False,
        "fontsize": SMALL,
        "borderaxespad": 0.9,
    }
    wide = [1.0 + 0.085 * len(said) for said in words]  # inches
    room = float(figure.get_figwidth()) - 0.4
    columns = len(words) if sum(wide) <= room else max(1, int(room / max(wide)))
    made = figure.legend(list(handles), ["?"] * len(handles), **style | {"ncols": columns} | look)
    for text, said in zip(made.get_texts(), words, strict=True):
        text.set_text(said)
        plain(text)
    return made
