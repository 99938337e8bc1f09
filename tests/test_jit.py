"""Cache of compiled kernels: later processes load it, and edits renew it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import float64

from closeform._jit import Kernel, kernel

CALL = """
import numpy as np
from closeform.planning.energy.quadratic_program import is_definite
print(is_definite.is_cached, bool(is_definite(np.eye(3))))
"""


def call(folder: Path) -> subprocess.CompletedProcess[str]:
    """Call a kernel in a new process whose user cache is in a folder."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    return subprocess.run(
        [sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=True
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the user's cache is set as on Linux")
def test_later_processes_load_compiled_kernels_unless_damaged(tmp_path):
    first, second = call(tmp_path), call(tmp_path)
    assert first.stdout.split() == ["False", "True"]
    assert "compiling planning.energy.quadratic_program.is_definite" in first.stderr
    assert second.stdout.split() == ["True", "True"]
    assert not second.stderr
    for file in tmp_path.rglob("*.nb[ic]"):
        file.write_bytes(file.read_bytes()[:20])
    assert call(tmp_path).stdout.split()[1] == "True"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the user's cache is set as on Linux")
def test_unusable_cache_folder_costs_no_result(tmp_path):
    (tmp_path / "closeform").write_text("a file where the folder would be")
    assert call(tmp_path).stdout.split() == ["False", "True"]


def twice(factor: float, call_part: bool = True) -> Kernel:
    """Return a kernel that calls a part with a constant of its own."""

    @kernel()
    def part(x):
        return factor * x

    def whole(x):
        return part(x) if call_part else x

    return Kernel(whole, float64(float64))


def test_cache_folder_depends_on_called_parts():
    assert twice(2.0).folder == twice(2.0).folder
    assert twice(2.0).folder != twice(3.0).folder  # constant of the called part
    assert twice(2.0).folder != twice(2.0, call_part=False).folder


def test_read_only_arrays_are_accepted():
    """Kernels take read-only arrays, such as memory maps of result files."""

    @kernel(float64(float64[::1]))
    def total(values):
        return values.sum()

    values = np.arange(4.0)
    values.flags.writeable = False
    assert total(values) == 6.0
