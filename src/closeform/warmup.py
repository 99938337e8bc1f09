"""What a scenario needs compiled, in two processes: this one as it flies, another ahead of it."""

import atexit
import re
import subprocess
import sys
from importlib import import_module

from closeform.compiled import ENTRIES, before_first_compilation, prepare


def compile_for(text: str) -> None:
    """Have what the stages of a scenario file need compiled ahead, once a kernel is found missing."""
    searches = re.search(r"^\s*\[\s*search\s*\]", text, re.MULTILINE) is not None
    moves = set(re.findall(r'^\s*do\s*=\s*"(avoid|reconfigure|scatter|regather)"', text, re.MULTILINE))
    modules = []
    if moves - {"avoid"}:
        modules.append("closeform.planning.reconfigure")
    if "avoid" in moves:
        modules.append("closeform.planning.avoid")
    if re.search(r'^\s*(cost\s*=\s*"delta-v"|do\s*=\s*"transfer")', text, re.MULTILINE):
        modules.append("closeform.fuel.bound")
    if re.search(r"^\s*thrusters\s*=", text, re.MULTILINE):
        modules.append("closeform.fuel.firing")
    if searches:
        modules.append("closeform.search.gather")
    if modules:
        before_first_compilation.append(lambda: compile_beside(modules))


def compile_beside(modules: list[str]) -> None:
    """Start a process that compiles what `modules` hold; it ends with this one at the latest."""
    ahead = "from closeform.own_process import import_numba; import_numba()"
    code = f"{ahead}; from closeform.warmup import compile_all; compile_all({modules})"
    command = [sys.executable, "-P", "-c", code]  # nothing from the folder where the user stands
    other = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    atexit.register(other.kill)


def compile_all(modules: list[str]) -> None:
    """Compile the entry points that `modules` bring along, last ones first: others begin with the first."""
    for module in modules:
        import_module(module)
    for entry in reversed(ENTRIES):
        prepare(entry, wait=False)
