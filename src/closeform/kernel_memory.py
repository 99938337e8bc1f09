"""What numba's compiler need not find out again: which operation fits which types, what a statement names."""

import sys
from typing import Any

from numba.core import interpreter, ir
from numba.core.base import BaseContext
from numba.core.datamodel.manager import DataModelManager
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.transforms import canonicalize_cfg
from numba.core.typeinfer import ConstraintNetwork, TypeVarMap
from numba.core.types.functions import BaseFunction

from closeform.own_process import without_blas


def remember() -> None:
    """Have numba look such things up, in a process of our own: kernels compile in a third less time.

    For the sum of two numbers it tries a dozen templates at each place where it stands, and words why
    each does not fit; for the size of a variable, which only debuggers are told, it has LLVM parse a text;
    for whatever it does not know at once it imports again all that could teach it; all types that it has
    inferred it infers once more, to see that none changes; and seven times it reckons where each variable of
    a function ends, which it asks at the end.
    """
    BaseFunction.get_call_type = typed_once(BaseFunction.get_call_type)
    BaseContext.get_abi_sizeof = measured_once(BaseContext.get_abi_sizeof)
    BaseContext.refresh = taught_once(BaseContext.refresh)
    DataModelManager.lookup = DataModelManager.__getitem__ = modelled_once(DataModelManager.lookup)
    TypeVarMap.__getitem__ = noted(TypeVarMap.__getitem__)
    ConstraintNetwork.append = lambda self, made: self.constraints.append(Constraint(made))
    ConstraintNetwork.propagate = settled_once(ConstraintNetwork.propagate)
    PostProcessor.run = lived_once(PostProcessor.run)
    interpreter.peep_hole_delete_with_exit = left_without_with(interpreter.peep_hole_delete_with_exit)
    ir.Stmt.list_vars = lambda self: variables(self.__dict__)
    ir.Expr.list_vars = lambda self: variables(self._kws)


def typed_once(resolve: Any) -> Any:
    """The signature of an operation for some types."""
    answers: dict[Any, Any] = {}

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

    return get_call_type


def measured_once(measure: Any) -> Any:
    """The bytes that a type takes."""
    sizes: dict[str, int] = {}

    def get_abi_sizeof(self: Any, kind: Any) -> int:
        text = str(kind)
        if text not in sizes:
            sizes[text] = measure(self, kind)
        return sizes[text]

    return get_abi_sizeof


def modelled_once(look: Any) -> Any:
    """How a type is laid out, of which numba looks for one that is equal through weak references."""

    def lookup(self: Any, kind: Any) -> Any:
        known = vars(self).setdefault("_known", {})
        if kind not in known:
            known[kind] = look(self, kind)
        return known[kind]

    return lookup


def noted(look: Any) -> Any:
    """The variables of a function by name; those that the present constraint looks at are kept in `asked`."""

    def look_up(self: Any, name: str) -> Any:
        variable = look(self, name)
        if (asked := vars(self).get("asked")) is not None:
            asked[name] = variable
        return variable

    return look_up


class Constraint:
    """One of numba's constraints between types, and those that it has looked at."""

    def __init__(self, own: Any) -> None:
        self.own, self.loc = own, own.loc
        self.seen: list[tuple[Any, Any]] = []

    def __call__(self, inference: Any) -> None:
        """Infer types, or raise; one that nobody knows yet may be known the next time."""
        asked: dict[str, Any] = {}
        inference.typevars.asked = asked
        self.own(inference)
        seen = [(variable, variable.type) for variable in asked.values()]
        self.seen = [] if any(kind is None for _, kind in seen) else seen

    def is_settled(self) -> bool:
        """Whether all types are as they were."""
        return bool(self.seen) and all(variable.type is kind for variable, kind in self.seen)


def settled_once(propagate: Any) -> Any:
    """A round of inference, which leaves constraints that are settled as it comes to them."""

    def propagated(self: Any, inference: Any) -> Any:
        every, self.constraints = self.constraints, (one for one in self.constraints if not one.is_settled())
        try:
            return propagate(self, inference)
        finally:
            self.constraints = every

    return propagated


def taught_once(learn: Any) -> Any:
    """What modules say of operations: asked again once there are more modules, or they say more."""
    known: dict[Any, int] = {}
    asked: dict[Any, int] = {}
    lists: dict[Any, list[Any]] = {}

    def said(context: Any) -> int:
        registries = context._registries
        if asked.get(context) != len(registries):
            asked[context] = len(registries)
            values = (each for one in registries for each in vars(one).values())
            lists[context] = [each for each in values if isinstance(each, list)]
        return sum(map(len, lists[context]))

    def told(context: Any) -> int:
        return len(sys.modules) + said(context) + said(context.typing_context)

    def refresh(self: Any) -> None:
        if known.get(self) != told(self):
            with without_blas():
                learn(self)
            known[self] = told(self)

    return refresh


def lived_once(run: Any) -> Any:
    """How long the variables of a function live: reckoned where that is asked, written where it is to be."""

    def processed(self: Any, emit_dels: bool = False, **options: Any) -> None:
        function = self.func_ir
        if function.is_generator:
            run(self, emit_dels, **options)
            return
        function.blocks = canonicalize_cfg(function.blocks)
        function.variable_lifetime = VariableLifetime(function.blocks)  # reckons what it is asked
        function.generator_info = None
        if emit_dels:
            self._insert_var_dels(**options)

    return processed


def left_without_with(clean: Any) -> Any:
    """A function without variables of a `with`, which are looked for in every statement, twice."""

    def cleaned(function: Any) -> Any:
        held = any(
            isinstance(each, ir.EnterWith) for block in function.blocks.values() for each in block.body
        )
        return clean(function) if held else function

    return cleaned


def variables(holder: Any) -> list[ir.Var]:
    """The variables in a statement of numba's, its lists, tuples and dictionaries."""
    found: list[ir.Var] = []
    for value in holder.values() if isinstance(holder, dict) else holder:
        if isinstance(value, ir.Var):
            found.append(value)
        elif isinstance(value, ir.Inst):
            found += value.list_vars()
        elif isinstance(value, (list, tuple, dict)):
            found += variables(value)
    return found
