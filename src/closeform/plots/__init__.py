"""Figures of paths, zones, conflicts and searches.

All functions except the animations return a matplotlib Figure. They neither use nor change matplotlib's
global state: save a figure with its `savefig` method.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

# The stub lists the functions and their modules. Each is imported at first use, so that only the kernels it
# needs are compiled.
_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {name: module for module, name in re.findall(r"^from (\S+) import (\w+)", _STUB, re.MULTILINE)}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'closeform.plots' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
