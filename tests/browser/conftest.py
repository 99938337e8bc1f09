"""Pages of examples in Debian's Chromium, drawn by software: `pytest -m browser`."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from pagereader import EXAMPLES, SOFTWARE, Reader, fly
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).parents[2]


def chromium_path() -> str:
    """Chromium of the machine; as root Debian's is installed where it is missing. Playwright gets none."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None and os.geteuid() == 0 and shutil.which("apt-get"):
        subprocess.run(["apt-get", "update", "-qq"], check=True)
        subprocess.run(["apt-get", "install", "-qq", "-y", "--no-install-recommends", "chromium"], check=True)
        found = shutil.which("chromium")
    if found is None:
        pytest.fail("no Chromium: install Debian's with `apt-get install chromium`")
    return found


@pytest.fixture(scope="session")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The page of each example, flown once."""
    folder = tmp_path_factory.mktemp("pages")
    for name in EXAMPLES:
        fly(ROOT / "examples" / f"{name}.toml", folder / name)
    return {name: folder / name / "viewer.html" for name in EXAMPLES}


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path(), args=SOFTWARE)
        yield browser
        browser.close()


@pytest.fixture
def reader(chromium: Browser, request: pytest.FixtureRequest) -> Iterator[Reader]:
    """A page at 1280 x 720, or as the parameter says, that in the end has nothing to complain of."""
    options = {"viewport": {"width": 1280, "height": 720}, "color_scheme": "light"}
    options |= getattr(request, "param", {})
    context = chromium.new_context(**options)
    made = Reader(context.new_page())
    yield made
    context.close()
    assert not made.faults
