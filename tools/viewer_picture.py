"""Draw docs/images/viewer.png: the page of the cluster at its closest approach, in Chromium.

.venv/bin/pip install -e '.[browser]' && .venv/bin/python tools/viewer_picture.py
"""

import shutil
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

import closeform as cf
from closeform.viewer.page import document
from closeform.viewer.scene import scene_of
from closeform.viewer.shown import Shown

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "browser"))

from pagereader import SOFTWARE, Reader  # noqa: E402

SIZE = {"width": 1280, "height": 720}
COLOURS = 128  # few colours keep the file small


def main() -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("no Chromium; install it with `apt-get install chromium`")
    scene = scene_of(Shown.of_mission(cf.run(ROOT / "examples" / "cluster.toml")), report="report.html")
    near = min((one for one in scene.record["approaches"] if one["stage"] == 2), key=lambda one: one["ratio"])
    mover = scene.record["craft"][near["second"]]["name"]
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        page = Path(folder) / "viewer.html"
        page.write_text(document(scene), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=chromium, args=SOFTWARE)
        tab = browser.new_page(viewport=SIZE, color_scheme="light")
        reader = Reader(tab)
        reader.open(page, f"#t={near['time']:.1f}&craft={mover}")
        reader.settle()
        shot = Image.open(BytesIO(tab.screenshot())).convert("RGB")
        browser.close()
    shot.quantize(COLOURS).save(ROOT / "docs" / "images" / "viewer.png", optimize=True)


if __name__ == "__main__":
    main()
