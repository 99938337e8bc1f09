"""What numba need not write for LLVM, which would only take it out again: two thirds of all instructions."""

from functools import cache
from inspect import signature
from typing import Any

from llvmlite.binding import create_pass_builder
from llvmlite.ir import Constant, IntType, IRBuilder, Undefined
from llvmlite.ir.instructions import InsertValue
from numba.core import cgutils, types
from numba.core.codegen import CPUCodegen, CPUCodeLibrary
from numba.core.imputils import builtin_registry, lower_builtin
from numba.core.runtime.context import NRTContext
from numba.core.typing.templates import _OverloadFunctionTemplate
from numba.cpython import slicing
from numba.cpython.rangeobj import range_impl_map
from numba.np import arrayobj

from closeform.kernel_parts import EntryLibrary, OwnPartCompiler

ROUGHLY = 1  # how far LLVM simplifies each function before those that call it are there; then it does fully


def write_less() -> None:
    """Have numba write what the kernels compute, in a process of our own: they compile in a sixth less time.

    For each element of an array it puts the array on the stack, as it does what it puts together, for each
    time that one is let go of it takes out sizes and strides, what it has just put together it takes apart,
    where a loop counts up by one it divides by that, if it is not zero, and it asks whether 3 is negative.
    """
    NRTContext.get_meminfos = counted
    IRBuilder.extract_value = taken_out(IRBuilder.extract_value)
    IRBuilder.mul, IRBuilder.add = without(IRBuilder.mul, 1), without(IRBuilder.add, 0)
    slicing.fix_index = from_start(slicing.fix_index)
    cgutils.ValueStructProxy = Read
    cgutils._struct_proxy_cache.clear()
    arrayobj.make_array = array_struct(arrayobj.make_array)
    if (
        "llvm_module" not in signature(CPUCodegen._function_pass_manager).parameters
    ):  # numba 0.61, LLVM's old passes
        CPUCodeLibrary._optimize_functions = simplify
        CPUCodegen._pass_builder = rolled(CPUCodegen._pass_builder)
    _OverloadFunctionTemplate._get_jit_decorator = linked(_OverloadFunctionTemplate._get_jit_decorator)
    count_up()


