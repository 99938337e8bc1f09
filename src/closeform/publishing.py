"""How results get their place: made aside, whole or not at all, and never where others' files are.

A run builds in a private folder beside its place and takes the place by one rename, which fails
where somebody else was quicker.  A study, which may take hours, holds its place from the start: it
works in a private folder inside, and its files move up when all are made, the summary last.  Either
private folder holds a lock: what a killed process left is told from what a living one makes, and
is cleared away by the next.
"""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from io import BufferedWriter
from pathlib import Path
from tempfile import mkdtemp

from closeform import manifest
from closeform.lock_file import lock
from closeform.result_folder import (
    CASES,
    LOCK,
    PRIVATE,
    REPLACED,
    RESULTS,
    SUMMARY,
    UNDER_WAY,
    Folder,
    FolderError,
    check_free,
    finished,
    listed,
    own,
    written,
)

BESIDE = ".closeform-"  # begins the name of a run's private folder


@contextmanager
def folder(path: Path, overwrite: bool = False) -> Iterator[Folder]:
    """A run's folder to fill; it appears at `path` when the block ends well, and not at all otherwise.

    Raises FolderError, before the block, for finished results without `overwrite`, a folder that
    holds anything else, and a place that cannot be written; after it, for a place that was taken
    meanwhile.
    """
    check_free(path, overwrite)
    place = Path(os.path.realpath(path))
    with written(path):
        made = make_folders(place.parent)
    try:
        with written(path):
            for left in place.parent.glob(f"{BESIDE}*{PRIVATE}"):
                clear(left)
            private, held = claimed(lambda: Path(mkdtemp(PRIVATE, BESIDE, place.parent)))
        try:
            with written(path):
                (private / RESULTS).mkdir()
            yield Folder(private / RESULTS)
            take(path, place, private, overwrite)
        finally:
            drop(private, held)
    finally:
        remove_folders(made)


def take(path: Path, place: Path, private: Path, overwrite: bool) -> None:
    """Give complete results the name of their place; what may stand there goes."""
    results, replaced = private / RESULTS, private / REPLACED
    check_free(place, overwrite, path)  # again: who knows what came meanwhile
    try:
        with written(path):
            if place.exists():
                place.rename(replaced)
                check_free(replaced, overwrite, path)  # and once more, where nobody looks for it
            try:
                results.rename(place)
            except OSError:
                if os.path.lexists(place):
                    raise FolderError(f"{path}: appeared during the run; choose another --out") from None
                raise
    except BaseException:
        if replaced.exists() and not os.path.lexists(place):
            replaced.rename(place)
        raise


@contextmanager
def workplace(path: Path, overwrite: bool = False) -> Iterator[Folder]:
    """A study's folder to fill: at `path` from the start, for nobody else; finished when the block ends well.

    Results that it replaces stay until then.  Chunks that a manifest lists stay where the block ends badly,
    and are there again the next time, unless that is to `overwrite` what is no finished study.  Raises
    FolderError as `folder` does, and for a place where another study is under way.
    """
    check_free(path, overwrite, study=True)
    place = Path(os.path.realpath(path))
    with written(path):
        made = make_folders(place)
    try:
        with written(path):
            private, held = claimed(lambda: private_in(place))
        if held is None:
            raise FolderError(f"{path}: {UNDER_WAY}")
        try:
            with written(path):
                begin(path, place, private, overwrite)
            with goes_on(path, private):
                yield Folder(private / RESULTS)
                with written(path):
                    move_up(path, place, private)
        finally:
            leave(private, held)
    finally:
        remove_folders(made)


def leave(private: Path, held: BufferedWriter | None) -> None:
    """Let go of a study's private folder, which stays with its chunks if there are any to go on from."""
    try:
        kept = stays(private)
    except KeyboardInterrupt:
        drop(private, held)
        raise
    if kept and held is not None:
        held.close()
    else:
        drop(private, held)


def stays(private: Path) -> bool:
    """Whether there are chunks to go on from; a study of a single one is soon flown again."""
    whole, every = manifest.progress(private / manifest.NAME)
    return whole > 0 and every > 1


