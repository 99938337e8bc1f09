"""CCSDS conjunction data messages (CDM, CCSDS 508.0-B): read and write.

Files contain states in km and km/s, covariances and distances in m; this module returns m and m/s.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from closeform.arrays import instance, sequence
from closeform.exchange.ccsds.conjunction import Conjunction, ConjunctionObject
from closeform.exchange.ccsds.entries import (
    CORRECT,
    Entry,
    by_keyword,
    message,
    number_in,
    quantity,
    require,
    within,
)
from closeform.exchange.ccsds.message_text import STATE, covariance_units
from closeform.exchange.ephemerides.covariance import LOWER, from_lower
from closeform.exchange.epochs import clock, now

HEADER = ("CREATION_DATE", "ORIGINATOR", "MESSAGE_ID")
RELATIVE = ("TCA", "MISS_DISTANCE")
WORDS = {  # keywords of an object, by field
    "designator": "OBJECT_DESIGNATOR",
    "catalog": "CATALOG_NAME",
    "name": "OBJECT_NAME",
    "international_designator": "INTERNATIONAL_DESIGNATOR",
    "ephemeris_name": "EPHEMERIS_NAME",
    "covariance_method": "COVARIANCE_METHOD",
    "manoeuvrable": "MANEUVERABLE",
    "frame": "REF_FRAME",
}
COVARIANCE = covariance_units(("R", "T", "N", "RDOT", "TDOT", "NDOT"), "m")
# Version 1.0 messages give radii in comments: COMMENT HBR and COMMENT EXCLUSION_VOLUME_RADIUS (CARA, others).
RADIUS = re.compile(r"(?:HBR|HARD[ _-]?BODY[ _-]?RADIUS)\s*[=:]\s*(\S+)\s*(?:\[(\S+)\])?", re.IGNORECASE)
EXCLUDED = re.compile(r"EXCLUSION[ _]VOLUME[ _]RADIUS\s*=\s*(\S+)\s*(?:\[(\S+)\])?", re.IGNORECASE)
RADIUS_WORDS = ("HBR", "HARD_BODY_RADIUS")


def read_cdm(file: str | PathLike[str]) -> Conjunction:
    """Read the conjunction in a CDM, in key-value or XML form.

    The result keeps states, covariances, radii, probability, and the identification of the objects and the
    message.

    Parameters
    ----------
    file : str or path-like
        File with states in km and km/s, covariances in m**2, m**2/s and m**2/s**2, as in the standard.

    Returns
    -------
    Conjunction
        Conjunction in m and m/s.

    Raises
    ------
    ValueError
        If the file is absent, damaged or not a CDM, lacks mandatory keywords, has other units, frames
        that are unknown or differ, numbers that are not finite, or a miss distance that contradicts its
        states; in one line, with file, line or keyword.

    References
    ----------
    CCSDS 508.0-B, Conjunction Data Message; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    with within(file):
        relative, *objects = _parts(message(file, "CDM"))
        found = by_keyword(relative, "before OBJECT1")
        require(found, (*HEADER, *RELATIVE), "before OBJECT1")
        try:
            clock(found["TCA"].value, "UTC")
        except ValueError:
            what = f"TCA: '{found['TCA'].value[:30]}' is not a valid epoch; "
            what += "write it in the form 2010-03-13T22:37:52.618"
            raise ValueError(f"line {found['TCA'].line}: {what}") from None
        chance = found.get("COLLISION_PROBABILITY")
        return Conjunction(
            tca=found["TCA"].value,
            objects=(_object(objects[0], "OBJECT1"), _object(objects[1], "OBJECT2")),
            miss_distance=quantity(found["MISS_DISTANCE"], "m"),
            hard_body_radius=_radius(relative, found),
            collision_probability=_optional(chance and number_in(chance.line, chance.value)),
            collision_probability_method=_word(found, "COLLISION_PROBABILITY_METHOD"),
            originator=found["ORIGINATOR"].value,
            message_id=found["MESSAGE_ID"].value,
            creation_date=found["CREATION_DATE"].value,
            message_for=_word(found, "MESSAGE_FOR"),
            exclusion_radii=tuple(
                _length(entry, match) for part in objects for entry, match in _comments(part, EXCLUDED)
            ),
        )


