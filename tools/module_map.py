"""Print every package and module of closeform with the first line of its docstring."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1] / "src" / "closeform"

for folder in sorted(path.parent for path in ROOT.rglob("__init__.py")):
    print(f"\n{folder.relative_to(ROOT.parent)}/")
    for file in sorted(folder.glob("*.py")):
        docstring = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
        print(f"  {file.stem:24} {docstring.partition(chr(10))[0]}")
