"""A spacecraft's own zone (region, covariance or body), and the combination of two for a pair."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, shown
from closeform.zones.containment import containing_zone
from closeform.zones.minkowski_sums import outer_sum
from closeform.zones.solids import Ellipsoid
from closeform.zones.zone import Zone

REGION, COVARIANCE, BODY = "keep-out region", "covariance", "body"


@dataclass(frozen=True, eq=False, init=False)
class CovarianceZone:
    """Normally distributed position of a spacecraft about its path.

    Errors of two spacecraft are taken as independent: their covariances add, and the zone of the pair is
    the ellipsoid of the same number of standard deviations of the sum.

    Parameters
    ----------
    covariance : array_like of shape (3, 3) [m^2]
        Position covariance in the path's frame; symmetric and positive definite.
    sigmas : float, no unit
        Number of standard deviations to keep clear; the same for all spacecraft.

    Raises
    ------
    ValueError
        If `covariance` is not symmetric, finite and positive definite, or `sigmas` is not positive
        and finite.

    References
    ----------
    docs/theory.md section 3, zones of pairs.
    """

    covariance: Floats
    sigmas: float

    def __init__(self, covariance: ArrayLike, sigmas: float) -> None:
        Ellipsoid.from_covariance(covariance, sigmas)
        object.__setattr__(self, "covariance", np.array(covariance, dtype=float))
        object.__setattr__(self, "sigmas", float(sigmas))

    @property
    def zone(self) -> Ellipsoid:
        """Ellipsoid of this spacecraft alone, with lengths in m."""
        return Ellipsoid.from_covariance(self.covariance, self.sigmas)


@dataclass(frozen=True, eq=False)
class Body:
    """Solid that a spacecraft occupies, about its path and fixed in the path's frame.

    Two bodies must not touch: the zone of the pair contains the Minkowski sum of both.

    Parameters
    ----------
    zone : Zone
        A set that contains the body, such as `Sphere(2.0)`.

    Raises
    ------
    ValueError
        If `zone` is not a zone.

    References
    ----------
    docs/theory.md section 3, zones of pairs; Schweppe 1973.
    """

    zone: Zone

    def __post_init__(self) -> None:
        if not isinstance(self.zone, Zone):
            raise ValueError(f"zone: expected a zone, for example Sphere(2.0), got {shown(self.zone)}")


OwnZone = Zone | CovarianceZone | Body


def enlarged(own: OwnZone, factor: float) -> OwnZone:
    """Return the own zone scaled by `factor`; zones of pairs made of such zones scale alike."""
    if isinstance(own, CovarianceZone):
        return CovarianceZone(own.covariance, factor * own.sigmas)
    if isinstance(own, Body):
        return Body(own.zone.enlarged(factor))
    return own.enlarged(factor)


def key(own: OwnZone) -> tuple[Any, ...]:
    """Return a hashable key that is equal for own zones of the same kind and numbers."""
    if isinstance(own, CovarianceZone):
        return own.covariance.tobytes(), own.sigmas
    if isinstance(own, Body):
        return "body", *key(own.zone)
    return own.shape, own.matrix.tobytes(), own.faces.tobytes()


def pair_zone(around: OwnZone | None, seen: OwnZone | None) -> tuple[Zone, str]:
    """Return the zone `around` one spacecraft and how it was made; `seen` is the other's own zone.

    Of two regions, the one that contains the other applies. Covariances add. All other combinations add as
    sets: two bodies, a region and a body, or one of them and a covariance ellipsoid. If one own zone is None,
    the other one applies.

    Raises ValueError, without names, for two regions of which neither contains the other, for covariances of
    different sigmas, and for an unbounded sum.
    """
    own = [one for one in (seen, around) if one is not None]
    kinds = sorted({_kind(one) for one in own})
    if kinds == [COVARIANCE]:
        return _of_covariances([one for one in own if isinstance(one, CovarianceZone)])
    sets = [_set(around)] if around is not None else []
    sets += [_set(seen).mirrored] if seen is not None else []
    if len(own) == 1:
        return sets[0], REGION if kinds == [REGION] else f"{BODY} of one"
    if kinds == [REGION]:
        zone = containing_zone(*sets)
        if zone is None:
            raise ValueError("neither zone contains the other; give both a zone that contains both")
        return zone, REGION
    both = " and ".join(kinds) if len(kinds) > 1 else "bodies"
    sigmas = "".join(f", {one.sigmas:g} sigma" for one in own if isinstance(one, CovarianceZone))
    return outer_sum(*sets), f"{both} added{sigmas}"


def _of_covariances(own: list[CovarianceZone]) -> tuple[Zone, str]:
    """Return the ellipsoid of the sum of one or two covariances."""
    if len({one.sigmas for one in own}) > 1:
        demanded = " and ".join(f"{one.sigmas:g}" for one in own)
        raise ValueError(f"covariances of {demanded} sigmas; give both the same number")
    total = np.sum([one.covariance for one in own], axis=0)
    made = "covariances added" if len(own) > 1 else f"{COVARIANCE} of one"
    return Ellipsoid.from_covariance(total, own[0].sigmas), f"{made}, {own[0].sigmas:g} sigma"


def _kind(own: OwnZone) -> str:
    if isinstance(own, CovarianceZone):
        return COVARIANCE
    return BODY if isinstance(own, Body) else REGION


def _set(own: OwnZone) -> Zone:
    """Return the set of relative positions of an own zone."""
    return own if isinstance(own, Zone) else own.zone