def write_cdm(file: str | PathLike[str], conjunction: Conjunction, *, comments: Sequence[str] = ()) -> None:
    """Write a conjunction as a CDM in key-value form: states to 1e-6 m and 1e-9 m/s.

    Parameters
    ----------
    file : str or path-like
        Output file; an existing file is replaced.
    conjunction : Conjunction
        Conjunction to write; relative position and velocity are computed from its states.
    comments : sequence of str, optional
        Lines of COMMENT in the header.

    Raises
    ------
    ValueError
        If an argument is of another type.

    References
    ----------
    CCSDS 508.0-B, Conjunction Data Message; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    checked = instance("conjunction", conjunction, Conjunction)
    comments = sequence("comments", comments, str)
    relative = checked.relative_state
    lines: list[tuple[str, Any, str]] = [
        ("CCSDS_CDM_VERS", "1.0", ""),
        *(("COMMENT", comment, "") for comment in comments),
        ("CREATION_DATE", checked.creation_date or now(), ""),
        ("ORIGINATOR", checked.originator, ""),
        *([("MESSAGE_FOR", checked.message_for, "")] if checked.message_for else []),
        ("MESSAGE_ID", checked.message_id, ""),
        ("TCA", checked.tca, ""),
        ("MISS_DISTANCE", f"{checked.miss_distance:.6f}", "m"),
        ("RELATIVE_SPEED", f"{checked.relative_speed:.9f}", "m/s"),
        *((f"RELATIVE_POSITION_{part}", f"{relative[k]:.6f}", "m") for k, part in enumerate("RTN")),
        *((f"RELATIVE_VELOCITY_{part}", f"{relative[3 + k]:.9f}", "m/s") for k, part in enumerate("RTN")),
    ]
    if checked.collision_probability is not None:
        lines.append(("COLLISION_PROBABILITY", checked.collision_probability, ""))
    if checked.collision_probability_method is not None:
        lines.append(("COLLISION_PROBABILITY_METHOD", checked.collision_probability_method, ""))
    if checked.hard_body_radius is not None:
        lines.append(("COMMENT HBR", checked.hard_body_radius, "m"))
    for number, each in enumerate(checked.objects, 1):
        lines += [("OBJECT", f"OBJECT{number}", "")]
        lines += [(keyword, getattr(each, field), "") for field, keyword in WORDS.items()]
        if each.radius is not None:
            lines.append(("COMMENT HBR", each.radius, "m"))
        state = [f"{value / 1e3:.{9 if row < 3 else 12}f}" for row, value in enumerate(each.state)]
        lines += zip(STATE, state, STATE.values(), strict=True)
        lines += zip(COVARIANCE, each.covariance[LOWER], COVARIANCE.values(), strict=True)
    text = [
        f"{keyword}{' ' if keyword == 'COMMENT' else ' = '}{_shown(value)}" + (f" [{unit}]" if unit else "")
        for keyword, value, unit in lines
    ]
    FilePath(file).write_text("\n".join(text) + "\n", encoding="utf-8")


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else repr(float(value))


def _parts(entries: Sequence[Entry]) -> list[list[Entry]]:
    """Split the entries into those before the objects and those of each object."""
    parts: list[list[Entry]] = [[]]
    for entry in entries:
        if entry.keyword == "OBJECT":
            if entry.value != f"OBJECT{len(parts)}":
                what = f"OBJECT is '{entry.value[:30]}', expected OBJECT{len(parts)}"
                raise ValueError(
                    f"line {entry.line}: {what if len(parts) < 3 else 'a third OBJECT'}; {CORRECT}"
                )
            parts.append([])
        elif not entry.keyword:
            what = f"'{entry.value[:30]}' is not a keyword with a value"
            raise ValueError(f"line {entry.line}: {what}; {CORRECT}")
        elif not entry.keyword.startswith(("META_", "COVARIANCE_ST")):  # blocks of XML
            parts[-1].append(entry)
    if len(parts) != 3:
        raise ValueError(f"incomplete CDM: has {len(parts) - 1} of 2 objects; {CORRECT}")
    return parts


def _object(entries: Sequence[Entry], which: str) -> ConjunctionObject:
    found = by_keyword(entries, f"in {which}")
    require(found, (*WORDS.values(), *STATE, *COVARIANCE), f"in {which}")
    state = [_finite(found[keyword], unit) * 1e3 for keyword, unit in STATE.items()]
    lower = [_finite(found[keyword], unit) for keyword, unit in COVARIANCE.items()]
    for keyword, value in zip(COVARIANCE, lower, strict=True):
        left, right = keyword[1:].split("_")
        if left == right and value < 0.0:
            raise ValueError(f"line {found[keyword].line}: {keyword}: a variance is negative; {CORRECT}")
    words = {field: found[keyword].value for field, keyword in WORDS.items()}
    radius = _radius(entries, found)
    try:
        return ConjunctionObject(state=np.array(state), covariance=from_lower(lower), radius=radius, **words)
    except ValueError as error:
        raise ValueError(f"{which}: {error}") from None


def _finite(entry: Entry, unit: str) -> float:
    value = quantity(entry, unit)
    if not np.isfinite(value):
        raise ValueError(f"line {entry.line}: {entry.keyword} is not finite; {CORRECT}")
    return value


def _radius(entries: Sequence[Entry], found: dict[str, Entry]) -> float | None:
    """Return the radius [m] in a keyword or a comment of this part, or None."""
    radii = [quantity(found[keyword], "m") for keyword in RADIUS_WORDS if keyword in found]
    radii += [_length(entry, match) for entry, match in _comments(entries, RADIUS)]
    return _optional(radii[0]) if radii else None


def _comments(entries: Sequence[Entry], pattern: re.Pattern[str]) -> list[tuple[Entry, re.Match[str]]]:
    """Return the comments that match a pattern, and the matches."""
    return [
        (entry, match)
        for entry in entries
        if entry.keyword == "COMMENT" and (match := pattern.search(entry.value)) is not None
    ]


def _length(entry: Entry, match: re.Match[str]) -> float:
    """Return the length [m] in a comment."""
    return quantity(Entry(entry.line, "COMMENT", match[1], match[2] or ""), "m")


def _word(found: dict[str, Entry], keyword: str) -> str | None:
    return found[keyword].value or None if keyword in found else None


def _optional(value: float | None) -> float | None:
    """Return a number, or None if the message omits it."""
    return None if value is None or np.isnan(value) else value
