"""HTML page: the results as one self-contained file."""

import base64
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import islice
from typing import Any

from closeform.report.picture import Shot
from closeform.report.section import Section
from closeform.report.table import Column, Table

LONG = 40  # characters above which the text of a cell wraps
RIGHT_TO_LEFT = re.compile(
    "[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+(?: +[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc]+)*"
)
LIGHT = (
    "--ink:#1b1f24;--paper:#fdfdfc;--faint:#5b6470;--line:#d5d8dc;--card:#f3f4f5;--good:#14704e;--bad:#a83a17"
)
DARK = (
    "--ink:#e6e8ea;--paper:#16191d;--faint:#a2abb5;--line:#363c44;--card:#1f2429;--good:#5bc49a;--bad:#f0926b"
)
STYLE = f"""
:root {{ color-scheme: light dark; {LIGHT}; }}
@media screen and (prefers-color-scheme: dark) {{ :root {{ {DARK}; }} }}
* {{ box-sizing: border-box; }}
body {{ font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 64rem; margin: 0 auto; padding: 2rem 1.2rem 4rem; overflow-wrap: break-word; }}
h1 {{ font-size: 1.7rem; line-height: 1.25; margin: 0 0 .3rem; }}
h2 {{ font-size: 1.25rem; line-height: 1.3; margin: 0 0 .4rem; }}
h3 {{ font-size: 1rem; margin: 1.3rem 0 .3rem; }} p {{ margin: .35rem 0; }} .faint {{ color: var(--faint); }}
a {{ color: inherit; text-decoration-color: var(--faint); text-underline-offset: .15em; }}
section {{ margin-top: 2.2rem; border-top: 1px solid var(--line); padding-top: 1.2rem; }}
.verdict {{ display: inline-block; padding: .4rem .8rem; border-radius: .4rem; background: var(--card);
  font-weight: 600; margin: .8rem 0 .2rem; }}
.good {{ color: var(--good); }} .bad {{ color: var(--bad); }} td.good, td.bad {{ font-weight: 600; }}
nav {{ margin-top: 1.4rem; }}
nav ol {{ margin: .2rem 0; padding-left: 1.6rem; columns: 22rem 2; column-gap: 2rem; }}
nav li {{ break-inside: avoid; }}
nav li::marker {{ color: var(--faint); font-variant-numeric: tabular-nums; }}
.wide {{ overflow-x: auto; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .95rem; }}
th, td {{ text-align: right; vertical-align: top; padding: .2rem .55rem; border-bottom: 1px solid var(--line);
  white-space: nowrap; }}
th {{ font-weight: 600; color: var(--faint); white-space: normal; vertical-align: bottom; }}
.words {{ text-align: left; }} td.long {{ white-space: normal; min-width: 16rem; }}
th:first-child, td:first-child {{ padding-left: 0; }}
figure {{ margin: 1.2rem 0; }} figcaption {{ color: var(--faint); font-size: .92rem; }}
img {{ display: block; max-width: 100%; height: auto; background: #fff;
  border-radius: .4rem; padding: .4rem; }}
summary {{ cursor: pointer; margin: 1rem 0 .3rem; font-weight: 600; }}
@media (max-width: 40rem) {{ body {{ padding: 1.2rem .9rem 3rem; }} h1 {{ font-size: 1.4rem; }}
  th, td {{ padding: .2rem .55rem; }} td.long {{ min-width: 13rem; }} img {{ padding: .15rem; }} }}
@media print {{ @page {{ size: A4; margin: 14mm 15mm; }} :root {{ color-scheme: light; }}
  body {{ font-size: 10pt; max-width: none; padding: 0; background: none; }} nav, .screen {{ display: none; }}
  section {{ margin-top: 1.4rem; padding-top: .8rem; }} h2, h3 {{ break-after: avoid; }}
  tr, figure, .verdict {{ break-inside: avoid; }} thead {{ display: table-header-group; }}
  .wide {{ overflow: visible; }} table {{ font-size: 8pt; max-width: 100%; }}
  th, td {{ padding: .1rem .45rem; }}
  td.long {{ min-width: 0; }}
  .verdict {{ padding: .3rem 0; background: none; }} img {{ max-height: 112mm; width: auto; padding: 0; }}
  details:not([open])::details-content {{ content-visibility: visible; height: auto; }}
  @supports not selector(::details-content) {{
    details:not([open]) summary::after {{ content: " (closed; open it to print it)"; font-weight: 400; }} }}
  summary {{ break-after: avoid; }} a {{ text-decoration: none; }} }}
"""


@dataclass(frozen=True)
class Head:
    """Header of a page: title, subject `lines`, verdict, `warnings` and `links`.

    `links`: files next to the page, each with its link text.
    """

    title: str
    lines: Sequence[str]
    verdict: str
    good: bool
    warnings: Sequence[str] = ()
    links: Sequence[tuple[str, str]] = ()


