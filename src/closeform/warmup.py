"""What a verb or a scenario needs compiled, side by side in two processes."""

import re
import subprocess
import sys
from importlib import import_module

from platformdirs import user_cache_path

from closeform.compiled import announce, cache_folder, is_compiled


def compile_ahead(module: str) -> None:
    """Compile the kernels that `module` imports now if they are not cached, beside those of conflicts."""
    if is_compiled(module) or user_cache_path("closeform") not in cache_folder(module).parents:
        return
    announce()
    command = [sys.executable, "-c", f"import {module}"]
    other = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    import_module("closeform.conflicts.two_paths")
    other.wait()


def compile_for(text: bytes) -> None:
    """Compile ahead what the stages of a scenario file will need."""
    searches = re.search(rb"^\s*\[\s*search\s*\]", text, re.MULTILINE) is not None
    moves = set(re.findall(rb'^\s*do\s*=\s*"(avoid|reconfigure|scatter|regather)"', text, re.MULTILINE))
    if searches:
        compile_ahead("closeform.search.chain")
    if moves - {b"avoid"}:
        compile_ahead("closeform.planning.joint")
    elif moves or not searches:
        compile_ahead("closeform.planning.contacts")
