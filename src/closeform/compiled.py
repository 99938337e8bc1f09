"""The one decorator that every compiled kernel passes through."""

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import numba
from numba.core import config
from numba.core.types import Array, BaseTuple, unliteral

from closeform.kernel_cache import KernelCache, alone, is_under_way, parts
from closeform.kernel_parts import EntryCompiler, PartCompiler
from closeform.own_process import is_ours, with_room
from closeform.part_cache import PartCache

_announced: list[bool] = []
ENTRIES: list[Any] = []  # the entry points of all modules that were imported
before_first_compilation: list[Callable[[], None]] = []  # called when a kernel is found missing
meanwhile: list[Callable[[Callable[[], bool]], None]] = []  # called to wait for one, until it is there
_waiting = Lock()


def announce(damaged: str = "") -> None:
    """Say on standard error that a compilation is under way, once, however many are needed."""
    if _announced:
        return
    _announced.append(True)
    print(
        damaged or "closeform: compiling the kernels that this needs, once (some ten seconds)",
        file=sys.stderr,
    )
    for begin in before_first_compilation:
        begin()


@contextmanager
def uncollected() -> Iterator[None]:
    """No search for unreachable objects: a compiler makes millions, and it costs a tenth of its time.

    Nor afterwards among those that it left, in a process of our own.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if is_ours():
            gc.freeze()
        if was_on:
            gc.enable()


def use_the_wait(ended: Callable[[], bool]) -> None:
    """Do what there is to do meanwhile, if this is not done in such a wait itself."""
    if _waiting.acquire(blocking=False):
        try:
            for work in meanwhile:
                work(ended)
        finally:
            _waiting.release()


def prepare(entry: Any, wait: bool = True) -> None:
    """Load an entry point from the cache or compile it; nobody else does meanwhile.

    One that another process is compiling is left to it, if not to `wait`.
    """
    cached = entry._cache
    if entry.overloads or not isinstance(cached, KernelCache):
        return
    for part in parts(entry)[1:]:  # an entry point can be part of another
        prepare(part)
    here = cached.lock.locked()  # another thread has it
    if wait and _announced and not here and is_under_way(cached.path):
        use_the_wait(cached.path.exists)
    with cached.lock:
        if entry.overloads:
            return
        if cached.is_whole():
            entry.compile(cached.signature)
        else:
            announce(f"closeform: {cached.path} is damaged; compiling it anew" * cached.damaged)
            with alone(cached.path, wait) as mine, uncollected():
                if not mine:
                    return
                with_room(entry.compile, cached.signature)


def _writeable(kind: Any) -> Any:
    """A type with arrays that may be written to, in it or in what it holds."""
    if isinstance(kind, Array):
        return kind.copy(readonly=False)
    if isinstance(kind, BaseTuple):
        return BaseTuple.from_types([*map(_writeable, kind)], getattr(kind, "instance_class", None))
    return kind


def _match(entry: Any) -> Callable[..., Any]:
    """What numba asks for the compiled form that fits arguments of types it has not yet met.

    There is one form, and it serves read-only arrays too (of memory maps, joblib, pandas): kernels
    write only to arrays that their callers have just made, never to what a user hands over.
    """
    served: set[Any] = set()

    def match(*arguments: Any) -> Any:
        prepare(entry)
        ((declared, result),) = entry.overloads.items()
        given = tuple(entry.typeof_pyval(argument) for argument in arguments)
        convert = entry.typingctx.can_convert
        if len(given) != len(declared) or None in map(convert, map(_writeable, given), declared):
            raise TypeError(f"{entry.__name__}: takes {declared}, got {given}")
        with entry._cache.lock:
            if given not in {declared, *served}:  # the next time numba finds it by itself
                entry._insert([kind._code for kind in given], result.entry_point)
                served.add(given)
        return result.entry_point

    return match


def _part(part: Any) -> Any:
    """Keep numba from compiling a part anew for every literal that it is called with.

    Nor what another process of ours has compiled: libraries leave parts to who imports them.
    """
    if is_ours():
        part._cache = PartCache(part)
    template = part.get_call_template

    def by_type(args: Any, kws: Any) -> Any:
        return template([unliteral(a) for a in args], {k: unliteral(a) for k, a in kws.items()})

    part.get_call_template = by_type
    return part


def kernel(signature: Any = None, inline: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function of floats and arrays.

    With a `signature` it is an entry point: compiled at its first call, once for a version of the
    sources, then loaded from the cache. Without, it is a part that entry points inline, and
    that only they can call: it has no wrapper for Python, which saves time to compile.  A part
    that is `inline` is written into its callers at once: only then does a loop over it become
    vector instructions.
    Every kernel releases the GIL; none is parallel inside (chunks in a thread pool are as
    fast and cannot abort); none uses fastmath (the certificates need IEEE arithmetic).
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    if config.DISABLE_JIT:
        return numba.njit(**options)
    if inline:
        return numba.njit(inline="always", **options)
    if signature is None:
        options |= {"no_cpython_wrapper": True, "pipeline_class": PartCompiler}
        return lambda function: _part(numba.njit(**options)(function))

    def declare(function: Callable[..., Any]) -> Any:
        entry = numba.njit(**options, pipeline_class=EntryCompiler)(function)
        entry._cache = KernelCache(entry, signature)
        entry._compile_for_args = _match(entry)
        ENTRIES.append(entry)
        return entry

    return declare
