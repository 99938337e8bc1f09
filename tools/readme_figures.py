"""Copies the figures that decide from docs/benchmarks.md into README, and names those that are not reached.

Run from the repository, after benchmarks/run.py: python tools/readme_figures.py
"""

from pathlib import Path

ROOT = Path(__file__).parents[1]
FIRST, LAST = "<!-- figures: copied by tools/readme_figures.py -->\n", "<!-- end of figures -->\n"
DECISIVE = (
    "screen, natural motion, a pair",
    "against V-BAR's batch",
    "thrusting, against 1 s sampling, table, vectorised",
    "avoid, against the convex program",
    "joint plan, against convex programs",
    "swap of 12 for delta-v, below least energy's",
    "impulses, 10,000 random transfers: greatest certified gap",
    "lock_times, 1,000,000 pairs",
)


def figures() -> str:
    """The decisive rows of "Figures to reach"; how many there are, and which are missed."""
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    section = page.partition("## Figures to reach\n")[2].partition("\n## ")[0]
    head, rule, *rows = [line for line in section.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    named = {cell[0]: row for cell, row in zip(cells, rows, strict=True)}
    missed = [f"{what} ({got}, asked {asked})" for what, asked, got, met in cells if met != "yes"]
    told = f"{len(rows) - len(missed)} of {len(rows)} figures are reached"
    told += f". Not reached: {'; '.join(missed)}." if missed else "."
    return "\n".join([head, rule, *(named[name] for name in DECISIVE), "", told]) + "\n"


def renewed(readme: str) -> str:
    """README with the figures of today's page."""
    before, _, rest = readme.partition(FIRST)
    _, _, after = rest.partition(LAST)
    return f"{before}{FIRST}{figures()}{LAST}{after}"


if __name__ == "__main__":
    file = ROOT / "README.md"
    file.write_text(renewed(file.read_text(encoding="utf-8")), encoding="utf-8")
