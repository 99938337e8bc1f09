"""Change one operator of the library at a time: do golden vectors or the fuzzer's digest notice?

Usage: mutants.py VECTORS [COUNT] [SEED], VECTORS the folder of `closeform flight-vectors`.  A mutant is found
if golden.c fails or prints anything else, or the fuzzer does for 20 000 inputs.  Operators whose change
cannot change an answer, for a reason that EQUIVALENT states, are not drawn.
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
EQUIVALENT = {  # (part of a line, operator): why its change changes no answer
    ("gap = SAME", "*"): "pieces of one conflict meet at equal times; the gap only allows for rounding",
}
FLAGS = ["-w", "-std=gnu99", "-O1", "-ffp-contract=off", f"-I{FLIGHT / 'include'}", f"-I{FLIGHT / 'src'}"]


def sites(texts):
    """Yield (file, place, old, new) of all operators between expressions, outside of comments and macros."""
    for file, text in sorted(texts.items()):
        code = re.sub(r"/\*.*?\*/|^#[^\n]*$", lambda m: " " * len(m[0]), text, flags=re.DOTALL | re.MULTILINE)
        for m in re.finditer(r" ([+\-*/<>]|<=|>=|&&|\|\|) (?=[\w(-])", code):
            declared = code[: m.start()].rstrip().endswith(("(", ",", "double", "const"))
            line = text[text.rfind("\n", 0, m.start()) : text.find("\n", m.end())]
            if not declared and not any(part in line and m[1] == sign for part, sign in EQUIVALENT):
                yield file, m.start(1), m[1], SWAPS[m[1]]


def ran(place, objects, name):
    """Return the status and the output of a program; a hang counts as an answer."""
    subprocess.run(["gcc", *objects, place / f"{name}.o", "-lm", "-o", place / name], check=True)
    try:
        done = subprocess.run([place / name], capture_output=True, timeout=60)
    except subprocess.TimeoutExpired:
        return "hangs"
    return done.returncode, done.stdout


def main():
    """Print the mutants that are not found, and how many are."""
    vectors, count, seed = sys.argv[1], *(int(a) for a in (*sys.argv[2:4], "150", "3")[:2])
    texts = {file.name: file.read_text() for file in (FLIGHT / "src").glob("*.c")}  # one state of the sources
    chosen = random.Random(seed).sample(list(sites(texts)), count)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)

        def compiled(name, text, *options):
            (place / f"{name}.c").write_text(text)
            given = [*FLAGS, *options, "-c", place / f"{name}.c", "-o", place / f"{name}.o"]
            subprocess.run(["gcc", *given], check=True)
            return place / f"{name}.o"

        objects = {file: compiled(Path(file).stem, text) for file, text in texts.items()}
        for name, option in (("golden", f"-I{vectors}"), ("fuzz", "-DCASES=20000")):
            compiled(name, (FLIGHT / "tests" / f"{name}.c").read_text(), option)
        expected = {name: ran(place, objects.values(), name) for name in ("golden", "fuzz")}
        found = {"golden": 0, "fuzz": 0}
        for file, at, old, new in chosen:
            text = texts[file]
            mutant = compiled("mutant", text[:at] + new + text[at + len(old) :])
            mixed = [mutant if one == file else made for one, made in objects.items()]
            for name, answer in expected.items():
                if ran(place, mixed, name) != answer:
                    found[name] += 1
                    break
            else:
                number = text[:at].count("\n")
                where, line = f"{file}:{number + 1}", text.splitlines()[number].strip()
                print(f"not found: {where:24} {old:2} as {new:2}  {line[:90]}", flush=True)
    print(
        f"{sum(found.values())} of {count} mutants found: {found['golden']} by golden vectors, "
        f"{found['fuzz']} more by fuzzing"
    )


main()
