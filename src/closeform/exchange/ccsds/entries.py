"""Entries of a CCSDS message in order, in key-value or XML form (502.0-B 7, 508.0-B 6)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, NamedTuple
from xml.parsers.expat import ExpatError, ParserCreate

COMMENT = re.compile(r"COMMENT(?![A-Z0-9_])\s*(.*)")
KEYED = re.compile(r"([A-Z][A-Z0-9_]*)\s*=\s*(.*)")
WORD = re.compile(r"[A-Z][A-Z_]*")
BRACKETS = re.compile(r"\s*\[([^\[\]]*)\]$")
BLOCKS = {
    "metadata": "META",
    "covarianceMatrix": "COVARIANCE",
}  # blocks of XML that key-value form delimits by keywords
ROW = ("EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
CORRECT = "correct the file or ask its originator for it again"


class Entry(NamedTuple):
    """One line: a keyword with its value and unit, or data without a keyword."""

    line: int
    keyword: str
    value: str
    unit: str = ""


@contextmanager
def within(file: str | PathLike[str]) -> Iterator[None]:
    """Prefix the message of a ValueError with the file's name, in one line."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{file}: {' '.join(str(error).split())}") from None


def message(file: str | PathLike[str], kind: str) -> list[Entry]:
    """Return the entries of a message of a `kind` ("OEM", "CDM"); raise ValueError for another file."""
    one = f"{'an' if kind[0] in 'AEO' else 'a'} {kind}"
    try:
        text = FilePath(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"not a text file; give {one} in key-value or XML form") from None
    if not text.strip():
        raise ValueError(f"empty file; give {one} in key-value or XML form")
    entries = of_xml(text, kind) if text.lstrip().startswith("<") else of_key_values(text)
    version = f"CCSDS_{kind}_VERS"
    first = next((entry for entry in entries if entry.keyword != "COMMENT"), entries[0])
    if first.keyword != version:
        raise ValueError(f"line {first.line}: not {one}, which starts with {version}; give another file")
    return entries


def of_key_values(text: str) -> list[Entry]:
    """Return the lines of key-value form that are not blank."""
    entries = []
    for number, raw in enumerate(text.split("\n"), 1):
        line = raw.strip()
        if match := COMMENT.fullmatch(line):
            entries.append(Entry(number, "COMMENT", match[1]))
        elif match := KEYED.fullmatch(line):
            unit = BRACKETS.search(match[2])
            value = match[2][: unit.start()] if unit else match[2]
            entries.append(Entry(number, match[1], value, unit[1].strip() if unit else ""))
        elif WORD.fullmatch(line):
            entries.append(Entry(number, line, ""))
        elif line:
            entries.append(Entry(number, "", line))
    return entries


def of_xml(text: str, kind: str) -> list[Entry]:
    """Return the elements of XML as the corresponding lines of key-value form."""
    entries: list[Entry] = []
    opened: list[tuple[int, str, str, list[str]]] = []  # line, tag, unit, text
    leaves: dict[str, str] = {}  # of the state of an ephemeris

    def begin(tag: str, attributes: dict[str, str]) -> None:
        tag, line = tag.rpartition(":")[2], parser.CurrentLineNumber
        if not opened:
            entries.append(Entry(line, f"CCSDS_{tag.upper()}_VERS", attributes.get("version", "")))
        if tag in BLOCKS:
            entries.append(Entry(line, f"{BLOCKS[tag]}_START", ""))
        opened.append((line, tag, attributes.get("units", ""), []))

    def end(_: str) -> None:
        line, tag, unit, parts = opened.pop()
        value = " ".join("".join(parts).split())
        if tag in BLOCKS:
            entries.append(Entry(parser.CurrentLineNumber, f"{BLOCKS[tag]}_STOP", ""))
        elif tag == "stateVector" and kind == "OEM":
            entries.append(Entry(line, "", " ".join(leaves.get(name) or "-" for name in ROW)))
            leaves.clear()
        elif kind == "OEM" and opened and opened[-1][1] == "stateVector":
            leaves[tag] = value
        elif tag.isupper():
            entries.append(Entry(line, tag, value, unit))

    def characters(data: str) -> None:
        if opened:
            opened[-1][3].append(data)

    parser = ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler, parser.EntityDeclHandler = characters, refuse_entities
    try:
        parser.Parse(text.lstrip(), True)
    except ExpatError as error:
        raise ValueError(f"line {error.lineno}: incomplete {kind} in XML; {CORRECT}") from None
    return entries


def refuse_entities(*_: Any) -> None:
    """Refuse entities: no message needs them, and a few lines of them can expand to gigabytes."""
    raise ValueError(f"declares entities, which no message has; {CORRECT}")


def by_keyword(entries: Iterable[Entry], where: str) -> dict[str, Entry]:
    """Return entries by keyword without comments; raise ValueError if one occurs twice."""
    found: dict[str, Entry] = {}
    for entry in entries:
        if entry.keyword == "COMMENT":
            continue
        if entry.keyword in found:
            raise ValueError(f"line {entry.line}: keyword {entry.keyword} occurs twice {where}; keep one")
        found[entry.keyword] = entry
    return found


def require(found: Mapping[str, Entry], keywords: Iterable[str], where: str) -> None:
    """Raise ValueError if a mandatory keyword is missing."""
    for keyword in keywords:
        if keyword not in found or not found[keyword].value:
            raise ValueError(f"keyword {keyword} is missing {where}; {CORRECT}")


def numbers_in(line: int, words: Sequence[str]) -> list[float]:
    """Return words as numbers, which may be nan or infinite."""
    return [number_in(line, word) for word in words]


def number_in(line: int, word: str) -> float:
    """Return a word as a number."""
    try:
        if "_" in word:  # which Python accepts between digits
            raise ValueError
        return float(word)
    except ValueError:
        raise ValueError(f"line {line}: '{word[:30]}' is not a number; {CORRECT}") from None


def quantity(entry: Entry, unit: str) -> float:
    """Return a keyword's number in the `unit` of the standard."""
    if entry.unit and entry.unit.replace(" ", "").lower() != unit.lower():
        what = f"{entry.keyword} in [{entry.unit}], where the standard has [{unit}]"
        raise ValueError(f"line {entry.line}: {what}; convert it, or correct the unit")
    return number_in(entry.line, entry.value)
