"""The one decorator that every compiled kernel passes through."""

import hashlib
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.core.types import unliteral
from platformdirs import user_cache_path


@cache
def digest(module: str) -> str:
    """Hash of a module's source and of all that it imports from the package."""
    own = Path(__file__).parent
    source = own.joinpath(*module.split(".")[1:]).with_suffix(".py").read_bytes()
    found = hashlib.sha256(source)
    for imported in re.findall(rb"^from (closeform\.[a-z_.]+) import", source, re.MULTILINE):
        name = imported.decode()
        if own.joinpath(*name.split(".")[1:]).with_suffix(".py").is_file():
            found.update(digest(name).encode())
    return found.hexdigest()


@cache
def cache_folder(module: str) -> Path:
    """Folder of a module's compiled kernels: the user's cache, under a hash of their sources.

    numba notices an edited kernel, but not an edited kernel that it inlined from another
    file; a folder per state of the module and its imports does. Where the user's cache cannot
    be written (read-only home), a private temporary folder serves for this process.
    """
    folder = user_cache_path("closeform") / f"numba-{numba.__version__}" / digest(module)[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return temporary_folder()


@cache
def temporary_folder() -> Path:
    """A private folder for kernels of this process alone."""
    return Path(tempfile.mkdtemp(prefix="closeform-"))


@cache
def announce() -> None:
    """Say once, on standard error, that a compilation is under way."""
    print("closeform: compiling its kernels, once for this version (half a minute)", file=sys.stderr)


@cache
def is_compiled(module: str) -> bool:
    """Whether the cache held kernels of a module when it was first asked."""
    return any(cache_folder(module).rglob("*.nbi"))


@contextmanager
def own_cache(module: str) -> Iterator[None]:
    """Point numba at our folder while one kernel is declared, and back for everybody else's."""
    others = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder(module))
    try:
        yield
    finally:
        config.CACHE_DIR = others


def _by_type(part: Any) -> Any:
    """Keep numba from compiling a part anew for every literal that it is called with."""
    template = part.get_call_template

    def by_type(args: Any, kws: Any) -> Any:
        return template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})

    part.get_call_template = by_type
    return part


def kernel(signature: Any = None, inline: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function of floats and arrays.

    With a `signature` it is an entry point: compiled at import, once for a version of the
    sources, then loaded from the cache. Without, it is a part that entry points inline, and
    that only they can call: it has no wrapper for Python, which saves time to compile.  A part
    that is `inline` is written into its callers at once: only then does a loop over it become
    vector instructions.
    Every kernel releases the GIL; none is parallel inside (chunks in a thread pool are as
    fast and cannot abort); none uses fastmath (the certificates need IEEE arithmetic).
    """
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    if config.DISABLE_JIT:
        return numba.njit(**options)
    if inline:
        return numba.njit(inline="always", **options)
    if signature is None:
        return lambda function: _by_type(numba.njit(no_cpython_wrapper=True, **options)(function))

    def declare(function: Callable[..., Any]) -> Any:
        if not is_compiled(function.__module__):
            announce()
        with own_cache(function.__module__):
            return numba.njit(signature, cache=True, **options)(function)

    return declare
