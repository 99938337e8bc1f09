"""Turns of craft with search errors: each turns by its own clock and at its own rate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closeform.arrays import Floats
from closeform.search.leg import Group
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, body_axis

# signs of the body axes relative to those of A
OF_GROUP = {"A": np.array([1.0, 1.0, 1.0]), "B": np.array([1.0, -1.0, -1.0])}


@dataclass(frozen=True, eq=False)
class OwnTurns:
    """Turns of `search` as executed by craft (..., N) of these `groups`, with their `errors` (..., N)."""

    search: Search
    groups: tuple[Group, ...]
    errors: SearchErrors

    @cached_property
    def _angles(self) -> Floats:
        """Absolute angles of the turns (L,) [rad]."""
        return np.array([abs(leg.angle) for leg in self.search.legs])

    @cached_property
    def _rates(self) -> tuple[Floats, Floats]:
        """Largest rate of each turn (..., N, L) [rad/s], and the duration of its ramps [s]."""
        nominal = self._angles / [leg.end - leg.start for leg in self.search.legs]
        pace, gain = 1.0 + self.errors.slew_rate[..., None], self.errors.slew_acceleration[..., None]
        moving = np.where(self._angles > 0.0, self._angles, 1.0)
        rates = np.minimum(pace * nominal, np.sqrt(moving * gain))
        return rates, rates / gain

    @cached_property
    def begins(self) -> Floats:
        """Start of each turn, and end of the last (..., N, L + 1) [s]; a wait lasts as long for all craft."""
        rates, ramps = self._rates
        waits = np.array([leg.end - leg.start for leg in self.search.legs])
        moves = self._angles > 0.0
        lasts = np.where(moves, self._angles / np.where(moves, rates, 1.0) + ramps, waits)
        late = self.errors.start[..., None]
        return np.concatenate([late, late + np.cumsum(lasts, axis=-1)], axis=-1)

    def boresights(self, leg: int) -> Floats:
        """Return the boresight of each craft at the start of a leg (..., N, 3)."""
        return self._bodies(self.search.legs[leg].attitude)[..., 2]

    def _bodies(self, nominal: Floats) -> Floats:
        """Return the attitudes (..., N, 3, 3) from the nominal ones of group A, (3, 3) or (N, 3, 3)."""
        from scipy.spatial.transform import Rotation  # imported late: slow to import

        sides = np.stack([OF_GROUP[group] for group in self.groups])[:, None, :]
        turned = self.errors.pointing
        bodies = Rotation.from_rotvec(np.array(turned).reshape(-1, 3)).as_matrix().reshape(*turned.shape, 3)
        return np.asarray((nominal * sides) @ bodies)

    @cached_property
    def sun_angles(self) -> Floats:
        """Largest angle of each craft's body x from the sun line in any turn (..., N) [rad]."""
        shades = body_axis(self.errors.pointing, 0) * np.stack([OF_GROUP[group] for group in self.groups])
        return np.asarray(np.max([leg._sun_angle_of(shades) for leg in self.search.legs], axis=0))

    def attitudes(self, time: float) -> Floats:
        """Return attitudes (N, 3, 3) at a time [s] for errors of shape (N,); columns are the body axes."""
        return self._bodies(self.search.attitude(self.searched(np.array([time]))[:, 0]))

    def searched(self, times: Floats) -> Floats:
        """Return the search times (N, T) [s] that the craft have reached at `times`; errors are (N,)."""
        legs = self.search.legs
        starts = np.array([leg.start for leg in legs])
        lengths = np.array([leg.end - leg.start for leg in legs])
        found = np.empty((len(self.groups), len(times)))
        for out, begins, rates, ramps in zip(found, self.begins, *self._rates, strict=True):
            at = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(legs) - 1)
            inside = np.clip(times, begins[0], begins[-1])
            since, left = inside - begins[at], begins[at + 1] - inside
            angle, rate, ramp = self._angles[at], rates[at], ramps[at]
            bend = rate / np.where(ramp > 0.0, ramp, 1.0)
            turned = rate * (since - 0.5 * ramp)
            turned = np.where(left < ramp, angle - 0.5 * bend * left**2, turned)
            turned = np.where(since < ramp, 0.5 * bend * since**2, turned)
            moves = angle > 0.0
            share = np.where(moves, turned, since) / np.where(moves, angle, lengths[at])
            out[:] = starts[at] + lengths[at] * np.clip(share, 0.0, 1.0)
        return np.minimum(found, self.search.duration)
