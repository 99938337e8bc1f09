"""The look of every picture: sizes, units, places of axes, words around them."""

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
LEFT, ABOVE, GAP = 1.0, 0.92, 0.14  # inches: left of axes, above them for words, between two
LETTERS = 7.6  # of a headline to an inch
BANNER = 0.3  # inches of the line above a picture
TEXT, SMALL = 13.0, 11.5  # points, readable at half size

HALO = [withStroke(linewidth=4, foreground="white")]  # keeps words readable on lines
DASHED, DOTTED = (0, (4, 2)), (0, (1, 1.5))


@dataclass(frozen=True)
class Unit:
    """A unit to print in: `size` in SI."""

    size: float
    name: str


def length_unit(longest: float) -> Unit:
    """Metres, or kilometres from 10 km on, millimetres below 0.1 m."""
    if longest >= 1e4:
        return Unit(1e3, "km")
    return Unit(1.0, "m") if longest >= 0.1 else Unit(1e-3, "mm")


def length(value: float) -> str:
    """A length [m] in words."""
    unit = length_unit(value)
    return f"{value / unit.size:.3g} {unit.name}"


def rounded_down(most: float) -> float:
    """The greatest of 1, 2 and 5 times a power of ten that is not above a positive number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))


def thrust_unit(greatest: float, basic: str = "m/s²") -> Unit:
    """The unit for a greatest thrust [m/s^2 or N]; thousandths where there is none."""
    for size, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if greatest >= 0.1 * size:
            return Unit(size, prefix + basic)
    return Unit(1e-9, f"n{basic}") if greatest > 0 else Unit(1e-3, f"m{basic}")


def speed_unit(greatest: float) -> Unit:
    """The unit of speed for a greatest speed [m/s]."""
    return Unit(1.0, "m/s") if greatest >= 0.1 else Unit(1e-3, "mm/s")


def speed(value: float) -> str:
    """A speed [m/s] in words."""
    unit = speed_unit(value)
    return f"{value / unit.size:.4g} {unit.name}"


@dataclass(frozen=True)
class Clock:
    """The time axis: what is printed below, and `other` above (None in deep space)."""

    unit: Unit
    other: Unit | None

    def __call__(self, time: Any) -> Any:
        """Times [s] in the unit of the axis."""
        return np.asarray(time) / self.unit.size

    def text(self, time: float) -> str:
        """A time [s] in words."""
        return f"{time / self.unit.size:.2f} {self.unit.name}"


def plain_unit(duration: float) -> Unit:
    """Seconds, minutes, hours or days, whichever makes handy numbers."""
    for limit, unit in ((300.0, Unit(1.0, "s")), (3e4, Unit(60.0, "min")), (4e5, Unit(3600.0, "h"))):
        if duration <= limit:
            return unit
    return Unit(86400.0, "d")


def clock(path: Path, start: float, end: float) -> Clock:
    """Minutes with orbits above, or orbits with hours above where there are many orbits."""
    plain, period = plain_unit(end - start), path.orbit.period
    if not np.isfinite(period):
        return Clock(plain, None)
    orbits = Unit(period, "orbits")
    return Clock(orbits, plain) if end - start >= 4 * period else Clock(plain, orbits)


def instants(start: float, end: float, *paths: Path) -> Floats:
    """Times [s] at which curves look smooth, both sides of every joint among them."""
    orbits = max(((end - start) / path.orbit.period for path in paths), default=0.0)
    grid = np.linspace(start, end, int(np.clip(240 * orbits, 900, 6000)))
    joints = np.concatenate([path.arcs[:, START] for path in paths])
    joints = joints[(joints > start) & (joints <= end)]
    return np.unique(np.concatenate([grid, joints, np.nextafter(joints, -np.inf)]))


class Sheet(Figure):
    """A figure that a notebook shows as it is, without pyplot."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def sheet(height: float, width: float = WIDTH) -> Figure:
    """An empty figure, in inches, whose axes are placed by hand: to find their places out is slow."""
    return Sheet(figsize=(width, height), dpi=DPI, facecolor="white")


def area(figure: Figure, left: float, bottom: float, wide: float, high: float) -> Axes:
    """Axes at a place in inches."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((left / across, bottom / up, wide / across, high / up))
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(fontsize=TEXT, color=INK)
    return axes


def column(figure: Figure, shares: Sequence[float], below: float = 0.7, beside: float = 0.3) -> list[Axes]:
    """Axes above each other, with heights in `shares`, `below` and `beside` them inches for words."""
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
    """A figure of one panel, with `below` and `beside` it inches for words."""
    figure = sheet(height)
    return figure, column(figure, [1.0], below, beside)[0]


def zone_band(axes: Axes, edge: float = 1.0) -> None:
    """Shade what is below an edge, the keep-out zone of a clearance ratio."""
    axes.axhspan(min(-1.0, -edge), edge, color=ZONE, alpha=0.2, linewidth=0)
    axes.axhline(edge, color=ZONE, linewidth=1.6)


def headline(figure: Figure, text: str) -> Text:
    """What the picture shows, in one line; a long one in smaller letters."""
    size = min(TEXT + 1, (TEXT + 1) * LETTERS * float(figure.get_figwidth()) / max(1, len(text)))
    words = figure.suptitle(text, x=0.01, y=1.0 - 0.1 / figure.get_figheight(), ha="left", va="top")
    words.set(fontsize=size, color=INK, fontweight="bold")
    return plain(words)


def banner(figure: Figure, text: str, bad: bool = False) -> Text:
    """What a picture belongs to, in a line above it, by which the page grows; `bad` news are red."""
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
    """A legend whose words may hold names: those that begin with `_` are not left out."""
    style: dict[str, Any] = {"loc": "lower center", "frameon": False, "fontsize": SMALL} | look
    made = figure.legend(handles=list(handles), labels=["?"] * len(handles), **style)
    for text, word in zip(made.get_texts(), words, strict=True):
        text.set_text(word)
        plain(text)
    return made


def say_scale(axes: Axes, words: str, low: bool = False) -> None:
    """Words about an axis that is not linear, in the upper right corner, or the lower one."""
    corner: dict[str, Any] = {
        "xycoords": "axes fraction",
        "textcoords": "offset points",
        "ha": "right",
        "va": "bottom" if low else "top",
    }
    place, shift = ((1.0, 0.0), (-4, 3)) if low else ((1.0, 1.0), (-4, -3))
    axes.annotate(words, place, shift, fontsize=SMALL - 2.0, color=OTHER, **corner)


def dress(axes: Axes) -> None:
    """Quiet frame, faint grid, text sizes."""
    axes.tick_params(labelsize=SMALL, colors=INK, length=3)
    axes.grid(color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for spine in axes.spines.values():
        spine.set_color(OTHER)


def right_axis(axes: Axes, colour: str) -> Axes:
    """An axis on the right of others, with numbers in the colour of its curve and no frame."""
    right = axes.twinx()
    right.tick_params(labelsize=SMALL, colors=colour, length=3)
    for side in ("top", "left", "bottom", "right"):
        right.spines[side].set_visible(False)
    return right


def time_axes(column: list[Axes], ticks: Clock, start: float, end: float) -> None:
    """Give a column of axes one time axis, with its second unit above the first."""
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
    """The time that two craft share. Raises ValueError where there is none, or for batches."""
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
    """A relative change in words."""
    return f"{100 * share:+.3g} %".replace("-", "−")
