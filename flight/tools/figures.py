"""Measure the flight core and write the tables of docs/on_board.md: size, stack, instructions of each target.

Usage: python flight/tools/figures.py VECTORS, the folder of `closeform flight-vectors`. It needs the cross
compilers of TARGETS and QEMU 7.2 (qemu-user). The stack is the longest path in the compiler's call graph.
Instructions are those that QEMU counts in the golden vectors: two replays less one, over the number of cases.
"""

import re
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

FLIGHT = Path(__file__).parents[1]
PAGE = FLIGHT.parent / "docs" / "on_board.md"
FLAGS = ["-std=gnu99", "-ffp-contract=off", "-fno-math-errno", "-DCFF_FREESTANDING"]
THUMB = ["-nostartfiles", "tests/start_thumb.c", "-lm", "--specs=nosys.specs"]
SPARC = "-fno-tree-loop-distribute-patterns -fno-pie -no-pie"
TARGETS = {  # compiler and its options, emulator, what the program is linked with
    "Cortex-M7": (
        "arm-none-eabi-gcc -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16",
        "qemu-arm -cpu max",
        THUMB,
    ),
    "Cortex-M4, software double": (
        "arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16",
        "qemu-arm -cpu max",
        THUMB,
    ),
    "LEON3": (
        f"sparc64-linux-gnu-gcc -m32 -mcpu=leon3 {SPARC}",
        "qemu-sparc -cpu LEON3",
        ["-nostdlib", "-static", "tests/start_sparc.c"],
    ),
}
WORK = [  # number in golden.c, cases, name
    (1, "pair", "conflicts of a pair"),
    (2, "pair", "closest approach"),
    (3, "transfer", "transfer, coast and energy"),
    (5, "avoid", "avoidance of one or two"),
    (6, "loss", "loss of thrust"),
    (7, "impulses", "minimum delta-v"),
]
MODELS = ("Hill", "table")


def built(compiler: str, place: Path) -> tuple[int, dict[str, int], dict[str, set[str]]]:
    """Return the bytes of code and constants with -Os, and the stack and the calls of each function."""
    size, stacks, calls = 0, {}, {}
    command, *options = compiler.split()
    for source in sorted((FLIGHT / "src").glob("*.c")):
        out = place / f"{source.stem}.o"
        given = [command, *options, *FLAGS, "-Os", "-fcallgraph-info=su", f"-I{FLIGHT / 'include'}"]
        subprocess.run([*given, "-c", str(source), "-o", str(out)], check=True)
        listed = subprocess.run(
            [command.replace("gcc", "size"), out], capture_output=True, text=True, check=True
        )
        text, data, bss = map(int, listed.stdout.splitlines()[1].split()[:3])
        assert data + bss == 0, f"{source.name} has writable data"
        size += text
        graph = out.with_suffix(".ci").read_text()
        for name, bytes_ in re.findall(
            r'node: { title: "([^"]+)" label: "[^"]*?(\d+) bytes \(static\)', graph
        ):
            stacks[name] = int(bytes_)
        for caller, callee in re.findall(r'edge: { sourcename: "([^"]+)" targetname: "([^"]+)"', graph):
            calls.setdefault(caller, set()).add(callee)
    return size, stacks, calls


def deepest(stacks: dict[str, int], calls: dict[str, set[str]]) -> dict[str, int]:
    """Return the deepest stack below each public function."""

    @cache
    def depth(name: str) -> int:  # ends, because nothing is recursive
        return stacks.get(name, 0) + max(map(depth, calls.get(name, ())), default=0)

    return {name: depth(name) for name in stacks if name.startswith("cff_")}


def instructions(compiler: str, emulator: str, linked: list[str], vectors: Path, place: Path) -> list[float]:
    """Return the mean number of instructions of each kind of work and model, with -O2; 0 without cases."""
    header = (vectors / "golden_vectors.h").read_text()
    given = [*compiler.split(), *FLAGS, "-O2", "-Iinclude", f"-I{vectors}"]
    sources = sorted(map(str, (FLIGHT / "src").glob("*.c")))
    objects = [str(place / f"{Path(source).stem}_2.o") for source in sources]
    for source, made in zip(sources, objects, strict=True):
        subprocess.run([*given, "-c", source, "-o", made], check=True, cwd=FLIGHT)
    found = []
    for number, kind, _ in WORK:
        listed = re.search(rf"golden_{kind}\[.*?\] = {{\n(.*?)\n}};", header, re.DOTALL)
        assert listed is not None
        orbits = re.findall(r"^    {(\d), ", listed[1], re.MULTILINE)
        for table in range(len(MODELS)):
            cases = sum((int(orbit) >= 2) == bool(table) for orbit in orbits)  # 2 and 3 have tables
            totals = []
            for repeat in (1, 2):
                asked = [
                    f"-DWORK={number}",
                    f"-DTABLE={table}",
                    f"-DREPEAT={repeat}",
                    "-o",
                    str(place / "golden"),
                ]
                subprocess.run([*given, "tests/golden.c", *objects, *linked, *asked], check=True, cwd=FLIGHT)
                plugin = ["-plugin", str(place / "count.so"), "-d", "plugin", str(place / "golden")]
                done = subprocess.run(
                    [*emulator.split(), *plugin], capture_output=True, text=True, check=True
                )
                totals.append(int(re.findall(r"instructions (\d+)", done.stderr)[-1]))
            found.append((totals[1] - totals[0]) / cases if cases else 0.0)
    return found


def rounded(value: float) -> str:
    """Return a number with two digits, in thousands or millions; a dash for 0."""
    for unit, name in ((1e6, " M"), (1e3, " k"), (1.0, "")):
        if value >= unit:
            return f"{float(f'{value / unit:.2g}'):g}{name}"
    return f"{value:.2g}" if value else "-"


def tables(vectors: Path) -> str:
    """Return the tables in Markdown."""
    sizes = [
        "| target, `-Os` | code and constants | stack of a search | of an avoidance |",
        "|---|---:|---:|---:|",
    ]
    means: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        plugin = ["gcc", "-shared", "-fPIC", str(FLIGHT / "tools" / "count_instructions.c")]
        subprocess.run([*plugin, "-o", str(place / "count.so")], check=True)
        for label, (compiler, emulator, linked) in TARGETS.items():
            size, stacks, calls = built(compiler, place)
            below = deepest(stacks, calls)
            search = below["cff_conflicts_continue"]
            sizes.append(f"| {label} | {size / 1024:.1f} KiB | {search} bytes | {below['cff_avoid']} bytes |")
            means[label] = instructions(compiler, emulator, linked, vectors, place)
    heads = " | ".join(means)
    counts = [f"| mean instructions, `-O2` | model | {heads} | LEON3 at 100 MHz |", "|---|---|" + "---:|" * 4]
    for k, (name, model) in enumerate((name, model) for _, _, name in WORK for model in MODELS):
        if means["LEON3"][k] > 0.0:
            row = " | ".join(rounded(each[k]) for each in means.values())
            counts.append(f"| {name} | {model} | {row} | {rounded(means['LEON3'][k] / 1e5)} ms |")
    return "\n".join([*sizes, "", *counts])


def main() -> None:
    vectors = Path(sys.argv[1]).resolve()
    begin, end = "<!-- figures -->\n", "\n<!-- end -->"
    measured = tables(vectors)
    head, rest = PAGE.read_text(encoding="utf-8").split(begin)
    PAGE.write_text(head + begin + measured + end + rest.split(end, 1)[1], encoding="utf-8")


if __name__ == "__main__":
    main()
