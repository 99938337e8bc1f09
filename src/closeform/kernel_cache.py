"""Compiled kernels on disk: one file for each entry point, named by all that it is made from."""

import hashlib
import inspect
import os
import pickle
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from types import CodeType, ModuleType
from typing import Any

import llvmlite
import numba
from llvmlite.binding import parse_bitcode
from numba.core import types
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.dispatcher import Dispatcher
from numba.core.extending import _Intrinsic
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from platformdirs import user_cache_path

from closeform.lock_file import lock

UNUSED = 30 * 86400.0  # [s] that a compiled kernel is kept without being used
# Modules that write LLVM code, and say what numba leaves out.
MAKERS = tuple(f"closeform.kernel_{noun}" for noun in ("calls", "loans", "parts", "variables", "writing"))
CHECKSUM = 32  # bytes at the start of a file: without it garbage would reach the unpickler


def folder() -> Path:
    """Where compiled kernels lie: the user's cache."""
    return user_cache_path("closeform") / "kernels"


class KernelCache(NullCache):
    """The compiled form of one entry point, kept where numba's own cache would be too careful.

    numba notices an edited kernel, but not an edited part that it was compiled with; and it asks
    for the same file at the same place.  Here the name of a file says all that the machine code
    depends on, so equal kernels share it wherever their sources lie, and nothing else does.
    """

    def __init__(self, entry: Any, signature: Any) -> None:
        self.entry, self.signature = entry, signature
        self.lock = Lock()  # one thread prepares the entry point
        self.damaged = False  # at the last look

    @cached_property
    def path(self) -> Path:
        """The file of the compiled kernel, by a hash of all that it is made from."""
        return file_of(self.entry, self.signature, "".join(map(described, parts(self.entry))))

    def is_whole(self) -> bool:
        """Whether the compiled kernel can be loaded; what is damaged goes, and is compiled anew."""
        self.damaged = False
        try:
            content = self.path.read_bytes()
        except FileNotFoundError:
            return False
        except OSError:
            content = b""
        self.damaged = not intact(content)
        if self.damaged:
            with suppress(OSError):
                shutil.rmtree(self.path) if self.path.is_dir() else self.path.unlink()
        return not self.damaged

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled kernel, None if there is none, or none that is whole."""
        content = content_of(self.path)
        if content is None:
            return None
        rtsys.initialize(target)  # numba's cache registers all that a compiler needs: 0.3 s
        return loaded(target, pickle.loads(content))

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep a compiled kernel, if the folder can be written."""
        keep(self.path, dumps(result._reduce()))
        with suppress(OSError):
            drop_unused()


class LoadedLibrary(JITCodeLibrary):
    """Machine code from a file.

    What other kernels link of it, its code for LLVM, is read when one does: half of the time to load.
    """

    def __init__(self, codegen: Any, serialized: Any) -> None:
        name, _, (machine_code, self.code) = serialized
        super().__init__(codegen, name)
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()

    def _get_module_for_linking(self) -> Any:
        self._shared_module: Any = self._shared_module or parse_bitcode(self.code)
        return self._shared_module

    def get_pointer_to_function(self, name: str) -> int:
        """The address of what can be called; numba looks first whether the code for LLVM has it."""
        address: int = self._codegen._engine.get_function_address(name)
        return address


def loaded(target: Any, made: tuple[Any, ...]) -> Any:
    """A compiled kernel, as `CompileResult._rebuild` makes it from what its `_reduce` gave."""
    serialized, described, environment, signature, object_mode, lifted, _, reload_init, environments = made
    for begin in reload_init:
        begin()
    library = LoadedLibrary(target.codegen(), serialized)
    entry_point = target.get_executable(library, described, environment)
    for each in environments:
        library.codegen.set_env(each.env_name, each)
    return compile_result(
        target_context=target,
        typing_context=target.typing_context,
        library=library,
        environment=environment,
        entry_point=entry_point,
        fndesc=described,
        signature=signature,
        objectmode=object_mode,
        lifted=lifted,
        reload_init=reload_init,
        referenced_envs=environments,
    )


def file_of(function: Any, signature: Any, made_from: str) -> Path:
    """Where a function lies that is compiled for a signature, or for types of arguments."""
    made = hashlib.sha256(processor(function.targetctx.codegen()).encode())
    versions = numba.__version__, llvmlite.__version__, sys.implementation.cache_tag
    made.update(repr((versions, signature, makers())).encode())
    made.update("".join(map(type_text, getattr(signature, "args", signature))).encode())
    made.update(made_from.encode())
    name = f"{function.py_func.__module__}.{function.py_func.__name__}"
    return folder() / f"{name.removeprefix('closeform.')}-{made.hexdigest()[:20]}"


@cache
def processor(codegen: Any) -> str:
    """What machine code is written for."""
    return repr(codegen.magic_tuple())


