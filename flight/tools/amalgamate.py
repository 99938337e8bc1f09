"""Write the library as two files, closeform_flight.c and closeform_flight.h, to a folder.

Usage: python flight/tools/amalgamate.py FOLDER
"""

import re
import sys
from pathlib import Path

FLIGHT = Path(__file__).parents[1]
LOCAL = re.compile(r'^#include "cff_internal\.h"\n', re.MULTILINE)
MACRO = re.compile(r"^#define (\w+)", re.MULTILINE)
STATIC = re.compile(r"^static [\w *]*?(\w+)\(", re.MULTILINE)
SHARED = re.compile(r"^(?!static)(\w[\w *]*\bcfi_\w+\()", re.MULTILINE)  # by the files, not with callers


def amalgamation() -> str:
    """Return all sources as one, in which only public functions are visible.

    Macros of a file end with it, and its static functions get its name.
    """
    parts = [(FLIGHT / "src" / "cff_internal.h").read_text(encoding="utf-8")]
    for file in sorted((FLIGHT / "src").glob("*.c")):
        text = LOCAL.sub("", file.read_text(encoding="utf-8"))
        for name in dict.fromkeys(STATIC.findall(text)):
            text = re.sub(rf"\b{name}\(", f"{file.stem}_{name}(", text)
        undone = "".join(f"#undef {name}\n" for name in dict.fromkeys(MACRO.findall(text)))
        parts.append(f"/* ---- {file.name} ---- */\n{text}{undone}")
    return SHARED.sub(r"static \1", "\n".join(parts))


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    header = (FLIGHT / "include" / "closeform_flight.h").read_text(encoding="utf-8")
    (folder / "closeform_flight.h").write_text(header, encoding="utf-8")
    (folder / "closeform_flight.c").write_text(amalgamation(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