def counted(self: Any, builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """What of a value has a count of references: nothing that is null, and only that is looked at."""
    model = self._context.data_model_manager[kind]
    found = []
    if model.has_nrt_meminfo():
        count = model.get_nrt_meminfo(builder, value)
        if not (isinstance(count, Constant) and count.constant is None):
            found.append((kind, count))
    for inner, take in model.traverse(builder):
        if has_counts(self._context.data_model_manager[inner]):
            found += self.get_meminfos(builder, inner, take(value))
    return found


@cache
def has_counts(model: Any) -> bool:
    """Whether anything in values of a type has a count of references."""
    return any(inner.has_nrt_meminfo() for inner in model.traverse_models())


def taken_out(extract: Any) -> Any:
    """A member of a structure or an array: what was put in there, or what was taken out in the same block."""

    def extract_value(self: Any, whole: Any, place: Any, name: str = "") -> Any:
        places = place if isinstance(place, (tuple, list)) else [place]
        if len(places) > 1:
            return extract(self, whole, places, name)
        (k,) = places
        while isinstance(whole, InsertValue) and len(whole.indices) == 1:
            if whole.indices[0] == k:
                return whole.value
            whole = whole.aggregate
        known = vars(whole).setdefault("_taken_out", {})
        if k not in known or known[k].parent is not self.block:
            known[k] = extract(self, whole, places, name)
        return known[k]

    return extract_value


def without(operation: Any, neutral: int) -> Any:
    """A sum without zeros, a product without ones, of integers."""

    def operate(self: Any, left: Any, right: Any, name: str = "", flags: Any = ()) -> Any:
        for one, other in ((left, right), (right, left)):
            if isinstance(one, Constant) and isinstance(one.type, IntType) and one.constant == neutral:
                return other
        return operation(self, left, right, name, flags)

    return operate


def from_start(fix: Any) -> Any:
    """An index as it is counted from the start: written as a number it says from which end."""

    def fix_index(builder: Any, index: Any, size: Any) -> Any:
        if isinstance(index, Constant):
            return index if index.constant >= 0 else builder.add(index, size)
        return fix(builder, index, size)

    return fix_index


class Read(cgutils.ValueStructProxy):
    """A structure that is read, and put together, where it is made, and comes onto the stack only later."""

    def __init__(self, context: Any, builder: Any, value: Any = None, ref: Any = None) -> None:
        if ref is not None:
            super().__init__(context, builder, value, ref)
            return
        self._context, self._builder = context, builder
        self._datamodel = context.data_model_manager[self._fe_type]
        self._be_type = self._get_be_type(self._datamodel)
        self._keep(self._be_type(None) if value is None else value)

    def _keep(self, value: Any) -> None:
        """What it is from here on, in this block."""
        self._read, self._block = value, self._builder.block
        self._after = self._block.instructions[-1:]

    def __getattr__(self, name: str) -> Any:
        if name not in ("_value", "_outer_ref"):
            return super().__getattr__(name)
        with self._builder.goto_entry_block():
            self._value = self._outer_ref = self._builder.alloca(self._be_type)
        with self._builder.goto_block(self._block):
            if self._after:
                self._builder.position_after(*self._after)
            else:
                self._builder.position_at_start(self._block)
            self._builder.store(self._read, self._value)
        return self._value

    def __getitem__(self, place: int) -> Any:
        if "_value" in vars(self):
            return super().__getitem__(place)
        return self._builder.extract_value(self._read, place)

    def __setitem__(self, place: int, value: Any) -> None:
        at_end = self._builder._anchor == len(self._builder.block.instructions)
        if "_value" in vars(self) or self._builder.block is not self._block or not at_end:
            super().__setitem__(place, value)
        else:
            self._keep(self._builder.insert_value(self._read, value, place))

    def _getvalue(self) -> Any:
        return super()._getvalue() if "_value" in vars(self) else self._read


def array_struct(make: Any) -> Any:
    """The structure of an array: a class is made once for a type."""
    made: dict[Any, Any] = {}

    def make_array(kind: Any) -> Any:
        if type(kind) is not types.Array:
            return make(kind)
        if kind not in made:
            made[kind] = cgutils.create_struct_proxy(kind)
        return made[kind]

    return make_array


def count_up() -> None:
    """Loops over `range` that count up by one, which LLVM would find out."""
    integer = types.int64
    kind, iterator = range_impl_map[integer]
    (whole,) = (made for made, name, of in builtin_registry.functions if (name, of) == ("getiter", (kind,)))

    @lower_builtin(range, integer)
    def to(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return structure(context, builder, kind, Constant(args[0].type, 0), *args, Constant(args[0].type, 1))

    @lower_builtin(range, integer, integer)
    def between(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return structure(context, builder, kind, *args, Constant(args[0].type, 1))

    @lower_builtin("getiter", kind)
    def begin(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        start, stop, step = (builder.extract_value(args[0], k) for k in range(3))
        if not (isinstance(step, Constant) and step.constant == 1):
            return whole(context, builder, signature, args)
        none = Constant(start.type, 0)
        left = builder.sub(stop, start)
        left = builder.select(builder.icmp_signed(">", left, none), left, none)
        at, count = (cgutils.alloca_once_value(builder, value) for value in (start, left))
        return structure(context, builder, iterator, at, stop, step, count)

    @lower_builtin("iternext", iterator)
    def advance(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        at, _, step, count = (builder.extract_value(args[0], k) for k in range(4))
        value, left = builder.load(at), builder.load(count)
        builder.store(builder.add(value, step), at)
        builder.store(builder.sub(left, Constant(left.type, 1)), count)
        is_left = builder.icmp_signed(">", left, Constant(left.type, 0))
        return structure(context, builder, signature.return_type, value, is_left)


def structure(context: Any, builder: Any, kind: Any, *values: Any) -> Any:
    """A value of a type that has these members."""
    whole = Constant(context.get_value_type(kind), Undefined)
    for k, value in enumerate(values):
        whole = builder.insert_value(whole, value, k)
    return whole


def simplify(self: Any, module: Any) -> None:
    """Have LLVM simplify the functions of a part before callers link it; an entry point's wait for all."""
    module.data_layout = self._codegen._data_layout
    if isinstance(self, EntryLibrary):
        return
    manager, builder = self._codegen._function_pass_manager(opt=ROUGHLY)
    for function in module.functions:
        if not function.is_declaration:
            manager.run(function, builder)


def rolled(build: Any) -> Any:
    """What LLVM does to kernels: loops stay loops, but for short ones, which functions have unrolled.

    A planner of twelve craft takes 3 % more time, and all kernels a twentieth less to compile.
    """

    def pass_builder(self: Any, **options: Any) -> Any:
        built = build(self, **options)
        if options.get("opt") == ROUGHLY:
            return built
        built._pto.loop_unrolling = built._pto.loop_interleaving = False
        return create_pass_builder(built._tm, built._pto)

    return pass_builder


def linked(choose: Any) -> Any:
    """What numba compiles its own functions by: only as far as callers link them."""

    def decorator(self: Any) -> Any:
        jit = choose(self)
        return lambda **options: jit(**options, pipeline_class=OwnPartCompiler, no_cfunc_wrapper=True)

    return decorator
