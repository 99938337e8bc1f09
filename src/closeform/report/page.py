"""The result as one self-contained HTML page."""

import base64
import re
from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path

from closeform.report.section import Section
from closeform.report.table import Table

RIGHT_TO_LEFT = re.compile(
    "[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+(?: +[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+)*"
)
STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fdfdfc; --faint: #667; --line: #d5d8dc;
  --card: #f3f4f5; --good: #1a7f5a; --bad: #b3421e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ea; --paper: #16191d; --faint: #9aa3ad;
  --line: #363c44; --card: #1f2429; --good: #5bc49a; --bad: #f0926b; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 62rem; margin: 0 auto; padding: 2rem 1.2rem 4rem; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; } h2 { font-size: 1.2rem; margin: 2.4rem 0 .4rem;
  border-top: 1px solid var(--line); padding-top: 1.2rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; } p { margin: .35rem 0; } .faint { color: var(--faint); }
.verdict { display: inline-block; padding: .3rem .8rem; border-radius: .4rem; background: var(--card);
  font-weight: 600; margin: .8rem 0 0; } .good { color: var(--good); } .bad { color: var(--bad); }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .2rem .9rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; color: var(--faint); }
.words { text-align: left; } th:first-child, td:first-child { padding-left: 0; }
img { max-width: 100%; background: #fff; border-radius: .4rem; padding: .4rem; box-sizing: border-box; }
figure { margin: 1rem 0; } figcaption { color: var(--faint); font-size: .92rem; }
summary { cursor: pointer; margin: 1rem 0 .3rem; font-weight: 600; }
"""


def document(title: str, parts: list[str]) -> str:
    """The parts of a page as one HTML document without references to other files."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def head(title: str, lines: Iterable[str], verdict: str, good: bool) -> list[str]:
    """The title, what was flown, and how it ended."""
    tone = "good" if good else "bad"
    faint = (paragraph(line, "faint") for line in lines)
    return [f"<h1>{letters(title)}</h1>", *faint, paragraph(verdict, f"verdict {tone}")]


def letters(text: str) -> str:
    """A text as it is, with names that read from right to left set apart from the numbers beside them."""
    return RIGHT_TO_LEFT.sub(r"<bdi>\g<0></bdi>", escape(text))


def paragraph(line: str, look: str = "") -> str:
    """A line of words."""
    return f'<p class="{look}">{letters(line)}</p>' if look else f"<p>{letters(line)}</p>"


def section(told: Section, pictures: Iterable[tuple[Path, str]]) -> Iterator[str]:
    """One stage with its pictures, each with a caption."""
    yield f"<h2>{letters(told.title)}</h2>"
    yield from map(paragraph, told.lines)
    yield from (f"<h3>{escape(one.title)}</h3>{table(one)}" for one in told.tables if not one.folded)
    yield from map(paragraph, told.closing)
    yield from (embedded(file, caption) for file, caption in pictures)
    for one in told.tables:
        if one.folded:
            yield f"<details><summary>{escape(one.title)}</summary>{table(one)}</details>"


def links(title: str, some: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    """Files beside the page, what each shows, and why it is worth looking at; nothing without any."""
    rows = [
        f'<li><a href="{escape(file)}">{letters(what)}</a>: {letters(why)}</li>' for file, what, why in some
    ]
    if rows:
        yield f"<h2>{escape(title)}</h2><ul>{''.join(rows)}</ul>"


def titled(shown: Table) -> str:
    """A table under a title of its own."""
    return f"<h2>{escape(shown.title)}</h2>{table(shown)}"


def embedded(file: Path, caption: str) -> str:
    """A picture inside the page."""
    data = base64.b64encode(file.read_bytes()).decode()
    text = escape(caption)
    image = f'<img alt="{text}" src="data:image/{file.suffix[1:]};base64,{data}">'
    return f"<figure>{image}<figcaption>{letters(caption)}</figcaption></figure>"


def table(shown: Table) -> str:
    """A table; words to the left, numbers to the right."""
    look = [' class="words"' if column.words else "" for column in shown.shown]

    def row(tag: str, cells: Iterable[str]) -> str:
        parts = zip(look, cells, strict=True)
        return f"<tr>{''.join(f'<{tag}{how}>{letters(cell)}</{tag}>' for how, cell in parts)}</tr>"

    top = row("th", (column.heading or "" for column in shown.shown))
    body = "".join(row("td", cells) for cells in shown.texts)
    return f'<div class="wide"><table>{top}{body}</table></div>'
