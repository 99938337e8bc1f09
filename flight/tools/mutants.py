"""Do the golden vectors notice a fault?  Each mutant of the core changes one operator or constant."""
import random, re, subprocess, tempfile, shutil, sys
from pathlib import Path
ROOT = Path(__file__).parent.parent
random.seed(3)
sites = []
for f in sorted((ROOT / "core").glob("*.c")):
    text = f.read_text()
    code = re.sub(r"/\*.*?\*/", lambda m: " " * len(m[0]), text, flags=re.S)
    for m in re.finditer(r" ([+\-*/<>]|<=|>=|&&|\|\|) (?=[\w(-])", code):
        if code[: m.start()].rstrip().endswith(("(", ",", "double", "const")):
            continue
        swap = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">", ">": "<", "<=": ">", ">=": "<", "&&": "||", "||": "&&"}[m[1]]
        sites.append((f.name, m.start(1), m[1], swap))
chosen = random.sample(sites, int(sys.argv[1]))
killed, alive, by_bits = 0, [], 0
base = subprocess.run(f"gcc -w -std=c99 -O1 {ROOT}/src/*.c {ROOT}/tests/golden.c -lm -o build/golden_base && build/golden_base", shell=True, capture_output=True, text=True).stdout.split("evaluations")[1]
with tempfile.TemporaryDirectory() as d:
    for name, at, old, new in chosen:
        work = Path(d) / "core"
        shutil.rmtree(work, ignore_errors=True)
        shutil.copytree(ROOT / "core", work)
        text = (work / name).read_text()
        (work / name).write_text(text[:at] + new + text[at + len(old):])
        source = (ROOT / "tests/golden.c").read_text()
        (Path(d) / "tests").mkdir(exist_ok=True)
        (Path(d) / "tests/golden.c").write_text(source)
        shutil.copy(ROOT / "tests/golden_vectors.h", Path(d) / "tests/golden_vectors.h")
        built = subprocess.run(f"gcc -w -std=c99 -O1 {work}/*.c {d}/tests/golden.c -lm -o {d}/g", shell=True, capture_output=True)
        if built.returncode:
            continue
        try:
            ran = subprocess.run([f"{d}/g"], capture_output=True, timeout=20, text=True)
            bad = ran.returncode != 0
            if not bad and ran.stdout.split("evaluations")[1] != base:
                by_bits += 1
                continue
        except subprocess.TimeoutExpired:
            bad = True
        killed += bad
        if not bad:
            line = text[:at].count("\n")
            alive.append((name, line + 1, text.splitlines()[line].strip()[:90], old, new))
print(f"{killed + by_bits} of {killed + by_bits + len(alive)} mutants found: {killed} by tolerances, {by_bits} more by bits and counts of evaluations")
for one in alive:
    print("  alive:", *one)
