"""The documentation site builds without warnings, needs no network and has valid links."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

pytestmark = pytest.mark.site
ROOT = Path(__file__).parents[1]
# What a browser fetches by itself to show a page.
FETCHED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href", "object": "data"}


class Page(HTMLParser):
    """The anchors of a page, where its links lead, and what it fetches."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {given["id"]} if given.get("id") else set()
        if tag == "a" and given.get("href"):
            self.links.append(str(given["href"]))
        target = given.get(FETCHED.get(tag, ""))
        if target and given.get("rel") not in ("canonical", "next", "prev"):
            self.fetched.append(target)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built pages; any warning of Sphinx ends it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {file: Page(file) for file in site.rglob("*.html") if "_static" not in file.parts}


def test_every_page_is_built(site: Path) -> None:
    for source in (ROOT / "docs").glob("*.md"):
        heading = re.match(r"# (\w+)", source.read_text(encoding="utf-8"))
        assert heading is not None
        # a page with the name of one of Sphinx's own, such as search, would be hidden
        assert f"<h1>{heading[1]}" in (site / f"{source.stem}.html").read_text(encoding="utf-8")


def test_site_needs_no_network(site: Path, pages: dict[Path, Page]) -> None:
    """Scripts, styles, pictures and frames are files of the site; so are fonts and what styles import."""
    for file, page in pages.items():
        for target in page.fetched:
            if target.startswith("data:"):
                continue
            parts = urlsplit(target)
            assert not parts.scheme + parts.netloc, f"{file.name} fetches {target}"
            assert (file.parent / unquote(parts.path)).exists(), f"{file.name}: no {target}"
    for sheet in site.rglob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        for target in re.findall(r"(?:url\(\s*|@import\s+)['\"]?([^'\")\s]+)", text):
            assert not target.startswith(("http:", "https:", "//")), f"{sheet.name} fetches {target}"


def test_links_within_the_site_are_valid(pages: dict[Path, Page]) -> None:
    for file, page in pages.items():
        for target in page.links:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc or target == "#":
                continue
            other = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            assert other.exists(), f"{file.name}: no {target}"
            if parts.fragment and other in pages:
                assert unquote(parts.fragment) in pages[other].anchors, f"{file.name}: no {target}"


def test_formulas_have_their_numbers(site: Path, pages: dict[Path, Page]) -> None:
    """As formulas, not as code, each with the number that the source cites."""
    text = (site / "theory.html").read_text(encoding="utf-8")
    tags = re.findall(r"\\tag\{(\w+)\}", (ROOT / "docs" / "theory.md").read_text(encoding="utf-8"))
    assert len(tags) == len(set(tags)) > 60
    for tag in tags:
        assert f"equation-{tag}" in pages[site / "theory.html"].anchors
    assert text.count('class="math notranslate') >= len(tags)
