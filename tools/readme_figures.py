"""Copies the table of figures from docs/benchmarks.md into README.

Run from the repository, after benchmarks/run.py: python tools/readme_figures.py
"""

from pathlib import Path

ROOT = Path(__file__).parents[1]
FIRST, LAST = "<!-- figures: copied by tools/readme_figures.py -->\n", "<!-- end of figures -->\n"


def figures() -> str:
    """The table "Figures to reach"."""
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    section = page.partition("## Figures to reach\n")[2].partition("\n## ")[0]
    return "".join(f"{line}\n" for line in section.splitlines() if line.startswith("|"))


def renewed(readme: str) -> str:
    """README with the figures of today's page."""
    before, _, rest = readme.partition(FIRST)
    _, _, after = rest.partition(LAST)
    return f"{before}{FIRST}{figures()}{LAST}{after}"


if __name__ == "__main__":
    file = ROOT / "README.md"
    file.write_text(renewed(file.read_text(encoding="utf-8")), encoding="utf-8")
