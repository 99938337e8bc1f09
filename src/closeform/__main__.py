"""`python -m closeform` and the command `closeform`: the command line, which Ctrl-C ends at any moment."""

import gc
import signal
import sys
from _thread import interrupt_main
from threading import Timer
from typing import Any

AGAIN = 0.05  # [s] after which a Ctrl-C that was lost is repeated


_stops: list[int] = []  # Ctrl-C so far: some libraries make another error of the one that it raises


def stop(number: int, frame: Any) -> None:
    """What Ctrl-C does."""
    _stops.append(number)
    raise KeyboardInterrupt


def main() -> int:
    """Run the command line in a process of its own; returns the exit status."""
    complain = sys.unraisablehook

    def unheard(lost: Any) -> None:
        """A Ctrl-C in a callback, of a compiler say, is not lost: it comes again."""
        if issubclass(lost.exc_type, KeyboardInterrupt):
            Timer(AGAIN, interrupt_main).start()
        else:
            complain(lost)

    sys.unraisablehook = unheard
    signal.signal(signal.SIGINT, stop)
    try:
        from closeform.cli.app import main as obey

        return obey()
    except BaseException:
        if not _stops:
            raise
        print("closeform: stopped by the keyboard; nothing was written", file=sys.stderr)
        return 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is left is to end
        gc.freeze()  # without a search for garbage among a million objects: half a second


if __name__ == "__main__":
    sys.exit(main())
