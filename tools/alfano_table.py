"""Write the table of Alfano's conjunctions in docs/uncertainty.md.

python tools/alfano_table.py
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "uncertainty.md"
BEGIN, END = "<!-- alfano -->", "<!-- /alfano -->"


def table() -> str:
    """Return the table with one row per case."""
    sys.path.append(str(ROOT / "tests"))
    from test_alfano import CASES, probability

    lines = [
        "| case | radius | e | published [95 %] | entries by CARA | ever inside | at the start | entries | "
        "short encounter |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for number, case in CASES.items():
        cells = [f"{number}", f"{case['hard_body_radius_m']} m", f"{case['eccentricity']:.4f}"]
        cells.append(f"{case['monte_carlo_1e8']:.5g}")
        if case["interval_95"][0] is not None:
            cells[-1] += " [{:.5g}, {:.5g}]".format(*case["interval_95"])
        cells.append(f"{case['entries']:.5g}")
        _, figure = probability(number)
        cells += [f"{figure.value:.5g}", f"{figure.at_start:.2g}", f"{figure.mean_entries:.5g}"]
        try:
            cells.append(f"{probability(number, method='short-encounter')[1].value:.4g}")
        except ValueError:  # two neighbours on one orbit have no short encounter
            cells.append("")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def renewed(page: str) -> str:
    """Return the page with the new table."""
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}\n{table()}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
