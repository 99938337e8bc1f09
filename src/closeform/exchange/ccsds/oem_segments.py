"""Segments of an OEM: conversion of message entries to ephemerides, with the line of each error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ccsds.entries import CORRECT, Entry, by_keyword, number_in, numbers_in, require
from closeform.exchange.ccsds.message_text import COVARIANCE
from closeform.exchange.ephemerides.covariance import LOWER, Covariances, check, from_lower
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris, flaw_of_frame, flaw_of_states
from closeform.exchange.epochs import EpochError, seconds_of

METADATA = "between META_START and META_STOP"
REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")
OPTIONAL = (
    "REF_FRAME_EPOCH",
    "USEABLE_START_TIME",
    "USEABLE_STOP_TIME",
    "INTERPOLATION",
    "INTERPOLATION_DEGREE",
)


@dataclass(frozen=True)
class Segment:
    """Entries of one segment."""

    metadata: list[Entry] = field(default_factory=list)
    states: list[Entry] = field(default_factory=list)
    covariances: list[list[Entry]] = field(default_factory=list)  # each starts with an EPOCH


def segments_of(entries: Sequence[Entry]) -> list[Segment]:
    """Return the segments of a message; raise ValueError for entries in the wrong place."""
    segments: list[Segment] = []
    inside = ""
    for entry in entries:
        word = entry.keyword
        block, _, edge = word.rpartition("_")
        if block in ("META", "COVARIANCE") and edge in ("START", "STOP"):
            opens = edge == "START" and not inside and (block == "META" or bool(segments))
            if not (opens or (edge == "STOP" and inside == block)):
                raise ValueError(f"line {entry.line}: {word} is out of place; {CORRECT}")
            inside = block if opens else ""
            if word == "META_START":
                segments.append(Segment())
        elif word == "COMMENT" or not (segments or inside):
            continue  # the header is not used
        elif inside == "META":
            if word not in REQUIRED and word not in OPTIONAL:
                what = f"keyword {word}" if word else f"'{entry.value[:30]}'"
                raise ValueError(f"line {entry.line}: {what} is not a metadata keyword of an OEM; {CORRECT}")
            segments[-1].metadata.append(entry)
        elif inside:
            if word == "EPOCH":
                segments[-1].covariances.append([])
            elif not segments[-1].covariances:
                raise ValueError(f"line {entry.line}: a covariance without EPOCH; {CORRECT}")
            segments[-1].covariances[-1].append(entry)
        elif word:
            raise ValueError(f"line {entry.line}: keyword {word} is out of place among states; {CORRECT}")
        else:
            segments[-1].states.append(entry)
    if inside:
        raise ValueError(f"incomplete OEM: {inside}_STOP is missing; {CORRECT}")
    if not segments:
        raise ValueError(f"incomplete OEM: has no segment; {CORRECT}")
    return segments


def ephemeris_of(segment: Segment) -> Ephemeris:
    """Return the ephemeris of one segment, in m and m/s."""
    found = by_keyword(segment.metadata, METADATA)
    require(found, REQUIRED, METADATA)
    header = {keyword: entry.value for keyword, entry in found.items()}
    stamps, states = _states(segment.states)
    system = header["TIME_SYSTEM"].upper()
    limits = [header.get("USEABLE_" + key) or header[key] for key in ("START_TIME", "STOP_TIME")]
    blocks = segment.covariances
    places = ["time limits"] * 2 + [
        f"line {entry.line}" for entry in (*segment.states, *(b[0] for b in blocks))
    ]
    try:
        seconds = seconds_of([*limits, *stamps, *(block[0].value for block in blocks)], system)
    except EpochError as error:
        raise ValueError(f"{places[error.index]}: {error}") from None
    (start, stop), times, epochs = seconds[:2], seconds[2 : 2 + len(stamps)], seconds[2 + len(stamps) :]
    flaw = flaw_of_states(times, states)
    if flaw is not None:
        raise ValueError(f"line {segment.states[flaw[0]].line}: {flaw[1]}")
    useable = (times >= start - SAME_EPOCH) & (times <= stop + SAME_EPOCH)
    if useable.sum() < 2:
        raise ValueError(f"has {useable.sum()} states from {limits[0]} to {limits[1]}; correct these limits")
    first = int(np.argmax(useable))
    return Ephemeris(
        name=header["OBJECT_NAME"],
        object_id=header["OBJECT_ID"],
        center=header["CENTER_NAME"],
        frame=header["REF_FRAME"],
        time_system=system,
        epoch=stamps[first].rstrip("Z"),
        times=times[useable] - times[first],
        states=states[useable],
        covariances=_covariances(blocks, epochs - times[first], header["REF_FRAME"]) if blocks else None,
    )


def _states(entries: Sequence[Entry]) -> tuple[list[str], Floats]:
    """Return epochs as in the text, and states [m, m/s]."""
    if len(entries) < 2:
        raise ValueError(f"has {len(entries)} states; at least two are needed")
    stamps, rows = [], []
    for entry in entries:
        stamp, *words = entry.value.split()
        if len(words) not in (6, 9):  # with accelerations
            what = f"expected an epoch and 6 or 9 numbers, got {len(words) + 1} words"
            raise ValueError(f"line {entry.line}: {what}; {CORRECT}")
        stamps.append(stamp)
        rows.append(numbers_in(entry.line, words[:6]))
    return stamps, np.array(rows) * 1e3


def _covariances(blocks: Sequence[Sequence[Entry]], epochs: Floats, states: str) -> Covariances:
    """Return covariances [m^2, m^2/s, m^2/s^2] at epochs [s], by default in the frame of the states."""
    frames, matrices = [], []
    for index, (epoch, *entries) in enumerate(blocks):
        if index and epochs[index] <= epochs[index - 1]:
            raise ValueError(f"line {epoch.line}: epochs of covariances must increase; sort them")
        frame = states
        if entries and entries[0].keyword == "COV_REF_FRAME":
            frame = entries[0].value
            if (wrong := flaw_of_frame(frame, states)) is not None:
                raise ValueError(f"line {entries[0].line}: COV_REF_FRAME {wrong}")
            del entries[0]
        with np.errstate(over="ignore"):  # the check refuses what is not finite
            matrix = from_lower(_lower(epoch, entries)) * 1e6
        check(f"line {epoch.line}: covariance of {epoch.value}", matrix)
        frames.append(frame)
        matrices.append(matrix)
    return Covariances(epochs, np.array(matrices), tuple(frames))


def _lower(epoch: Entry, entries: Sequence[Entry]) -> list[float]:
    """Return the 21 values of one covariance, from six rows of key-value form or by name in XML."""
    if entries and entries[0].keyword:
        found = by_keyword(entries, f"in the covariance of {epoch.value}")
        require(found, COVARIANCE, f"in the covariance of {epoch.value}")
        return [number_in(found[name].line, found[name].value) for name in COVARIANCE]
    values: list[float] = []
    for row, entry in enumerate(entries, 1):
        words = entry.value.split()
        if entry.keyword or row > 6 or len(words) != row:
            what = f"keyword {entry.keyword}" if entry.keyword else f"{len(words)} values"
            raise ValueError(
                f"line {entry.line}: {what} in place of row {row} of a lower triangle; {CORRECT}"
            )
        values += numbers_in(entry.line, words)
    if len(values) != len(LOWER[0]):
        raise ValueError(f"line {epoch.line}: covariance of {epoch.value} has fewer than six rows; {CORRECT}")
    return values
