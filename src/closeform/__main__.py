"""Entry point of `python -m closeform` and of the command `closeform`, which Ctrl-C stops at any moment."""

import gc
import signal
import sys
from _thread import interrupt_main
from threading import Timer
from typing import Any

AGAIN = 0.05  # [s] after which a lost Ctrl-C is repeated


_stops: list[int] = []  # Ctrl-C so far: some libraries replace its KeyboardInterrupt by another error


def stop(number: int, frame: Any) -> None:
    """Handle Ctrl-C."""
    _stops.append(number)
    raise KeyboardInterrupt


def main() -> int:
    """Run the command line in a process of its own; return the exit status."""
    complain = sys.unraisablehook

    def unheard(lost: Any) -> None:
        """Repeat a Ctrl-C that is lost in a callback, for example of a compiler."""
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
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process is about to end
        gc.freeze()  # avoids garbage collection of a million objects: half a second


if __name__ == "__main__":
    sys.exit(main())
