"""Parts of kernels: compiled only as far as those that they are part of need."""

from collections.abc import Iterable
from typing import Any

from llvmlite.binding import Linkage
from numba.core import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import IRLegalization

# What numba looks for in a function, and parts have none of: closures and functions made inside,
# `with`, exceptions made at run time, arguments that are None, tuples of several types, array
# expressions.  Each look goes through all of the code, and reckons anew where variables end.
NOT_LOOKED_FOR = (
    *("InlineClosureLikes", "MakeFunctionToJitFunction", "WithLifting", "RewriteDynamicRaises"),
    *("RewriteSemanticConstants", "DeadBranchPrune", "FindLiterallyCalls", "LiteralUnroll"),
    *("LiteralPropagationSubPipelinePass", "InlineOverloads", "NopythonRewrites"),
)


class PartLibrary(JITCodeLibrary):
    """Code that is linked into entry points, which LLVM optimises and turns into machine code there.

    numba would do both for each part too, with all that it calls in turn: a quarter of the time
    that kernels take to compile, for machine code that nobody calls.
    """

    kept: tuple[str, bytes] | None = None  # name and checksum of the file that it is in

    @property
    def codegen(self) -> "PartLibrary":
        """Takes what numba says of code that can be called: where its environment lies."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """A part that is in nobody's memory has no place for an environment."""

    def finalize(self) -> None:
        """Nothing more is added; what it calls is linked by who links it, once for all that call it."""
        self._raise_if_finalized()
        self._finalize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.external:
                function.linkage = Linkage.linkonce_odr
        self._finalized = True

    def with_called(self, called: Iterable[JITCodeLibrary]) -> Any:
        """A module of its code and that of others, some that it calls."""
        module = self._final_module.clone()
        for library in called:
            module.link_in(own_code(library), preserve=True)
        return module

    def _get_module_for_linking(self) -> Any:
        """What numba's own libraries link: its code with all that it calls."""
        self._shared_module: Any = self._shared_module or self.with_called(reached(self))
        return self._shared_module


def reached(caller: JITCodeLibrary, kept: bool = True) -> list[JITCodeLibrary]:
    """All that a library calls, and that parts call in turn, of those that are `kept` in files too or not.

    Each after all that call it: LLVM links a part only once something refers to it.
    """
    met: set[JITCodeLibrary] = set()
    found: list[JITCodeLibrary] = []

    def visit(library: JITCodeLibrary) -> None:
        met.add(library)
        part = isinstance(library, PartLibrary) and (kept or library.kept is None)
        if part or library is caller:
            for called in library._linking_libraries:
                if called not in met:
                    visit(called)
        found.append(library)

    visit(caller)
    return found[-2::-1]


def own_code(library: JITCodeLibrary) -> Any:
    """The module of a part without what it calls, of another library with it."""
    return library._final_module if isinstance(library, PartLibrary) else library._get_module_for_linking()


class EntryLibrary(JITCodeLibrary):
    """Code of an entry point, into which each part is linked once, however many others call it."""

    def finalize(self) -> None:
        """Link, optimise and compile."""
        called = reached(self)
        for library in called:
            if isinstance(library, PartLibrary):
                self._final_module.link_in(own_code(library), preserve=True)
        self._linking_libraries = [library for library in called if not isinstance(library, PartLibrary)]
        super().finalize()


@register_pass(mutates_CFG=False, analysis_only=True)
class LinkAll(AnalysisPass):
    """Gives an entry point its library before it is lowered."""

    _name = "closeform_link_all"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = EntryLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


@register_pass(mutates_CFG=False, analysis_only=True)
class LinkOnly(AnalysisPass):
    """Gives a part its library before it is lowered, and lets go of arrays only.

    numba marks where each variable ends: half of all statements, and nothing to do for a number.
    """

    _name = "closeform_link_only"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        models, types = state.targetctx.data_model_manager, state.typemap
        for block in state.func_ir.blocks.values():
            block.body = [
                statement
                for statement in block.body
                if not isinstance(statement, ir.Del) or models[types[statement.value]].contains_nrt_meminfo()
            ]
        return False


class EntryCompiler(CompilerBase):
    """numba's compiler, for entry points."""

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(LinkAll, IRLegalization)
        passes.finalize()
        return [passes]


class PartCompiler(CompilerBase):
    """numba's compiler, up to what callers link."""

    not_looked_for: tuple[str, ...] = NOT_LOOKED_FOR

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [look for look in passes.passes if look[0].__name__ not in self.not_looked_for]
        passes.add_pass_after(LinkOnly, IRLegalization)
        passes.finalize()
        return [passes]


class OwnPartCompiler(PartCompiler):
    """The same for what numba itself has written as parts of kernels, `np.empty` say, in any way."""

    not_looked_for = ()
