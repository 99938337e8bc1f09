"""Executes the notebooks of examples/notebooks, and leaves them with what they show: notebooks.py FOLDER."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import jupytext
import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]


def executed(file: Path) -> nbformat.NotebookNode:
    """One of them, run where the examples are; a cell that fails raises its error."""
    notebook = jupytext.read(file)
    with TemporaryDirectory() as place:
        (Path(place) / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": place}}).execute()
    return notebook


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for file in sorted((ROOT / "examples" / "notebooks").glob("*.md")):
        written = folder / f"{file.stem}.ipynb"
        nbformat.write(executed(file), written)
        print(written)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "notebooks"))
