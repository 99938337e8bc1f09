"""Drawing of a report's pictures in parallel processes; pictures take most of the time of a short run."""

import atexit
import os
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from importlib import import_module
from socket import socket, socketpair
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, Protocol

from closeform.report.picture import Film, Share

if TYPE_CHECKING:
    from closeform.report.picture import Progress, Shot
    from closeform.storage.result_folder import Folder

AHEAD = (  # modules for pictures of most stages; no scenario, no tables
    "closeform.plots",
    "matplotlib.backends.backend_agg",
    "closeform.conflicts.two_paths",
    "closeform.plots.fleet",
    "closeform.plots.closest",
    "closeform.plots.missions",
    "PIL.PngImagePlugin",
    "closeform.plots.space",
    "closeform.plots.timelines",
    "closeform.report.picture",
    "closeform.storage.result_folder",
    "closeform.motion.orbit",
    "closeform.plots.drifts",
    "scipy.special",  # for uncertainty; last, while the main process still reads the scenario
)
STUDIED = (*AHEAD, "closeform.plots.lockings")  # and for studies
MOST = 4  # maximum number of drawing processes: a run has about ten pictures
HELPED = 1  # processes up to which this one draws too: loading matplotlib takes as long as a few pictures
_drawers: list["Drawer"] = []


class Drawable(Protocol):
    """Picture that is written into a folder, or some frames of one."""

    @property
    def name(self) -> str:
        """The name of the file, without its extension."""
        ...

    def leave(self, folder: "Folder", progress: "Progress") -> Any:
        """Make the picture: return a `Shot`, or frames."""
        ...


class Drawer:
    """Process that draws pictures, connected by a socket."""

    def __init__(self, end: socket) -> None:
        self.stream, self.free = end.makefile("rwb"), Lock()
        end.close()  # the stream keeps the socket open

    def draw(self, picture: Drawable, folder: "Folder") -> Any:
        """Have a picture drawn and return the result; raise EOFError or OSError if the process has ended."""
        with self.free:
            pickle.dump((picture, folder), self.stream)
            self.stream.flush()
            return pickle.load(self.stream)


def begin(ahead: tuple[str, ...] = AHEAD) -> None:
    """Start processes that draw while this one computes; if none can start, this one draws everything.

    The first loads modules `ahead`, then forks once per core, so that matplotlib is loaded once.
    """
    if os.name != "posix":  # sockets cannot be passed on
        return
    forks = sys.platform == "linux"  # elsewhere the state of libraries may not survive a fork
    with suppress(OSError):
        pairs = [socketpair() for _ in range(min(os.cpu_count() or 1, MOST) if forks else 1)]
        ends = [theirs.fileno() for _, theirs in pairs]
        code = f"from closeform.report.drawing import serve; serve({ahead}, {ends})"
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", code],  # import nothing from the user's current folder
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=ends,
        )
        atexit.register(process.kill)  # its forks end when their sockets close
        for ours, theirs in pairs:
            theirs.close()
            _drawers.append(Drawer(ours))


def serve(modules: tuple[str, ...], ends: list[int]) -> None:
    """Draw the pictures that sockets request until they close, with one process per socket."""
    for ahead in modules:
        import_module(ahead)
    mine = ends[0]
    for end in ends[1:]:
        if not os.fork():
            mine = end
            break
    for end in ends:
        if end != mine:
            os.close(end)  # or the end of its process would go unnoticed
    with socket(fileno=mine).makefile("rwb") as stream:
        while True:
            picture, folder = pickle.load(stream)
            pickle.dump(picture.leave(folder, lambda text: None), stream)
            stream.flush()


def drawn(pictures: Sequence[Drawable], folder: "Folder", progress: "Progress") -> "list[Shot]":
    """Draw all pictures as files in a folder, by this process and those that `begin` started.

    This process draws an equal share of each film, which can be long and reports its progress.  It also
    draws what the others could not, so that an error is raised here, and the remaining pictures if there
    is at most one other process.
    """
    count = max(1, len(_drawers))
    films = [picture for picture in pictures if isinstance(picture, Film)]
    shares = {film.name: [Share(film, index, count) for index in range(1, count)] for film in films}
    waiting = deque[Drawable](share for each in shares.values() for share in each)  # longest first
    waiting.extend(picture for picture in pictures if not isinstance(picture, Film))
    made: dict[str, Any] = {}
    awaited = set[str]()  # films that wait for the frames of other processes

    def following() -> Drawable | None:
        with suppress(IndexError):
            return waiting.popleft()
        return None

    def tell(name: str) -> None:
        done = sum(picture.name in made or picture.name in awaited for picture in pictures)
        if done < len(pictures):
            progress(f"picture {done + 1} of {len(pictures)}: {name}")

    def ask(drawer: Drawer) -> None:
        while picture := following():
            tell(picture.name)
            try:
                made[picture.name] = drawer.draw(picture, folder)
            except Exception:
                waiting.append(picture)
                return

    others = [Thread(target=ask, args=(drawer,), daemon=True) for drawer in _drawers]
    for other in others:
        other.start()

    def draw_what_waits() -> None:
        while picture := following():
            tell(picture.name)
            made[picture.name] = picture.leave(folder, progress)

    def draw_rest() -> None:
        if len(others) <= HELPED:
            draw_what_waits()
        for other in others:
            other.join()
        draw_what_waits()

    def frames(film: Film) -> list[Any]:
        awaited.add(film.name)
        draw_rest()
        return [made.pop(share.name) for share in shares[film.name]]

    for film in films:
        tell(film.name)
        made[film.name] = film.leave(folder, progress, count, partial(frames, film))
    draw_rest()
    return [made[picture.name] for picture in pictures]
