"""Result folder of a run or a study: its files, their digests, and which files belong to it.

`summary.json` (hash of the inputs, versions, seed, every printed figure), tables in Parquet, pictures and
`report.html`. The summary is written last and lists all files. A folder is finished when it holds a summary,
and a file that the summary does not list belongs to another program.
"""

import csv
import io
import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from closeform.storage import manifest
from closeform.storage.lock_file import is_held

if TYPE_CHECKING:
    from closeform.scenario import Scenario

SUMMARY, SCENARIO = "summary.json", "scenario.toml"
REPORT, VIEWER, WORST_FLIGHT = "report.html", "viewer.html", "worst.html"
FORMAT = 1  # of summary.json
DIGESTED = (".parquet", ".toml")  # files that `load` reads, with their SHA-256 in the summary, and
INPUTS = "inputs/"  # the files that a scenario names
CASES = "cases"  # the folder of a study's chunks
LIBRARIES = ("closeform", "numpy", "numba", "scipy", "pydantic", "matplotlib", "pyarrow")

PRIVATE = ".unfinished"  # the folder in a result folder where a run or a study works
LOCK = "lock"  # in a private folder: held while its owner runs
RESULTS, REPLACED = "results", "replaced"  # in it too: new results, and the ones they replace
AGAIN = "run it again, or give another folder"


class FolderError(ValueError):
    """Result folder that cannot be written or opened; the message is one line with the remedy."""


