"""Atomic publication of results: all files or none, and never over files of another origin.

A run or a study works in a private folder inside its result folder and holds a lock file there. It writes its
summary last; from then on the results are complete. Publication moves old results aside and new ones up, the
new summary last. After an interruption the next command that opens the folder finishes the move (`settle`).
Incomplete results are deleted, except the chunks of a study, from which the same study continues.
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
NAMED = 3  # number of foreign files that a message lists


@contextmanager
def folder(path: Path, overwrite: bool = False, study: bool = False) -> Iterator[Folder]:
    """Open a result folder to fill; the results appear at `path` only if the block ends without an error.

    Finished results that they replace stay until then. With `study`, the chunks listed in a manifest stay
    after an error and are available again the next time. Raises FolderError for finished results without
    `overwrite`, and for a folder that holds anything else, is in use, or cannot be written.
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
            with explain_continuation(path, private):
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
    """Raise FolderError unless results may be written at `path`, which messages name as `called`.

    `mine`: this process already works in the folder; `study`: an unfinished study may be continued.
    """
    if not mine:
        settle(path)
    with written(called or path):
        if reason := refusal(path, overwrite, mine, study):
            raise FolderError(f"{called or path}: {reason}")


def refusal(path: Path, overwrite: bool, mine: bool, study: bool) -> str | None:
    """Return the reason why results must not be written at a path, or None. Raises OSError."""
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
        return "holds an unfinished study; continue it, add --overwrite or choose another --out"
    if strange := others(path):
        named = ", ".join(strange[:NAMED]) + f" and {len(strange) - NAMED} more" * (len(strange) > NAMED)
        return f"holds files that are not results: {named}; move them away or choose another --out"
    return None


def settle(path: Path) -> None:
    """Finish a publication that was interrupted; leave any other folder as it is."""
    place = Path(os.path.realpath(path))
    private = place / PRIVATE
    with suppress(OSError):  # a folder that cannot be read or written stays as it is
        if not listed(private / RESULTS / SUMMARY) or (held := lock(private / LOCK)) is None:
            return
        with held:
            move_up(path, place, private)
            drop(private)


def claim(private: Path) -> BufferedWriter | None:
    """Create the private folder and lock it; return None if another process holds it."""
    while True:
        private.mkdir(exist_ok=True)
        with suppress(FileNotFoundError):  # another process has just deleted it
            return lock(private / LOCK)


def begin(path: Path, place: Path, private: Path, overwrite: bool, study: bool) -> None:
    """Delete the remains of an interrupted process in a claimed folder, except the chunks of a study."""
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
    """Replace the previous results by the complete new ones: all files, or none.

    Files that an interrupted call has already moved stay where they are.
    """
    results, replaced, listing = private / RESULTS, private / REPLACED, private / manifest.NAME
    new = listed(results / SUMMARY)
    old = listed(place / SUMMARY) | listed(replaced / SUMMARY)
    waiting = {name for name in new if os.path.lexists(results / name)}
    if taken := sorted(name for name in waiting - old if os.path.lexists(place / name)):
        raise FolderError(f"{path}: {taken[0]} appeared during the run; move it away")
    aside = sorted(old - new | waiting & old, key=lambda name: name != SUMMARY)
    moves = [(place / name, replaced / name) for name in aside]
    moves += [(results / name, place / name) for name in sorted(waiting - {SUMMARY})]
    moves += [(listing, replaced / listing.name), (results / SUMMARY, place / SUMMARY)]
    begun: list[tuple[Path, Path]] = []
    try:
        for source, target in moves:
            begun.append((source, target))
            target.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):  # deleted by another process, or moved already
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
    """Release the private folder; keep it only if it holds chunks from which a study can continue."""
    with held:
        try:
            kept = can_continue(private)
        except KeyboardInterrupt:
            drop(private)
            raise
        if not kept:
            drop(private)


def can_continue(private: Path) -> bool:
    """Return True if the private folder holds chunks to continue from; a one-chunk study restarts instead."""
    whole, every = manifest.progress(private / manifest.NAME)
    return whole > 0 and every > 1


@contextmanager
def explain_continuation(path: Path, private: Path) -> Iterator[None]:
    """Extend the error of an interrupted study: chunks are kept, and the same command continues."""
    try:
        yield
    except (KeyboardInterrupt, FolderError) as error:
        if not can_continue(private):
            raise
        whole, every = manifest.progress(private / manifest.NAME)
        kept = f"{whole} of {every} chunks are kept in {path}"
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(f"{kept}; run the same command to continue") from None
        what = str(error).removesuffix("; choose another --out")  # which would not continue the study
        raise FolderError(f"{what}; {kept}; run the same command to continue") from error


def drop(private: Path) -> None:
    """Delete this process's private folder, even if Ctrl-C interrupts the deletion.

    The summary is deleted first, so that an interruption cannot leave partial results that look complete.
    """
    try:
        (private / RESULTS / SUMMARY).unlink(missing_ok=True)
        shutil.rmtree(private, ignore_errors=True)
    except KeyboardInterrupt:
        shutil.rmtree(private, ignore_errors=True)
        raise


def make_folders(path: Path) -> list[Path]:
    """Create a folder and its missing parents; return the created ones, outermost first."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    return made[::-1]


def remove_folders(folders: Iterable[Path]) -> None:
    """Remove those of some folders that are empty, innermost first."""
    for one in sorted(set(folders), reverse=True):
        with suppress(OSError):
            one.rmdir()
