"""Animations: a still background, parts that are drawn anew for each frame, and the GIF file."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from closeform.arrays import Floats
from closeform.plots.drawing.inputs import File
from closeform.plots.drawing.text import SMALL, plain, word

COLOURS = 192  # per animation, of 256 at most: fewer tint pale areas, more make larger files
TYPICAL = 5  # frames from which the palette is computed
WIDE, NARROW = 900, 720  # width in pixels for few and for many spacecraft; many moving lines make large files
PLAY = 80  # ms per frame in motion


def write_gif(
    file: File,
    figure: Figure,
    show: Callable[[float], str],
    moments: Sequence[tuple[float, int]],
    pixels: int,
) -> None:
    """Write an animated GIF of a figure, `pixels` wide.

    Each entry of `moments` is a time [s] and the duration of its frame [ms]. `show` draws the parts of one
    time and returns the headline; these parts are removed after the frame.
    """
    figure.set_dpi(pixels / figure.get_figwidth())
    canvas, headline = FigureCanvasAgg(figure), figure.texts[0]
    headline.set_animated(True)  # canvas.draw skips it
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for axes in figure.axes:
        axes.autoscale(False)  # what moves keeps the scales of the background
    background = {child for axes in figure.axes for child in axes.get_children()}

    def frame(time: float) -> Image.Image:
        headline.set_text(show(time))
        drawn = [child for axes in figure.axes for child in axes.get_children() if child not in background]
        canvas.restore_region(still)
        for artist in [*sorted(drawn, key=lambda one: one.zorder), headline]:
            figure.draw_artist(artist)
        for artist in drawn:
            artist.remove()
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())

    times = [time for time, _ in moments]
    typical = np.vstack([np.asarray(frame(time)) for time in times[:: max(1, len(times) // TYPICAL)]])
    palette = Image.fromarray(typical).quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    first, *rest = [frame(time).quantize(palette=palette, dither=Image.Dither.NONE) for time in times]
    stays = [stay for _, stay in moments]  # `optimize` stores only the pixels that change
    first.save(file, "GIF", save_all=True, append_images=rest, duration=stays, loop=0, optimize=True)


def name_moving(axes: Axes, points: Floats, names: Sequence[str], tints: Sequence[str]) -> None:
    """Write names next to moving points (N, 2); a name that would cover an earlier one is left out."""
    places = axes.transData.transform(points) * 72.0 / axes.figure.dpi  # typographic points
    kept: list[int] = []
    for k, (name, tint) in enumerate(zip(names, tints, strict=True)):
        wide = [0.65 * SMALL * max(len(name), len(names[other])) for other in kept]
        near = np.abs(places[kept] - places[k])
        if np.isfinite(places[k]).all() and not ((near[:, 0] < wide) & (near[:, 1] < 1.4 * SMALL)).any():
            kept.append(k)
            plain(word(axes, points[k], name, tint, (5, 9), ha="left", annotation_clip=True))
