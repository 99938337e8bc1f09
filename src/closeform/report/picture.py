"""Pictures of a report, drawn by parallel processes: they take most of the time of a short run."""

import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing import forkserver, get_all_start_methods, get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from closeform.plots.drawing.moving import Reel
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
    def made(self) -> Any:
        """The figure, or the `Reel` of an animation."""
        from closeform import plots

        home, _, name = self.plot.rpartition(".")
        drawn = import_module(f"closeform.plots.{home}") if home else plots
        return getattr(drawn, name)(*self.arguments, **self.options)

    def draw(self, folder: "Folder") -> Shot:
        """Draw the picture into a folder and return it."""
        from closeform.plots.drawing.style import banner, headline

        figure = self.made
        says = figure.get_suptitle().replace("\n", " ")
        if not self.executed and says:
            says = f"Not executed: {says}"
            headline(figure, says)
        if self.stage:
            banner(figure, "; ".join(filter(None, (self.stage, self.shows))), self.failed)
        return Shot(folder.picture(self.name, figure), self.caption, says)


@dataclass(frozen=True)
class Film(Picture):
    """Animation of up to `most` spacecraft; its function returns the `Reel` to be drawn."""

    most: int = 400  # drawn in about 15 s

    def frames(
        self, first: int = 0, step: int = 1, progress: Callable[[int, int], object] | None = None
    ) -> list[Any]:
        """Draw every `step`-th frame from the `first` one; `progress` gets the numbers done and in all."""
        reel: Reel = self.made
        return reel.frames(slice(first, None, step), progress)

    def save(self, folder: "Folder", shares: Sequence[list[Any]]) -> Shot:
        """Save the animation from shares of its frames."""
        reel: Reel = self.made
        frames: list[Any] = [None] * len(reel.moments)
        for first, share in enumerate(shares):
            frames[first :: len(shares)] = share
        file = folder.path / f"{self.name}.gif"
        reel.save(file, frames)
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
    """Draw all pictures as files in a folder, in processes if `begin` was called, or else in this one.

    The frames of an animation are shared among the processes.
    """
    if _begun and pictures:
        # Ctrl-C ends this process, which then ends the others
        ignored = signal.SIGINT, signal.SIG_IGN
        context, count = get_context("forkserver"), min(os.cpu_count() or 1, MOST)
        pool = ProcessPoolExecutor(count, context, signal.signal, ignored)
        with suppress(BrokenProcessPool), pool:  # a process was killed: this one draws everything
            return drawn_by(pool, pictures, folder, progress)

    def filmed(done: int, count: int) -> None:
        progress(f"animation: picture {done} of {count}")

    shots = []
    for number, one in enumerate(pictures, 1):
        progress(f"picture {number} of {len(pictures)}: {one.name}")
        if isinstance(one, Film):
            shots.append(one.save(folder, [one.frames(progress=filmed)]))
        else:
            shots.append(one.draw(folder))
    return shots


def drawn_by(
    pool: ProcessPoolExecutor, pictures: Sequence[Picture], folder: "Folder", progress: Progress
) -> list[Shot]:
    """Draw all pictures in the processes of a pool, animations first."""
    asked: dict[Future[Any], str] = {}

    def ask(name: str, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future = pool.submit(work, *arguments)
        asked[future] = name
        return future

    shares = {
        one.name: [ask(one.name, one.frames, first, MOST) for first in range(MOST)]
        for one in pictures
        if isinstance(one, Film)
    }
    single = {one.name: ask(one.name, one.draw, folder) for one in pictures if one.name not in shares}
    try:
        for number, future in enumerate(as_completed(asked), 1):
            future.result()
            progress(f"picture {number} of {len(asked)}: {asked[future]}")
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    return [
        one.save(folder, [share.result() for share in shares[one.name]])
        if isinstance(one, Film)
        else single[one.name].result()
        for one in pictures
    ]
