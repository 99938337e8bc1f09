"""How many sigmas are clear: the least there are between a zone and what errors make of two paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import broadcast
from closeform.conflicts.two_paths import check_comparable, closest_approach, craft_of
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.search import one_for_each
from closeform.uncertainty.sigma_levels import least_of_pairs
from closeform.uncertainty.spread import spread_of
from closeform.uncertainty.tube import tube_for
from closeform.zones.zone import Zone


@dataclass(frozen=True, eq=False, repr=False)
class SigmaApproach(Rows):
    """How many standard deviations keep two craft apart, or the pairs of two batches.

    Attributes
    ----------
    sigmas : float or array of shape (...), no unit
        The greatest k at which no error of up to k sigmas ever brings them together; 0 where the paths
        themselves do, inf where no error can, or they have no common time.
    time : float or array of shape (...) [s]
        When that k touches the zone; of the paths' closest approach where it is 0, nan where it is inf.
    """

    _columns: ClassVar = {
        "sigmas": "sigmas",
        "time": "time_s",
    }

    sigmas: Any
    time: Any


def clearance_in_sigmas(
    path: Path,
    other: Path,
    zone: Zone,
    errors: Uncertainty | Sequence[Uncertainty | None] | None,
    other_errors: Uncertainty | Sequence[Uncertainty | None] | None = None,
) -> SigmaApproach:
    """How many standard deviations of their errors keep two craft clear of a zone, over their common time.

    Parameters
    ----------
    path : Path
        Of one craft, or a batch.
    other : Path
        Of the craft that the zone is around, or a batch, in the same orbit; batch shapes broadcast.
    zone : Zone
        Of the pair.
    errors : Uncertainty, sequence of these, or None
        Of `path`: one for all its craft or one for each, in order; None for none.  Or, with
        `other_errors=None`, of the one relative to the other, from the start of `path` on.
    other_errors : Uncertainty, sequence of these, or None, default None
        Of `other`, independent.

    Returns
    -------
    SigmaApproach
        Floats for two craft, arrays for batches.  No error within fewer sigmas brings them together,
        between any two instants; they are the most such to 1e-9 of themselves.

    Raises
    ------
    ValueError
        As by `closest_approach`; if errors are of another kind or of another number of craft, or are of
        the thrust of a path through samples.

    Notes
    -----
    k sigmas are all errors xi, of whatever kind, with |xi| <= k.  In m dimensions a draw is outside with
    the probability that chi squared of m is above k^2, which bounds that of ever coming together; it is
    mostly far smaller.  From 1e4 sigmas on they count as inf.

    Covariances may be singular, errors along a line or in a plane: these come from planes that are compared
    one by one, each time in about a millisecond.  What 16 digits of a covariance cannot tell from nothing
    across a line or a plane, 6e-8 of its size, is nothing.  Where k times
    the errors is a million times the zone, 1e-16 of that is above 1e-10 of the zone, and rounding is seen.

    References
    ----------
    docs/theory.md section 3, k sigmas.
    """
    check_comparable(path, other, zone)
    shape = broadcast(path=path.shape, other=other.shape)
    one = spread_of(path, one_for_each("errors", errors, path, Uncertainty))
    two = spread_of(other, one_for_each("other_errors", other_errors, other, Uncertainty))
    first, second = craft_of(path, shape), craft_of(other, shape)
    mean = closest_approach(path, other, zone)
    time, sigmas = np.array(mean.time).reshape(-1), np.zeros(len(first))
    apart = np.reshape(mean.ratio, -1) > 1.0
    found = np.empty((int(apart.sum()), 2))
    least_of_pairs(one, two, first[apart], second[apart], tube_for(zone, path.orbit.mean_motion), -1.0, found)
    time[apart], sigmas[apart] = found.T
    if not shape:
        return SigmaApproach(float(sigmas[0]), float(time[0]))
    return SigmaApproach(sigmas.reshape(shape), time.reshape(shape))
