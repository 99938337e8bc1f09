"""Publication of results: complete or not at all, and never over the files of others.

A run or a study works in a private folder inside its place, and holds a lock file there.  Its summary is
written last: from then on the results are complete.  They are moved up, the old ones aside, the new summary
last of all.  The next command that opens the place after a kill finishes that move (`settle`).  Anything less
than complete results is deleted, except the chunks of a study, from which the same study continues.
"""

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from io import BufferedWriter
from pathlib import Path

from closeform.storage import manifest
from closeform.storage.lock_file import is_held, lock
from closeform.storage.result_folder import (
    CASES,
    LOCK,
    PRIVATE,
    REPLACED,
    RESULTS,
    SUMMARY,
    Folder,
    FolderError,
    finished,
    listed,
    others,
    written,
)

UNDER_WAY = "a run or a study is under way in it; wait for its end or choose another --out"
NAMED = 3  # files that are named where more are in the way


@contextmanager
def folder(path: Path, overwrite: bool = False, study: bool = False) -> Iterator[Folder]:
    """Open a result folder to fill; the results appear at `path` when the block ends well, and not otherwise.

    Finished results that they replace stay until then.  With `study` the chunks that a manifest lists stay
    where the block ends badly, and are there again the next time.  Raises FolderError for finished results
    without `overwrite`, and for a folder that holds anything else, is in use, or cannot be written.
    """
    check_free(path, overwrite, study=study)
    place = Path(os.path.realpath(path))
    private = place / PRIVATE
    with written(path):
        made = make_folders(place)
    try:
        with written(path):
            held = claim(private)
        if held is None:
            raise FolderError(f"{path}: {UNDER_WAY}")
        try:
            with written(path):
                begin(path, place, private, overwrite, study)
            with goes_on(path, private):
                yield Folder(private / RESULTS)
                with written(path):
                    move_up(path, place, private)
        finally:
            leave(private, held)
    finally:
        remove_folders(made)


def check_free(
    path: Path, overwrite: bool, called: Path | None = None, mine: bool = False, study: bool = False
) -> None:
    """Raise FolderError unless results may be written at `path`, which the user has `called` so.

    `mine`: this process is the one that works in it; `study`: it may go on with an unfinished study.
    """
    if not mine:
        settle(path)
    with written(called or path):
        if reason := refusal(path, overwrite, mine, study):
            raise FolderError(f"{called or path}: {reason}")


def refusal(path: Path, overwrite: bool, mine: bool, study: bool) -> str | None:
    """Return why results must not be written at a path, None where they may. Raises OSError."""
    try:
        if not os.listdir(path):
            return None
    except FileNotFoundError:
        return None
    except NotADirectoryError:
        return "is a file; choose another --out"
    if not mine and is_held(path / PRIVATE / LOCK):
        return UNDER_WAY
    done = finished(path)
    if done and not overwrite:
        return "holds finished results; add --overwrite or choose another --out"
    if not done and not (path / PRIVATE).is_dir():
        return "is not a result folder and not empty; choose another --out"
    if not (overwrite or study) and manifest.progress(path / PRIVATE / manifest.NAME)[0]:
        return "holds an unfinished study; go on with it, add --overwrite or choose another --out"
    if strange := others(path):
        named = ", ".join(strange[:NAMED]) + f" and {len(strange) - NAMED} more" * (len(strange) > NAMED)
        return f"holds what is none of its results: {named}; move that away or choose another --out"
    return None


def settle(path: Path) -> None:
    """Finish a publication that a kill interrupted; leave any other folder as it is."""
    place = Path(os.path.realpath(path))
    private = place / PRIVATE
    with suppress(OSError):  # a folder that cannot be read or written stays as it is
        if not listed(private / RESULTS / SUMMARY) or (held := lock(private / LOCK)) is None:
            return
        with held:
            move_up(path, place, private)
            drop(private)


def claim(private: Path) -> BufferedWriter | None:
    """Make the private folder and lock it; None where another process holds it."""
    while True:
        private.mkdir(exist_ok=True)
        with suppress(FileNotFoundError):  # another process has just deleted it
            return lock(private / LOCK)


def begin(path: Path, place: Path, private: Path, overwrite: bool, study: bool) -> None:
    """Clear away what a killed process left in a place that is ours now, except the chunks of a study."""
    check_free(place, overwrite, path, mine=True, study=study)
    listing, results = private / manifest.NAME, private / RESULTS
    (results / SUMMARY).unlink(missing_ok=True)
    if not study:
        listing.unlink(missing_ok=True)
    for left in (results, private / REPLACED):
        left.mkdir(exist_ok=True)
        for file in left.iterdir():
            if left == results and file.name == CASES and listing.exists():
                continue
            if file.is_dir() and not file.is_symlink():
                shutil.rmtree(file, ignore_errors=True)
            else:
                file.unlink()


def move_up(path: Path, place: Path, private: Path) -> None:
    """Put complete results in the place of those before them: all of them, or none.

    What an interrupted call has moved already stays where it is.
    """
    results, replaced, listing = private / RESULTS, private / REPLACED, private / manifest.NAME
    new = listed(results / SUMMARY)
    old = listed(place / SUMMARY) | listed(replaced / SUMMARY)
    waiting = {name for name in new if os.path.lexists(results / name)}
    if taken := sorted(name for name in waiting - old if os.path.lexists(place / name)):
        raise FolderError(f"{path}: {taken[0]} appeared meanwhile; move it away")
    aside = sorted(old - new | waiting & old, key=lambda name: name != SUMMARY)
    moves = [(place / name, replaced / name) for name in aside]
    moves += [(results / name, place / name) for name in sorted(waiting - {SUMMARY})]
    moves += [(listing, replaced / listing.name), (results / SUMMARY, place / SUMMARY)]
    begun: list[tuple[Path, Path]] = []
    try:
        for source, target in moves:
            begun.append((source, target))
            target.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # deleted by somebody, or moved already
                source.replace(target)
    except BaseException:
        for source, target in reversed(begun):
            if not os.path.lexists(source):
                with suppress(FileNotFoundError):
                    target.replace(source)
        raise
    finally:
        remove_folders((place / name).parent for name in old | new)


def leave(private: Path, held: BufferedWriter) -> None:
    """Let go of the private folder, which stays with the chunks of a study if there are any to go on from."""
    with held:
        try:
            kept = stays(private)
        except KeyboardInterrupt:
            drop(private)
            raise
        if not kept:
            drop(private)


def stays(private: Path) -> bool:
    """Return whether there are chunks to go on from; a study of a single one is soon repeated."""
    whole, every = manifest.progress(private / manifest.NAME)
    return whole > 0 and every > 1


@contextmanager
def goes_on(path: Path, private: Path) -> Iterator[None]:
    """Add to the error of a study that ends badly that chunks stay, and how it continues."""
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


def drop(private: Path) -> None:
    """Delete one's own private folder, also where Ctrl-C interrupts that.

    The summary goes first: a kill on the way must not leave half of the results as though they were complete.
    """
    try:
        (private / RESULTS / SUMMARY).unlink(missing_ok=True)
        shutil.rmtree(private, ignore_errors=True)
    except KeyboardInterrupt:
        shutil.rmtree(private, ignore_errors=True)
        raise


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
