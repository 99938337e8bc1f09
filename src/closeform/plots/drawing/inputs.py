"""Arguments of plot functions: each kind is described and checked once, for all functions that take it."""

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from os import PathLike
from textwrap import fill
from typing import IO, Any, ParamSpec, TypeVar

import numpy as np

from closeform.arrays import instance, sequence, shown
from closeform.motion.path import Path
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

P = ParamSpec("P")
R = TypeVar("R")
LOOKS = 201  # instants at which two paths are compared
UNSEEN = 1e-4  # of the extent of a path: a smaller difference is below one pixel
HEADING = re.compile(r"^(\w+)\n-+\n", re.MULTILINE)
RETURNS = "Figure\n    Matplotlib figure; save it with its `savefig` method."
WRAP: dict[str, Any] = {"width": 106, "initial_indent": "    ", "subsequent_indent": "    "}
TYPE = "an argument has the wrong type"
PAPERS = {
    "SP11": "SP11 (Sauter and Palmer 2011)",
    "S04": "S04 (Scharf, Ploen, Hadaegh and Sohl 2004)",
    "H03": "H03 (Hadaegh, Scharf and Ploen 2003)",
}
PAPER = re.compile("|".join(PAPERS))


# ----- values that are accepted


def one_path(name: str, given: Any) -> Path:
    """Return an argument as a Path of any shape, or raise ValueError; None usually means a failed plan."""
    if given is None:
        raise ValueError(f"{name}: expected a Path, got None; a plan that is not ok has none")
    path: Path = instance(name, given, Path)
    return path


def one_craft(name: str, given: Any) -> Path:
    """Return an argument as a Path of one spacecraft, or raise ValueError."""
    path = one_path(name, given)
    if path.shape:
        raise ValueError(f"{name}: pictures show one craft at a time, got shape {path.shape}; index it")
    return path


def crafts(name: str, given: Any) -> list[Path]:
    """Return the single paths in a Path of any shape, or in a sequence of such paths."""
    if given is None or isinstance(given, Path):
        path = one_path(name, given)
        return [path] if not path.shape else [path[k] for k in np.ndindex(path.shape)]
    return [craft for path in sequence(name, given, Path) for craft in crafts(name, path)]


def same(before: Path, after: Path) -> bool:
    """Return True if two paths of one shape look the same in a figure."""
    if after is before:
        return True
    for one, other in zip(crafts("before", before), crafts("after", after), strict=True):
        if (one.start, one.end) != (other.start, other.end):
            return False
        times = np.linspace(one.start, one.end, LOOKS)
        where, there = one.position(times), other.position(times)
        if np.abs(where - there).max() > UNSEEN * np.ptp(where, axis=0).max():
            return False
    return True


def texts(name: str, given: Any, count: int, what: str) -> list[str]:
    """Return an argument as `count` strings, or raise ValueError."""
    words = sequence(name, given, str)
    if len(words) != count:
        raise ValueError(f"{name}: {len(words)} {name} for {count} {what}")
    return words


def output(name: str, given: Any) -> None:
    """Raise ValueError unless an argument is a path or an open file."""
    if not isinstance(given, str | PathLike) and not hasattr(given, "write"):
        raise ValueError(f"{name}: expected a path or an open file, got {shown(given)}")


def callback(name: str, given: Any) -> None:
    """Raise ValueError unless an argument is None or a function."""
    if given is not None and not callable(given):
        raise ValueError(f"{name}: expected a function, got {shown(given)}")


def of(kind: str) -> Callable[[str, Any], None]:
    """Return the check that an argument is of a class of this package, which is not imported for it."""

    def check(name: str, given: Any) -> None:
        ours = [base.__name__ for base in type(given).__mro__ if base.__module__.startswith("closeform.")]
        if kind not in ours:
            raise ValueError(f"{name}: expected {kind}, got {shown(given)}")

    return check


# ----- what documentation says of them


@dataclass(frozen=True)
class Argument:
    """Kind of argument: its type and description in documentation, its check, and what it `raises`."""

    kind: str
    words: str
    check: Callable[[str, Any], Any] = lambda name, given: None
    raises: str = ""


