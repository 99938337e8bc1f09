"""Manifest of a study: its identity and its complete chunks, as an append-only file of JSON lines."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

NAME = "manifest.jsonl"


def entries(manifest: Path) -> list[dict[str, Any]]:
    """Return the entries of a manifest: the identity of the study, then its chunks.

    Reading stops at a line that an interruption cut off.
    """
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
    """Replace a manifest atomically."""
    fresh = manifest.with_suffix(".partial")
    fresh.write_text("".join(json.dumps(entry) + "\n" for entry in entries), encoding="utf-8")
    fresh.replace(manifest)


def append(manifest: Path, entry: Mapping[str, Any]) -> None:
    """Append an entry and flush it to the disk."""
    with manifest.open("a", encoding="utf-8") as opened:
        opened.write(json.dumps(entry) + "\n")
        opened.flush()
        os.fsync(opened.fileno())


def progress(manifest: Path) -> tuple[int, int]:
    """Return the number of complete chunks and the number of all chunks."""
    known = entries(manifest)
    if not known:
        return 0, 0
    return len(known) - 1, -(-int(known[0]["cases"]) // int(known[0]["chunk"]))
