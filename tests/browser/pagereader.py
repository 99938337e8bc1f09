"""A page as a reader has it open."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from time import monotonic
from typing import Any

from playwright.sync_api import Page

EXAMPLES = ("swap", "three_sigmas", "passive_inspector", "tpf", "station_ellipsoid", "docking")
SOFTWARE = [  # what lets Chromium draw without a graphics card
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
PATIENCE = 60.0  # seconds, on a busy machine


def fly(scenario: Path, results: Path) -> None:
    """As a user does."""
    command = [sys.executable, "-m", "closeform", "run", str(scenario), "--out", str(results)]
    subprocess.run(command, check=True, capture_output=True)


class Reader:
    """A page as a reader has it open, and what it did that it should not."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.faults: list[str] = []
        page.on("console", lambda said: said.type in ("error", "warning") and self.faults.append(said.text))
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("request", lambda asked: asked.url.startswith("file:") or self.faults.append(asked.url))

    def open(self, file: Path, fragment: str = "") -> None:
        self.page.goto("about:blank")
        self.page.goto(f"{file.as_uri()}{fragment}")
        self.wait("app && app.frames > 0")

    def ask(self, code: str) -> Any:
        """What JavaScript gives; `app` is the page's state."""
        return self.page.evaluate(f"() => {{ const app = window.closeform; return {code}; }}")

    def go(self, share: float) -> None:
        """To a share of the scene's time."""
        self.ask(f"app.player.go(app.scene.start + {share} * (app.scene.end - app.scene.start))")
        self.settle()

    def settle(self) -> None:
        """Until what was changed is drawn."""
        self.wait("!app.queued")

    def wait(self, code: str) -> None:
        """Until JavaScript gives something true; Playwright's waiting needs `eval`, which pages forbid."""
        late = monotonic() + PATIENCE
        while not self.ask(code):
            assert monotonic() < late, code
            self.page.wait_for_timeout(20)
