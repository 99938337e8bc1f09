"""Compiled parts on disk: what one process has compiled of a kernel, others that compile need not."""

import hashlib
import pickle
from functools import cache
from pathlib import Path
from secrets import randbits
from typing import Any

from llvmlite.binding import parse_bitcode
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import NullCache
from numba.core.compiler import compile_result
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from closeform.kernel_cache import content_of, described, file_of, keep, used
from closeform.kernel_parts import PartLibrary
from closeform.own_process import is_ours

if is_ours():
    # Numba counts functions, in each process and fork alike, and to LLVM those of one name and number are the
    # same: code that is linked from another process has numbers that nobody else has.
    FunctionIdentity._unique_ids = iter(lambda: randbits(60), None)


class LoadedPart(PartLibrary):
    """Code that another process has compiled."""

    def __init__(self, codegen: Any, name: str, code: bytes) -> None:
        super().__init__(codegen, name)
        self._final_module = self._shared_module = parse_bitcode(code)
        self._finalize_final_module()


class PartCache(NullCache):
    """Code for LLVM of one part, a file for all types of arguments that it is called with."""

    def __init__(self, part: Any) -> None:
        self.part = part
        self.path = cache(self.file)

    def file(self, args: Any) -> Path:
        """Where the part lies, compiled for types of arguments, by a hash of all that it is made from."""
        return file_of(self.part, args, digest(self.part))

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The compiled part, None if there is none, or none that is whole."""
        content = content_of(self.path(signature))
        if content is None:
            return None
        name, code, description, environment, signature = pickle.loads(content)
        library = LoadedPart(target.codegen(), name, code)
        return compile_result(
            target_context=target,
            typing_context=target.typing_context,
            library=library,
            environment=environment,
            entry_point=target.get_executable(library, description, environment),
            fndesc=description,
            signature=signature,
            objectmode=False,
            lifted=(),
            reload_init=(),
        )

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep a compiled part, if the folder can be written."""
        description, library = result.fndesc, result.library
        description.typemap = description.calltypes = None  # as numba's `_reduce` has it
        code = library._get_module_for_linking().as_bitcode()
        keep(
            self.path(signature),
            dumps((library.name, code, description, result.environment, result.signature)),
        )


@cache
def digest(part: Any) -> str:
    """A hash of a part and of all that is compiled into it."""
    called = [value for _, value in used(part.py_func) if isinstance(value, Dispatcher) and value is not part]
    return hashlib.sha256("".join([described(part), *map(digest, called)]).encode()).hexdigest()
