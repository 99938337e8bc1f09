"""Animated figures, written as GIF files with Pillow."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import IO

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

COLOURS = 128  # per animation; twice as many make the file 10 % larger without a visible gain
TYPICAL = 5  # frames from which the palette is computed


@dataclass(frozen=True)
class Reel:
    """Animated figure, `pixels` wide.

    `show` moves the `moving` artists, ordered from back to front, to a time [s]. Each entry of `moments` is a
    time [s] and the duration of its frame [ms].
    """

    figure: Figure
    moving: Callable[[], Sequence[Artist]]
    show: Callable[[float], None]
    moments: Sequence[tuple[float, int]]
    pixels: int

    def frames(self, share: slice, progress: Callable[[int, int], object] | None = None) -> list[Image.Image]:
        """Return the frames of a slice of `moments` in one palette; the static background is drawn once."""
        self.figure.set_dpi(self.pixels / self.figure.get_figwidth())
        canvas = FigureCanvasAgg(self.figure)
        times = [time for time, _ in self.moments]
        self.show(times[0])
        for artist in self.moving():
            artist.set_animated(True)  # canvas.draw skips it
        canvas.draw()
        still = canvas.copy_from_bbox(self.figure.bbox)

        def picture(time: float) -> Image.Image:
            canvas.restore_region(still)
            self.show(time)
            for artist in self.moving():
                (artist.axes or self.figure).draw_artist(artist)
            return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())

        typical = {time: picture(time) for time in times[:: max(1, len(times) // TYPICAL)]}
        together = Image.fromarray(np.vstack([np.asarray(one) for one in typical.values()]))
        palette = together.quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
        coded = []
        for done, time in enumerate(times[share], start=1):
            drawn = typical.get(time) or picture(time)
            coded.append(drawn.quantize(palette=palette, dither=Image.Dither.NONE))
            if progress is not None:
                progress(done, len(times[share]))
        return coded

    def save(self, file: str | PathLike[str] | IO[bytes], frames: Sequence[Image.Image]) -> None:
        """Write all frames as an animated GIF; `optimize` stores only the pixels that change."""
        stays = [stay for _, stay in self.moments]
        frames[0].save(
            file, "GIF", save_all=True, append_images=frames[1:], duration=stays, loop=0, optimize=True
        )
