"""Common style of all figures: sizes, units, axes layout, headlines and legends."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from closeform.arrays import Floats
from closeform.motion.arc import START
from closeform.motion.path import Path
from closeform.plots.fonts import plain
from closeform.plots.inputs import one_craft
from closeform.plots.palette import CONFLICT, FAINT, INK, OTHER, ZONE

WIDTH, DPI = 10.6, 150  # inches and dots per inch: 1590 pixels
LEFT, ABOVE, GAP = 1.0, 0.92, 0.14  # inches: left margin, top margin for the headline, gap between axes
LETTERS = 7.6  # characters of a headline per inch
BANNER = 0.3  # inches: height of the banner
TEXT, SMALL = 13.0, 11.5  # points, readable at half size

HALO = [withStroke(linewidth=4, foreground="white")]  # keeps words readable on lines
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.5))


@dataclass(frozen=True)
class Unit:
    """Display unit; `size` is its value in SI."""

    size: float
    name: str


def length_unit(longest: float) -> Unit:
    """Return the display unit of a length [m]: km from 10 km, mm below 0.1 m, otherwise m."""
    if longest >= 1e4:
        return Unit(1e3, "km")
    return Unit(1.0, "m") if longest >= 0.1 else Unit(1e-3, "mm")


def length(value: float) -> str:
    """Return a length [m] as text with its unit."""
    unit = length_unit(value)
    return f"{value / unit.size:.3g} {unit.name}"


def rounded_down(most: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed a positive number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))


def thrust_unit(greatest: float, basic: str = "m/s²") -> Unit:
    """Return the display unit for a maximum thrust [m/s^2 or N]; the milli unit if it is zero."""
    for size, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if greatest >= 0.1 * size:
            return Unit(size, prefix + basic)
    return Unit(1e-9, f"n{basic}") if greatest > 0 else Unit(1e-3, f"m{basic}")


def speed_unit(greatest: float) -> Unit:
    """Return the display unit for a maximum speed [m/s]."""
    return Unit(1.0, "m/s") if greatest >= 0.1 else Unit(1e-3, "mm/s")


def speed(value: float) -> str:
    """Return a speed [m/s] as text with its unit."""
    unit = speed_unit(value)
    return f"{value / unit.size:.4g} {unit.name}"


@dataclass(frozen=True)
class Clock:
    """Time axis with its `unit`; `other` is the unit of the upper axis (None in deep space)."""

    unit: Unit
    other: Unit | None

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

    It shows minutes (or a similar unit) with orbits on the upper axis; from four orbits on, the two are
    swapped.
    """
    plain, period = plain_unit(end - start), path.orbit.period
    if not np.isfinite(period):
        return Clock(plain, None)
    orbits = Unit(period, "orbits")
    return Clock(orbits, plain) if end - start >= 4 * period else Clock(plain, orbits)


def instants(start: float, end: float, *paths: Path) -> Floats:
    """Return times [s] for smooth curves, including both sides of every joint between arcs."""
    orbits = max(((end - start) / path.orbit.period for path in paths), default=0.0)
    grid = np.linspace(start, end, int(np.clip(240 * orbits, 900, 6000)))
    joints = np.concatenate([path.arcs[:, START] for path in paths])
    joints = joints[(joints > start) & (joints <= end)]
    return np.unique(np.concatenate([grid, joints, np.nextafter(joints, -np.inf)]))


class Sheet(Figure):
    """Figure that displays in a notebook without pyplot."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def sheet(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure (inches); axes are placed by hand because automatic layout is slow."""
    return Sheet(figsize=(width, height), dpi=DPI, facecolor="white")


