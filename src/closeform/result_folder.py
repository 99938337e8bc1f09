"""What a run leaves behind: a folder that is either finished or not there.

`summary.json` (hash of the inputs, versions, seed, every figure printed), tables in Parquet,
pictures and `report.html`. Everything is written into a neighbour folder that takes the final
name only when it is complete.
"""

import json
import platform
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Any

SUMMARY = "summary.json"
REPORT = "report.html"
FORMAT = 1  # of summary.json
LIBRARIES = ("closeform", "numpy", "numba", "scipy", "pydantic", "matplotlib", "pyarrow")


class FolderError(ValueError):
    """A result folder that cannot be written or opened; one line with the remedy."""


@dataclass(frozen=True)
class Folder:
    """A result folder under way."""

    path: Path

    def summary(self, figures: Mapping[str, Any]) -> None:
        """Write `summary.json`: `figures` with the versions; numbers that are not finite as null."""
        content = {"closeform": FORMAT, "versions": versions(), **figures}
        text = json.dumps(finite(content), indent=1, allow_nan=False, ensure_ascii=False)
        (self.path / SUMMARY).write_text(text + "\n", encoding="utf-8")

    def table(self, name: str, columns: Mapping[str, Sequence[Any]]) -> None:
        """Write `name`.parquet; the unit stands in a column's name, as in `start_s`."""
        import pyarrow
        import pyarrow.parquet

        pyarrow.parquet.write_table(pyarrow.table(dict(columns)), self.path / f"{name}.parquet")

    def picture(self, name: str, figure: Any) -> Path:
        """Write a matplotlib figure as `name`.png."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        file = self.path / f"{name}.png"
        FigureCanvasAgg(figure).print_png(file)  # unlike savefig it lays out and draws once
        return file

    def text(self, name: str, text: str) -> None:
        """Write a text file."""
        (self.path / name).write_text(text, encoding="utf-8")


def versions() -> dict[str, str]:
    """The versions that the figures depend on."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def finite(value: Any) -> Any:
    """The value for JSON: what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return value if isfinite(value) else None
    return value


def finished(path: Path) -> bool:
    """Whether a folder holds the results of a finished run."""
    try:
        return "closeform" in json.loads((path / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError, TypeError):
        return False


def check_free(path: Path, overwrite: bool) -> None:
    """Raise FolderError unless results may be written at `path`."""
    if path.is_dir() and finished(path):
        if not overwrite:
            raise FolderError(f"{path}: holds finished results; add --overwrite or choose another --out")
    elif path.is_dir() and any(path.iterdir()):
        raise FolderError(f"{path}: is not a result folder and not empty; choose another --out")
    elif path.exists() and not path.is_dir():
        raise FolderError(f"{path}: is a file; choose another --out")


@contextmanager
def folder(path: Path, overwrite: bool = False) -> Iterator[Folder]:
    """A folder to fill; it appears at `path` when the block ends well, and not at all otherwise.

    What a killed run left unfinished is done anew. Raises FolderError for finished results
    without `overwrite` or a folder of something else, before anything is written, and for a
    place that cannot be written.
    """
    check_free(path, overwrite)
    place = path.resolve()
    building = place.with_name(f".{place.name}.unfinished")
    shutil.rmtree(building, ignore_errors=True)
    try:
        building.mkdir(parents=True)
        yield Folder(building)
        publish(building, place)
    except OSError as error:
        raise FolderError(
            f"{path}: {(error.strerror or str(error)).lower()}; choose another --out"
        ) from error
    finally:
        shutil.rmtree(building, ignore_errors=True)


def publish(building: Path, path: Path) -> None:
    """Give a complete folder its name; what stood there goes last."""
    old = path.with_name(f".{path.name}.replaced")
    shutil.rmtree(old, ignore_errors=True)
    if path.exists():
        path.rename(old)
    building.rename(path)
    shutil.rmtree(old, ignore_errors=True)


def report_of(path: Path) -> Path:
    """The report in a finished result folder. Raises FolderError where there is none."""
    if not path.is_dir():
        raise FolderError(f"{path}: no such folder; give the folder that a run left")
    if not finished(path) or not (path / REPORT).is_file():
        raise FolderError(f"{path}: holds no finished results; run the scenario first")
    return path / REPORT
