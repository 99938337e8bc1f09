"""Manifest: what a study is, and which of its chunks are whole; a file of JSON lines that only grows."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

NAME = "manifest.jsonl"


def entries(manifest: Path) -> list[dict[str, Any]]:
    """The lines of a manifest, up to one that a kill cut off: what the study is, then its chunks."""
    found = []
    try:
        lines = manifest.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return []
    for line in lines:
        try:
            found.append(json.loads(line))
        except ValueError:
            break
    return found


def rewrite(manifest: Path, entries: Sequence[Mapping[str, Any]]) -> None:
    """Make a manifest anew, whole or not at all."""
    fresh = manifest.with_suffix(".partial")
    fresh.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    fresh.replace(manifest)


def append(manifest: Path, entry: Mapping[str, Any]) -> None:
    """Add a line, on the disk when it returns."""
    with manifest.open("a", encoding="utf-8") as opened:
        opened.write(json.dumps(entry) + "\n")
        opened.flush()
        os.fsync(opened.fileno())


def progress(manifest: Path) -> tuple[int, int]:
    """How many chunks are whole, of how many."""
    known = entries(manifest)
    if not known:
        return 0, 0
    return len(known) - 1, -(-int(known[0]["cases"]) // int(known[0]["chunk"]))