def area(figure: Figure, left: float, bottom: float, wide: float, high: float) -> Axes:
    """Add axes at a position and of a size in inches."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((left / across, bottom / up, wide / across, high / up))
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(fontsize=TEXT, color=INK)
    return axes


def column(figure: Figure, shares: Sequence[float], below: float = 0.7, beside: float = 0.3) -> list[Axes]:
    """Return stacked axes with heights in `shares`; leave `below` and `beside` inches for labels."""
    wide, high = figure.get_size_inches()
    room = high - below - ABOVE - GAP * (len(shares) - 1)
    found: list[Axes] = []
    top = high - ABOVE
    for share in shares:
        tall = room * share / sum(shares)
        axes = area(figure, LEFT, top - tall, wide - LEFT - beside, tall)
        axes.yaxis.set_label_coords(-0.72 / (wide - LEFT - beside), 0.5)
        dress(axes)
        found.append(axes)
        top -= tall + GAP
    return found


def chart(height: float, below: float = 0.7, beside: float = 0.3) -> tuple[Figure, Axes]:
    """Return a figure of one panel, with `below` and `beside` inches for labels."""
    figure = sheet(height)
    return figure, column(figure, [1.0], below, beside)[0]


def zone_band(axes: Axes, edge: float = 1.0) -> None:
    """Shade the keep-out zone: clearance ratios below `edge`."""
    axes.axhspan(min(-1.0, -edge), edge, color=ZONE, alpha=0.2, linewidth=0)
    axes.axhline(edge, color=ZONE, linewidth=1.6)


def headline(figure: Figure, text: str) -> Text:
    """Add a one-line headline; shrink the font for long text."""
    size = min(TEXT + 1, (TEXT + 1) * LETTERS * float(figure.get_figwidth()) / max(1, len(text)))
    words = figure.suptitle(text, x=0.01, y=1.0 - 0.1 / figure.get_figheight(), ha="left", va="top")
    words.set(fontsize=size, color=INK, fontweight="bold")
    return plain(words)


def banner(figure: Figure, text: str, bad: bool = False) -> Text:
    """Add a line above the headline and extend the page for it; `bad` makes it red."""
    wide, high = (float(side) for side in figure.get_size_inches())
    kept = high / (high + BANNER)  # of the new page
    figure.set_size_inches(wide, high + BANNER)
    for axes in figure.axes:
        left, low, across, up = axes.get_position(original=True).bounds
        axes.set_position((left, low * kept, across, up * kept))
    for words in figure.texts:
        words.set_y(words.get_position()[1] * kept)
    for made in figure.legends:
        anchor = made.get_bbox_to_anchor().transformed(figure.transFigure.inverted())
        made.set_bbox_to_anchor((anchor.x0, anchor.y0 * kept, anchor.width, anchor.height * kept))
    size = min(TEXT, TEXT * LETTERS * 1.08 * wide / max(1, len(text)))
    look: dict[str, Any] = {"ha": "left", "va": "top", "fontsize": size, "color": CONFLICT if bad else INK}
    return plain(figure.text(0.01, 1.0 - 0.1 / (high + BANNER), text, **look))


def legend(figure: Figure, handles: Sequence[Any], words: Sequence[str], **look: Any) -> Any:
    """Add a legend to a figure; labels that begin with `_` are kept."""
    style: dict[str, Any] = {"loc": "lower center", "frameon": False, "fontsize": SMALL} | look
    made = figure.legend(handles=list(handles), labels=["?"] * len(handles), **style)
    for text, word in zip(made.get_texts(), words, strict=True):
        text.set_text(word)
        plain(text)
    return made


def say_scale(axes: Axes, words: str, low: bool = False) -> None:
    """Label a non-linear axis in its upper right corner, or the lower right one if `low`."""
    corner: dict[str, Any] = {
        "xycoords": "axes fraction",
        "textcoords": "offset points",
        "ha": "right",
        "va": "bottom" if low else "top",
    }
    place, shift = ((1.0, 0.0), (-4, 3)) if low else ((1.0, 1.0), (-4, -3))
    axes.annotate(words, place, shift, fontsize=SMALL - 2.0, color=OTHER, **corner)


def dress(axes: Axes) -> None:
    """Apply the common frame, grid and text sizes to axes."""
    axes.tick_params(labelsize=SMALL, colors=INK, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for spine in axes.spines.values():
        spine.set_color(OTHER)


def right_axis(axes: Axes, colour: str) -> Axes:
    """Add a frameless axis on the right with tick labels in the colour of its curve."""
    right = axes.twinx()
    right.tick_params(labelsize=SMALL, colors=colour, length=3)
    for side in ("top", "left", "bottom", "right"):
        right.spines[side].set_visible(False)
    return right


def time_axes(column: list[Axes], ticks: Clock, start: float, end: float) -> None:
    """Set one time axis for stacked axes, with its second unit above the first."""
    for axes in column:
        axes.set_xlim(ticks(start), ticks(end))
        axes.tick_params(labelbottom=axes is column[-1])
    column[-1].set_xlabel(f"time [{ticks.unit.name}]")
    if ticks.other is not None:
        factor = ticks.unit.size / ticks.other.size

        def forward(time: Any) -> Any:
            return time * factor

        def backward(time: Any) -> Any:
            return time / factor

        above = column[0].secondary_xaxis("top", functions=(forward, backward))
        above.set_xlabel(f"time [{ticks.other.name}]", fontsize=SMALL, color=INK)
        above.tick_params(labelsize=SMALL, colors=INK, length=3)
        above.spines["top"].set_color(OTHER)


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


def signed_percent(share: float) -> str:
    """Return a relative change as a signed percentage."""
    return f"{100 * share:+.3g} %".replace("-", "−")