def document(head: Head, sections: Sequence[Section], shots: Iterable[Shot]) -> str:
    """Return a complete HTML page: header, contents and sections; `shots` holds one shot per picture."""
    drawn = iter(shots)
    marks = [anchor(told.title, place) for place, told in enumerate(sections, 1)]
    parts = [*top(head), *contents(sections, marks), "<main>"]
    for told, mark in zip(sections, marks, strict=True):
        parts += [
            f'<section id="{mark}">',
            *section(told, islice(drawn, len(told.pictures))),
            "</section>",
        ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(head.title)}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join([*parts, "</main>"])
        + "\n</body></html>\n"
    )


def top(head: Head) -> Iterator[str]:
    """Yield the HTML of the header: title, subject lines, verdict, warnings and links."""
    yield f"<header>\n<h1>{letters(head.title)}</h1>"
    yield from (paragraph(line, "faint") for line in head.lines)
    yield paragraph(head.verdict, f"verdict {'good' if head.good else 'bad'}")
    yield from (paragraph(line, "bad") for line in head.warnings)
    if head.links:
        yield f'<p class="screen">{" · ".join(link(*one) for one in head.links)}</p>'
    yield "</header>"


def contents(sections: Sequence[Section], marks: Sequence[str]) -> Iterator[str]:
    """Yield the HTML of the table of contents, one link per section."""
    yield '<nav aria-label="Contents"><ol>'
    yield from (
        f'<li><a href="#{mark}">{letters(told.title)}</a></li>'
        for told, mark in zip(sections, marks, strict=True)
    )
    yield "</ol></nav>"


def anchor(title: str, place: int) -> str:
    """Return the anchor of the section at a place in the page, such as "stage-2" or "what-was-found"."""
    words = re.findall(r"[a-z0-9]+", re.split('[:"]', title)[0].lower())
    return "-".join(words) or f"section-{place}"


def letters(text: str) -> str:
    """Return escaped text with right-to-left names isolated from the numbers next to them."""
    return RIGHT_TO_LEFT.sub(r"<bdi>\g<0></bdi>", escape(text))


def link(file: str, words: str) -> str:
    """Return the HTML link to a file next to the page."""
    return f'<a href="{escape(file)}">{letters(words)}</a>'


def paragraph(line: str, look: str = "") -> str:
    """Return one line of text as an HTML paragraph of class `look`."""
    return f'<p class="{look}">{letters(line)}</p>' if look else f"<p>{letters(line)}</p>"


def section(told: Section, pictures: Iterable[Shot]) -> Iterator[str]:
    """Yield the HTML of a section and its pictures; folded tables come last."""
    yield f"<h2>{letters(told.title)}</h2>"
    yield from map(paragraph, told.lines)
    yield from (titled(one) for one in told.tables if not one.folded)
    yield from map(paragraph, told.closing)
    yield from map(embedded, pictures)
    for one in told.tables:
        if one.folded:
            yield f"<details><summary>{escape(one.title)}</summary>{table(replace(one, title=''))}</details>"


def links(title: str, some: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    """Yield a titled list of links: file, what it shows and why it matters; nothing if the list is empty."""
    rows = [
        f'<li><a href="{escape(file)}">{letters(what)}</a>: {letters(why)}</li>' for file, what, why in some
    ]
    if rows:
        yield f"<h2>{escape(title)}</h2><ul>{''.join(rows)}</ul>"


def titled(shown: Table) -> str:
    """Return the HTML of a table under its title."""
    return (f"<h3>{escape(shown.title)}</h3>" if shown.title else "") + table(shown)


def embedded(shot: Shot) -> str:
    """Return the HTML of a picture embedded in the page, with its own text as alternative text."""
    data = base64.b64encode(shot.file.read_bytes()).decode()
    told = escape(": ".join(filter(None, (shot.caption, shot.says))))
    image = f'<img alt="{told}" src="data:image/{shot.file.suffix[1:]};base64,{data}">'
    return f"<figure>{image}<figcaption>{letters(shot.caption)}</figcaption></figure>"


def table(shown: Table) -> str:
    """Return the HTML of a table; text is aligned left, numbers right."""
    columns = shown.shown
    heads = (f'<th scope="col"{look(column)}>{letters(column.heading or "")}</th>' for column in columns)
    rows = []
    for cells, texts in zip(shown.cells, shown.texts, strict=True):
        parts = zip(columns, cells, texts, strict=True)
        rows.append(f"<tr>{''.join(f'<td{look(*part)}>{content(*part)}</td>' for part in parts)}</tr>")
    named = f' aria-label="{escape(shown.title)}"' if shown.title else ""
    return (
        f'<div class="wide" role="group" tabindex="0"{named}><table><thead><tr>{"".join(heads)}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def look(column: Column, cell: Any = None, text: str = "") -> str:
    """Return the class attribute of a cell, or of its heading; empty if it has none."""
    found = ["words"] * column.words + ["long"] * (column.words and len(text) > LONG)
    if column.judges and cell is not None:
        found.append("good" if cell else "bad")
    return f' class="{" ".join(found)}"' if found else ""


def content(column: Column, cell: Any, text: str) -> str:
    """Return the HTML content of a cell."""
    return link(str(cell), text) if column.links and cell is not None else letters(text)
