"""The command line. Exit status: 0 done and clear, 1 a conflict remains, 2 bad input."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

if TYPE_CHECKING:
    from rich.console import Console

    from closeform.chapters import Sheet
    from closeform.mission import Mission
    from closeform.scenario import Scenario
    from closeform.zones import Zone

WIDTH = 100  # columns of the output, on a terminal or not
CLEAR, CONFLICT, BAD_INPUT = 0, 1, 2


class UsageError(ValueError):
    """An argument that does not fit; one line with the remedy."""


def installed() -> str:
    """The version of closeform."""
    from importlib.metadata import version

    return version("closeform")


app = App(
    name="closeform",
    help="Closed-form guidance for close formation flight: certified conflicts, safe and cheap paths.",
    version=installed,
    help_format="plaintext",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    from closeform.results import FolderError

    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        status = app(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        complain(f"closeform: {one_line(error)}; see closeform --help")
        return BAD_INPUT
    except (UsageError, FolderError) as error:
        complain(str(error))
        return BAD_INPUT
    except KeyboardInterrupt:
        complain("closeform: stopped by the keyboard; nothing was written")
        return 130
    return int(status or 0)


@app.command(sort_key=0)
def run(
    scenario: Path,
    /,
    *,
    out: Path | None = None,
    case: int | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Fly a scenario: every conflict, the cheapest way around, and a folder with the results.

    Parameters
    ----------
    scenario
        TOML file; docs/scenario.md lists its keys.
    out
        Folder for the results; NAME-results next to where you are by default.
    case
        One case of the study instead of the nominal values. Not built yet.
    overwrite
        Replace finished results.
    """
    from closeform.results import check_free, folder

    place = out if out is not None else Path(f"{scenario.stem}-results")
    if case is not None:
        raise UsageError("--case: cases of a study are not built yet; leave --case out")
    check_free(place, overwrite)
    loaded = read(scenario)
    if loaded is None:
        return BAD_INPUT
    from closeform.mission import fly
    from closeform.report import leave
    from closeform.scenario import ScenarioError

    notes = stderr()
    try:
        with notes.status("flying") as status:
            mission = fly(loaded, lambda text: status.update(text))
            with folder(place, overwrite) as under_way:
                status.update("writing results")
                leave(mission, under_way)
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    tell(mission, place)
    return CLEAR if mission.clear else CONFLICT


@app.command(sort_key=1)
def check(scenario: Path, /) -> int:
    """Validate a scenario without flying it: every error at once, each with its key.

    Parameters
    ----------
    scenario
        TOML file; docs/scenario.md lists its keys.
    """
    loaded = read(scenario)
    if loaded is None:
        return BAD_INPUT
    stages = ", ".join(stage.verb for stage in loaded.stages)
    console = stdout()
    say(console, f"{scenario}: valid: {len(loaded.craft)} craft; stages: {stages}")
    for line in loaded.unbuilt():
        say(console, f"{scenario}: {line}")
    return CLEAR


@app.command(sort_key=2)
def screen(
    files: Annotated[tuple[Path, ...], Parameter(name="oem")],
    /,
    *,
    sphere: str | None = None,
    box: str | None = None,
    ellipsoid: str | None = None,
) -> int:
    """Find every conflict among real ephemerides, in the orbital frame of the first.

    Parameters
    ----------
    files
        CCSDS orbit ephemeris messages, two or more, with common epochs.
    sphere
        Keep-out zone by its radius: "20 m".
    box
        Keep-out zone by its half-widths radial, along-track, cross-track: "20 40 20 m".
    ellipsoid
        Keep-out zone by its half-axes radial, along-track, cross-track: "20 40 20 m".
    """
    zone = zone_of(sphere=sphere, box=box, ellipsoid=ellipsoid)
    if len(files) < 2:
        raise UsageError("screen: needs two ephemerides or more; name another file")
    if missing := next((file for file in files if not file.is_file()), None):
        raise UsageError(f"{missing}: no such file; check the path")
    import numpy as np

    from closeform.ccsds import common_frame, read_oem
    from closeform.chapters import encounters, nearest
    from closeform.flight import watch
    from closeform.orbit import Orbit

    try:
        frame = common_frame([read_oem(file) for file in files])
    except (ValueError, ImportError) as error:
        raise UsageError(str(error)) from None
    paths = Orbit(frame.mean_motion).sampled(frame.times, frame.states)
    pairs = np.stack(np.triu_indices(len(files), 1), axis=1)
    flight = watch(paths, frame.names, [(zone, pairs)])
    console = stdout()
    say(
        console,
        f"{len(files)} craft, {len(frame.times)} common epochs from {frame.epoch} {frame.time_system}, "
        f"{frame.times[-1] - frame.times[0]:.1f} s",
        f"Frame: radial, along-track (arc), cross-track of {frame.names[0]}, "
        f"on a circle of {frame.radius / 1e3:.3f} km",
    )
    lines, sheets = encounters("Conflicts", flight)
    say(console, *lines)
    for sheet in (*sheets, *nearest("Closest approaches", flight)):
        show(console, sheet)
    return CONFLICT if flight.encounters else CLEAR


