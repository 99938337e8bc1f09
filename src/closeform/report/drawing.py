"""Drawing: the pictures of a report, side by side in two processes; they are most of a short run."""

import atexit
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from threading import Lock, Thread
from typing import TYPE_CHECKING, NamedTuple, Protocol

from closeform import own_process

if TYPE_CHECKING:
    from closeform.report.picture import Progress, Shot
    from closeform.result_folder import Folder

AHEAD = (  # what pictures of most stages need; no scenario, no tables
    "matplotlib.backends.backend_agg",
    "closeform.conflicts.two_paths",
    "closeform.plots.fleet",
    "closeform.plots.closest",
    "closeform.plots.png",
    "closeform.report.picture",
    "closeform.result_folder",
)
_seconds: list["Second"] = []  # at most one


class Drawable(Protocol):
    """What leaves a file in a folder: a picture, or a page of a case."""

    @property
    def name(self) -> str:
        """Of the file."""
        ...

    @property
    def moves(self) -> bool:
        """Whether it takes long."""
        ...

    def leave(self, folder: "Folder", progress: "Progress") -> "Shot":
        """Make it."""
        ...


class Share(NamedTuple):
    """What the second process has to do with a command: modules that it loads `ahead`.

    This one draws as well once the second has worked `alone` [s]: longer than matplotlib takes to load.
    """

    ahead: tuple[str, ...]
    alone: float


DRAWN = Share(AHEAD, 0.0)  # of a run, which has many pictures, and has loaded matplotlib for its viewer
STUDIED = Share((*AHEAD, "closeform.plots.lockings", "closeform.mission", "closeform.viewer.page"), 1.0)


class Second:
    """A second process that draws; it loads matplotlib while this one flies."""

    def __init__(self, share: Share) -> None:
        self.alone, self.free = share.alone, Lock()
        code = f"from closeform.report.drawing import serve; serve({share.ahead})"
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", code],  # nothing from the folder where the user stands
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(self.process.kill)

    def draw(self, picture: Drawable, folder: "Folder") -> "Shot":
        """Have a picture drawn. Raises EOFError or OSError where the process could not, and is gone."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        with self.free:
            pickle.dump((picture, folder), self.process.stdin)
            self.process.stdin.flush()
            shot: Shot = pickle.load(self.process.stdout)
        return shot


def begin(share: Share = DRAWN) -> None:
    """Start the second process, ahead of the first picture; where there can be none, this one draws all."""
    with suppress(OSError):
        _seconds.append(Second(share))


def serve(modules: tuple[str, ...]) -> None:
    """Draw what standard input asks for, as long as it does: the second process."""
    answers, sys.stdout = sys.stdout.buffer, sys.stderr
    own_process.begin()
    own_process.import_numba()
    for ahead in modules:
        import_module(ahead)
    while True:
        picture, folder = pickle.load(sys.stdin.buffer)
        pickle.dump(picture.leave(folder, lambda text: None), answers)
        answers.flush()


def begun(pictures: Sequence[Drawable], folder: "Folder") -> "Callable[[Progress], list[Shot]]":
    """Pictures that become files in a folder, by the second process at once; who is called finishes them.

    This process then draws from the front, films first; the second, if there is one, from the back.
    What it cannot draw is drawn here, where an error is heard.
    """
    waiting = deque(sorted(pictures, key=lambda picture: not picture.moves))
    shots: dict[str, Shot] = {}

    def ask(second: Second) -> None:
        while waiting and not waiting[-1].moves:
            picture = waiting.pop()
            try:
                shots[picture.name] = second.draw(picture, folder)
            except Exception:
                waiting.append(picture)
                return

    others = [Thread(target=ask, args=(second,), daemon=True) for second in _seconds]
    for other in others:
        other.start()

    def finish(progress: "Progress") -> "list[Shot]":
        for other, second in zip(others, _seconds, strict=True):
            other.join(second.alone)
        while True:
            while waiting:
                picture = waiting.popleft()
                progress(f"picture {len(pictures) - len(waiting)} of {len(pictures)}")
                shots[picture.name] = picture.leave(folder, progress)
            for other in others:
                other.join()
            if not waiting:
                return [shots[picture.name] for picture in pictures]

    return finish


def drawn(pictures: Sequence[Drawable], folder: "Folder", progress: "Progress") -> "list[Shot]":
    """All pictures as files in a folder."""
    return begun(pictures, folder)(progress)
