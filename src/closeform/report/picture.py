"""Pictures to be drawn and written into a folder; this module loads little, for the drawing processes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from closeform.plots.reel import Reel
    from closeform.storage.result_folder import Folder

Progress = Callable[[str], None]


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
    flown: bool = True  # if False, its title begins with "Not flown"

    def leave(self, folder: "Folder", progress: Progress) -> Shot:
        """Draw the picture into a folder and return it."""
        from closeform import plots
        from closeform.plots.style import banner, headline

        home, _, name = self.plot.rpartition(".")
        drawn = import_module(f"closeform.plots.{home}") if home else plots
        figure = getattr(drawn, name)(*self.arguments, **self.options)
        if not self.flown and (words := figure.get_suptitle()):
            headline(figure, f"Not flown: {words}")
        if self.stage:
            banner(figure, "; ".join(filter(None, (self.stage, self.shows))), self.failed)
        return Shot(folder.picture(self.name, figure), self.caption, figure.get_suptitle())


@dataclass(frozen=True)
class Film(Picture):
    """Animation of up to `most` spacecraft; its function returns the `Reel` to be drawn."""

    most: int = 400  # drawn in about 15 s

    def leave(
        self,
        folder: "Folder",
        progress: Progress,
        count: int = 1,
        others: Callable[[], list[Any]] = list,
    ) -> Shot:
        """Save the animation from the first of `count` shares of frames and those that `others` returns."""
        reel = self.reel()
        frames: list[Any] = [None] * len(reel.moments)

        def told(done: int, share: int) -> None:
            progress(f"animation: picture {done * len(frames) // share} of {len(frames)}")

        for k, drawn in enumerate([reel.frames(slice(0, None, count), told), *others()]):
            frames[k::count] = drawn
        file = folder.path / f"{self.name}.gif"
        reel.save(file, frames)
        return Shot(file, self.caption, "")

    def reel(self) -> "Reel":
        """Return the reel of the animation."""
        home, _, name = self.plot.rpartition(".")
        made: Reel = getattr(import_module(f"closeform.plots.{home}"), name)(*self.arguments, **self.options)
        return made


@dataclass(frozen=True)
class Share:
    """Share of a film's frames: every `count`-th frame from `index` on, to be combined with the others."""

    film: Film
    index: int
    count: int

    @property
    def name(self) -> str:
        """The name of the share, for progress messages only."""
        return f"{self.film.name}, share {self.index}"

    def leave(self, folder: "Folder", progress: Progress) -> list[Any]:
        """Draw the frames of the share."""
        return self.film.reel().frames(slice(self.index, None, self.count))
