"""The benchmark: closeform and its peers on the same work, side by side in one run.

    python benchmarks/run.py                 measures everything, prints it and writes docs/benchmarks.md
    python benchmarks/run.py --only fuel     measures a section anew; the others stay on the page as they are
    python benchmarks/run.py --quick         a small version that only shows that everything runs

Each section runs in a process of its own, so that none disturbs another; those that compare
single cores are pinned to one.  What was measured last is kept in benchmarks/measured.
"""

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path

from tables import Report, Table, as_markdown, as_text, figures_table, seconds
from timing import machine, say

SECTIONS = {
    "natural": 1,
    "thrusting": 1,
    "many": None,
    "shaping": 1,
    "formation": 1,
    "limits": 1,
    "locks": None,
    "gathering": None,
    "campaign": None,
    "fuel": None,
    "fuel_zones": 1,
    "drift": 1,
    "drift_pairs": None,
    "sigmas": 1,
    "probability": None,
    "planning": 1,
    "field": None,
    "basilisk": 1,
    "kernels": 1,
    "start": None,
    "viewer": None,
    "exchange": 1,
}  # cores; None: all
LIMIT = 1200  # seconds a section may take
TESTS = Path(__file__).parents[1] / "tests"  # formations fixed before the planner was tuned
TOOLS = Path(__file__).parents[1] / "tools"  # crowds
PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
MEASURED = Path(__file__).parent / "measured"  # SECTION.json: when, on what machine, and its report


def main() -> int:
    parser = argparse.ArgumentParser(description="closeform and its peers on the same work.")
    parser.add_argument("--quick", action="store_true", help="a small version; writes no page")
    parser.add_argument(
        "--only", choices=SECTIONS, nargs="+", help="some sections; the page keeps the others"
    )
    parser.add_argument("--result", type=Path, help=argparse.SUPPRESS)  # a section's own process
    arguments = parser.parse_args()
    if arguments.result:
        measure_here(arguments.only[0], arguments.quick, arguments.result)
        return 0
    reports = {name: measured(name, arguments.quick) for name in arguments.only or SECTIONS}
    print(machine())
    for table in tables_of(reports):
        print("\n" + as_text(table))
    if not arguments.quick:
        keep(reports)
    return 1 if any(report.failed for report in reports.values()) else 0


def keep(reports: dict[str, Report]) -> None:
    """Write what was measured, and the page of what was measured last of every section."""
    MEASURED.mkdir(exist_ok=True)
    for name, report in reports.items():
        if not report.failed:
            plain = {"date": date.today().isoformat(), "machine": machine(), "report": report.plain()}
            text = json.dumps(plain, indent=1, ensure_ascii=False)
            (MEASURED / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")
    say(f"wrote {PAGE}")


def tables_of(reports: dict[str, Report]) -> list[Table]:
    """Figures to reach, then each section's tables."""
    figures = [figure for report in reports.values() for figure in report.figures]
    speeds = {name: speed for report in reports.values() for name, speed in report.speeds.items()}
    sections = [table for report in reports.values() for table in report.tables]
    return [figures_table(figures), *sections, on_board(speeds)]


def measured(section: str, quick: bool) -> Report:
    """One section in a process of its own; a failure becomes its table."""
    say(f"{section} ...")
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [sys.executable, __file__, "--only", section, "--result", str(result)]
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        try:
            subprocess.run(command + ["--quick"] * quick, env=environment, check=True, timeout=LIMIT)
        except subprocess.SubprocessError as error:
            failure = Table(f"{section}: not measured", ["reason"], [[str(error)]])
            return Report([failure], failed=True)
        return Report.from_plain(json.loads(result.read_text()))


def measure_here(section: str, quick: bool, result: Path) -> None:
    """Measure a section in this process, on its share of the cores."""
    share = SECTIONS[section]
    if share and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-share:])
    sys.path += [str(TESTS), str(TOOLS)]
    report = importlib.import_module(f"sections.{section}").measure(quick)
    result.write_text(json.dumps(report.plain()))


# SP11 section 5: on a desktop of 2 GHz; on board it expects 1000 times as long.
PUBLISHED = {
    "conflicts of a coasting pair": (0.0002, "natural"),
    "conflicts of a thrusting pair": (0.0067, "thrusting"),
    "conflicts found and a path shaped": (0.04, "shaping"),
}
SLOWER = 1000


def on_board(speeds: dict[str, float]) -> Table:
    """SP11's estimate for a satellite's processor, and the same factor on what was measured here."""
    rows = []
    for name, (published, key) in PUBLISHED.items():
        here = [speeds.get(key), speeds.get(f"{key} SP11")]
        cells = [seconds(value) if value else "-" for value in here]
        rows.append(
            [
                name,
                seconds(published),
                cells[1],
                cells[0],
                seconds(published * SLOWER),
                seconds(here[0] * SLOWER) if here[0] else "-",
            ]
        )
    columns = ["", "SP11 then", "its method here", "closeform", "SP11 on board", "closeform"]
    note = f"On board: {SLOWER} times slower, as SP11 estimates; it published times of a 2 GHz desktop."
    return Table("On board a satellite", columns, rows, [note])


def page() -> str:
    """docs/benchmarks.md, of what was measured last of every section."""
    kept = {
        name: json.loads(file.read_text(encoding="utf-8"))
        for name in SECTIONS
        if (file := MEASURED / f"{name}.json").exists()
    }
    runs: dict[tuple[str, str], list[str]] = {}
    for name, one in kept.items():
        runs.setdefault((one["machine"], one["date"]), []).append(name)
    told = "\n".join(f"- {', '.join(names)}: {day}, {on}" for (on, day), names in sorted(runs.items()))
    head = f"""# Benchmarks

Written by `python benchmarks/run.py`; do not edit. Each section of `benchmarks/sections` was measured in
one run:

{told}

Times are medians; “spread” is half the range of the repeats over the median; “takes” is the time relative to
closeform's in the same table. Compilation is left out, except where a table says so. The peers are in
`benchmarks/peers`, and each says at its top what it does and what it does not. To repeat it:

    pip install -e '.[benchmark]'
    python benchmarks/run.py

V-BAR needs Python 3.12; on 3.11 its table says that it was left out, and so does
that of Basilisk without the extra `basilisk`.
"""
    tables = tables_of({name: Report.from_plain(one["report"]) for name, one in kept.items()})
    return head + "\n" + "\n".join(as_markdown(table) for table in tables)


if __name__ == "__main__":
    sys.exit(main())
