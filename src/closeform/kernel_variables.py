"""Variables of kernels that need no place on the stack, and arrays that a kernel is lent."""

from typing import Any

from numba.core import analysis, ir, types
from numba.core.lowering import Lower

from closeform.kernel_loans import uncounted


def keep_values() -> None:
    """Have numba write variables as values, in a process of our own: kernels compile in a twentieth less.

    It puts what more than one block of a function uses on the stack, cleared first, loads all of it wherever
    a part of it is used, and before each value the one that it replaces, to let go of it.
    """
    Lower._find_singly_assigned_variable = lasting(Lower._find_singly_assigned_variable)
    Lower.extract_function_arguments = lent_arguments(Lower.extract_function_arguments)
    Lower.alloca = unclear(Lower.alloca)
    Lower._alloca_var = placed(Lower._alloca_var)
    Lower.storevar = stored(Lower.storevar)
    Lower.loadvar = loaded(Lower.loadvar)
    Lower.delvar = dropped(Lower.delvar)


def lasting(find: Any) -> Any:
    """Which variables are set at one place, which the way to each of their uses leads past."""

    def find_all(self: Any) -> None:
        find(self)
        self.lasting, self.values = set(), {}
        if not self.func_ir.func_id.is_generator:
            self.lasting = set_once(self.func_ir.blocks) - self._singly_assigned_vars

    return find_all


def set_once(blocks: dict[int, Any]) -> set[str]:
    """The names of variables that are set at one place, which dominates all places where they are used."""
    places: dict[str, int] = {}
    often = set(analysis.must_use_alloca(blocks))
    for label, block in blocks.items():
        for statement in block.find_insts(ir.Assign):
            name = statement.target.name
            if name in places:
                often.add(name)
            places[name] = label
    dominators = analysis.compute_cfg_from_blocks(blocks).dominators()
    for label, used in analysis.compute_use_defs(blocks).usemap.items():
        for name in used:
            place = places.get(name, label)
            if place >= label or place not in dominators[label]:  # blocks are written in order
                often.add(name)
    return places.keys() - often


def lent_arguments(extract: Any) -> Any:
    """Arguments, whose arrays the caller holds meanwhile: who hands none on need not count them."""

    def extract_function_arguments(self: Any) -> Any:
        extract(self)
        models = self.context.data_model_manager
        if not models[self.fndesc.restype].contains_nrt_meminfo():
            given = zip(self.fndesc.argtypes, self.fnargs, strict=True)
            self.fnargs = [uncounted(self.context, self.builder, kind, value) for kind, value in given]
        return self.fnargs

    return extract_function_arguments


def is_counted(lower: Any, kind: types.Type) -> bool:
    """Whether values of a type have counts of references."""
    counted: bool = lower.context.data_model_manager[kind].contains_nrt_meminfo()
    return counted


def unclear(allocate: Any) -> Any:
    """A place on the stack: cleared only where something is let go of before it is set."""

    def alloca(self: Any, name: str, kind: types.Type) -> Any:
        if is_counted(self, kind):
            return allocate(self, name, kind)
        with self.builder.goto_entry_block():
            return self.builder.alloca(self.context.get_value_type(kind), name=name)

    return alloca


def placed(place: Any) -> Any:
    """A place for a variable that needs one."""

    def _alloca_var(self: Any, name: str, kind: types.Type) -> None:
        if name not in self.lasting:
            place(self, name, kind)

    return _alloca_var


def stored(store: Any) -> Any:
    """A variable is set: its value is kept by name, or put in its place."""

    def storevar(self: Any, value: Any, name: str, **place: Any) -> None:
        kind = self.typeof(name)
        counted = is_counted(self, kind)
        if name in self.lasting:
            if not (counted and self.context.nrt.get_meminfos(self.builder, kind, value)):
                self.values[name] = value
                return
            self.lasting.discard(name)
        if counted or name in self._singly_assigned_vars:
            store(self, value, name, **place)
        else:
            self.builder.store(value, self.getvar(name))

    return storevar


def loaded(load: Any) -> Any:
    """The value of a variable."""

    def loadvar(self: Any, name: str) -> Any:
        if name in self.values:
            return self.values[name]
        self.lasting.discard(name)
        return load(self, name)

    return loadvar


def dropped(drop: Any) -> Any:
    """A variable ends: what is not counted is not let go of."""

    def delvar(self: Any, name: str) -> None:
        if name not in self.values:
            self.lasting.discard(name)
            drop(self, name)

    return delvar
