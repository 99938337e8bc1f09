"""Execute examples/notebooks/*.md and write them with output into docs/notebooks, or as .ipynb into FOLDER.

Run from the repository: python tools/notebooks.py [FOLDER]
"""

import re
import shutil
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import jupytext
import nbformat
from nbclient import NotebookClient
from nbconvert import MarkdownExporter
from nbconvert.writers import FilesWriter
from PIL import Image

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "notebooks"
NOTE = "<!-- Written by tools/notebooks.py from examples/notebooks/{}. -->\n\n"


def executed(file: Path) -> nbformat.NotebookNode:
    """Return a notebook after execution in a folder with the examples; a cell that fails raises its error."""
    notebook = jupytext.read(file)
    with TemporaryDirectory() as place:
        (Path(place) / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": place}}).execute()
    for cell in notebook.cells:
        if "outputs" in cell:  # without messages about compilation
            cell.outputs = [one for one in cell.outputs if one.get("name") != "stderr"]
    return notebook


def small(png: bytes) -> bytes:
    """Return a picture with a palette of 128 colours."""
    held = BytesIO()
    Image.open(BytesIO(png)).convert("RGB").quantize(128).save(held, "PNG", optimize=True)
    return held.getvalue()


def write_page(notebook: nbformat.NotebookNode, file: Path) -> None:
    named = {"unique_key": file.stem, "output_files_dir": "images"}
    text, resources = MarkdownExporter().from_notebook_node(notebook, resources=named)
    text = re.sub(r'<img alt="Picture of [^>]*>', "", text)  # of a result, which a cell draws with names
    text = re.sub(r" +$", "", text.strip().replace("![png]", "![output]"), flags=re.MULTILINE)
    text = re.sub(r"\n{4,}|\n{3,}(?=```)", "\n\n", text)  # Python has two blank lines at most
    resources["outputs"] = {name: small(data) for name, data in resources["outputs"].items()}
    FilesWriter(build_directory=str(PAGES)).write(f"{NOTE.format(file.name)}{text}\n", resources, file.stem)


def main(folder: Path | None) -> None:
    if folder is None:
        shutil.rmtree(PAGES, ignore_errors=True)  # pictures have the numbers of their cells
    for file in sorted((ROOT / "examples" / "notebooks").glob("*.md")):
        notebook = executed(file)
        if folder is None:
            write_page(notebook, file)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            nbformat.write(notebook, folder / f"{file.stem}.ipynb")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
