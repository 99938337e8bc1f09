"""Tracks: where the craft of a batch are at common times, to exclude pairs (see `exclusion`)."""

from collections.abc import Sequence
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.quick_rejection import fill_tracks
from closeform.motion.arc import END, MEAN_MOTION, START
from closeform.zones.zone import Zone, enclosing

# Intervals an orbit, and at least.  Half as many: a quarter more pairs are marched.  Twice as
# many: twice the time, and as few pairs as are in conflict.
PER_ORBIT = 48
PAYS = 4  # pairs for each craft and zone: to follow a craft costs as much as to march so many
LARGEST = 8_000_000  # floats of all tracks; beyond, pairs are marched at once


class Tracks(NamedTuple):
    """Places at common times of the craft of two batches, scaled so that the zone is in the unit ball.

    `times` (K + 1,) [s]; `own` and `others` (N, 4, K + 1): x, y and z at each time, and how far
    at most the craft is off its chord from that time to the next.
    """

    times: Floats
    own: Floats
    others: Floats


NO_TRACKS = Tracks(np.empty(0), np.empty((0, 4, 0)), np.empty((0, 4, 0)))


def follow(
    arcs: Floats, offsets: Any, others: Floats, other_offsets: Any, zones: Sequence[Zone], pairs: int
) -> dict[Zone, Tracks]:
    """Tracks of the craft of two batches for each of the zones, to search a number of pairs.

    None where that costs more than it saves, or would take too much memory.
    """
    craft = len(offsets) - 1 if others is arcs else len(offsets) + len(other_offsets) - 2
    if not 0 < PAYS * craft * len(zones) <= pairs:
        return dict.fromkeys(zones, NO_TRACKS)
    start = min(float(bodies[:, START].min()) for bodies in (arcs, others))
    end = max(float(bodies[:, END].max()) for bodies in (arcs, others))
    n = max(float(bodies[:, MEAN_MOTION].max()) for bodies in (arcs, others))
    count = PER_ORBIT * max(1.0, n * (end - start) / (2 * pi))
    if not 4 * craft * len(zones) * count <= LARGEST:
        return dict.fromkeys(zones, NO_TRACKS)
    times = np.linspace(start, end, ceil(count) + 1)
    tracks = {}
    for zone in zones:
        own = tracks_of(arcs, offsets, times, zone)
        same = others is arcs
        tracks[zone] = Tracks(times, own, own if same else tracks_of(others, other_offsets, times, zone))
    return tracks


def tracks_of(arcs: Floats, offsets: Any, times: Floats, zone: Zone) -> Floats:
    """Tracks (N, 4, K + 1) of one batch."""
    tracks = np.zeros((len(offsets) - 1, 4, len(times)))
    fill_tracks(arcs, offsets, enclosing(zone), times, tracks)
    return tracks
