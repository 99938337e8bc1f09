"""Figures in motion, written as an animated GIF."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import IO

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

COLOURS = 63
AS_BEFORE = COLOURS  # the index of pixels that a frame leaves as they are
NEAR = 24  # of 765: a shade that is as near to a firm colour is drawn in that


@dataclass(frozen=True)
class Reel:
    """A figure that moves, some `pixels` across.

    `show` moves the `moving` artists, from back to front, to a time [s]; each of the `moments` has a
    time and how long it stays [ms].  The colours `firm` are kept as they are.
    """

    figure: Figure
    moving: Callable[[], Sequence[Artist]]
    show: Callable[[float], None]
    moments: Sequence[tuple[float, int]]
    firm: Sequence[str]
    pixels: int

    def frames(self, share: slice, progress: Callable[[int, int], object] | None = None) -> list[Image.Image]:
        """The frames of a share of the moments, in the film's palette: what stands still is drawn once."""
        self.figure.set_dpi(self.pixels / self.figure.get_figwidth())
        canvas = FigureCanvasAgg(self.figure)
        times = [time for time, _ in self.moments]
        self.show(times[0])
        for artist in self.moving():
            artist.set_animated(True)  # leaves it out of what is drawn once
        canvas.draw()
        still = canvas.copy_from_bbox(self.figure.bbox)

        def picture(time: float) -> Image.Image:
            canvas.restore_region(still)
            self.show(time)
            for artist in self.moving():
                (artist.axes or self.figure).draw_artist(artist)
            return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())

        typical = {time: picture(time) for time in times[:: max(1, len(times) // 5)]}
        palette = common_palette([*typical.values()], self.firm)
        coded = []
        for done, time in enumerate(times[share], start=1):
            drawn = typical.get(time) or picture(time)
            coded.append(drawn.quantize(palette=palette, dither=Image.Dither.NONE))
            if progress is not None:
                progress(done, len(times[share]))
        return coded

    def save(self, file: str | PathLike[str] | IO[bytes], frames: Sequence[Image.Image]) -> None:
        """Write all frames as an animated GIF: of each what differs from the one before."""
        frames[0].save(
            file,
            "GIF",
            save_all=True,
            append_images=[changed(*two) for two in pairwise(frames)],
            duration=[stay for _, stay in self.moments],
            loop=0,
            optimize=False,  # Pillow would look for the differences again, in some versions for seconds
            transparency=AS_BEFORE,
            disposal=1,
        )


def changed(before: Image.Image, frame: Image.Image) -> Image.Image:
    """A frame with only those pixels that are not as in the one before."""
    old, new = np.asarray(before), np.asarray(frame)
    only = frame.copy()
    only.frombytes(np.where(new == old, np.uint8(AS_BEFORE), new).tobytes())
    return only


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
