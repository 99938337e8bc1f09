"""Slew profile: how a craft executes the turns of a search, with errors of its clock, rate and attitude.

A craft makes its turns one after another by its own clock. In each it accelerates, turns at constant rate and
decelerates. Its boresight therefore moves in segments: in each it rotates about a fixed axis by an angle that
is quadratic in time. After its last turn it keeps its attitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.leg import AXES_OF_GROUP, Group
from closeform.search.schedule import ANGLE, END, MATRICES, START, Search
from closeform.search.search_errors import (
    ACCELERATION,
    BODY,
    PACE,
    START_DELAY,
    SearchErrors,
    body_axis,
)

# columns of a segment: times, then the angle PHASE + RATE s + BEND s^2 / 2, s from its begin
BEGIN, FINISH, PHASE, RATE, BEND = range(5)
VECTORS, LEG, PART, SEGMENT = 5, 14, 15, 16  # steady, cosine and sine vectors; leg, part of its turn; columns
WAIT, FASTER, STEADY, SLOWER = -1, 0, 1, 2  # parts of a turn


@kernel()
def rate_and_ramp(angle, length, pace, acceleration):
    """Return the largest rate of a turn [rad/s], and the time for which it accelerates [s]."""
    rate = np.minimum(pace * angle / length, np.sqrt(angle * acceleration))
    return rate, rate / acceleration


@kernel(inline=True)
def nominal_segment(leg):
    """Return the segment of the boresight of A in a leg without errors, as a tuple."""
    start, end = leg[START], leg[END]
    return (
        *(start, end, 0.0, leg[ANGLE] / (end - start), 0.0),
        *(leg[5], leg[8], leg[11], leg[14], leg[17], leg[20], leg[23], leg[26], leg[29]),
    )


@kernel()
def rotate(legs, k, craft, segment):
    """Write the boresight vectors of a craft in leg k to its segment."""
    for j in range(9):
        m = MATRICES + 3 * j
        segment[VECTORS + j] = (
            legs[k, m] * craft[BODY] + legs[k, m + 1] * craft[BODY + 1] + legs[k, m + 2] * craft[BODY + 2]
        )


@kernel()
def first_segment(legs, craft, segment):
    """Initialize the segment of a craft: it waits until its start."""
    rotate(legs, 0, craft, segment)
    segment[BEGIN] = segment[PHASE] = segment[RATE] = segment[BEND] = 0.0
    segment[FINISH], segment[LEG], segment[PART] = craft[START_DELAY], 0.0, WAIT


@kernel()
def next_segment(legs, craft, segment):
    """Replace the segment of a craft by the next one."""
    k, part = int(segment[LEG]), int(segment[PART]) + 1
    if part > SLOWER:
        k, part = k + 1, FASTER
        if k == len(legs):
            length = segment[FINISH] - segment[BEGIN]
            segment[PHASE] += (segment[RATE] + 0.5 * segment[BEND] * length) * length
            segment[BEGIN], segment[RATE], segment[BEND] = segment[FINISH], 0.0, 0.0
            segment[FINISH], segment[LEG] = inf, k
            return
        rotate(legs, k, craft, segment)
    turn, length = legs[k, ANGLE], legs[k, END] - legs[k, START]
    angle, way = abs(turn), -1.0 if turn < 0.0 else 1.0
    segment[BEGIN], segment[LEG], segment[PART] = segment[FINISH], k, part
    if angle == 0.0:  # a wait lasts as long for all craft
        segment[PHASE] = segment[RATE] = segment[BEND] = 0.0
        segment[FINISH] += length
        segment[PART] = SLOWER
        return
    gain = craft[ACCELERATION]
    rate, ramp = rate_and_ramp(angle, length, craft[PACE], gain)
    last = angle - 0.5 * rate * ramp
    segment[PHASE] = way * (0.0 if part == FASTER else 0.5 * rate * ramp if part == STEADY else last)
    segment[RATE] = 0.0 if part == FASTER else way * rate
    segment[BEND] = way * (gain if part == FASTER else 0.0 if part == STEADY else -gain)
    segment[FINISH] += angle / rate - ramp if part == STEADY else ramp
    if ramp == 0.0:
        segment[BEND] = 0.0


@dataclass(frozen=True, eq=False)
class ExecutedTurns:
    """Turns of `search` as executed by craft (..., N) of these `groups`, with their `errors` (..., N)."""

    search: Search
    groups: tuple[Group, ...]
    errors: SearchErrors

    @cached_property
    def _turns(self) -> tuple[Floats, ...]:
        """Start, duration and absolute angle of each turn (L,), its rate and ramp (..., N, L)."""
        starts, ends, angles = np.abs(self.search.table[:, :MATRICES].T)
        pace, gain = 1.0 + self.errors.slew_rate[..., None], self.errors.slew_acceleration[..., None]
        moving = np.where(angles > 0.0, angles, 1.0)  # a wait has no rate
        return starts, ends - starts, angles, *rate_and_ramp(moving, ends - starts, pace, gain)

    @cached_property
    def begins(self) -> Floats:
        """Start of each turn, and end of the last (..., N, L + 1) [s]; a wait lasts as long for all craft."""
        starts, lengths, angles, rates, ramps = self._turns
        longer = np.where(angles > 0.0, lengths * (angles / lengths / rates - 1.0) + ramps, 0.0)
        late = self.errors.start[..., None] + np.cumsum(longer, axis=-1)
        ends = starts + lengths
        return np.concatenate([self.errors.start[..., None], ends + late], axis=-1)

    def boresights(self, leg: int) -> Floats:
        """Return the boresight of each craft at the start of a leg (..., N, 3)."""
        return self._bodies(self.search.legs[leg].attitude)[..., 2]

    def _bodies(self, nominal: Floats) -> Floats:
        """Return the attitudes (..., N, 3, 3) from the nominal ones of group A, (3, 3) or (N, 3, 3)."""
        sides = np.stack([AXES_OF_GROUP[group] for group in self.groups])[:, None, :]
        axes = [body_axis(self.errors.pointing, axis) for axis in range(3)]
        return np.asarray((nominal * sides) @ np.stack(axes, axis=-1))

    @cached_property
    def sun_angles(self) -> Floats:
        """Largest angle of each craft's body x from the sun line in any turn (..., N) [rad]."""
        shades = body_axis(self.errors.pointing, 0) * np.stack(
            [AXES_OF_GROUP[group] for group in self.groups]
        )
        return np.asarray(np.max([leg._sun_angle_of(shades) for leg in self.search.legs], axis=0))

    def attitudes(self, time: float) -> Floats:
        """Return attitudes (N, 3, 3) at a time [s] for errors of shape (N,); columns are the body axes."""
        return self._bodies(self.search.attitude(self.search_times(np.array([time]))[:, 0]))

    def search_times(self, times: Floats) -> Floats:
        """Return the search times (N, T) [s] that the craft have reached at `times`; errors are (N,)."""
        starts, lengths, angles, *each = self._turns
        found = np.empty((len(self.groups), len(times)))
        for out, begins, rates, ramps in zip(found, self.begins, *each, strict=True):
            at = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(starts) - 1)
            inside = np.clip(times, begins[0], begins[-1])
            since, left = inside - begins[at], begins[at + 1] - inside
            angle, rate, ramp = angles[at], rates[at], ramps[at]
            bend = rate / np.where(ramp > 0.0, ramp, 1.0)
            turned = rate * (since - 0.5 * ramp)
            turned = np.where(left < ramp, angle - 0.5 * bend * left**2, turned)
            turned = np.where(since < ramp, 0.5 * bend * since**2, turned)
            moves = angle > 0.0
            share = np.where(moves, turned, since) / np.where(moves, angle, lengths[at])
            out[:] = starts[at] + lengths[at] * np.clip(share, 0.0, 1.0)
        return np.minimum(found, self.search.duration)
