"""Section: all that a report has to say of one stage, for the terminal, the page and the files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from closeform.mission_result import StageResult
from closeform.report.table import Table
from closeform.result_folder import Folder

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Picture:
    """A picture to be drawn: `plot` names the function of `closeform.plots` that gets the `arguments`."""

    name: str
    caption: str
    plot: str
    arguments: tuple[Any, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    stage: str = ""  # written above it, in red where that has
    failed: bool = False
    moves: ClassVar[bool] = False

    def leave(self, folder: Folder, progress: Progress) -> Path:
        """Draw it into a folder."""
        from closeform import plots
        from closeform.plots.look import banner

        figure = getattr(plots, self.plot)(*self.arguments, **self.options)
        if self.stage:
            banner(figure, self.stage, self.failed)
        return folder.picture(self.name, figure)


@dataclass(frozen=True)
class Film(Picture):
    """A picture that moves; its function writes the file itself, of up to `most` craft."""

    most: int = 400  # drawn in a quarter of a minute
    moves: ClassVar[bool] = True

    def leave(self, folder: Folder, progress: Progress) -> Path:
        from closeform import plots

        def told(done: int, frames: int) -> None:
            progress(f"animation: picture {done} of {frames}")

        file = folder.path / f"{self.name}.gif"
        getattr(plots, self.plot)(*self.arguments, file, progress=told, **self.options)
        return file


@dataclass(frozen=True)
class Section:
    """A stage: `lines`, the `tables` that are shown, `closing` lines and `pictures`.

    `figures` go into `summary.json`; the rows of `files` into the Parquet file of that name, below
    those of other stages.
    """

    title: str
    lines: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    closing: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, Table] = field(default_factory=dict)


def not_filmed(pictures: Sequence[Picture], count: int) -> tuple[str, ...]:
    """That there is no film, since there are too many craft."""
    films = [picture for picture in pictures if isinstance(picture, Film) and picture.most < count]
    return tuple(
        f"Animation left out: {count} craft, and more than {film.most} are not shown" for film in films
    )


def called(result: StageResult[Any, Any]) -> str:
    """Which stage that is, and what is done in it."""
    named = f' "{result.stage.name}"' if result.stage.name else ""
    return f"Stage {result.number}{named}: {result.stage.verb}"


def heading(result: StageResult[Any, Any], who: str = "") -> str:
    """The title of a stage; `who` moves."""
    moving = f", {who}" if who else ""
    return f"{called(result)}{moving}, {result.start:.1f} s to {result.end:.1f} s"


def fate(result: StageResult[Any, Any]) -> str:
    """Which stage a picture is of, and what has become of it where it failed."""
    if result.failure is None:
        return called(result)
    shown = "" if result.flown else "; these are the direct paths, which are not flown"
    return f"{called(result)} failed: {result.failure.split(':')[0]}{shown}"