@dataclass(frozen=True)
class Folder:
    """Result folder that is being written; `known` holds the SHA-256 of files whose writer computed it."""

    path: Path
    known: dict[str, str] = field(default_factory=dict)

    @property
    def manifest(self) -> Path:
        """Manifest of the chunks of a study, which are kept if the study is stopped."""
        return self.path.parent / manifest.NAME

    def summary(self, figures: Mapping[str, Any]) -> None:
        """Write `summary.json`, the last file, from `figures`, versions and files.

        Non-finite numbers become null.
        """
        files = sorted(file.relative_to(self.path).as_posix() for file in below(self.path))
        content = {"closeform": FORMAT, "versions": versions(), "files": [*files, SUMMARY], **figures}
        content["digests"] = {
            name: self.known.get(name) or digest(self.path / name) for name in files if digested(name)
        }
        self.text(SUMMARY, json.dumps(finite(content), indent=1, allow_nan=False, ensure_ascii=False) + "\n")

    def table(self, name: str, columns: Mapping[str, Sequence[Any]]) -> None:
        """Write `name`.parquet; a column's name includes the unit, as in `start_s`."""
        import pyarrow
        import pyarrow.parquet

        file = self.path / f"{name}.parquet"
        file.parent.mkdir(exist_ok=True)
        pyarrow.parquet.write_table(pyarrow.table(dict(columns)), file)

    def csv(self, name: str, columns: Mapping[str, Sequence[Any]]) -> None:
        """Write columns as `name`.csv for programs without Parquet; an absent value is empty."""
        if not columns:
            return
        lines = io.StringIO(newline="")
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
        self.text(f"{name}.csv", lines.getvalue())

    def picture(self, name: str, figure: Any) -> Path:
        """Write a matplotlib figure as `name`.png."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image

        file = self.path / f"{name}.png"
        canvas = FigureCanvasAgg(figure)
        canvas.draw()  # once; savefig draws twice
        pixels = Image.frombuffer("RGBA", canvas.get_width_height(), canvas.buffer_rgba())
        pixels.convert("RGB").save(file, compress_level=1)  # half the time of the default, a quarter larger
        return file

    def scenario(self, scenario: "Scenario") -> None:
        """Write `scenario.toml`, and copies of the files that it names."""
        self.text(SCENARIO, scenario.text)
        for name, held in (scenario.inputs.copies if scenario.inputs is not None else {}).items():
            (self.path / name).parent.mkdir(exist_ok=True)
            (self.path / name).write_bytes(held)

    def text(self, name: str, text: str) -> None:
        """Write a text file; characters that UTF-8 cannot encode become backslash escapes."""
        (self.path / name).write_bytes(text.encode("utf-8", "backslashreplace"))


def digested(name: str) -> bool:
    """Return True if `load` reads the file, so that its digest is stored."""
    return name.endswith(DIGESTED) or name.startswith(INPUTS)


def digest(file: Path) -> str:
    """Return the SHA-256 of a file."""
    import hashlib

    with file.open("rb") as content:
        return hashlib.file_digest(content, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and the libraries on which the results depend."""
    from importlib.metadata import version

    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def finite(value: Any) -> Any:
    """Return the value with every non-finite number replaced by None, for JSON."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return value if isfinite(value) else None
    return value


@contextmanager
def written(path: Path) -> Iterator[None]:
    """Turn an OSError into one line that states why results cannot be written at a `path`."""
    try:
        yield
    except OSError as error:
        reason = (
            os.strerror(error.errno) if error.errno else str(error)
        )  # pyarrow raises errors without an errno
        raise FolderError(f"{path}: {reason.lower()}; choose another --out") from error


def below(path: Path) -> Iterator[Path]:
    """Yield every file, empty folder and link below a folder; links are not followed."""
    for file in path.iterdir():
        inner = [*below(file)] if file.is_dir() and not file.is_symlink() else []
        yield from inner or [file]


def listed(summary: Path) -> frozenset[str]:
    """Return the files that a summary written by closeform lists; none for any other file."""
    try:
        content = json.loads(summary.read_bytes())
    except (OSError, ValueError, RecursionError):
        return frozenset()
    if not isinstance(content, dict) or content.get("closeform") != FORMAT:
        return frozenset()
    made_with, files = content.get("versions"), content.get("files")
    if not isinstance(made_with, dict) or not {"python", *LIBRARIES} <= made_with.keys():
        return frozenset()
    if not isinstance(files, list) or SUMMARY not in files or not all(map(inside, files)):
        return frozenset()
    return frozenset(files)


def inside(name: Any) -> bool:
    """Return True if the value is a relative file name that stays within its folder."""
    if not isinstance(name, str):
        return False
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and path.as_posix() == name


def finished(path: Path) -> bool:
    """Return True if a folder holds the results of a finished run or study."""
    return bool(listed(path / SUMMARY))


def others(path: Path) -> list[str]:
    """Return the entries of a folder that are neither listed results nor in its private folder."""
    files = listed(path / SUMMARY)
    folders = {parent.as_posix() for name in files for parent in PurePosixPath(name).parents}
    private = tuple(f"{PRIVATE}/{name}" for name in (LOCK, RESULTS, REPLACED, Path(manifest.NAME).stem))
    strange = []
    for file in below(path):
        name = file.relative_to(path).as_posix()
        ours = name in files or name == PRIVATE or name.startswith(private)
        if not ours and (name not in folders or file.is_symlink()):
            strange.append(name)
    return sorted(strange)


def page_of(path: Path, report: bool = False) -> Path:
    """Return the page to open for a finished result folder: the viewer, or the report if it has none.

    With `report`, the report. Raises FolderError if there is no such page.
    """
    if not os.path.isdir(path):
        raise FolderError(f"{path}: no such folder; give the result folder of a run")
    pages = (REPORT,) if report else (VIEWER, REPORT)
    found = next((path / name for name in pages if os.path.isfile(path / name)), None)
    if not finished(path) or found is None:
        raise FolderError(f"{path}: {unfinished(path)}")
    return found


def unfinished(path: Path) -> str:
    """Describe a folder without finished results as text, with the remedy."""
    whole, every = manifest.progress(path / PRIVATE / manifest.NAME)
    chunks = f"{whole} of {every} chunks are complete"
    if is_held(path / PRIVATE / LOCK):
        what = f"a study is under way in it, {chunks}" if every else "a run is under way in it"
        return f"{what}; wait for its end"
    if whole:
        return f"holds an unfinished study, {chunks}; run the same closeform study command to continue"
    return "holds no finished results; run the scenario first"


def summary_of(path: Path) -> dict[str, Any]:
    """Return the content of `summary.json` of a finished result folder.

    Raises FolderError if there is none.
    """
    if not os.path.isdir(path):
        what = "is a file" if os.path.exists(path) else "no such folder"
        raise FolderError(f"{path}: {what}; give the result folder of a run")
    try:
        content: dict[str, Any] = json.loads((path / SUMMARY).read_bytes())
    except FileNotFoundError:
        raise FolderError(f"{path}: {unfinished(path)}") from None
    except (OSError, ValueError, RecursionError):
        raise FolderError(f"{path}: {SUMMARY} is damaged; {AGAIN}") from None
    form = content.get("closeform") if isinstance(content, dict) else None
    if isinstance(form, int) and form != FORMAT:
        raise FolderError(f"{path}: has format {form}, this version reads {FORMAT}; {AGAIN}")
    if not finished(path):
        raise FolderError(f"{path}: {SUMMARY} was not written by closeform; give the result folder of a run")
    return content


@contextmanager
def intact(path: Path, name: str) -> Iterator[None]:
    """Turn an error while reading a file of a folder into one line: the file is missing or damaged."""
    try:
        yield
    except FolderError:
        raise
    except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
        what = "is missing" if isinstance(error, FileNotFoundError) else "is damaged"
        raise FolderError(f"{path}: {name} {what}; {AGAIN}") from None


def content(path: Path, summary: Mapping[str, Any], name: str) -> bytes:
    """Return the bytes of a file of a folder after a check of its SHA-256.

    Raises FolderError if the file is missing, changed or damaged.
    """
    import hashlib

    with intact(path, name):
        data = (path / name).read_bytes()
        if hashlib.sha256(data).hexdigest() != summary["digests"][name]:
            raise FolderError(f"{path}: {name} was changed or is damaged; {AGAIN}")
    return data


def table(path: Path, summary: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the columns of a table of a folder as arrays."""
    import pyarrow
    import pyarrow.parquet

    data = content(path, summary, name)
    with intact(path, name):
        found = pyarrow.parquet.read_table(  # pyarrow's threads can abort Python's exit
            pyarrow.BufferReader(data), use_threads=False, pre_buffer=False
        )
        return {key: found[key].to_numpy() for key in found.column_names}