def content_of(path: Path) -> bytes | None:
    """What is kept in a file, None if it is not there or not whole; it is used, and stays another month."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if not intact(content):
        return None
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > UNUSED / 10:
            os.utime(path)
    return content[CHECKSUM:]


def keep(path: Path, data: bytes) -> bytes | None:
    """Write a file that is whole, or none; returns its checksum."""
    written, checksum = path.with_name(f"{path.name}.{os.getpid()}"), hashlib.sha256(data).digest()
    with suppress(OSError):
        try:
            written.write_bytes(checksum + data)
            written.replace(path)
            return checksum
        finally:
            written.unlink(missing_ok=True)
    return None


def intact(content: bytes) -> bool:
    """Whether a file is as it was written."""
    return hashlib.sha256(content[CHECKSUM:]).digest() == content[:CHECKSUM]


def drop_unused() -> None:
    """Delete what no process has used for a month; who wants it meanwhile compiles it again."""
    for file in folder().iterdir():
        with suppress(OSError):
            if time.time() - file.stat().st_mtime > UNUSED:
                file.unlink()


@contextmanager
def alone(path: Path, wait: bool = True) -> Iterator[bool]:
    """Hold the right to compile a kernel, against other processes; False without, if not to `wait`.

    Where the folder cannot be written, or knows no locks, everybody compiles for themselves.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        held = lock(path.with_name(f"{path.name}.lock"), wait)
    except OSError:
        yield True
        return
    yield held is not None
    if held is not None:
        held.close()


def is_under_way(path: Path) -> bool:
    """Whether somebody else compiles a kernel."""
    with alone(path, wait=False) as mine:
        return not mine


def parts(entry: Any) -> list[Any]:
    """An entry point and all that is compiled into it, in an order that its code fixes."""
    found: dict[Any, None] = {}
    to_do = [entry]
    while to_do:
        part = to_do.pop()
        if part not in found:
            found[part] = None
            to_do += [value for _, value in used(part.py_func) if isinstance(value, Dispatcher)]
    return list(found)


def used(function: Any) -> list[tuple[str, Any]]:
    """What a kernel takes from its module or from a function around it, by name."""
    names: list[str] = []
    codes = [function.__code__]
    while codes:
        code = codes.pop()
        names += code.co_names
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    closed = inspect.getclosurevars(function).nonlocals if function.__closure__ else {}
    given = function.__globals__ | closed
    return [(name, given[name]) for name in (*names, *closed) if name in given]


def described(part: Any) -> str:
    """A text that differs wherever two parts can compile to different code."""
    function = part.py_func
    taken = [(name, value) for name, value in used(function) if not isinstance(value, Dispatcher)]
    return "\n".join(
        [
            f"{function.__module__} {part.targetoptions} {function.__defaults__}",  # a file names modules
            code_text(function.__code__, function.__doc__),
            *(f"{name} = {constant_text(function, name, value)}" for name, value in taken),
        ]
    )


@cache
def makers() -> tuple[str, ...]:
    """What the modules say that kernels are made by, which no kernel names as a part of it."""
    specs: list[Any] = [find_spec(name) for name in MAKERS]
    return tuple(code_text(spec.loader.get_code(spec.name), None) for spec in specs)


def type_text(kind: types.Type) -> str:
    """A type with the names of its fields, and the module where a file that is read looks for it.

    Of a named tuple numba's own text has the values' types only, of one that is lent its name.
    """
    kind = getattr(kind, "of", kind)
    inner = "".join(map(type_text, getattr(kind, "types", ())))
    place = getattr(getattr(kind, "instance_class", None), "__module__", "")
    return f"{kind!r} {place} {getattr(kind, 'fields', '')} {inner}"


def code_text(code: CodeType, doc: str | None) -> str:
    """Bytecode and what it refers to; neither comments, docstrings nor numbers of lines."""
    constants = [
        code_text(c, None) if isinstance(c, CodeType) else repr(c) for c in code.co_consts if c != doc
    ]
    return repr((code.co_name, code.co_argcount, code.co_code, constants, code.co_names, code.co_varnames))


def constant_text(function: Any, name: str, value: Any) -> str:
    """What a kernel makes of a global: a number, a type, or something of math or NumPy."""
    if isinstance(value, (bool, int, float, str, tuple, types.Type)):
        return repr(value)
    if isinstance(value, ModuleType) and not value.__name__.startswith("closeform"):
        return value.__name__
    if isinstance(value, _Intrinsic):  # writes LLVM code itself
        return code_text(value._defn.__code__, None)
    if callable(value) and hasattr(value, "__name__"):
        return f"{value.__module__}.{value.__name__} {getattr(value, '_fields', '')}"
    raise TypeError(f"{function.__qualname__}: {name} is a {type(value).__name__}; a kernel takes numbers")
