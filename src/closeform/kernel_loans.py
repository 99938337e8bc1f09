"""Arrays passed between kernels without reference counts, on the stack, or by reference in tuples.

Measured without this module (arrays and tuples passed as numba does by default): `avoid` past a box takes
1.9 times as long, kernels of planning compile 1.4 times as long, and those of conflicts 1.15 times.

An array is lent without its reference count.  So lend only arrays that the caller of a function owns: one
that the function itself has allocated would be freed after its last counted use, while it is still read.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    register_model,
    unbox,
)


def uncounted(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return an array without its reference count; anything else unchanged."""
    if not isinstance(kind, types.Array):
        return value
    for field in ("meminfo", "parent"):
        place = context.data_model_manager[kind].get_field_position(field)
        null = cgutils.get_null_value(value.type.elements[place])
        value = builder.insert_value(value, null, place)
    return value


def _borrowed(typing: Any, array: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return uncounted(context, builder, array, args[0])

    return array(array), generate


class Lent(types.Type):
    """Reference to a named tuple of arrays, which are read by name without reference counts."""

    def __init__(self, of: Any) -> None:
        self.of = of
        super().__init__(f"Lent[{of.instance_class.__name__}]")

    def can_convert_from(self, typing: Any, given: Any) -> Any:
        """Return how well the type stands for the tuple itself, which an entry point receives."""
        found = typing.can_convert(given, self.of)
        return None if found is None else max(found, Conversion.safe)

    @property
    def key(self) -> Any:
        """Key that distinguishes two of these types."""
        return self.of


@register_model(Lent)
class LentModel(models.PrimitiveModel):
    """Representation in machine code: a pointer."""

    def __init__(self, manager: Any, lent: Lent) -> None:
        super().__init__(manager, lent, manager.lookup(lent.of).get_value_type().as_pointer())


@infer_getattr
class LentFields(AttributeTemplate):
    """Fields of the tuple."""

    key = Lent

    def generic_resolve(self, lent: Lent, name: str) -> Any:
        """Return the type of a field."""
        return lent.of.types[lent.of.fields.index(name)] if name in lent.of.fields else None


@lower_getattr_generic(Lent)
def read_field(context: Any, builder: Any, lent: Lent, pointer: Any, name: str) -> Any:
    """Load one field."""
    place = lent.of.fields.index(name)
    value = builder.load(cgutils.gep_inbounds(builder, pointer, 0, place))
    return uncounted(context, builder, lent.of.types[place], value)


@unbox(Lent)
def refer(lent: Lent, given: Any, c: Any) -> NativeValue:
    """Put an entry point's tuple on the stack; its arrays are released after the call."""
    place = cgutils.alloca_once(c.builder, c.context.get_value_type(lent.of))
    arrays: list[tuple[Any, Any]] = []
    failed = _fill(lent.of, given, place, arrays, c)

    def release() -> None:
        for kind, array in arrays:
            c.context.nrt.decref(c.builder, kind, array)

    return NativeValue(place, is_error=failed, cleanup=release)


def _fill(kind: Any, given: Any, place: Any, arrays: list[tuple[Any, Any]], c: Any) -> Any:
    """Fill a place with a tuple, an array or a number, and list its arrays; return whether it failed."""
    if isinstance(kind, types.BaseTuple):
        failed = cgutils.false_bit
        for k, one in enumerate(kind):
            inner = cgutils.gep_inbounds(c.builder, place, 0, k)
            failed = c.builder.or_(failed, _fill(one, c.pyapi.tuple_getitem(given, k), inner, arrays, c))
        return failed
    native = c.unbox(kind, given)
    c.builder.store(uncounted(c.context, c.builder, kind, native.value), place)
    if isinstance(kind, types.Array):
        arrays.append((kind, native.value))
    return native.is_error


def _lent(typing: Any, group: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return cgutils.alloca_once_value(builder, args[0])

    return Lent(group)(group), generate


def _on_stack(typing: Any, *sizes: Any) -> Any:
    """Return an array (size,) or (rows, columns) of floats, of sizes that are literals."""
    kind = types.Array(types.float64, len(sizes), "C")
    shape = [size.literal_value for size in sizes]
    strides = [8 * int(np.prod(shape[k + 1 :])) for k in range(len(shape))]

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        room = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), int(np.prod(shape))))
        size = context.get_constant(types.intp, 8)
        view = context.make_array(kind)(context, builder)
        context.populate_array(
            view,
            data=builder.bitcast(room, view.data.type),
            shape=[context.get_constant(types.intp, length) for length in shape],
            strides=[context.get_constant(types.intp, stride) for stride in strides],
            itemsize=size,
            meminfo=None,
        )
        return view._getvalue()

    return kind(*sizes), generate


def _vector(typing: Any, size: Any) -> Any:
    return _on_stack(typing, size)


def _matrix(typing: Any, rows: Any, columns: Any) -> Any:
    return _on_stack(typing, rows, columns)


# The same array without its reference count, for an entry point's arguments, which outlive the call. numba
# counts references in every function that receives an array, with atomic operations that block other cores.
borrowed = (lambda array: array) if config.DISABLE_JIT else intrinsic(_borrowed)

# The same named tuple by reference, for an entry point's own tuples. numba passes all fields of all arrays of
# a tuple by value, two hundred words for a scene, to every function at every call.
lent = (lambda group: group) if config.DISABLE_JIT else intrinsic(_lent)

# Space for a few floats of literal size, valid while the calling function runs.
stack_vector = np.empty if config.DISABLE_JIT else intrinsic(prefer_literal=True)(_vector)
stack_matrix = (
    (lambda *shape: np.empty(shape)) if config.DISABLE_JIT else intrinsic(prefer_literal=True)(_matrix)
)
