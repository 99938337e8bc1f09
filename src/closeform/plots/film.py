"""A gathering as an animation."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import IO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from closeform.plots.camera import GROUP_COLOURS, SUN_COLOUR
from closeform.plots.formation import ThreeViews
from closeform.plots.look import FAINT, INK, OTHER
from closeform.plots.panels import FEW, STYLES
from closeform.search.gather_result import EventKind, Gathering

WIDE, NARROW = 900, 720  # pixels across, for few and for many craft: many moving lines fill a file
COLOURS = 64
FIRM = ["#ffffff", INK, OTHER, FAINT, SUN_COLOUR, *GROUP_COLOURS.values()]
FIRM += [face for _, _, face in STYLES.values() if face not in ("white", INK)]
PLAY, HOLD, LAST = 80, 1200, 3000  # ms that a frame stays: in motion, at a lock, at the end
STOPS = 12_000  # ms for the locks together


def animation(
    gathering: Gathering,
    file: str | PathLike[str] | IO[bytes],
    craft: int = 0,
    names: Sequence[str] | None = None,
    *,
    frames: int = 150,
    progress: Callable[[int, int], object] | None = None,
) -> None:
    """Write a gathering in three views as an animated GIF to a `file`: what H03's simulation showed.

    The views are those of `three_views`, with the same `craft` and `names`.  `frames` are spread
    evenly over the gathering's time [s], with one more at each lock, where the film stops for a
    moment, as it does at the end.  `progress` is called with the frames done and all frames.

    Raises ValueError for fewer than two frames, a craft that is not there, or names that are not
    as many as the craft.
    """
    if frames < 2:
        raise ValueError(f"frames: must be at least 2, got {frames!r}")
    views = ThreeViews(gathering, craft, names)
    pixels = WIDE if len(gathering.groups) <= FEW else NARROW
    views.figure.set_dpi(pixels / views.figure.get_size_inches()[0])
    canvas = FigureCanvasAgg(views.figure)
    views.show(0.0)
    for artist in views.artists:
        artist.set_animated(True)  # leaves it out of what is drawn once
    canvas.draw()
    still = canvas.copy_from_bbox(views.figure.bbox)

    def picture(time: float) -> Image.Image:
        canvas.restore_region(still)
        views.show(time)
        for artist in views.artists:
            (artist.axes or views.figure).draw_artist(artist)
        return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())

    times, stays = schedule(gathering, frames)
    palette = common_palette([picture(time) for time in times[:: max(1, len(times) // 5)]])
    coded = []
    for done, time in enumerate(times, start=1):
        coded.append(picture(time).quantize(palette=palette, dither=Image.Dither.NONE))
        if progress is not None:
            progress(done, len(times))
    coded[0].save(file, "GIF", save_all=True, append_images=coded[1:], duration=stays, loop=0, optimize=False)


def schedule(gathering: Gathering, frames: int) -> tuple[list[float], list[int]]:
    """Times [s] of the frames, and how long each stays [ms]."""
    locks = np.unique([event.time for event in gathering.events if event.kind == EventKind.LOCK])
    times = np.unique(np.concatenate([np.linspace(0.0, gathering.duration, frames), locks]))
    stop = min(HOLD, STOPS // max(1, len(locks)) // 10 * 10)
    stays = np.where(np.isin(times, locks), max(stop, PLAY), PLAY)
    stays[-1] = LAST
    return times.tolist(), stays.tolist()


def common_palette(pictures: list[Image.Image]) -> Image.Image:
    """One palette for all frames, so that what stands still stays the same.

    The colours of the look are in it as they are; the others are those of most use for the shades
    that occur, each counted once, since most of a frame is white.
    """
    chosen = [tuple(int(one[k : k + 2], 16) for k in (1, 3, 5)) for one in FIRM]
    packed = [np.asarray(one).astype(np.uint32) @ np.array([1, 256, 65536], np.uint32) for one in pictures]
    shades = np.unique(np.concatenate(packed, axis=None))[:, None] >> np.array([0, 8, 16], np.uint32) & 255
    room = COLOURS - len(FIRM)
    cut = Image.fromarray(shades[None].astype(np.uint8)).quantize(room, Image.Quantize.MEDIANCUT)
    rest = (cut.getpalette() or [])[: 3 * room]
    common = Image.new("P", (1, 1))
    common.putpalette([part for colour in chosen for part in colour] + rest)
    return common
