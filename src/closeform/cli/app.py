"""Command line. Exit status: 0 done and clear, 1 a clearance or a limit is not met, 2 bad input."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from closeform.cli.console import (
    WIDTH,
    OutputError,
    complain,
    discard_output,
    kept,
    one_line,
    open_output,
    print_report,
    say,
    stderr,
    stdout,
    working,
)
from closeform.cli.inputs import BAD_INPUT, CLEAR, UsageError, one_case, read
from closeform.cli.screen import encounter, export, screen
from closeform.cli.simulate import simulate
from closeform.cli.study import study

if TYPE_CHECKING:
    from closeform.report.picture import Shot
    from closeform.storage.result_folder import Folder

NOT_PRINTED, INTERRUPTED, NOBODY_READS = 74, 130, 141  # EX_IOERR of sysexits.h; 128 + SIGINT, + SIGPIPE


def installed() -> str:
    """Return the installed version of closeform."""
    from importlib.metadata import version

    return version("closeform")


app = App(
    name="closeform",
    help="Guidance for spacecraft in close formation: search, certified conflicts, optimal avoidance.",
    version=installed,
    help_format="plaintext",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status; `arguments` default to those of the process."""
    from closeform.storage.result_folder import FolderError

    tokens = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if arguments is None:
            open_output()
        check_folder()
        if arguments is None:
            make_haste(tokens)
        status = app(tokens, exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except CycloptsError as error:
        named = " ".join(("closeform", *(error.command_chain or ())))
        summary, listed, _ = one_line(error).partition("Available commands: ")  # cyclopts lists only eight
        every = ", ".join(name for name in app if not name.startswith("-")) if listed else ""
        complain(f"closeform: {summary}{listed}{every}; see {named} --help")
        return BAD_INPUT
    except (UsageError, FolderError) as error:
        complain(str(error))
        return BAD_INPUT
    except OutputError as error:
        discard_output()
        if error.closed:
            return NOBODY_READS
        complain(f"closeform: {error}")
        return NOT_PRINTED
    except KeyboardInterrupt as error:
        complain(f"closeform: stopped by the keyboard; {str(error) or 'nothing was written'}")
        return INTERRUPTED
    return int(status or 0)


def check_folder() -> None:
    """Raise UsageError if the current folder was deleted, because relative paths are then invalid."""
    try:
        os.getcwd()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise UsageError(f"closeform: the current folder: {reason}; change to another folder") from None


def make_haste(tokens: list[str]) -> None:
    """Set environment variables for help and matplotlib, and start drawing processes early if needed.

    `tokens` are the arguments of a command that runs in its own process.
    """
    if not sys.stdout.isatty():
        os.environ.setdefault("COLUMNS", str(WIDTH))  # width of help, which otherwise is 80 in a pipe
    os.environ["MPLBACKEND"] = "agg"  # matplotlib does not load with an unknown backend
    if (
        tokens[:1] in (["run"], ["simulate"], ["screen"], ["encounter"], ["study"])
        and (os.cpu_count() or 1) > 1
    ):
        from closeform.report import picture

        picture.begin(picture.STUDIED if tokens[0] == "study" else picture.AHEAD)


@app.command(sort_key=0)
def run(
    scenario: Path,
    /,
    *,
    out: Path | None = None,
    case: int | None = None,
    point: int | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    no_viewer: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Plan and evaluate the stages of a scenario, and write a result folder.

    Parameters
    ----------
    scenario
        TOML file; docs/scenario_keys.md lists its keys.
    out
        Folder for the results. Default: NAME-results in the current folder.
    case
        Number of one case of the study, from 0, instead of the nominal values.
    point
        Number of one point of the study's sweep, from 0.
    overwrite
        Replace finished results.
    no_viewer
        Omit viewer.html, the animated page.
    """
    from closeform.storage.publishing import check_free, folder
    from closeform.storage.result_folder import WORST_FLIGHT, written

    name = scenario.stem
    for what, number in (("point", point), ("case", case)):
        name += "" if number is None else f"-{what}-{number}"
    place = out if out is not None else Path(f"{name}-results")
    check_free(place, overwrite)
    loaded = read(scenario, "run" if case is None else "run --case")
    if loaded is not None:
        loaded = one_case(loaded, case, point)
    if loaded is None:
        return BAD_INPUT
    from closeform.mission.mission import plan_mission
    from closeform.report.run import RunReport
    from closeform.scenario import ScenarioError

    def viewer(under_way: "Folder", pictures: "Sequence[Shot]") -> None:
        from closeform.viewer import page  # loads matplotlib while the other process draws
        from closeform.viewer.shown import Shown

        page.write(Shown.of_mission(mission), under_way, pictures)
        if report.flights is not None:
            page.write(Shown.of_simulations(report.flights), under_way, pictures, WORST_FLIGHT)

    notes = stderr()
    try:
        with working(notes, "planning") as tell, folder(place, overwrite) as under_way:
            mission = plan_mission(loaded, tell)
            report = RunReport(mission)
            with written(place):
                report.write(under_way, tell, None if no_viewer else viewer, out)
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    with kept(place):
        print_report(report, place)
    return mission.verdict.status


@app.command(sort_key=1)
def check(scenario: Path, /) -> int:
    """Validate a scenario without running it; report its errors with their keys.

    Parameters
    ----------
    scenario
        TOML file; docs/scenario_keys.md lists its keys.
    """
    loaded = read(scenario, "check")
    if loaded is None:
        return BAD_INPUT
    stages = ", ".join(stage.verb for stage in loaded.stages)
    summary = f"{len(loaded.craft)} craft; stages: {stages}"
    commands = ("study", "run --case", "run") if loaded.study is not None else ("run",)
    refused = {command: lines for command in commands if (lines := loaded.refused(command))}
    if commands[0] not in refused:
        from closeform.mission.mission import stops

        held = stops(loaded) if "run" not in refused else ()
        if held and loaded.study is None:
            say(stdout(), f"{scenario}: the tables are valid, but a run would stop: {summary}")
            complain(*(f"{scenario}: {line}" for line in held))
            return BAD_INPUT
        say(stdout(), f"{scenario}: valid: {summary}")
        for lines in (*refused.values(), *([held] if held else [])):
            say(stdout(), f"{scenario}: for run: {lines[0]}")
        return CLEAR
    others = [command for command in commands if command not in refused]
    taken = f"; use {others[0]}" if others else ""
    say(stdout(), f"{scenario}: the tables are valid, but not for {' and '.join(refused)}{taken}: {summary}")
    complain(*(f"{scenario}: {line}" for line in refused[commands[0]]))
    return BAD_INPUT


app.command(simulate, name="simulate", sort_key=1)
app.command(screen, sort_key=2)
app.command(encounter, sort_key=2)


app.command(study, sort_key=3)


@app.command(sort_key=4)
def view(
    directory: Path,
    /,
    *,
    report: Annotated[bool, Parameter(negative="")] = False,
    serve: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Open the animated page of a run in a browser, or the report of a study.

    Parameters
    ----------
    directory
        Result folder of a run, or of a study.
    report
        Open the report of a run instead.
    serve
        Serve the folder at a local address until Ctrl-C, for browsers that do not open local files.
    """
    import webbrowser

    from closeform.storage.publishing import settle
    from closeform.storage.result_folder import page_of

    settle(directory)
    page = page_of(directory, report).resolve()
    if not serve:
        print(page)
        webbrowser.open(page.as_uri())
        return CLEAR
    from contextlib import suppress
    from functools import partial
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

    handler = partial(SimpleHTTPRequestHandler, directory=page.parent)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        address = f"http://127.0.0.1:{server.server_port}/{page.name}"
        print(f"{address} (Ctrl-C ends it)", flush=True)
        webbrowser.open(address)
        with suppress(KeyboardInterrupt):
            server.serve_forever()
    return CLEAR


@app.command(sort_key=5)
def new(name: str | None = None, /) -> int:
    """Write an example scenario as NAME.toml in the current folder; without a name, list the examples.

    Parameters
    ----------
    name
        Name of the example.
    """
    from closeform.cli import example_files as examples

    known = examples.names()
    if name is None:
        width = max(map(len, known))
        say(stdout(), *(f"{one:{width}}  {examples.title(one)}" for one in known))
        return CLEAR
    if name not in known:
        from difflib import get_close_matches

        near = "".join(f"; did you mean {one}?" for one in get_close_matches(name, known, 1))
        raise UsageError(f"new: there is no example {name!r}{near or '; closeform new lists them'}")
    file = Path(f"{name}.toml")
    try:
        with open(file, "x", encoding="utf-8") as written:
            written.write(examples.text(name))
    except FileExistsError:
        raise UsageError(f"{file}: already exists and is not overwritten; move or rename it") from None
    except OSError as error:
        raise UsageError(f"{file}: {(error.strerror or str(error)).lower()}; choose another folder") from None
    verb = "study" if examples.studied(name) else "run"
    say(stdout(), f"{file}: {examples.title(name)}", f"Run it with: closeform {verb} {file}")
    return CLEAR


@app.command(sort_key=6)
def completion(shell: Literal["bash", "zsh", "fish"], /) -> int:
    """Print a script with which a shell completes commands, options and files.

    Parameters
    ----------
    shell
        Name of the shell.
    """
    print(app.generate_completion(shell=shell))
    return CLEAR


@app.command(name="compile", sort_key=6)
def compile_kernels() -> int:
    """Compile all kernels now, for this version and this processor; later commands load them."""
    from closeform._jit import compile_ahead, kernel_modules

    compiled = compile_ahead(kernel_modules(), complain)
    say(stdout(), f"{compiled} kernels compiled" if compiled else "All kernels are compiled already")
    return CLEAR


app.command(export, sort_key=4)


@app.command(name="flight-vectors", sort_key=6)
def flight_vectors(directory: Path, /) -> int:
    """Write golden vectors for the flight core in C99, made by this package: docs/on_board.md.

    Parameters
    ----------
    directory
        Folder for golden_vectors.h; it is created if need be.
    """
    from closeform.flight.vectors import write

    try:
        file = write(directory)
    except OSError as error:
        raise UsageError(
            f"{directory}: {(error.strerror or str(error)).lower()}; choose another folder"
        ) from None
    say(stdout(), f"{file}: golden vectors for flight/tests/golden.c")
    return CLEAR
