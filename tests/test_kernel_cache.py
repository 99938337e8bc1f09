"""Compiled kernels on disk: whose they are, and what happens where they cannot be read or written."""

import math
import os
import re
import shutil
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest
from numba.core import types

import closeform
from closeform.kernel_cache import described, type_text
from closeform.kernel_loans import Lent
from closeform.motion.hill import coast


def evaluated(cache, code="", **environment):
    """What a fresh process with its own cache of kernels says: motion of one arc, and on standard error."""
    program = """
        import closeform as cf
        print(cf.Orbit(1.1e-3).coast([60, 30, 20, 0, -0.132, 0.03], 3000.0).position(1000.0)[0].hex())
    """
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", textwrap.dedent(program) + code],
        env={**os.environ, "HOME": str(cache), "XDG_CACHE_HOME": str(cache), **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return done.stdout, done.stderr


def test_a_cache_that_cannot_be_written_is_no_obstacle(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("a file stands where the cache folder would be")
    said, noted = evaluated(blocked)
    assert said == evaluated(tmp_path)[0]
    assert noted.count("compiling") == noted.count("\n") == 1


def compiled_file(cache):
    (file,) = (f for f in (cache / "closeform" / "kernels").iterdir() if f.suffix != ".lock")
    return file


def put_folder(file):
    file.unlink()
    file.mkdir()
    (file / "inside").touch()


DAMAGES = {
    "empty": lambda file: file.write_bytes(b""),
    "truncated": lambda file: file.write_bytes(file.read_bytes()[:3000]),
    "a wrong byte": lambda file: file.write_bytes(file.read_bytes()[:5000] + b"x" + file.read_bytes()[5001:]),
    "zeros": lambda file: file.write_bytes(bytes(file.stat().st_size)),
    "other content": lambda file: file.write_text("a note" * 1000),
    "a folder": put_folder,
    "a link to itself": lambda file: (file.unlink(), file.symlink_to(file.name)),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_cache_is_compiled_anew(tmp_path, damage):
    whole = evaluated(tmp_path)[0]
    file = compiled_file(tmp_path)
    damage(file)
    said, noted = evaluated(tmp_path)
    assert said == whole
    assert noted == f"closeform: {file} is damaged; compiling it anew\n"
    assert evaluated(tmp_path) == (whole, "")


MORE = "cf.Orbit(1.1e-3).transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)"  # compiles another


def test_a_cache_of_damaged_files_is_told_in_one_line(tmp_path):
    evaluated(tmp_path, MORE)
    kernels = tmp_path / "closeform" / "kernels"
    files = [file for file in kernels.iterdir() if file.suffix != ".lock"]
    assert len(files) > 1
    for file in files:
        file.write_bytes(file.read_bytes()[:-1])
    noted = evaluated(tmp_path, MORE)[1]
    assert noted.count("\n") == noted.count("is damaged; compiling it anew") == 1
    assert evaluated(tmp_path, MORE)[1] == ""


def test_a_full_disk_leaves_no_damage(tmp_path):
    """No file may be longer than 4 kB; what a process compiles then it keeps to itself."""
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))"
    program = f"{limit}\nimport closeform as cf\nprint(cf.Orbit(1.1e-3).coast([1] * 6, 9.0).position(1.0)[0])"
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        assert done.stderr.count("\n") == 1
        assert [file.suffix for file in (tmp_path / "closeform" / "kernels").iterdir()] == [".lock"]


def test_locks_of_killed_processes_and_strange_ones_keep_nobody_waiting(tmp_path):
    whole = evaluated(tmp_path)[0]
    file = compiled_file(tmp_path)
    lock = file.with_name(f"{file.name}.lock")
    hold = f"import fcntl, time; f = open({str(lock)!r}, 'ab'); fcntl.flock(f, 2); print(); time.sleep(99)"
    with subprocess.Popen([sys.executable, "-u", "-c", hold], stdout=subprocess.PIPE) as holder:
        holder.stdout.readline()
        holder.kill()
    file.unlink()
    assert evaluated(tmp_path)[0] == whole
    file.unlink()
    lock.unlink()
    lock.mkdir()
    assert evaluated(tmp_path)[0] == whole


def nobody(cache, read_only):
    """What a process of the user nobody says, whose cache it may only read or not even that."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("needs root and setpriv to become somebody else")
    kernels = cache / "closeform" / "kernels"
    for folder in (cache, *cache.parents):
        if folder.stat().st_uid == 0 and not folder.stat().st_mode & 1:
            folder.chmod(folder.stat().st_mode | 0o711)
    for file in kernels.iterdir():
        file.chmod(0o444 if read_only else 0o000)
    kernels.chmod(0o555)
    program = "import closeform as cf; print(cf.Orbit(1.1e-3).coast([1] * 6, 9.0).position(1.0)[0])"
    drop = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    return subprocess.run(
        [*drop, sys.executable, "-c", program],
        env={**os.environ, "HOME": str(cache), "XDG_CACHE_HOME": str(cache)},
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize("read_only", [True, False])
def test_a_cache_of_somebody_else(tmp_path, read_only):
    evaluated(tmp_path)
    done = nobody(tmp_path, read_only)
    if "Permission denied" in done.stderr and "python" in done.stderr:
        pytest.skip("nobody may not run this Python")
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") == (0 if read_only else 1)


def test_a_copy_of_the_package_elsewhere_shares_its_kernels(tmp_path):
    """Neither where the sources lie nor when they were written tells kernels apart; what they say does."""
    source = Path(closeform.__file__).parent
    evaluated(tmp_path)
    copy = shutil.copytree(source, tmp_path / "elsewhere" / "closeform", copy_function=shutil.copyfile)
    assert evaluated(tmp_path, PYTHONPATH=str(copy.parent))[1] == ""
    arc = copy / "motion" / "arc.py"  # which `path.evaluate` is compiled with
    arc.write_text("# A comment\n" + arc.read_text())
    assert evaluated(tmp_path, PYTHONPATH=str(copy.parent))[1] == ""
    hill = copy / "motion" / "hill.py"  # which is two imports away
    hill.write_text(re.sub(r"SERIES_BELOW = [0-9.]+", "SERIES_BELOW = 1.9", hill.read_text()))
    assert "compiling" in evaluated(tmp_path, PYTHONPATH=str(copy.parent))[1]


@pytest.mark.parametrize(
    ("maker", "old", "new"),
    [("kernel_loans", "gep_inbounds", "gep"), ("kernel_parts", '"DeadBranchPrune", ', "")],
)
def test_kernels_made_in_another_way_are_others(tmp_path, maker, old, new):
    """By what writes LLVM code of its own, which no kernel names, or by another choice of numba's passes."""
    copy = shutil.copytree(Path(closeform.__file__).parent, tmp_path / "closeform")
    file, content = copy / f"{maker}.py", (copy / f"{maker}.py").read_text()
    code = (
        "import closeform.motion.path; from closeform.compiled import ENTRIES; print(ENTRIES[0]._cache.path)"
    )

    def named(seed):
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONHASHSEED": seed}
        return subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, check=True
        ).stdout

    before = named("1")
    file.write_text(content)  # anew
    assert named("2") == before
    assert old in content
    file.write_text(content.replace(old, new))
    assert named("1") != before


