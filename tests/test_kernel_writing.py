"""What a process of our own has numba write for LLVM: kernels compute what Python does, in less text."""

import os
import subprocess
import sys

LENGTHS = """
from numba.core.codegen import CPUCodeLibrary
add, lengths = CPUCodeLibrary.add_ir_module, []

def add_ir_module(self, module):
    lengths.append(str(module).count("\\n"))
    add(self, module)

CPUCodeLibrary.add_ir_module = add_ir_module
"""
KERNEL = """
import math
from typing import NamedTuple
import numpy as np
from numba import float64, int64, types
from closeform.compiled import kernel
from closeform.kernel_loans import Lent, borrowed, lent, stack_matrix, stack_vector

class Pair(NamedTuple):
    table: np.ndarray
    row: np.ndarray

@kernel()
def halves(pair, number, out):
    middle = pair.row[number:-1]
    for k, value in enumerate(middle):
        if k == 2:
            continue
        out[k] += 0.5 * value - pair.table[-1, k % 3]
    return middle[-1], len(middle)

@kernel()
def rows(table):
    most = -math.inf
    for row in table:
        most = max(most, row[1:].max())
    return most

@kernel()
def grown(start, count):
    for _ in range(count):
        longer = np.empty(len(start) + 1)
        longer[1:] = start
        longer[0] = start[-1]
        start = longer
    return start

class Group(NamedTuple):
    pair: Pair
    share: float
    which: np.ndarray

@kernel()
def room(count):
    return len(np.empty(count))

@kernel()
def weigh(group, out):
    most, place = -math.inf, -1
    for k in range(len(group.which)):
        value, row = group.share * group.pair.row[k], group.pair.table[group.which[k]]
        if group.which[k] > 1:
            row, scale = out[1:4], value
        if value > most:
            most, place = value, k
        row[k % 3] += scale if group.which[k] > 1 else room(k)
    return most + place

KIND = types.NamedTuple((float64[:, ::1], float64[::1]), Pair)
GROUP = types.NamedTuple((KIND, float64, int64[::1]), Group)

@kernel(float64(Lent(GROUP), float64[::1]))
def weighed(group, out):
    return weigh(group, out)

@kernel(int64(int64))
def spacious(count):
    return room(room(count))

@kernel(types.Tuple((float64[::1], float64, int64))(KIND, float64[:, :], float64[::1]))
def mixed(pair, strided, out):
    pair, out = lent(Pair(borrowed(pair.table), borrowed(pair.row))), borrowed(out)
    square, corner = stack_matrix(3, 3), stack_vector(3)
    for i in range(3):
        corner[i] = strided[i, -i]
        for j in range(i, 3):
            square[i, j] = square[j, i] = corner[i] * j
    last, number = halves(pair, 1, out)
    for i in range(len(out) - 1, 0, -2):
        out[i] -= square[i % 3, 1] + rows(strided) - rows(strided.T)
    view = pair.table[1]
    view[0], view[1] = view[1], view[0]
    more = grown(view, 3 if last > 0.0 else 1)
    for value in out:
        last += value
    return more, last + (view if number > 2 else corner)[2], number

def arguments():
    some = np.random.default_rng(3)
    return Pair(some.normal(size=(4, 3)), some.normal(size=9)), some.normal(size=(8, 6))[::2, ::2], np.ones(8)
"""
COMPUTED = """
try:
    spacious(2**58)
except MemoryError:
    assert spacious(3) == 3
else:
    raise AssertionError("there is no such room")
given = arguments()
group = Group(given[0], 0.3, np.arange(5) % 4)
weight = weighed(group, given[2])
more, total, number = mixed(*given)
print([float(value).hex() for value in (*more, total, weight, *given[0].table.ravel(), *given[2])], number)
print(sum(lengths))
"""
OURS = """
from closeform import own_compiler, own_process
own_process.begin()
own_compiler.prepare_numba()
"""


def computed(folder, begin="", **environment):
    """What the kernel computes in a fresh process, and how many lines LLVM was given."""
    script = folder / "kernel.py"
    folder.mkdir()
    script.write_text(f"{begin}{LENGTHS}{KERNEL}{COMPUTED}")
    done = subprocess.run(
        [sys.executable, "-W", "error", script],
        env={**os.environ, "HOME": str(folder), "XDG_CACHE_HOME": str(folder), **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    numbers, length = done.stdout.splitlines()
    return numbers, int(length)


def test_what_is_not_written_changes_no_bit(tmp_path):
    python, _ = computed(tmp_path / "python", NUMBA_DISABLE_JIT="1")
    ours, short = computed(tmp_path / "ours", OURS)
    whole, long = computed(tmp_path / "whole")
    assert ours == whole == python
    assert short < 0.45 * long


def test_a_numba_that_nobody_has_tried_compiles_as_it_is(tmp_path):
    unknown = "import numba\nnumba.version_info = numba.version_info._replace(short=(0, 99))\n"
    ours, length = computed(tmp_path / "unknown", unknown + OURS)
    whole, long = computed(tmp_path / "whole")
    assert ours == whole
    assert length == long
