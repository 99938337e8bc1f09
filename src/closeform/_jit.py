"""Compiled kernels: the one decorator, and the folder of numba's compiled code.

A kernel with a signature is called from Python.  It is compiled for that signature when it is first
called, and loaded from the user's cache afterwards.  A kernel without one is called by other
kernels only.

numba checks the file of a cached function, but not the files of the functions that it calls.  Each kernel
therefore has its own folder, named by a hash of all its code and constants: an edited kernel, or an edited
part of it, has another folder.  Within the folder numba itself distinguishes its own versions and processors.
"""

import gc
import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, wait
from contextlib import contextmanager
from functools import cache, cached_property
from importlib import import_module
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from pkgutil import walk_packages
from shutil import rmtree
from threading import RLock
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import types
from numba.extending import register_jitable, typeof_impl
from platformdirs import user_cache_path

# No fastmath: the certificates need IEEE arithmetic.  Not parallel: callers share chunks out to threads.  No
# wrappers for C: nobody calls kernels from C, and each takes a seventh of the time to compile its function.
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Sub-packages that define kernels.
SUB_PACKAGES = (
    "motion",
    "zones",
    "conflicts",
    "fuel",
    "safety",
    "uncertainty",
    "planning",
    "search",
    "dynamics",
)
Progress = Callable[[str], None]
PROGRESS_INTERVAL = 1.0  # [s] between looks at which kernels are compiled

_compiling = RLock()  # numba's cache folder is one setting for all threads
_announced: list[bool] = []
_KERNELS: list["Kernel"] = []  # of all modules that were imported


def cache_folder() -> Path:
    """Return the folder of all compiled kernels."""
    return user_cache_path("closeform") / "kernels"


class Kernel:
    """Compiled function with a fixed signature.

    Arrays that are read-only, such as memory maps, are copied: a compiled function has one form.
    """

    def __init__(self, function: Callable[..., Any], signature: Any) -> None:
        self.py_func, self.signature = function, signature
        self.__name__, self.__doc__ = function.__name__, function.__doc__
        self.__module__ = function.__module__
        _KERNELS.append(self)

    @property
    def name(self) -> str:
        """Module and function, without the package."""
        return f"{self.__module__.removeprefix('closeform.')}.{self.__name__}"

    @cached_property
    def folder(self) -> Path:
        """Folder in the cache, named by all that the kernel is made of."""
        file = self.py_func.__code__.co_filename
        stamp = file, Path(file).stat().st_mtime_ns  # numba compiles again for another file, or a newer one
        versions = numba.__version__, llvmlite.__version__, sys.version_info
        made_of = [repr((versions, OPTIONS, self.signature, stamp)), _loans()]
        made_of += sorted(_sources(self.py_func, {}).values())
        return cache_folder() / f"{self.name}-{hashlib.sha256(''.join(made_of).encode()).hexdigest()[:20]}"

    @property
    def is_cached(self) -> bool:
        """True if it need not be compiled, on this processor or one like it."""
        return any(self.folder.glob("**/*.nbc"))

    @cached_property
    def dispatcher(self) -> Any:
        """Function of numba, compiled or loaded."""
        with _compiling:
            if "dispatcher" in vars(self):  # meanwhile, by another thread
                return vars(self)["dispatcher"]
            if not self.is_cached:
                _announce(self)
            with _caching_in(self.folder):
                try:
                    return numba.njit(self.signature, cache=True, **OPTIONS)(self.py_func)
                except Exception:  # the cache cannot be read or written; an error of compilation comes again
                    rmtree(self.folder, ignore_errors=True)
                return numba.njit(self.signature, **OPTIONS)(self.py_func)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        try:
            return self.dispatcher(*arguments)
        except TypeError:
            writeable = _writeable(arguments)
            if writeable is arguments:
                raise
        return self.dispatcher(*writeable)


@typeof_impl.register(Kernel)
def _typeof_kernel(kernel: Kernel, context: Any) -> Any:
    """Return numba's type of a kernel, so that kernels can call it."""
    return types.Dispatcher(kernel.dispatcher)


