"""The cache of compiled kernels: loaded by later processes, and renewed after an edit."""

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
from closeform.planning.qp import is_definite
print(is_definite.is_cached, bool(is_definite(np.eye(3))))
"""


def call(folder: Path) -> subprocess.CompletedProcess[str]:
    """Call a kernel in a new process whose user cache is in a folder."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder)}
    return subprocess.run(
        [sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=True
    )


@pytest.mark.skipif(sys.platform != "linux", reason="the user's cache is set as on Linux")
def test_a_later_process_loads_what_an_earlier_one_compiled(tmp_path):
    first, second = call(tmp_path), call(tmp_path)
    assert first.stdout.split() == ["False", "True"]
    assert "compiling planning.qp.is_definite" in first.stderr
    assert second.stdout.split() == ["True", "True"]
    assert not second.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="the user's cache is set as on Linux")
@pytest.mark.parametrize("kept", [0, 20])
def test_a_damaged_cache_is_compiled_anew(tmp_path, kept):
    call(tmp_path)
    for file in tmp_path.rglob("*.nb[ic]"):
        file.write_bytes(file.read_bytes()[:kept])
    assert call(tmp_path).stdout.split()[1] == "True"


@pytest.mark.skipif(sys.platform != "linux", reason="the user's cache is set as on Linux")
def test_a_cache_that_cannot_be_made_costs_no_result(tmp_path):
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


def test_a_kernel_has_another_folder_if_one_of_its_parts_changes():
    assert twice(2.0).folder == twice(2.0).folder
    assert twice(2.0).folder != twice(3.0).folder  # a constant of the part that it calls
    assert twice(2.0).folder != twice(2.0, call_part=False).folder


def test_arrays_that_cannot_be_written_are_copied():
    """Memory maps of a result file are read-only; a kernel takes them like other arrays."""

    @kernel(float64(float64[::1]))
    def total(values):
        return values.sum()

    values = np.arange(4.0)
    values.flags.writeable = False
    assert total(values) == 6.0
