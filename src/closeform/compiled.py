"""The one decorator that every compiled kernel passes through."""

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.core.types import unliteral
from platformdirs import user_cache_path


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: the user's cache, under a hash of all their sources.

    numba notices an edited kernel, but not an edited kernel that it inlined from another
    file; a folder per state of the sources does. Where the user's cache cannot be written
    (read-only home), a private temporary folder serves for this process.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        text = source.read_bytes()
        if b"kernel" in text:
            digest.update(text)
    folder = user_cache_path("closeform") / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="closeform-"))


@cache
def announce() -> None:
    """Say once, on standard error, that a compilation is under way."""
    print("closeform: compiling its kernels, once for this version (half a minute)", file=sys.stderr)


@cache
def nothing_compiled() -> bool:
    """Whether this process found an empty cache."""
    return not any(cache_folder().rglob("*.nbi"))


def compile_ahead(module: str) -> None:
    """Compile the kernels of `module`'s package now if they are not cached, beside those of conflicts."""
    folder = cache_folder()
    package = module.split(".")[1]
    if any(folder.glob(f"{package}_*/*.nbi")) or user_cache_path("closeform") not in folder.parents:
        return
    announce()
    command = [sys.executable, "-c", f"import {module}"]
    other = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    import_module("closeform.conflicts")
    other.wait()


def compile_for(text: bytes) -> None:
    """Compile ahead what the stages of a scenario file will need."""
    searches = re.search(rb"^\s*\[\s*search\s*\]", text, re.MULTILINE) is not None
    moves = set(re.findall(rb'^\s*do\s*=\s*"(avoid|reconfigure|scatter|regather)"', text, re.MULTILINE))
    if searches:
        compile_ahead("closeform.search.chain")
    if moves - {b"avoid"}:
        compile_ahead("closeform.avoidance.formation")
    elif moves or not searches:
        compile_ahead("closeform.avoidance")


@contextmanager
def own_cache() -> Iterator[None]:
    """Point numba at our folder while one kernel is declared, and back for everybody else's."""
    others = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())
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
        if nothing_compiled():
            announce()
        with own_cache():
            return numba.njit(signature, cache=True, **options)(function)

    return declare