@contextmanager
def goes_on(path: Path, private: Path) -> Iterator[None]:
    """Of a study that ends badly: say that chunks stay, and how it goes on."""
    try:
        yield
    except (KeyboardInterrupt, FolderError) as error:
        if not stays(private):
            raise
        whole, every = manifest.progress(private / manifest.NAME)
        kept = f"{whole} of {every} chunks are kept in {path}"
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(f"{kept}, the same command goes on") from None
        what = str(error).removesuffix("; choose another --out")  # which would not go on
        raise FolderError(f"{what}; {kept}, and the same command goes on") from error
    (private / manifest.NAME).unlink(missing_ok=True)


def private_in(place: Path) -> Path:
    """The private folder of a study in its place."""
    private = place / PRIVATE
    private.mkdir(parents=True, exist_ok=True)
    return private


def begin(path: Path, place: Path, private: Path, overwrite: bool) -> None:
    """Clear away what a killed study left in a place that is ours now, but for chunks to go on from."""
    check_free(place, overwrite, path, mine=True, study=True)
    listing, results = private / manifest.NAME, private / RESULTS
    if not finished(place):
        if overwrite:
            listing.unlink(missing_ok=True)
        else:
            take_back(place, results)
        remove_files(place, own(place))
    for left in (results, private / REPLACED):
        left.mkdir(exist_ok=True)
        for file in left.iterdir():
            if left == results and file.name == CASES and listing.exists():
                continue
            if file.is_dir() and not file.is_symlink():
                shutil.rmtree(file, ignore_errors=True)
            else:
                file.unlink()


def take_back(place: Path, results: Path) -> None:
    """Bring back chunks that a study which was killed had moved up to their place."""
    for name in sorted(listed(results / SUMMARY)):
        if name.startswith(f"{CASES}/") and (place / name).exists() and not (results / name).exists():
            (results / name).parent.mkdir(exist_ok=True)
            (place / name).replace(results / name)


def move_up(path: Path, place: Path, private: Path) -> None:
    """Put complete results in the place of those before them: all of them, or none."""
    results, replaced = private / RESULTS, private / REPLACED
    old, new = listed(place / SUMMARY), listed(results / SUMMARY)
    if taken := sorted(name for name in new - old if os.path.lexists(place / name)):
        raise FolderError(f"{path}: {taken[0]} appeared during the study; choose another --out")
    moves = [(place / name, replaced / name) for name in sorted(old, key=lambda name: name != SUMMARY)]
    moves += [(results / name, place / name) for name in sorted(new, key=lambda name: name == SUMMARY)]
    begun: list[tuple[Path, Path]] = []
    try:
        for source, target in moves:
            begun.append((source, target))
            target.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # somebody deleted one of the results before
                source.replace(target)
    except BaseException:
        for source, target in reversed(begun):
            if not os.path.lexists(source):
                with suppress(FileNotFoundError):
                    target.replace(source)
        raise
    finally:
        remove_folders((place / name).parent for name in old | new)


def remove_files(place: Path, names: Iterable[str]) -> None:
    """Delete files, and the folders below `place` that are empty then."""
    files = [place / name for name in names]
    for file in files:
        file.unlink(missing_ok=True)
    remove_folders(file.parent for file in files)


def claimed(make: Callable[[], Path]) -> tuple[Path, BufferedWriter | None]:
    """A private folder that `make` makes, and its lock; None where another holds it."""
    while True:
        private = make()
        with suppress(FileNotFoundError):  # taken for one of a killed process, before it was locked
            return private, lock(private / LOCK)


def clear(private: Path) -> None:
    """Delete a private folder, if whose it was is dead."""
    with suppress(OSError):
        if not (private / LOCK).is_file():
            private.rmdir()  # which fails if it is not empty, and so not ours
        elif (held := lock(private / LOCK)) is not None:
            with held:
                shutil.rmtree(private)


def drop(private: Path, held: BufferedWriter | None) -> None:
    """Delete one's own private folder, and let go of it."""
    try:
        shutil.rmtree(private, ignore_errors=True)
    except KeyboardInterrupt:  # which is no reason to leave half of it
        shutil.rmtree(private, ignore_errors=True)
        raise
    finally:
        if held is not None:
            held.close()


def make_folders(path: Path) -> list[Path]:
    """Make a folder and those around it; which were made, the outermost first."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    return made[::-1]


def remove_folders(folders: Iterable[Path]) -> None:
    """Remove folders, the innermost first, as far as they are empty."""
    for one in sorted(set(folders), reverse=True):
        with suppress(OSError):
            one.rmdir()