Paths = Path  # of shape (N,)
Zones = OwnZone | Sequence[OwnZone | None] | PairZones | None
File = str | PathLike[str] | IO[bytes]
Progress = Callable[[int, int], object] | None
CLASSES = {  # results and objects of this package, each with the words for it
    "Zone": "Keep-out zone of the pair.",
    "ApproachCone": "Approach corridor, which is drawn by four lines on its surface.",
    "SpeedLimit": "Limit of the speed of this path.",
    "Uncertainty": "Uncertainty of the other spacecraft.",
    "Thrusters": "Thrusters for which the plan was made; d . p of the best replaces the primer magnitude.",
    "TransferCostTable": "Table from `transfer_cost_table`.",
    "ClearanceCostCurve": "Result of `clearance_cost_curve`.",
    "MaxClearance": "Result of `max_clearance`; a line shows its budget, and a ring the zones within it.",
    "ThrusterFiring": "Result of `fire_thrusters`.",
    "Simulation": "Result of `simulate`.",
    "Tube": "Tracking-error tube predicted by `tube`.",
    "Sensor": "Sensor of each spacecraft.",
    "Search": "Search to draw.",
    "Gathering": "Gathering to draw.",
}
NAMES_WRONG = "the number of names is wrong"
BY_NAME = {
    "names": Argument(
        "sequence of str", "Names of the spacecraft; default: their indices.", raises=NAMES_WRONG
    ),
    "obstacles": Argument("Path or sequence of Path", "Path of any shape, or a sequence of paths.", crafts),
    "until": Argument("float [s]", "End of the drift, as in `drift_approach`."),
}
BY_ANNOTATION = {
    **{name: Argument(name, words, of(name)) for name, words in CLASSES.items()},
    "Path": Argument("Path", "Path of one spacecraft.", one_craft, "a path is a batch"),
    "Paths": Argument("Path", "Paths of shape (N,).", one_path),
    "Path | Sequence[Path]": Argument("Path or sequence of Path", "Path of shape (N,), or N paths.", crafts),
    "Zones": Argument(
        "Zone, CovarianceZone, Body, None, sequence of these, or PairZones",
        "One zone for all spacecraft or one for each, combined for a pair as in `screen`; None: no own zone.",
        raises="two zones cannot be combined for a pair",
    ),
    "File": Argument(
        "str, path-like or file of bytes", "Output file; an existing file is overwritten.", output
    ),
    "Progress": Argument(
        "callable of int and int",
        "Function called with the number of finished frames and the total.",
        callback,
    ),
}


def picture(raises: str = "", source: str = "") -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return the decorator of a plot function, which checks its arguments and completes its docstring.

    An argument whose name or annotation is one of the above is checked at each call. The docstring describes
    the others; it gets the entries of those that it does not describe, the figure under Returns, under Raises
    the conditions of the function, `raises`, and of the checks, and the `source` under References.
    """

    def decorated(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        parameters = signature.parameters
        kinds = {name: kind for name in parameters if (kind := kind_of(parameters[name])) is not None}

        @wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs).arguments
            for name, kind in kinds.items():
                absent = given.get(name) is None and parameters[name].default is None
                if name in given and not absent:
                    kind.check(name, given[name])
            return function(*args, **kwargs)

        if (text := inspect.getdoc(function)) is not None:  # None in `python -OO`
            checked.__doc__ = documented(text, signature, kinds, raises, source)
        return checked

    return decorated


def kind_of(parameter: inspect.Parameter) -> Argument | None:
    """Return the kind of a parameter by its name or its annotation, None for a special one."""
    return BY_NAME.get(parameter.name) or BY_ANNOTATION.get(parameter.annotation.removesuffix(" | None"))


def documented(
    text: str, signature: inspect.Signature, kinds: dict[str, Argument], raises: str, source: str
) -> str:
    """Return a docstring with complete sections Parameters, Returns, Raises and References."""
    opening, *rest = HEADING.split(text)
    sections = {name: body.strip() for name, body in zip(rest[::2], rest[1::2], strict=True)}
    entries = dict[str, str]()
    for entry in re.split(r"^(?=\S)", sections.get("Parameters", ""), flags=re.MULTILINE):
        entries |= dict.fromkeys(entry.partition(" : ")[0].split(", "), entry.strip())
    for name, kind in kinds.items():
        default = signature.parameters[name].default
        more = {None: ", optional", (): ", default none"}.get(default, "")
        entries.setdefault(name, f"{name} : {kind.kind}{more}\n    {kind.words}")
    *most, last = dict.fromkeys([*(kind.raises for kind in kinds.values() if kind.raises), TYPE])
    checks = f"{', '.join(most)}, or {last}" if most else last
    whole = {"Parameters": "\n".join(dict.fromkeys(entries[name] for name in signature.parameters))}
    if signature.return_annotation == "Figure":
        whole["Returns"] = RETURNS
    every = f"If {raises}; also if {checks}." if raises else f"If {checks}."
    whole["Raises"] = "ValueError\n" + fill(every, **WRAP)
    if source:
        whole["References"] = PAPER.sub(lambda found: PAPERS[found[0]], source) + "."
    parts = [f"{name}\n{'-' * len(name)}\n{body}" for name, body in whole.items()]
    return "\n\n".join([opening.rstrip(), *parts]) + "\n"
