"""Tracks: bounds on the positions of a batch on common times, which exclude pairs (see `quick_rejection`)."""

from collections.abc import Sequence
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.quick_rejection import fill_tracks
from closeform.motion.arc import END, MEAN_MOTION, START
from closeform.zones.zone import Zone, enclosing

# Intervals an orbit, and at least. Half as many: the march searches a quarter more pairs. Twice as many:
# twice the time, and only pairs in conflict are searched.
PER_ORBIT = 48
PAYS = 4  # pairs for each spacecraft and zone: a track costs as much as a march over so many pairs
LARGEST = 8_000_000  # floats of all tracks; beyond, pairs are marched without tracks


class Tracks(NamedTuple):
    """Tracks of two batches at common times, scaled so that the zone is inside the unit ball.

    `times` (K + 1,) [s]; `own` and `others` (N, 4, K + 1): x, y and z at each time, and the largest deviation
    from the chord between that time and the next.
    """

    times: Floats
    own: Floats
    others: Floats


NO_TRACKS = Tracks(np.empty(0), np.empty((0, 4, 0)), np.empty((0, 4, 0)))


def follow(
    arcs: Floats, offsets: Any, others: Floats, other_offsets: Any, zones: Sequence[Zone], pairs: int
) -> dict[Zone, Tracks]:
    """Return the tracks of two batches for each of the zones, to search a number of pairs.

    They are empty if they would cost more time than they save, or too much memory.
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
    """Return the tracks (N, 4, K + 1) of one batch."""
    tracks = np.zeros((len(offsets) - 1, 4, len(times)))
    fill_tracks(arcs, offsets, enclosing(zone), times, tracks)
    return tracks
