"""Draw the pictures of pages in docs/ by running the Python code of those pages.

Run from the repository: python tools/page_pictures.py [pictures fuel ...]; without names, all pages
"""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib

DOCS = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def drawn(page: Path) -> list[str]:
    """Return the names of the new pictures."""
    text = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as work:
        os.chdir(work)
        Path("examples").symlink_to(DOCS.parent / "examples", target_is_directory=True)
        names: dict[str, Any] = {"__name__": "__main__"}
        with matplotlib.rc_context():
            exec("\n".join(BLOCK.findall(text)), names)
        saved = [*Path(work).glob("*.png"), *Path(names.get("folder", work)).glob("*.png")]
        shown = {file.name: file for file in saved if f"(images/{file.name})" in text}
        for file in shown.values():
            shutil.copy(file, DOCS / "images")
        os.chdir(DOCS)
    return sorted(shown)


def main() -> None:
    for page in [DOCS / f"{name}.md" for name in sys.argv[1:]] or sorted(DOCS.glob("*.md")):
        if ".savefig(" in page.read_text(encoding="utf-8"):
            print(page.stem, *drawn(page))


if __name__ == "__main__":
    main()
