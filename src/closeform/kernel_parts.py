"""Parts of kernels: compiled only as far as those that they are part of need."""

from typing import Any

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
    """Code that is linked into its callers, which LLVM optimises and turns into machine code there.

    numba would do both for each part too, with all that it calls in turn: a quarter of the time
    that kernels take to compile, for machine code that nobody calls.
    """

    @property
    def codegen(self) -> "PartLibrary":
        """Takes what numba says of code that can be called: where its environment lies."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """A part that is in nobody's memory has no place for an environment."""

    def _optimize_final_module(self) -> None:
        """Left to the callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


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