@app.command(sort_key=3)
def study(
    scenario: Path,
    /,
    *,
    cases: int | None = None,
    seed: int | None = None,
    out: Path | None = None,
    scheduler: str | None = None,
) -> int:
    """Fly many cases of a scenario with its [study.vary] draws. Not built yet.

    Parameters
    ----------
    scenario
        TOML file with a [study] table.
    cases
        How many cases.
    seed
        Seed of the draws.
    out
        Folder for the results.
    scheduler
        Address of a Dask scheduler.
    """
    raise UsageError(f"{scenario}: study is not built yet; fly the nominal values with closeform run")


@app.command(sort_key=4)
def view(directory: Path, /) -> int:
    """Open the report that a run left in a browser.

    Parameters
    ----------
    directory
        Result folder of a run.
    """
    import webbrowser

    from closeform.results import report_of

    report = report_of(directory).resolve()
    print(report)
    webbrowser.open(report.as_uri())
    return CLEAR


def read(file: Path) -> "Scenario | None":
    """The scenario, or None after saying everything that is wrong with it."""
    from closeform.compiled import compile_ahead

    if file.is_file():
        compile_ahead()
    from closeform.scenario import ScenarioError, load

    try:
        return load(file)
    except ScenarioError as error:
        complain(*error.lines)
        return None


def zone_of(**shapes: str | None) -> "Zone":
    """The one zone that the options of `screen` describe."""
    from closeform.scenario.quantity import LENGTH, Reader
    from closeform.zones import Box, Ellipsoid, Sphere

    given = {shape: text for shape, text in shapes.items() if text is not None}
    if len(given) != 1:
        raise UsageError('screen: give one of --sphere, --box, --ellipsoid; for example --sphere "20 m"')
    shape, text = given.popitem()
    try:
        size: Any = Reader(LENGTH, 1 if shape == "sphere" else 3, "positive")(text)
    except ValueError as error:
        raise UsageError(f"--{shape}: {error}") from None
    if shape == "sphere":
        return Sphere(size)
    return Box(size) if shape == "box" else Ellipsoid(size)


def tell(mission: "Mission", place: Path) -> None:
    """Print what a run found."""
    from closeform.chapters import chapters, opening, verdict

    console = stdout()
    say(console, mission.scenario.title, opening(mission))
    for chapter in chapters(mission):
        console.print(f"\n{chapter.title}", style="bold")
        say(console, *chapter.lines)
        for sheet in chapter.sheets:
            if not sheet.more:
                show(console, sheet)
        if chapter.closing:
            say(console, "", *chapter.closing)
    say(console, "", *mission.warnings)
    console.print(f"{verdict(mission)}; results in {place}", soft_wrap=True)  # a path is not to be broken


def stdout() -> "Console":
    """Where results are printed."""
    from rich.console import Console

    return Console(width=WIDTH, highlight=False, markup=False, emoji=False)


def stderr() -> "Console":
    """Where the state of long work is shown, on a terminal only."""
    from rich.console import Console

    return Console(stderr=True, width=WIDTH, markup=False, emoji=False)


def say(console: "Console", *lines: str) -> None:
    """Print lines as they are, wrapped at the width."""
    for line in lines:
        console.print(line)


def show(console: "Console", sheet: "Sheet") -> None:
    """Print a small table: the first column to the left, numbers to the right."""
    from rich.table import Table

    table = Table(title=f"\n{sheet.title}", title_justify="left", title_style="", box=None, pad_edge=False)
    for place, column in enumerate(sheet.columns):
        table.add_column(column, justify="left" if place == 0 else "right", overflow="fold")
    for row in sheet.rows:
        table.add_row(*row)
    console.print(table)


def complain(*lines: str) -> None:
    """Say what is wrong, on standard error."""
    for line in lines:
        print(line, file=sys.stderr)


def one_line(error: object) -> str:
    """A message of several lines as one."""
    return " ".join(str(error).split()).rstrip(".")
