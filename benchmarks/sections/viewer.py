"""Page of a result folder in Chromium with software rendering: first frame, frame rate, size."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tables import Figure, Report, Table
from timing import say

COMMAND = Path(sys.executable).with_name("closeform")
SOFTWARE = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
]
SIZE = {"width": 1280, "height": 720}
PLAYED = 5.0  # seconds
DRAWN = "!!window.closeform && closeform.frames > 0"
PAINTED = (
    "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now()))))"
)
PLAYS = """async (seconds) => {
    const app = window.closeform, from = app.frames, start = performance.now();
    app.player.go(app.scene.start);
    app.player.play(true);
    await new Promise(done => setTimeout(done, 1000 * seconds));
    const played = [app.frames - from, (performance.now() - start) / 1000];
    app.player.play(false);
    return played;
}"""


def measure(quick: bool) -> Report:
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    rows, seen, sizes = [], {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for name, text in scenarios(quick).items():
            say(f"  {name}")
            file, results = Path(folder) / "scenario.toml", Path(folder) / name.replace(" ", "-")
            file.write_text(text)
            subprocess.run([COMMAND, "run", file, "--out", results], check=True, capture_output=True)
            page = results / "viewer.html"
            sizes[name] = page.stat().st_size / 1e6
            seen[name] = watched(chromium, page, 1.0 if quick else PLAYED) if chromium else None
            first, rate = seen[name] or (None, None)
            rows.append([name, shown(first, " s", 2), shown(rate, "", 1), f"{sizes[name]:.2f} MB"])
    notes = [
        (
            "At 1280 x 720, rendered by SwiftShader on all cores without a graphics card. The first frame "
            "counts from the opening of the file to its display."
        )
    ]
    columns = ["scene", "first frame", "frames/s during playback", "page size"]
    return Report([Table("Viewer: the page of a run", columns, rows, notes)], figures(seen, sizes))


def scenarios(quick: bool) -> dict[str, str]:
    """Return rings of spacecraft that exchange places, or that coast in large numbers."""
    plan = '[[stage]]\ndo = "reconfigure"\nwithin = "%s"\nto = { projected_circular = { radius = "%s m" } }\n'
    made = {"5 spacecraft, 1 h": ring(5, 100) + plan % ("1 h", 150)}
    if not quick:
        made |= {
            "20 spacecraft": ring(20, 300) + plan % ("0.5 orbits", 400),
            "200 spacecraft": ring(200, 3000) + '[[stage]]\ndo = "coast"\nfor = "1 orbit"\n',
            "8 spacecraft, 24 h": ring(8, 150) + plan % ("24 h", 200),
        }
    return made


def ring(count: int, radius: float) -> str:
    names = ", ".join(f'"C{k + 1}"' for k in range(count))
    return (
        'closeform = 1\ntitle = "Ring"\n[orbit]\naltitude = "500 km"\n'
        f'[craft]\nname = [{names}]\nstart = {{ projected_circular = {{ radius = "{radius} m" }} }}\n'
        'keep_out = { sphere = "15 m" }\n'
    )


def watched(chromium: str, page: Path, seconds: float) -> tuple[float, float]:
    """Return the time to the first frame [s], and the frame rate during playback."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=SOFTWARE)
        tab = browser.new_page(viewport=SIZE)
        tab.goto(page.as_uri(), wait_until="commit")
        while not tab.evaluate(DRAWN):
            tab.wait_for_timeout(5)
        first = tab.evaluate(PAINTED) / 1000
        tab.wait_for_timeout(500)
        frames, passed = tab.evaluate(PLAYS, seconds)
        browser.close()
    return first, frames / passed


def shown(value: float | None, unit: str, digits: int) -> str:
    return "not measured" if value is None else f"{value:.{digits}f}{unit}"


def figures(seen: dict[str, tuple[float, float] | None], sizes: dict[str, float]) -> list[Figure]:
    found = []
    for name, least, soon in (("20 spacecraft", 20.0, 1.0), ("200 spacecraft", 8.0, None)):
        if name not in seen:
            continue
        first, rate = seen[name] or (None, None)
        if soon is not None:
            early = None if first is None else first <= soon
            found.append(Figure(f"viewer, first frame, {name}", "<= 1 s", shown(first, " s", 2), early))
        often = None if rate is None else rate >= least
        found.append(Figure(f"viewer, frames/s, {name}", f">= {least:g}", shown(rate, "", 1), often))
    for name, most in (("5 spacecraft, 1 h", 1.5), ("8 spacecraft, 24 h", 5.0)):
        if name in sizes:
            small = sizes[name] <= most
            found.append(Figure(f"viewer, page, {name}", f"<= {most:g} MB", f"{sizes[name]:.2f} MB", small))
    return found
