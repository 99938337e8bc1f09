"""The result as one self-contained HTML page."""

import base64
from collections.abc import Iterator
from html import escape
from pathlib import Path

from closeform.chapters import Chapter, Sheet, chapters, opening, verdict
from closeform.mission import Mission

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


def page(mission: Mission, shown: dict[int, list[tuple[Path, str]]]) -> str:
    """The whole report as one HTML page without references to other files."""
    tone = "good" if mission.clear else "bad"
    title = escape(mission.scenario.title)
    parts = [
        f"<h1>{title}</h1>",
        f'<p class="faint">{escape(opening(mission))}; {escape(Path(mission.scenario.file).name)}</p>',
        f'<p class="verdict {tone}">{escape(verdict(mission))}</p>',
        *(f'<p class="bad">{escape(line)}</p>' for line in mission.warnings),
    ]
    for leg, chapter in zip(mission.legs, chapters(mission), strict=True):
        parts += section(chapter, shown[leg.number])
    return document(title, parts)


def document(title: str, parts: list[str]) -> str:
    """The parts of a page as one HTML document; `title` is HTML already."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def section(chapter: Chapter, shown: list[tuple[Path, str]]) -> Iterator[str]:
    """One stage."""
    yield f"<h2>{escape(chapter.title)}</h2>"
    yield from (f"<p>{escape(line)}</p>" for line in chapter.lines)
    yield from (f"<h3>{escape(sheet.title)}</h3>{table(sheet)}" for sheet in chapter.sheets if not sheet.more)
    yield from (f"<p>{escape(line)}</p>" for line in chapter.closing)
    yield from (embedded(file, caption) for file, caption in shown)
    for sheet in chapter.sheets:
        if sheet.more:
            yield f"<details><summary>{escape(sheet.title)}</summary>{table(sheet)}</details>"


def embedded(file: Path, caption: str) -> str:
    """A picture inside the page."""
    data = base64.b64encode(file.read_bytes()).decode()
    text = escape(caption)
    image = f'<img alt="{text}" src="data:image/{file.suffix[1:]};base64,{data}">'
    return f"<figure>{image}<figcaption>{text}</figcaption></figure>"


def table(sheet: Sheet) -> str:
    """A sheet as an HTML table."""
    look = ['class="words"' if place in sheet.texts else "" for place in range(len(sheet.columns))]

    def row(tag: str, cells: tuple[str, ...]) -> str:
        parts = zip(look, cells, strict=True)
        return (
            "<tr>"
            + "".join(f"<{f'{tag} {how}'.strip()}>{escape(cell)}</{tag}>" for how, cell in parts)
            + "</tr>"
        )

    body = "".join(row("td", cells) for cells in sheet.rows)
    return f'<div class="wide"><table>{row("th", sheet.columns)}{body}</table></div>'