def kernel(signature: Any = None, inline: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function of numbers and arrays.

    Parameters
    ----------
    signature
        numba's types of result and arguments, for a kernel that is called from Python. Its arrays
        are written to only if the caller has just made them.
    inline
        Copy the function into its callers. LLVM turns a loop over it into vector instructions only then.
        It also saves seconds for a function with one caller and large callees: LLVM optimises every function
        together with all that it calls.
    """
    if numba.config.DISABLE_JIT:
        return lambda function: function
    if signature is not None:
        return lambda function: Kernel(function, signature)
    if inline:
        return numba.njit(inline="always", **OPTIONS)
    return register_jitable(**OPTIONS)


def kernel_modules() -> list[str]:
    """Return the names, without the package, of all modules that may define kernels."""
    package = import_module("closeform")
    names = (found.name.partition(".")[2] for found in walk_packages(package.__path__, "closeform."))
    return [name for name in names if name.partition(".")[0] in SUB_PACKAGES]


def kernels_of(modules: Iterable[str]) -> list[Kernel]:
    """Return the kernels that modules of the package define."""
    names = {import_module(f"closeform.{module}").__name__ for module in modules}
    return [one for one in _KERNELS if one.__module__ in names]


def compile_ahead(modules: Iterable[str], progress: Progress) -> int:
    """Compile the kernels of modules that are not in the cache, on all cores.

    One process compiles all kernels of a sub-package: they share parts, which it compiles once.

    Parameters
    ----------
    modules
        Names without the package.
    progress
        Called with a line of text before and after each kernel.

    Returns
    -------
    int
        Number of compiled kernels.
    """
    missing = [one for one in kernels_of(modules) if not one.is_cached]
    if not missing:
        return 0
    _announced.append(True)
    progress(f"compiling {len(missing)} kernels, once for this version")
    groups: dict[str, list[Kernel]] = {}
    for one in missing:
        groups.setdefault(one.name.partition(".")[0], []).append(one)
    with ProcessPoolExecutor(min(len(groups), cpu_count() or 1), mp_context=get_context("spawn")) as pool:
        largest_first = sorted(groups.values(), key=_parts, reverse=True)
        running = {
            pool.submit(_compile, [(one.__module__, one.__name__) for one in group])
            for group in largest_first
        }
        left = missing
        while left:
            ended, running = wait(running, timeout=PROGRESS_INTERVAL)
            for future in ended:
                future.result()
            compiled = [one for one in left if not running or one.is_cached]
            left = [one for one in left if one not in compiled]
            if compiled:
                done = len(missing) - len(left)
                progress(f"compiled {done} of {len(missing)} kernels ({compiled[-1].name})")
    return len(missing)


def _parts(kernels: list[Kernel]) -> int:
    """Return the number of functions that kernels are made of, as a measure of the time to compile them."""
    found: dict[str, str] = {}
    for one in kernels:
        _sources(one.py_func, found)
    return len(found)


def _compile(kernels: list[tuple[str, str]]) -> None:
    """Compile kernels, given by module and name, in a process of their own, for its cache."""
    _announced.append(True)  # by the process that waits
    gc.disable()  # numba makes millions of objects, which live as long as this process
    for module, name in kernels:
        getattr(import_module(module), name).dispatcher  # noqa: B018  # compiles


@cache
def _loans() -> str:
    """Return the source of the extensions to numba that any kernel may use."""
    return Path(__file__).with_name("kernel_loans.py").read_text(encoding="utf-8")


def _announce(one: Kernel) -> None:
    """Announce once on standard error that kernels are compiled."""
    if not _announced:
        print(
            f"closeform: compiling {one.name}, once for this version; closeform compile prepares all kernels",
            file=sys.stderr,
        )
        _announced.append(True)


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """Have numba cache functions in a folder, if it can be written."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def _sources(function: Any, found: dict[str, str]) -> dict[str, str]:
    """Return the code and constants of a function and of all that it calls in its package, by name."""
    place = f"{function.__module__}.{function.__qualname__}"
    if place in found:
        return found
    codes, texts, package = [function.__code__], [place], function.__module__.partition(".")[0]
    values = {**function.__globals__, **_closed_over(function)}
    found[place] = ""
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
        constants = [c for c in code.co_consts if not isinstance(c, CodeType) and c != function.__doc__]
        texts.append(repr((code.co_code, constants, code.co_names, code.co_varnames)))
        for name in {*code.co_names, *code.co_freevars} & values.keys():
            value = values[name]
            called = getattr(value, "py_func", value)
            if isinstance(called, FunctionType) and called.__module__.partition(".")[0] == package:
                _sources(called, found)
                texts.append(f"{name}: {called.__module__}.{called.__qualname__}")
            elif callable(value) or isinstance(value, ModuleType):
                texts.append(f"{name}: {getattr(value, '__name__', value)} {getattr(value, '_fields', '')}")
            else:
                texts.append(f"{name}: {value!r}")
    found[place] = "\n".join(sorted(texts))
    return found


def _closed_over(function: Any) -> dict[str, Any]:
    cells = function.__closure__ or ()
    return dict(zip(function.__code__.co_freevars, (cell.cell_contents for cell in cells), strict=True))


def _writeable(argument: Any) -> Any:
    """Return an array or a tuple of arrays without read-only arrays; the same object if there were none."""
    if isinstance(argument, np.ndarray):
        return argument if argument.flags.writeable else argument.copy()
    if isinstance(argument, tuple):
        parts = [_writeable(part) for part in argument]
        if any(new is not old for new, old in zip(parts, argument, strict=True)):
            return type(argument)(*parts) if hasattr(argument, "_fields") else tuple(parts)
    return argument
