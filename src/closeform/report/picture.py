"""Picture: what is to be drawn, and how it gets into a folder; loads little, for the process that draws."""

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
    """A picture in a folder: its `file`, its `caption`, and what it `says` in its own words, if anything."""

    file: Path
    caption: str
    says: str


@dataclass(frozen=True)
class Picture:
    """A picture to be drawn: `plot` names the function of `closeform.plots` that gets the `arguments`.

    Of one that is not public, with its module.
    """

    name: str
    caption: str
    plot: str
    arguments: tuple[Any, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    stage: str = ""  # written above it, in red where that has
    failed: bool = False
    shows: str = ""  # written there too, where it is not what is flown
    flown: bool = True  # or what it says is said to be of what is not

    def leave(self, folder: "Folder", progress: Progress) -> Shot:
        """Draw it into a folder."""
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
    """A picture that moves, of up to `most` craft; its function makes the `Reel` that is drawn."""

    most: int = 400  # drawn in a quarter of a minute

    def leave(
        self,
        folder: "Folder",
        progress: Progress,
        count: int = 1,
        others: Callable[[], list[Any]] = list,
    ) -> Shot:
        """Draw it into a folder; of a `count` of shares the first, while others draw what they then give."""
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
        """What is drawn."""
        home, _, name = self.plot.rpartition(".")
        made: Reel = getattr(import_module(f"closeform.plots.{home}"), name)(*self.arguments, **self.options)
        return made


@dataclass(frozen=True)
class Share:
    """Each of `count` frames of a film, from the one of this index on, for who puts them together."""

    film: Film
    index: int
    count: int

    @property
    def name(self) -> str:
        """Of no file."""
        return f"{self.film.name}, share {self.index}"

    def leave(self, folder: "Folder", progress: Progress) -> list[Any]:
        """Draw the frames."""
        return self.film.reel().frames(slice(self.index, None, self.count))
