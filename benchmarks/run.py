"""Benchmark of closeform and its peers on the same tasks in one run.

    python benchmarks/run.py                 measure everything, print it and write docs/benchmarks.md
    python benchmarks/run.py --only fuel     measure one section; the page keeps the others
    python benchmarks/run.py --quick         run a small version that only shows that everything works

Each section runs in its own process. Sections that compare single cores are pinned to one core. The latest
results of each section are in benchmarks/measured.
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

from tables import Report, Table, as_markdown, as_text, figures_table, other_figures, seconds
from timing import machine, say

SECTIONS = {
    "natural": 1,
    "thrusting": 1,
    "many": None,
    "shaping": 1,
    "any_chief": 1,
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
    "combined": 1,
    "field": None,
    "basilisk": 1,
    "kernels": 1,
    "start": None,
    "viewer": None,
    "exchange": 1,
}  # number of cores; None: all
LIMIT = 1200  # maximum time of a section [s]
TESTS = Path(__file__).parents[1] / "tests"  # formations
TOOLS = Path(__file__).parents[1] / "tools"  # crowds
PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
MEASURED = Path(__file__).parent / "measured"  # SECTION.json: date, machine and report


def main() -> int:
    parser = argparse.ArgumentParser(description="Compare closeform and its peers on the same tasks.")
    parser.add_argument("--quick", action="store_true", help="run a small version; write no page")
    parser.add_argument(
        "--only", choices=SECTIONS, nargs="+", help="measure these sections; the page keeps the others"
    )
    parser.add_argument("--result", type=Path, help=argparse.SUPPRESS)  # process of one section
    arguments = parser.parse_args()
    if arguments.result:
        measure_here(arguments.only[0], arguments.quick, arguments.result)
        return 0
    reports = {name: measured(name, arguments.quick) for name in arguments.only or SECTIONS}
    print(machine())
    figures = [figure for report in reports.values() for figure in report.figures]
    for table in [figures_table(figures), *tables_of(reports)]:
        print("\n" + as_text(table))
    if not arguments.quick:
        keep(reports)
    return 1 if any(report.failed for report in reports.values()) else 0


def keep(reports: dict[str, Report]) -> None:
    """Write the measured reports, and the page with the latest report of each section."""
    MEASURED.mkdir(exist_ok=True)
    for name, report in reports.items():
        if not report.failed:
            plain = {"date": date.today().isoformat(), "machine": machine(), "report": report.plain()}
            text = json.dumps(plain, indent=1, ensure_ascii=False)
            (MEASURED / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")
    say(f"wrote {PAGE}")


def tables_of(reports: dict[str, Report]) -> list[Table]:
    """Return the tables of each section, the on-board estimate and the figures without a table."""
    speeds = {name: speed for report in reports.values() for name, speed in report.speeds.items()}
    sections = [table for report in reports.values() for table in report.tables]
    return [*sections, on_board(speeds), other_figures(list(reports.values()))]


def measured(section: str, quick: bool) -> Report:
    """Run a section in its own process; a failure becomes its table."""
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
    """Measure a section in this process, on its number of cores."""
    share = SECTIONS[section]
    if share and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-share:])
    sys.path += [str(TESTS), str(TOOLS)]
    report = importlib.import_module(f"sections.{section}").measure(quick)
    result.write_text(json.dumps(report.plain()))


# SP11 section 5: times on a desktop of 2 GHz; SP11 estimates 1000 times as long on board.
PUBLISHED = {
    "conflicts of a coasting pair": (0.0002, "natural"),
    "conflicts of a thrusting pair": (0.0067, "thrusting"),
    "conflicts found and a path shaped": (0.04, "shaping"),
}
SLOWER = 1000


def on_board(speeds: dict[str, float]) -> Table:
    """Return the on-board estimate of SP11, and the same factor applied to the measured times."""
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
    columns = ["task", "SP11, published", "SP11 method", "closeform", "SP11 on board", "closeform on board"]
    note = (
        f"On board: {SLOWER} times slower, the estimate of SP11. Its published times are of a 2 GHz desktop."
    )
    return Table("On-board estimate", columns, rows, [note])


def page() -> str:
    """Return docs/benchmarks.md with the latest report of each section."""
    kept = {
        name: json.loads(file.read_text(encoding="utf-8"))
        for name in SECTIONS
        if (file := MEASURED / f"{name}.json").exists()
    }
    runs: dict[tuple[str, str], list[str]] = {}
    for name, one in kept.items():
        runs.setdefault((one["machine"], one["date"]), []).append(name)
    listed = "\n".join(f"- {', '.join(names)}: {day}, {on}" for (on, day), names in sorted(runs.items()))
    head = f"""# Benchmarks

`python benchmarks/run.py` writes this page; do not edit it. Each section of `benchmarks/sections` was
measured in one run:

{listed}

Times are medians. “Spread” is half the range of the repeats over the median. “Relative time” is relative to
closeform in the same table. Times exclude compilation unless a table states otherwise. The peers are in
`benchmarks/peers`, and the header of each states its method and its limits. To repeat the measurements:

    pip install -e '.[benchmark]'
    python benchmarks/run.py

V-BAR requires Python 3.12, and Basilisk the extra `basilisk`. Without them their tables are empty.
"""
    tables = tables_of({name: Report.from_plain(one["report"]) for name, one in kept.items()})
    return head + "\n" + "\n".join(as_markdown(table) for table in tables)


if __name__ == "__main__":
    sys.exit(main())
