"""Build and load the flight core: C99 sources in `flight/` of a clone, or in the installed package.

The public header is the only declaration of the interface: cffi reads it, so that no structure is described
twice.  The library is compiled with the user's C compiler and kept in the user's cache, under a name made of
its sources.
"""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from platformdirs import user_cache_path

from closeform.arrays import Floats

PACKAGE = Path(__file__).parent
OPTIONS = ["-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-shared"]
BUDGET = 100_000  # evaluations of a first call; each that continues it has twice as many


def source_folder() -> Path:
    """Return the folder of the C sources: inside an installed package, or next to `src` in a clone."""
    packed = PACKAGE / "c"
    return packed if packed.is_dir() else PACKAGE.parents[2] / "flight"


def compiler() -> list[str] | None:
    """Return the command of the C compiler: the variable CC, else cc, gcc or clang; None if there is none."""
    given = shlex.split(os.environ.get("CC", ""))
    for command in [given] if given else [["cc"], ["gcc"], ["clang"]]:
        if shutil.which(command[0]):
            return command
    return None


def build() -> Path:
    """Compile the flight core, unless that has been done already.

    The other functions of this package do so at their first call, which takes a second or two.

    Returns
    -------
    path-like
        The shared library, in the user's cache.

    Raises
    ------
    RuntimeError
        If there is no C compiler, or if it fails.

    References
    ----------
    docs/on_board.md.
    """
    folder = source_folder()
    sources = sorted(folder.glob("src/*.c"))
    command = compiler()
    if command is None:
        raise RuntimeError("flight: requires a C compiler; install gcc or clang, or set CC to its command")
    made_of = [*sources, *sorted(folder.glob("src/*.h")), *sorted(folder.glob("include/*.h"))]
    text = b"".join(file.read_bytes() for file in made_of) + " ".join([*command, *OPTIONS]).encode()
    library = user_cache_path("closeform") / f"flight-{hashlib.sha256(text).hexdigest()[:20]}.so"
    if not library.exists():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as place:
            made = Path(place) / library.name
            files = [f"-I{folder / 'include'}", *map(str, sources), "-o", str(made), "-lm"]
            done = subprocess.run([*command, *OPTIONS, *files], capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"flight: {command[0]} failed: {done.stderr.strip()}")
            os.replace(made, library)
    return library


def declarations() -> str:
    """Return the declarations of the public header without its lines for the preprocessor and for C++."""
    header = (source_folder() / "include" / "closeform_flight.h").read_text(encoding="utf-8")
    for name, number in re.findall(r"^#define (CFF_\w+) \(?(-?\d+)U?\)?\s", header, re.MULTILINE):
        header = re.sub(rf"\b{name}\b(?=[^[\n]*\])", number, header)  # in the length of an array
    header = re.sub(r"^#ifdef __cplusplus\n.*\n#endif$", "", header, flags=re.MULTILINE)
    return re.sub(r"^#.*$", "", header, flags=re.MULTILINE)


class Core(NamedTuple):
    """The loaded library and its types, both by cffi."""

    types: Any
    functions: Any


@cache
def core() -> Core:
    """Return the flight core, compiled if need be; raise RuntimeError if that is not possible."""
    try:
        from cffi import FFI
    except ImportError:
        raise RuntimeError("flight: requires cffi; pip install 'closeform[flight]'") from None
    types = FFI()
    types.cdef(declarations())
    return Core(types, types.dlopen(str(build())))


MEMORY: WeakKeyDictionary[Any, tuple[Any, ...]] = WeakKeyDictionary()  # memory that structures in C point at


def pointing(structure: Any, *memory: Any) -> Any:
    """Return a structure after making it keep alive the memory that it points at."""
    MEMORY[structure] = memory
    return structure


def filled(kind: str, values: Any) -> Any:
    """Return a structure of doubles, or an array of such, with given numbers."""
    types = core().types
    numbers = np.ascontiguousarray(values, dtype=float)
    many = (numbers.size * numbers.itemsize // types.sizeof(kind[:-2]),) if kind.endswith("[]") else ()
    made = types.new(kind, *many)
    types.buffer(made)[:] = numbers.tobytes()
    return made


def doubles(structure: Any) -> Floats:
    """Return a copy of the numbers of a structure of doubles, (K,)."""
    return np.frombuffer(bytes(core().types.buffer(structure)), dtype=float).copy()


def check(status: int, *done: str) -> str:
    """Return the name of a status without its prefix; raise ValueError unless it is OK or in `done`."""
    types = core().types
    name = str(types.string(types.cast("cff_status_t", status))).removeprefix("CFF_")
    if name not in ("OK", *done):
        raise ValueError(
            f"the flight core rejects this input ({name}); docs/on_board.md lists supported inputs"
        )
    return name


def complete(call: Callable[[int], int]) -> None:
    """Call a function of the flight core, given a budget of evaluations, until its answer is complete."""
    budget = BUDGET
    while check(call(budget), "MORE", "FULL") != "OK":
        budget = min(2 * budget, 2**32 - 1)
