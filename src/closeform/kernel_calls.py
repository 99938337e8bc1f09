"""How kernels call their parts: an error goes on as it comes."""

from typing import Any

from numba.core import types
from numba.core.callconv import RETCODE_NONE, RETCODE_OK, RETCODE_STOPIT, CPUCallConv, excinfo_ptr_t


def pass_errors_on() -> None:
    """Have numba write less around each call, in a process of our own.

    It gives what is called a place of its own for an error, clears that for what is returned twice, finds out
    of the code that comes back all that it could mean, and looks whether there is a `try` around.
    """
    CPUCallConv.call_function = called(CPUCallConv.call_function)
    CPUCallConv.return_status_propagate = passed_on(CPUCallConv.return_status_propagate)
    CPUCallConv.set_try_status = tried(CPUCallConv.set_try_status)


class Outcome:
    """What a call came to; its error, if there is one, is where this function would leave its own."""

    def __init__(self, builder: Any, code: Any, has_none: bool) -> None:
        self.builder, self.code, self.has_none = builder, code, has_none

    @property
    def is_none(self) -> Any:
        """Whether it returned none where it could have returned something."""
        return self.builder.icmp_signed("==", self.code, RETCODE_NONE)

    @property
    def is_stop_iteration(self) -> Any:
        """Whether a generator has ended."""
        return self.builder.icmp_signed("==", self.code, RETCODE_STOPIT)

    @property
    def is_error(self) -> Any:
        """Whether there was an error."""
        error = self.builder.icmp_signed("!=", self.code, RETCODE_OK)
        return self.builder.and_(error, self.builder.not_(self.is_none)) if self.has_none else error

    @property
    def is_ok(self) -> Any:
        """Whether there was none."""
        return self.builder.not_(self.is_error)

    @property
    def excinfoptr(self) -> Any:
        """The error."""
        return self.builder.load(self.builder.function.args[1])


def called(call: Any) -> Any:
    """A call from a function that can have errors itself."""

    def call_function(
        self: Any, builder: Any, callee: Any, returned: Any, kinds: Any, values: Any, attrs: Any = None
    ) -> Any:
        own = builder.function.args
        if attrs is not None or len(own) < 2 or own[1].type != excinfo_ptr_t.as_pointer():
            return call(self, builder, callee, returned, kinds, values, attrs)
        with builder.goto_entry_block():
            place = builder.alloca(self.get_return_type(returned).pointee)
        given = self._get_arg_packer(kinds).as_arguments(builder, values)
        code = builder.call(callee, [place, own[1], *given])
        value = self.context.get_returned_value(builder, returned, builder.load(place))
        return Outcome(builder, code, isinstance(returned, types.Optional)), value

    return call_function


def passed_on(propagate: Any) -> Any:
    """The end of a function where one that it called had an error."""

    def return_status_propagate(self: Any, builder: Any, status: Any) -> None:
        if isinstance(status, Outcome) and not hasattr(builder, "tries"):
            builder.ret(status.code)
        else:
            propagate(self, builder, status)

    return return_status_propagate


def tried(begin: Any) -> Any:
    """A `try` begins: from here on there may be one around."""

    def set_try_status(self: Any, builder: Any) -> None:
        builder.tries = True
        begin(self, builder)

    return set_try_status
