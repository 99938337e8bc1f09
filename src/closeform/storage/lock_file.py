"""Lock files: mark a folder as in use for as long as the process that holds the lock runs."""

import os
from contextlib import suppress
from io import BufferedWriter
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no flock: other processes are not excluded
    fcntl = None  # type: ignore[assignment]  # a module elsewhere


def lock(file: Path, wait: bool = False) -> BufferedWriter | None:
    """Return the open lock `file`, held until it is closed, or None if another process holds it.

    With `wait`, block until the lock is free. The operating system releases the lock of a process that was
    killed. A file system without locks excludes no other process. Raises OSError if the file cannot be
    opened.
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
        opened.close()  # the previous holder deleted the file meanwhile, so this lock is void


def is_held(file: Path) -> bool:
    """Return True if a running process holds the lock `file`, which need not exist."""
    if not file.is_file():
        return False
    held = lock(file)
    if held is None:
        return True
    held.close()
    return False
