"""Moving pictures: views whose artists move from one frame to the next, and the GIF file of the frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from closeform.arrays import Floats
from closeform.plots.drawing.inputs import File, Progress
from closeform.plots.drawing.palette import INK
from closeform.plots.drawing.space import Camera
from closeform.plots.drawing.text import follow, plain, word

COLOURS = 128  # per animation; twice as many make the file 10 % larger without a visible gain
TYPICAL = 5  # frames from which the palette is computed
WIDE, NARROW = 900, 720  # width in pixels for few and for many spacecraft; many moving lines make large files
PLAY = 80  # ms per frame in motion


class MovingView:
    """View in which each thing has a name: it is drawn at the first call and moves at later ones.

    `artists` holds the artists by name, from back to front.
    """

    def __init__(self, axes: Axes, camera: Camera, unit: float = 1.0) -> None:
        self.axes, self.camera, self.unit = axes, camera, unit
        self.artists: dict[str, Any] = {}
        self.labels: list[Any] = []

    def flat(self, points: Any) -> Floats:
        """Return points (..., 3) [m] in the view (..., 2)."""
        return self.camera(points) / self.unit

    def made(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the artist of a name, which is made at first use."""
        if name not in self.artists:
            self.artists[name] = make()
        return self.artists[name]

    def collection(self, name: str, kind: Any, look: dict[str, Any]) -> Any:
        """Return the collection of a name, of a kind and with a look."""

        def make() -> Any:
            made = kind([], **look)
            self.axes.add_collection(made, autolim=False)
            return made

        return self.made(name, make)

    def lines(self, name: str, lines: Sequence[Any], **look: Any) -> None:
        """Draw lines (K, 3) [m]."""
        self.collection(name, LineCollection, look).set_segments([self.flat(line) for line in lines])

    def shapes(self, name: str, outlines: Sequence[Floats], faces: Any, edges: Any, **look: Any) -> None:
        """Draw closed outlines (K, 2) in the view, with the colours of their faces and edges."""
        found = self.collection(name, PolyCollection, look)
        found.set_verts(outlines)
        found.set(facecolor=faces, edgecolor=edges)

    def dots(self, name: str, points: Floats, marker: str, **look: Any) -> None:
        """Draw marks at points (K, 3) [m]."""
        made = self.made(name, lambda: self.axes.plot([], [], marker, **look)[0])
        made.set_data(*self.flat(points).T)

    def points(self, name: str, points: Floats, edges: Any, **look: Any) -> None:
        """Draw discs at points (K, 3) [m] with the colours of their edges."""
        flat = self.flat(points)
        found = self.made(name, lambda: self.axes.scatter(*flat.T, zorder=4, **look))
        found.set_offsets(flat)
        found.set_edgecolors(edges)

    def names(self, texts: Sequence[str], points: Floats, tints: Sequence[Any]) -> None:
        """Write names beside points (K, 3) [m], where there is room."""
        for text, tint in zip(texts[len(self.labels) :], tints[len(self.labels) :], strict=True):
            made = plain(word(self.axes, (0, 0), text, tint, ha="left", annotation_clip=True))
            self.artists[f"name {len(self.labels)}"] = made
            self.labels.append(made)
        follow(self.axes, self.labels, self.flat(points))

    def write(self, name: str, text: str, place: Any, colour: Any = INK, **look: Any) -> None:
        """Write a text at a place (2,) of the axes."""
        made = self.made(name, lambda: word(self.axes, place, text, colour, **look))
        made.xy = place
        made.set_text(text)


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

    def frames(self, share: slice, progress: Progress = None) -> list[Image.Image]:
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
            frame = typical.get(time) or picture(time)
            coded.append(frame.quantize(palette=palette, dither=Image.Dither.NONE))
            if progress is not None:
                progress(done, len(times[share]))
        return coded

    def save(self, file: File, frames: Sequence[Image.Image]) -> None:
        """Write all frames as an animated GIF; `optimize` stores only the pixels that change."""
        stays = [stay for _, stay in self.moments]
        frames[0].save(
            file, "GIF", save_all=True, append_images=frames[1:], duration=stays, loop=0, optimize=True
        )
