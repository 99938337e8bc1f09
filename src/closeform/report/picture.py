"""Pictures of a report, drawn by parallel processes: they take most of the time of a short run."""

import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing import forkserver, get_all_start_methods, get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from closeform.storage.result_folder import Folder

Progress = Callable[[str], None]
AHEAD = (  # modules for pictures of most stages; no scenario, no tables
    "closeform.plots",
    "matplotlib.backends.backend_agg",
    "closeform.conflicts.two_paths",
    "closeform.plots.paths",
    "closeform.plots.missions",
    "PIL.PngImagePlugin",
    "closeform.report.picture",
    "closeform.storage.result_folder",
    "closeform.motion.orbit",
    "scipy.special",  # for uncertainty; last, while the main process still reads the scenario
)
STUDIED = (*AHEAD, "closeform.plots.studies")  # and for studies
MOST = 4  # maximum number of drawing processes: a run has about ten pictures
_begun: list[bool] = []  # whether `begin` was called


class Shot(NamedTuple):
    """Picture in a folder: its `file`, its `caption`, and its own text (`says`), which may be empty."""

    file: Path
    caption: str
    says: str


@dataclass(frozen=True)
class Picture:
    """Picture to be drawn: `plot` names the function of `closeform.plots` that takes the `arguments`.

    The name of a private function includes its module.
    """

    name: str
    caption: str
    plot: str
    arguments: tuple[Any, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    stage: str = ""  # written above it, in red if the stage failed
    failed: bool = False
    shows: str = ""  # written there too, if the picture shows something other than the final paths
    executed: bool = True  # if False, its title begins with "Not executed"

    @property
    def function(self) -> Callable[..., Any]:
        """The function that draws the picture."""
        from closeform import plots

        home, _, name = self.plot.rpartition(".")
        made: Callable[..., Any] = getattr(import_module(f"closeform.plots.{home}") if home else plots, name)
        return made

    def draw(self, folder: "Folder") -> Shot:
        """Draw the picture into a folder and return it."""
        from closeform.plots.drawing.style import banner, headline

        figure = self.function(*self.arguments, **self.options)
        says = figure.get_suptitle().replace("\n", " ")
        if not self.executed and says:
            says = f"Not executed: {says}"
            headline(figure, says)
        if self.stage:
            banner(figure, "; ".join(filter(None, (self.stage, self.shows))), self.failed)
        return Shot(folder.picture(self.name, figure), self.caption, says)


@dataclass(frozen=True)
class Film(Picture):
    """Animation of up to `most` spacecraft; its function writes the GIF."""

    most: int = 400  # drawn in about half a minute

    def draw(self, folder: "Folder") -> Shot:
        """Write the animation into a folder and return it."""
        file = folder.path / f"{self.name}.gif"
        first, *rest = self.arguments
        self.function(first, file, *rest, **self.options)
        return Shot(file, self.caption, "")


def begin(ahead: tuple[str, ...] = AHEAD) -> None:
    """Start a process that loads modules `ahead`, so that `drawn` can fork processes from it.

    It has no standard output or error: a reader of these need not wait for its end.
    """
    if "forkserver" not in get_all_start_methods():
        return
    forkserver.set_forkserver_preload(["__main__", *ahead])
    kept, nowhere = [os.dup(1), os.dup(2)], os.open(os.devnull, os.O_WRONLY)
    for stream, replacement in enumerate((nowhere, nowhere), 1):
        os.dup2(replacement, stream)
    forkserver.ensure_running()
    for stream, replacement in enumerate(kept, 1):
        os.dup2(replacement, stream)
    for copy in (*kept, nowhere):
        os.close(copy)
    _begun.append(True)


def drawn(pictures: Sequence[Picture], folder: "Folder", progress: Progress) -> list[Shot]:
    """Draw all pictures as files in a folder, in processes if `begin` was called, or else in this one."""
    if _begun and pictures:
        # Ctrl-C ends this process, which then ends the others
        ignored = signal.SIGINT, signal.SIG_IGN
        context, count = get_context("forkserver"), min(os.cpu_count() or 1, MOST)
        with (
            suppress(BrokenProcessPool),  # a process was killed: this one draws everything
            ProcessPoolExecutor(count, context, signal.signal, ignored) as pool,
        ):
            order = sorted(pictures, key=lambda one: not isinstance(one, Film))  # animations take longest
            futures = {one.name: pool.submit(one.draw, folder) for one in order}
            try:
                for number, future in enumerate(as_completed(futures.values()), 1):
                    future.result()
                    progress(f"picture {number} of {len(futures)}")
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
            return [futures[one.name].result() for one in pictures]
    shots = []
    for number, one in enumerate(pictures, 1):
        progress(f"picture {number} of {len(pictures)}: {one.name}")
        shots.append(one.draw(folder))
    return shots
