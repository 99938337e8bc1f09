"""Change one operator or constant of the library at a time: do golden vectors or the fuzzer's tallies notice?

Usage: mutants.py VECTORS [COUNT] [SEED], VECTORS the folder of `closeform flight-vectors`.  A mutant is found
if golden.c fails or prints anything else, or the fuzzer's 20 000 own inputs do.
"""

import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path

FLIGHT = Path(__file__).parents[1]
SWAPS = {
    "+": "-",
    "-": "+",
    "*": "/",
    "/": "*",
    "<": ">=",
    ">": "<=",
    "<=": ">",
    ">=": "<",
    "&&": "||",
    "||": "&&",
}
FLAGS = ["-w", "-std=gnu99", "-O1", "-ffp-contract=off", f"-I{FLIGHT / 'include'}", f"-I{FLIGHT / 'src'}"]


def sites():
    """Yield (file, place, old, new) of all operators between expressions, outside of comments and macros."""
    for file in sorted((FLIGHT / "src").glob("*.c")):
        text = file.read_text()
        code = re.sub(r"/\*.*?\*/|^#[^\n]*$", lambda m: " " * len(m[0]), text, flags=re.DOTALL | re.MULTILINE)
        for m in re.finditer(r" ([+\-*/<>]|<=|>=|&&|\|\|) (?=[\w(-])", code):
            if not code[: m.start()].rstrip().endswith(("(", ",", "double", "const")):
                yield file, m.start(1), m[1], SWAPS[m[1]]


def ran(place, objects, name):
    """Return what a program prints, and its status; a hang counts as an answer."""
    subprocess.run(["gcc", *objects, place / f"{name}.o", "-lm", "-o", place / name], check=True)
    try:
        done = subprocess.run([place / name], capture_output=True, timeout=60)
    except subprocess.TimeoutExpired:
        return "hangs"
    return done.returncode, done.stdout


def main():
    """Print how many mutants are found, and those that are not."""
    vectors, count, seed = sys.argv[1], *(int(a) for a in (*sys.argv[2:4], "150", "3")[:2])
    chosen = random.Random(seed).sample(list(sites()), count)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for file in (FLIGHT / "src").glob("*.c"):
            subprocess.run(["gcc", *FLAGS, "-c", file, "-o", place / f"{file.stem}.o"], check=True)
        for name, extra in (("golden", [f"-I{vectors}"]), ("fuzz", ["-DCASES=20000"])):
            source = FLIGHT / "tests" / f"{name}.c"
            subprocess.run(["gcc", *FLAGS, *extra, "-c", source, "-o", place / f"{name}.o"], check=True)
        objects = sorted(place.glob("cff_*.o"))
        expected = {name: ran(place, objects, name) for name in ("golden", "fuzz")}
        found, alive = {"golden": 0, "fuzz": 0}, []
        for file, at, old, new in chosen:
            text = file.read_text()
            (place / "mutant.c").write_text(text[:at] + new + text[at + len(old) :])
            subprocess.run(["gcc", *FLAGS, "-c", place / "mutant.c", "-o", place / "mutant.o"], check=True)
            mixed = [place / "mutant.o" if one.stem == file.stem else one for one in objects]
            for name, answer in expected.items():
                if ran(place, mixed, name) != answer:
                    found[name] += 1
                    break
            else:
                line = text[:at].count("\n")
                alive.append((file.name, line + 1, old, new, text.splitlines()[line].strip()[:90]))
    print(
        f"{sum(found.values())} of {count} mutants found: {found['golden']} by golden vectors, "
        f"{found['fuzz']} more by fuzzing"
    )
    for one in alive:
        print("  alive:", *one)


main()
