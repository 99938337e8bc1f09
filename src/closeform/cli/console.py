"""Console output: results on standard output, progress and error messages on standard error."""

import codecs
import io
import os
import re
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unicodedata import normalize

if TYPE_CHECKING:
    from rich.console import Console

    from closeform.report.description import Table
    from closeform.report.page import CommandReport
    from closeform.report.run import RunReport
    from closeform.report.study import StudyReport

WIDTH = 100  # columns of a terminal's output
# control characters except tabs and line ends; the last ranges change the writing direction
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
NO_BREAK = "\N{NO-BREAK SPACE}"
EVERY = 30.0  # [s] between progress lines without a terminal
UNBROKEN = 100_000  # columns without a terminal, so that no line is wrapped for programs and files


class OutputError(Exception):
    """Failure to write to standard output: its reader is gone (`closed`), or its disk is full."""

    def __init__(self, error: OSError) -> None:
        self.closed = isinstance(error, BrokenPipeError)
        super().__init__(f"standard output: {(error.strerror or str(error)).lower()}")


class Output(io.TextIOWrapper):
    """Standard output whose failures raise OutputError, which separates them from those of other files."""

    def write(self, text: str) -> int:
        try:
            return super().write(text)
        except OSError as error:
            raise OutputError(error) from error

    def flush(self) -> None:
        try:
            super().flush()
        except OSError as error:
            raise OutputError(error) from error


def open_output() -> None:
    """Set up standard output and standard error so that every character can be encoded.

    Failures to write to standard output then raise OutputError.
    """
    codecs.register_error("closeform", spelt)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # closed by the parent process
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="closeform")
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.__stdout__ is not None:
        out = sys.stdout
        sys.stdout = Output(out.buffer, out.encoding, "closeform", line_buffering=out.line_buffering)


def spelt(error: UnicodeError) -> tuple[str | bytes, int]:
    """Return the replacement of characters that an encoding lacks, and the position after them.

    Plain characters are used where they exist (2 for a superscript 2), and otherwise escape sequences.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    plain = normalize("NFKD", lacking).encode("ascii", "ignore").decode()
    return plain or codecs.backslashreplace_errors(error)[0], error.end


def discard_output() -> None:
    """Redirect a standard output that cannot be written, so that no later write fails."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def stdout() -> "Console":
    """Return the console for results."""
    from rich.console import Console

    width = WIDTH if sys.stdout.isatty() else UNBROKEN
    return Console(width=width, highlight=False, markup=False, emoji=False)


def stderr() -> "Console":
    """Return the console for progress, which is shown on a terminal only."""
    from rich.console import Console

    return Console(stderr=True, width=WIDTH, markup=False, emoji=False)


@contextmanager
def working(console: "Console", what: str) -> "Iterator[Callable[[str], None]]":
    """Yield a function that shows the current part of a long computation.

    On a terminal, the text is updated at once; otherwise a line is printed every `EVERY` seconds.
    """
    if console.is_terminal:
        with console.status(what) as status:
            yield lambda text: status.update(visible(text))
        return
    under_way, over, begun = [what], threading.Event(), time.monotonic()

    def tell() -> None:
        while not over.wait(EVERY):
            complain(f"{under_way[-1]}, {time.monotonic() - begun:.0f} s so far")

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield under_way.append
    finally:
        over.set()
        teller.join()


@contextmanager
def progress(console: "Console", total: int) -> "Iterator[Callable[[int, int], None]]":
    """Yield a function of the number of completed cases and of those that meet all requirements.

    On a terminal, it shows a bar with the rate and the remaining time.  Otherwise it prints a line every
    `EVERY` seconds.
    """
    if not console.is_terminal:
        yield Lines(total).tell
        return
    from rich import progress as rich

    class Rate(rich.ProgressColumn):
        """Cases per second."""

        def render(self, task: rich.Task) -> str:
            return f"{task.speed:,.0f}/s" if task.speed else ""

    unmet = rich.TextColumn("{task.fields[unmet]:,} not met")
    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), Rate(), rich.TimeRemainingColumn(), unmet)
    with rich.Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("cases", total=total, unmet=0)
        yield lambda done, met: bar.update(task, completed=done, unmet=done - met)


