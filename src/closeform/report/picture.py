"""Picture: what is to be drawn, and how it gets into a folder; loads little, for the process that draws."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

if TYPE_CHECKING:
    from closeform.result_folder import Folder

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
    moves: ClassVar[bool] = False

    def leave(self, folder: "Folder", progress: Progress) -> Shot:
        """Draw it into a folder."""
        from closeform import plots
        from closeform.plots.look import banner

        home, _, name = self.plot.rpartition(".")
        drawn = import_module(f"closeform.plots.{home}") if home else plots
        figure = getattr(drawn, name)(*self.arguments, **self.options)
        if self.stage:
            banner(figure, "; ".join(filter(None, (self.stage, self.shows))), self.failed)
        return Shot(folder.picture(self.name, figure), self.caption, figure.get_suptitle())


@dataclass(frozen=True)
class Film(Picture):
    """A picture that moves; its function writes the file itself, of up to `most` craft."""

    most: int = 400  # drawn in a quarter of a minute
    moves: ClassVar[bool] = True

    def leave(self, folder: "Folder", progress: Progress) -> Shot:
        from closeform import plots

        def told(done: int, frames: int) -> None:
            progress(f"animation: picture {done} of {frames}")

        file = folder.path / f"{self.name}.gif"
        getattr(plots, self.plot)(*self.arguments, file, progress=told, **self.options)
        return Shot(file, self.caption, "")
