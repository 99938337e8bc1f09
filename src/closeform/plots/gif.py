"""Figures in motion, written as an animated GIF."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import IO

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

COLOURS = 64
NEAR = 24  # of 765: a shade that is as near to a firm colour is drawn in that


def write(
    file: str | PathLike[str] | IO[bytes],
    figure: Figure,
    moving: Callable[[], Sequence[Artist]],
    show: Callable[[float], None],
    moments: Sequence[tuple[float, int]],
    firm: Sequence[str],
    pixels: int,
    progress: Callable[[int, int], object] | None,
) -> None:
    """Write a figure as a GIF of some `pixels` across: what stands still is drawn once.

    `show` moves the `moving` artists, from back to front, to a time [s]; each of the `moments` has a
    time and how long it stays [ms].  The colours `firm` are kept as they are.
    """
    figure.set_dpi(pixels / figure.get_figwidth())
    canvas = FigureCanvasAgg(figure)
    times = [time for time, _ in moments]
    show(times[0])
    for artist in moving():
        artist.set_animated(True)  # leaves it out of what is drawn once
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)

    def picture(time: float) -> Image.Image:
        canvas.restore_region(still)
        show(time)
        for artist in moving():
            (artist.axes or figure).draw_artist(artist)
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())

    palette = common_palette([picture(time) for time in times[:: max(1, len(times) // 5)]], firm)
    coded = []
    for done, time in enumerate(times, start=1):
        coded.append(picture(time).quantize(palette=palette, dither=Image.Dither.NONE))
        if progress is not None:
            progress(done, len(times))
    stays = [stay for _, stay in moments]
    coded[0].save(file, "GIF", save_all=True, append_images=coded[1:], duration=stays, loop=0, optimize=True)


def common_palette(pictures: list[Image.Image], firm: Sequence[str]) -> Image.Image:
    """One palette for all frames, so that what stands still stays the same.

    The `firm` colours are in it as they are; the others are those of most use for the shades
    that occur, each counted once, since most of a frame is white.
    """
    chosen = [tuple(int(one[k : k + 2], 16) for k in (1, 3, 5)) for one in firm]
    packed = [np.asarray(one).astype(np.uint32) @ np.array([1, 256, 65536], np.uint32) for one in pictures]
    shades = np.unique(np.concatenate(packed, axis=None))[:, None] >> np.array([0, 8, 16], np.uint32) & 255
    far = np.abs(shades[:, None].astype(int) - np.array(chosen)).sum(axis=2).min(axis=1) > NEAR
    shades = shades[far] if far.any() else shades
    room = COLOURS - len(firm)
    cut = Image.fromarray(shades[None].astype(np.uint8)).quantize(room, Image.Quantize.MEDIANCUT)
    rest = (cut.getpalette() or [])[: 3 * room]
    common = Image.new("P", (1, 1))
    common.putpalette([part for colour in chosen for part in colour] + rest)
    return common