class Lines:
    """Progress lines on standard error for a `total` number of cases."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.begun: int | None = None
        self.start = self.reported = time.monotonic()

    def tell(self, done: int, met: int) -> None:
        """Print the progress, the rate and the remaining time, if a line is due."""
        now = time.monotonic()
        self.begun = done if self.begun is None else self.begun  # cases of an interrupted study
        if now - self.reported < EVERY or done <= self.begun:
            return
        self.reported, rate = now, (done - self.begun) / (now - self.start)
        left = f"{(self.total - done) / rate:,.0f} s left"
        complain(f"{done:,} of {self.total:,} cases, {rate:,.0f}/s, {left}, {done - met:,} not met")


def say(console: "Console", *lines: str) -> None:
    """Print lines without control characters; on a terminal, wrap them at `WIDTH`."""
    for line in lines:
        put(console, line)


def put(console: "Console", text: str, **how: Any) -> None:
    """Print a text with its control characters escaped, so that a terminal does not execute them."""
    console.print(visible(text), **how)


def visible(text: str) -> str:
    """Return a text with control characters and marks of writing direction as escape sequences."""
    return CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def show(console: "Console", shown: "Table") -> None:
    """Print a small table with words aligned left and numbers aligned right."""
    from rich.table import Table

    say(console, "", *[shown.title] * bool(shown.title))
    table = Table(box=None, pad_edge=False)
    texts = [[column.heading or "" for column in shown.shown], *shown.texts]
    widths = [max(len(text) for text in column) for column in zip(*texts, strict=True)]
    full = sum(widths) + 2 * (len(widths) - 1) > console.width
    kept = [k for k, column in enumerate(shown.shown) if not (full and column.spare)]
    for column in (shown.shown[k] for k in kept):
        table.add_column(column.heading or "", justify="left" if column.words else "right", overflow="fold")
    for row in texts[1:]:
        table.add_row(*(visible(row[k]) for k in kept))
    console.print(table)


def wrapped(text: str) -> list[str]:
    """Return the lines of a text, indented after the first and without a break between quotation marks."""
    whole = re.sub('"[^"]*"', lambda quoted: quoted[0].replace(" ", NO_BREAK), text)
    return [line.replace(NO_BREAK, " ") for line in textwrap.wrap(whole, WIDTH, subsequent_indent="  ")]


def print_report(report: "RunReport | CommandReport | StudyReport", place: Path) -> None:
    """Print the sections of a report, its warnings, hints and verdict, and the place of its results."""
    console = stdout()
    for section in report.printed:
        if section.title:
            put(console, f"\n{section.title}", style="bold")
        say(console, *section.lines)
        for table in section.tables:
            if not table.folded:
                show(console, table)
        if section.closing:
            say(console, "", *section.closing)
    say(console, "", *(f"Warning: {line}" for line in report.printed_warnings))
    for line in report.hint:
        put(console, line, soft_wrap=True)
    end = f"{report.verdict}; results in {place}"
    if len(end) > WIDTH and report.wraps:
        say(console, *wrapped(str(report.verdict)))
        end = f"results in {place}"
    put(console, end, soft_wrap=True)  # do not break a path


@contextmanager
def kept(place: Path) -> Iterator[None]:
    """Make Ctrl-C report the place of published results, which it does not remove."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"results in {place}") from None


def complain(*lines: str) -> None:
    """Print lines on standard error, if it can be written."""
    with suppress(OSError):
        for line in lines:
            print(visible(line), file=sys.stderr, flush=True)


def one_line(error: object) -> str:
    """Return a message of several lines as one line without a final full stop."""
    return " ".join(str(error).split()).rstrip(" .,")
