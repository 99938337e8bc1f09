"""Lock files: who works at a place, for as long as that process lives, however it ends."""

import os
from contextlib import suppress
from io import BufferedWriter
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: nobody is kept out
    fcntl = None  # type: ignore[assignment]  # a module elsewhere


def lock(file: Path, wait: bool = False) -> BufferedWriter | None:
    """The open lock `file`, which is held until it is closed; None where another holds it and nobody waits.

    The system lets go of what a killed process held.  A file system that knows no locks keeps nobody
    out.  Raises OSError where the file cannot be opened.
    """
    while True:
        opened = file.open("ab")
        if fcntl is not None:
            try:
                fcntl.flock(opened, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            except BlockingIOError:
                opened.close()
                return None
            except OSError:
                return opened
        with suppress(FileNotFoundError):
            if os.path.samestat(os.stat(file), os.fstat(opened.fileno())):
                return opened
        opened.close()  # who held it has deleted it meanwhile: it keeps nobody out


def is_held(file: Path) -> bool:
    """Whether a living process holds a lock file that may not even be there."""
    if not file.is_file():
        return False
    held = lock(file)
    if held is None:
        return True
    held.close()
    return False