def test_kernels_that_nobody_uses_are_dropped(tmp_path):
    whole = evaluated(tmp_path)[0]
    file = compiled_file(tmp_path)
    old = file.with_name("of_last_year")
    old.write_bytes(b"")
    for name, age in ((old, 60), (file, 20)):  # days
        os.utime(name, (time.time() - 86400 * age,) * 2)
    assert evaluated(tmp_path) == (whole, "")  # used again, so it is not old any more
    assert time.time() - file.stat().st_mtime < 3600
    assert old.exists()
    evaluated(tmp_path, MORE)
    assert file.exists()
    assert not old.exists()


def test_two_processes_compile_a_kernel_once(tmp_path):
    code = "import closeform.compiled as c; print(*(e.stats.cache_hits for e in c.ENTRIES if e.overloads))"
    with ThreadPoolExecutor(2) as pool:
        both = [f.result()[0] for f in [pool.submit(evaluated, tmp_path, code) for _ in range(2)]]
    assert sorted(text.count(": 1") for text in both) == [0, 1]  # one compiled it, one loaded it


LINKED = """
import numpy as np
from numba import float64
from closeform.compiled import kernel

@kernel(float64(float64))
def inner(x):
    return np.sin(x) + x

@kernel(float64(float64))
def outer(x):
    return inner(2.0 * x)

print(outer(0.5), [sum(entry.stats.cache_hits.values()) for entry in (inner, outer)])
"""


def test_a_kernel_from_a_file_is_linked_into_one_that_is_compiled(tmp_path):
    """Its code for LLVM is read only then: all that is left of it otherwise is machine code."""
    value = str(math.sin(1.0) + 1.0)
    assert f"\n{value} [0, 0]\n" in evaluated(tmp_path, LINKED)[0]
    (file,) = (tmp_path / "closeform" / "kernels").glob("__main__.outer-*[!k]")  # no lock
    file.unlink()
    assert f"\n{value} [1, 0]\n" in evaluated(tmp_path, LINKED)[0]
    assert f"\n{value} [1, 1]\n" in evaluated(tmp_path, LINKED)[0]


