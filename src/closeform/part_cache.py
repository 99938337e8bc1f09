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

from closeform.kernel_cache import content_of, described, file_of, folder, keep, used
from closeform.kernel_parts import PartLibrary, reached
from closeform.own_process import is_ours

if is_ours():
    # Numba counts functions, in each process and fork alike, and to LLVM those of one name and number are the
    # same: code that is linked from another process has numbers that nobody else has.
    FunctionIdentity._unique_ids = iter(lambda: randbits(60), None)


_known: dict[bytes, PartLibrary] = {}  # by the checksums of their files


class LoadedPart(PartLibrary):
    """Code that another process has compiled, and the parts that it calls."""

    def __init__(self, codegen: Any, name: str, code: bytes, called: list[PartLibrary]) -> None:
        super().__init__(codegen, name)
        self._final_module = parse_bitcode(code)
        self._linking_libraries += called
        self._finalize_final_module()


def library_in(content: bytes, file: str, codegen: Any) -> PartLibrary | None:
    """The part in a file of some content, None if one that it calls is gone, or was compiled anew."""
    checksum = hashlib.sha256(content).digest()
    if checksum not in _known:
        name, code, calls, _ = pickle.loads(content)
        found = [library_at(place, wanted, codegen) for place, wanted in calls]
        called = [each for each in found if each is not None]
        if called != found:
            return None
        _known[checksum] = LoadedPart(codegen, name, code, called)
        _known[checksum].kept = file, checksum
    return _known[checksum]


def library_at(file: str, checksum: bytes, codegen: Any) -> PartLibrary | None:
    """The part that a file held as it had this checksum, None if it does no longer."""
    if checksum in _known:
        return _known[checksum]
    content = content_of(folder() / file)
    if content is None or hashlib.sha256(content).digest() != checksum:
        return None
    return library_in(content, file, codegen)


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
        path, codegen = self.path(signature), target.codegen()
        content = content_of(path)
        if content is None or (library := library_in(content, path.name, codegen)) is None:
            return None
        description, environment, signature = pickle.loads(pickle.loads(content)[-1])
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
        """Keep a compiled part, if the folder can be written; what it calls has files of its own."""
        description, library, path = result.fndesc, result.library, self.path(signature)
        description.typemap = description.calltypes = None  # as numba's `_reduce` has it
        called = reached(library, kept=False)
        kept = [each.kept for each in reversed(called) if getattr(each, "kept", None)]
        code = library.with_called(each for each in called if not getattr(each, "kept", None)).as_bitcode()
        told = dumps((description, result.environment, result.signature))
        checksum = keep(path, pickle.dumps((library.name, code, kept, told)))
        if checksum is not None:
            library.kept, _known[checksum] = (path.name, checksum), library


@cache
def digest(part: Any) -> str:
    """A hash of a part and of all that is compiled into it."""
    called = [value for _, value in used(part.py_func) if isinstance(value, Dispatcher) and value is not part]
    return hashlib.sha256("".join([described(part), *map(digest, called)]).encode()).hexdigest()
