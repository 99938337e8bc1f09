"""The formulas of the documentation, set by the MathJax of the site, in a browser."""

import html
import re
from importlib.util import find_spec
from pathlib import Path

import pytest
from playwright.sync_api import Browser

pytestmark = pytest.mark.browser

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"^```.*?^```$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
WIDTH = 752  # px, of the text in a window of 1280


def formulas(page: Path) -> list[str]:
    """Those in blocks and, between dollars, those in lines, for MathJax."""
    text = page.read_text(encoding="utf-8")
    inline = re.findall(r"\$([^$]+)\$", CODE.sub("", text))
    return [rf"\[{one}\]" for one in BLOCK.findall(text)] + [rf"\({one}\)" for one in inline]


PAGES = [page.name for page in sorted(DOCS.glob("*.md")) if formulas(page)]


@pytest.mark.skipif(find_spec("sphinx-mathjax-offline") is None, reason="the extra docs is not installed")
@pytest.mark.parametrize("name", PAGES)
def test_formulas_are_set(chromium: Browser, name: str, tmp_path: Path) -> None:
    """None is refused, and none is wider than its page."""
    folder = Path(str(find_spec("sphinx-mathjax-offline").origin)).parent
    script = (folder / "static" / "mathjax" / "tex-svg.js").as_uri()
    written = formulas(DOCS / name)
    lines = "".join(f'<div style="width: {WIDTH}px">{html.escape(one)}</div>' for one in written)
    file = tmp_path / "formulas.html"
    file.write_text(f'<!doctype html><meta charset="utf-8"><script src="{script}"></script>{lines}', "utf-8")
    page = chromium.new_page()
    page.goto(file.as_uri())
    page.wait_for_function("window.MathJax?.startup?.promise")
    page.evaluate("MathJax.startup.promise")
    assert page.locator("mjx-container").count() == len(written) > 0
    refused = page.locator("[data-mjx-error]").evaluate_all("all => all.map(one => one.dataset.mjxError)")
    wide = "all => all.filter(one => one.scrollWidth > one.clientWidth + 2).map(one => one.textContent)"
    assert refused + page.locator("div[style]").evaluate_all(wide) == []
    page.close()