def test_types_that_moved_are_others() -> None:
    """A file remembers the module of a named tuple: one that has moved since is not looked for there."""

    class Pair(NamedTuple):
        first: float
        second: float

    def text(module: str) -> str:
        Pair.__module__ = module
        return type_text(types.NamedTuple((types.float64, types.float64), Pair))

    assert text("closeform.old") != text("closeform.new")


def test_parts_that_moved_are_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """So it is for a function: the file of a kernel says in which module each of its parts was."""
    before = described(coast)
    monkeypatch.setattr(coast.py_func, "__module__", "closeform.moved")
    assert described(coast) != before


# as the command line, but for what it writes in fewer instructions
OURS = """
from closeform import kernel_memory, own_process
own_process.begin()
own_process.import_numba()
kernel_memory.remember()
"""
TOTALS = """
from closeform.compiled import prepare
from closeform.motion.effort import arc_energy, totals
prepare(totals)
print(sum(arc_energy.stats.cache_hits.values()))
print(*(made.library.get_asm_str() for made in totals.overloads.values()))
"""


def compiled_totals(cache, begin=""):
    """Whether a part of a kernel of arithmetic, arrays and loops was on disk, and instructions by function.

    In a fresh process. numba and LLVM count what they compile, or tell it by its address, in names alone;
    functions follow one another as their modules were linked.
    """
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", begin + TOTALS],
        env={**os.environ, "HOME": str(cache), "XDG_CACHE_HOME": str(cache)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    hits, _, text = done.stdout.partition("\n")
    unnamed = re.sub(r"B\d+v\d+|\.\d+(?=, %)|(?<=\.L[A-Z]{2})[A-Z]*\d+", "", text)
    functions = re.split(r"^[^.\s].*:", unnamed, flags=re.MULTILINE)
    instructions = sorted(re.findall(r"^\t[a-z].*", function, re.MULTILINE) for function in functions)
    assert sum(map(len, instructions)) > 1000
    return int(hits), instructions


def test_what_the_compiler_remembers_changes_no_instruction(tmp_path):
    assert compiled_totals(tmp_path / "ours", OURS) == compiled_totals(tmp_path / "whole")


def test_parts_that_another_process_has_compiled_are_linked(tmp_path):
    """The same instructions as without; libraries keep no parts.

    What is damaged is compiled anew, and so is what calls a part that is gone.
    """
    hits, instructions = compiled_totals(tmp_path, OURS)
    assert hits == 0
    kernels = tmp_path / "closeform" / "kernels"

    def forget():
        for file in kernels.glob("motion.effort.totals-*"):
            file.unlink()

    forget()
    assert compiled_totals(tmp_path, OURS) == (1, instructions)
    forget()
    (part,) = kernels.glob("motion.effort.arc_energy-*")
    part.write_bytes(part.read_bytes()[:-1])
    assert compiled_totals(tmp_path, OURS) == (0, instructions)
    forget()
    (called,) = kernels.glob("motion.effort.integral-*")
    called.unlink()
    assert compiled_totals(tmp_path, OURS) == (0, instructions)
    forget()
    assert compiled_totals(tmp_path, OURS) == (1, instructions)
    forget()
    assert compiled_totals(tmp_path) == (0, instructions)


def test_a_lent_tuple_with_other_fields_is_another() -> None:
    """A part's file is named by the types of its arguments: numba's text of one that is lent has its name."""

    def text(*fields: str) -> str:
        group = NamedTuple("Pair", [(field, float) for field in fields])  # type: ignore[misc]
        return type_text(Lent(types.NamedTuple((types.float64,) * len(fields), group)))

    assert len({text("first"), text("second"), text("first", "second")}) == 3


def test_no_two_processes_number_functions_alike():
    """Nor forks, such as those that draw: what one has compiled of a part, others link to their own."""
    program = """
        import os
        from closeform import own_process
        own_process.begin()
        import closeform.compiled
        from numba.core.bytecode import FunctionIdentity
        child = os.fork()
        if child:
            os.waitpid(child, 0)
        print(*(next(FunctionIdentity._unique_ids) for _ in range(3)), flush=True)
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    told = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)]
    numbers = " ".join(told).split()
    assert len({*numbers}) == len(numbers) == 12
