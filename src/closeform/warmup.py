"""What a scenario needs compiled, in two processes: this one as it flies, another ahead of it."""

import atexit
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module

from closeform.compiled import ENTRIES, before_first_compilation, meanwhile, prepare

STAGE = r"(?:(?!^\s*\[\[)[\s\S])*?"  # as little as there is, within a stage

# What a line of a scenario file begins with, and the modules whose kernels that needs; the longest first, for
# the process that flies begins with others.
NEEDS = (
    (
        rf'do\s*=\s*"(avoid(?!"{STAGE}^\s*drift\s*=)|reconfigure|scatter|regather)"',
        "planning.local planning.qp",
    ),
    (
        rf'do\s*=\s*"(avoid|reconfigure|scatter|regather)"(?!{STAGE}^\s*cost\s*=\s*"delta-v")',
        "planning.dual_bound",
    ),
    (r'do\s*=\s*"(avoid|reconfigure|scatter|regather)"', "planning.deflection planning.approaches"),
    (r"sigmas\s*=", "uncertainty.stays uncertainty.gauges planning.passive_planes"),
    (
        rf'do\s*=\s*"(avoid|reconfigure|regather)"{STAGE}^\s*drift\s*=',
        "planning.failures planning.passive_planes",
    ),
    (r"drift\s*=", "drift.search"),
    (r"covariance\s*=", "uncertainty.levels uncertainty.spread"),
    (r"hard_body\s*=", "uncertainty.entry_rate uncertainty.histories"),
    (r"field\s*=", "field.gravity field.least_ratios"),
    (r'do\s*=\s*"gather"', "search.gather_events"),
    (r'do\s*=\s*"lock"', "search.lock_march"),
    (
        rf'do\s*=\s*"(avoid|reconfigure|scatter|regather)"{STAGE}^\s*cost\s*=\s*"delta-v"',
        "planning.joint_dual planning.impulse_peaks planning.impulse_flight",
    ),
    (r'cost\s*=\s*"delta-v"|do\s*=\s*"transfer"|thrusters\s*=', "motion.impulses motion.constant_primers"),
    (
        rf'do\s*=\s*"avoid"{STAGE}^\s*cost\s*=\s*"delta-v"|do\s*=\s*"transfer"|thrusters\s*=',
        "motion.impulse_arcs",
    ),
    (r"thrusters\s*=", "motion.saturated"),
    (r'do\s*=\s*"(?!lock)', "conflicts.entries"),
    (r"\[\[\s*stage\s*\]\]", "motion.effort motion.path"),
    (r'do\s*=\s*"(avoid|reconfigure|scatter|regather|transfer)"', "motion.steering"),
)


def compile_for(text: str) -> None:
    """Have what the stages of a scenario file need compiled ahead, once a kernel is found missing."""
    needed = " ".join(needs for said, needs in NEEDS if re.search(rf"^\s*({said})", text, re.MULTILINE))
    modules = [f"closeform.{module}" for module in needed.split()]
    if modules:
        before_first_compilation.append(lambda: compile_beside(modules))
        meanwhile.append(lambda ended: compile_all(modules[::-1], ended))


def compile_beside(modules: list[str]) -> None:
    """Start a process that compiles the kernels of `modules`; it ends with this one at the latest."""
    code = f"""
from closeform import own_compiler, own_process
own_process.begin()
own_compiler.prepare_numba()
from closeform import warmup
warmup.compile_all({modules})
"""
    command = [sys.executable, "-P", "-c", code]  # nothing from the folder where the user stands
    other = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    atexit.register(other.kill)


def compile_all(modules: list[str], ended: Callable[[], bool] = lambda: False) -> None:
    """Compile the entry points of `modules` until `ended`, but for those that others have under way."""
    for module in modules:
        import_module(module)
        for entry in [*ENTRIES]:
            if ended():
                return
            if entry.__module__ == module:
                prepare(entry, wait=False)
