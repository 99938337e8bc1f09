"""Compiled kernels on disk: whose they are, and what happens where they cannot be read or written."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import closeform


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


@pytest.mark.parametrize(
    "damage",
    [lambda b: b"", lambda b: b[:3000], lambda b: b[:5000] + b"x" + b[5001:]],
    ids=["empty", "truncated", "a wrong byte"],
)
def test_a_damaged_cache_is_compiled_anew(tmp_path, damage):
    whole = evaluated(tmp_path)[0]
    file = compiled_file(tmp_path)
    file.write_bytes(damage(file.read_bytes()))
    said, noted = evaluated(tmp_path)
    assert said == whole
    assert noted == f"closeform: {file} is damaged; compiling it anew\n"
    assert evaluated(tmp_path) == (whole, "")


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
    evaluated(tmp_path, "cf.Orbit(1.1e-3).transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)")  # compiles another
    assert file.exists()
    assert not old.exists()


def test_two_processes_compile_a_kernel_once(tmp_path):
    code = "import closeform.compiled as c; print(*(e.stats.cache_hits for e in c.ENTRIES if e.overloads))"
    with ThreadPoolExecutor(2) as pool:
        both = [f.result()[0] for f in [pool.submit(evaluated, tmp_path, code) for _ in range(2)]]
    assert sorted(text.count(": 1") for text in both) == [0, 1]  # one compiled it, one loaded it
