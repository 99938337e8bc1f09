"""Sigma clearance: the minimum number of standard deviations at which errors bring two paths to a zone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import broadcast
from closeform.conflicts.two_paths import check_comparable, closest_approach, craft_of
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.uncertainty.covariance_propagation import propagate_errors
from closeform.uncertainty.errors import Uncertainty, beside_chief, one_for_each
from closeform.uncertainty.sigmas.beside_chief import least_of_all
from closeform.uncertainty.sigmas.levels import least_of_pairs
from closeform.uncertainty.sigmas.tube import tube_for
from closeform.zones.zone import Zone


@dataclass(frozen=True, eq=False, repr=False)
class SigmaApproach(Rows):
    """Sigma clearance of two craft, or of the pairs of two batches.

    Attributes
    ----------
    sigmas : float or array of shape (...), no unit
        The largest k such that no error of up to k sigmas results in a conflict; 0 if the paths themselves
        do, inf if no error can, or if they have no common time.
    time : float or array of shape (...) [s]
        Time at which k sigmas touch the zone; that of the paths' closest approach if k is 0, nan if k is inf.
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
    """Return the number of standard deviations that keep two craft clear of a zone over their time.

    Parameters
    ----------
    path : Path
        Path of one craft, or a batch.
    other : Path
        Path of the craft at the zone's centre, or a batch, in the same orbit; batch shapes broadcast.
    zone : Zone
        Zone of the pair.
    errors : Uncertainty, sequence of these, or None
        Uncertainty of `path`: one for all its craft or one for each, in order; None for exact craft. With
        `other_errors=None` it may be the relative uncertainty, from the start of `path` on.
    other_errors : Uncertainty, sequence of these, or None, default None
        Uncertainty of `other`, independent of `errors`.

    Returns
    -------
    SigmaApproach
        Floats for two craft, arrays for batches. No error within fewer sigmas results in a conflict at any
        instant; the number is the largest such to a relative 1e-9.

    Raises
    ------
    ValueError
        As `closest_approach`, and if errors have the wrong type or number, or concern the thrust of a sampled
        path.

    Notes
    -----
    k sigmas are all errors xi, of any kind, with |xi| <= k. In m dimensions a sample lies outside with the
    probability that chi squared of m exceeds k^2, which bounds the collision probability; that is usually far
    smaller. A result above 1e4 sigmas is inf.

    Covariances may be singular, for errors along a line or in a plane; these take about a millisecond per
    instant. A deviation across a line or a plane below 6e-8 of the size of the errors counts as zero. If k
    times the errors exceeds a million times the zone, rounding reduces the accuracy.

    References
    ----------
    docs/theory.md section 3, k sigmas.
    """
    check_comparable(path, other, zone)
    shape = broadcast(path=path.shape, other=other.shape)
    own = one_for_each("errors", errors, len(path.offsets) - 1)
    others = one_for_each("other_errors", other_errors, len(other.offsets) - 1)
    first, second = craft_of(path, shape), craft_of(other, shape)
    mean = closest_approach(path, other, zone)
    time, sigmas = np.array(mean.time).reshape(-1), np.zeros(len(first))
    apart = np.reshape(mean.ratio, -1) > 1.0
    apart &= np.isfinite(time)
    sigmas[~np.isfinite(time)] = np.inf
    if isinstance(path.orbit, ChiefOrbit):
        pair = beside_chief(path, own), beside_chief(other, others)
        found = least_of_all(path, other, first[apart], second[apart], zone, *pair)
    else:
        found = np.empty((int(apart.sum()), 2))
        both = propagate_errors(path, own), propagate_errors(other, others)
        tube = tube_for(zone, path.orbit.mean_motion)
        least_of_pairs(*both, first[apart], second[apart], tube, -1.0, found)
    time[apart], sigmas[apart] = found.T
    if not shape:
        return SigmaApproach(float(sigmas[0]), float(time[0]))
    return SigmaApproach(sigmas.reshape(shape), time.reshape(shape))
