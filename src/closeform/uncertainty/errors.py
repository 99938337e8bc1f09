"""Uncertainty of a craft: state covariance, execution errors and process noise."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, number, numbers, shown, size
from closeform.conflicts.two_paths import Conflict
from closeform.motion.arc import THRUST
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path, of_one_craft
from closeform.uncertainty.covariance import axes_of, into_frame, root_of, roots_of
from closeform.uncertainty.covariance_propagation import covariances, propagate_errors
from closeform.uncertainty.error_columns import columns_of
from closeform.uncertainty.sigmas.beside_chief import conflicts_of_all
from closeform.uncertainty.sigmas.conflicts import search_of, sigma_conflicts
from closeform.zones.zone import Zone

# sigma_v / (n sigma_r), for a warning of mixed units. It is usually about one, near a hundred for poor
# velocities, and a thousand times more for mixed units. Above the second number the positions are nearly
# exact, which is not a sign of mixed units. Nor is a nearly singular covariance, with such a share of its
# largest sigma, or of the correlations' largest eigenvalue, left along some axis.
MIXED, EXACT, SINGULAR = 1e3, 1e5, 1e-3


@dataclass(frozen=True, eq=False, init=False)
class Uncertainty:
    """State covariance and execution errors of one craft, normally distributed.

    Errors of different kinds, of different burns and of different craft are independent. The state covariance
    holds at the path's start, before an impulse there. A burn is an interval of thrust without a pause.

    Parameters
    ----------
    state : array_like of shape (6, 6) [m^2, m^2/s, m^2/s^2], optional
        Covariance of position and velocity at the path's start, in the path's rotating frame: symmetric,
        no eigenvalue below 0 (it may be singular). Default: an exact state.
    magnitude : float, no unit, default 0
        Relative standard deviation of each burn's thrust, constant over the burn.
    pointing : float [rad], default 0
        Standard deviation of the pointing errors of each burn's thrust about x, y and z, constant over the
        burn in the rotating frame.
    impulse : array_like of shape (4,) [m/s, no unit, m/s, rad], default zeros
        Gates' s1 to s4: standard deviations of each impulse, sqrt(s1^2 + s2^2 |v|^2) along it and
        sqrt(s3^2 + s4^2 |v|^2) on either of two axes across it.
    noise : float [m^2/s^3], default 0
        Spectral density of white acceleration noise on each axis. In deep space the variance of velocity
        grows as `noise` t.

    Raises
    ------
    ValueError
        If `state` is not symmetric or has an eigenvalue below 0 (by more than 1e-9, scaled by its diagonal),
        if another number is negative, or if shapes do not match or a number is not finite.

    Notes
    -----
    A velocity covariance out of proportion to the position covariance, as with km and m/s, gives a warning
    when it is used.

    References
    ----------
    docs/theory.md section 3, errors; Gates 1963, JPL TR 32-504.
    """

    state: Floats
    magnitude: float
    pointing: float
    impulse: tuple[float, ...]
    noise: float
    _root: Floats = field(repr=False)

    def __init__(
        self,
        state: ArrayLike | None = None,
        magnitude: float = 0.0,
        pointing: float = 0.0,
        impulse: ArrayLike = (0.0, 0.0, 0.0, 0.0),
        noise: float = 0.0,
    ) -> None:
        held = np.zeros((6, 6)) if state is None else numbers("state", state).copy()
        self.__dict__.update(
            state=held,
            _root=root_of("state", held),
            magnitude=float(_at_least_zero("magnitude", magnitude, ())),
            pointing=float(_at_least_zero("pointing", pointing, ())),
            impulse=tuple(_at_least_zero("impulse", impulse, (4,)).tolist()),
            noise=float(_at_least_zero("noise", noise, ())),
        )

    @classmethod
    def from_rtn(
        cls,
        covariance: ArrayLike,
        path: Path,
        time: float,
        chief: ArrayLike,
        craft: ArrayLike | None = None,
        **execution: Any,
    ) -> Self:
        """Create an uncertainty from a covariance at one time in radial, transverse and normal axes.

        Parameters
        ----------
        covariance : array_like of shape (6, 6) [m^2, m^2/s, m^2/s^2]
            Covariance of the inertial position and velocity, both along the axes of `craft`, as in a CDM.
        path : Path
            Path of the craft, at whose start the uncertainty is to hold.
        time : float [s]
            Time of the covariance on the path's clock: a closest approach or an epoch; also before the start.
        chief : array_like of shape (6,) [m, m/s]
            Inertial state, at that time, of the chief in whose frame the path is.
        craft : array_like of shape (6,) [m, m/s], optional
            Inertial state, at that time, of the object that defines the axes. Default: the chief.
        execution : keyword arguments
            `magnitude`, `pointing`, `impulse` and `noise` of `Uncertainty`.

        Returns
        -------
        Uncertainty
            In the path's rotating frame, at its start.

        Raises
        ------
        ValueError
            As `Uncertainty`, or if a state spans no orbital plane,
            the path is a batch or the time not finite.

        Notes
        -----
        The frame rotates, so that its velocities differ by rotation rate x position. From `time` to the start
        the covariance is propagated by natural motion in the path's orbit, without noise.

        References
        ----------
        docs/theory.md section 3, errors; CCSDS 508.0-B-1.
        """
        centre = one_state("chief", chief)
        axes = axes_of(centre if craft is None else one_state("craft", craft))
        return cls._from(covariance, np.kron(np.eye(2), axes.T), path, time, centre, execution)

    @classmethod
    def from_inertial(
        cls, covariance: ArrayLike, path: Path, time: float, chief: ArrayLike, **execution: Any
    ) -> Self:
        """Create an uncertainty from a covariance at one time in inertial axes.

        Parameters
        ----------
        covariance : array_like of shape (6, 6) [m^2, m^2/s, m^2/s^2]
            Covariance of position and velocity in the inertial frame of `chief`.
        path : Path
            Path of the craft, at whose start the uncertainty is to hold.
        time : float [s]
            Time of the covariance on the path's clock; also before the start.
        chief : array_like of shape (6,) [m, m/s]
            Inertial state, at that time, of the chief in whose frame the path is.
        execution : keyword arguments
            `magnitude`, `pointing`, `impulse` and `noise` of `Uncertainty`.

        Returns
        -------
        Uncertainty
            Uncertainty in the path's rotating frame, at its start, as by `from_rtn`.

        Raises
        ------
        ValueError
            As `Uncertainty`, or if `chief` spans no orbital plane,
            the path is a batch or the time not finite.

        References
        ----------
        docs/theory.md section 3, errors.
        """
        return cls._from(covariance, np.eye(6), path, time, one_state("chief", chief), execution)

    @classmethod
    def _from(
        cls, covariance: ArrayLike, turned: Any, path: Path, time: float, chief: Floats, execution: Any
    ) -> Self:
        """Create an uncertainty from a covariance in axes given by a matrix."""
        when = number("time", time)
        if not np.isfinite(when):
            raise ValueError(f"time: must be finite, got {when:g} s")
        (back,) = of_one_craft(path).orbit._flow(np.array([[when, path.start]]))
        root: Any = back @ into_frame(chief) @ turned @ root_of("covariance", covariance)
        return cls(None, **execution)._with_root(root)

    def _with_root(self, root: Floats) -> Self:
        """Return the same execution errors with another state covariance, by a root (6, m), m up to 6."""
        made = self._of_burns
        square = np.zeros((6, 6))
        square[:, : root.shape[1]] = root
        made.__dict__.update(state=root @ root.T, _root=square)  # the product would lose digits
        return made

    def covariance(self, path: Path, time: ArrayLike) -> Floats:
        """Return the covariance of a craft's state along its path, exactly.

        Parameters
        ----------
        path : Path
            Path of one craft.
        time : array_like of shape (...) [s]
            Times on the path; at an impulse the covariance is the one after it.

        Returns
        -------
        array of shape (..., 6, 6) [m^2, m^2/s, m^2/s^2]
            Covariance of position and velocity, in the path's rotating frame.

        Raises
        ------
        ValueError
            If the path is a batch, a sampled path has thrust errors, or a time is not on it.

        References
        ----------
        docs/theory.md section 3, errors.
        """
        times = numbers("time", time)
        of_one_craft(path).state(times)  # raises an error for invalid times
        if isinstance(path.orbit, ChiefOrbit):
            root = self._roots(path, times.reshape(-1))
            return np.asarray((root @ np.swapaxes(root, 1, 2)).reshape(*times.shape, 6, 6))
        propagated = propagate_errors(path, [self])
        out = np.empty((times.size, 6, 6))
        flat = np.ascontiguousarray(times.reshape(-1))
        covariances(path.arcs, path.orbit.mean_motion, propagated.rows, propagated.execution, flat, out)
        return out.reshape(*times.shape, 6, 6)

    def _roots(self, path: Path, times: Floats) -> Floats:
        """Return roots (T, 6, K) of the covariances about a chief, of one column for each error."""
        roots = columns_of(path, self)._evaluate_rows(times[None]).transpose(1, 2, 0)
        if not self.noise:
            return roots
        added = self.noise * path.orbit._noise(path.start, times)  # type: ignore[attr-defined]
        return np.concatenate([roots, roots_of(added)], axis=2)

    @staticmethod
    def _find_conflicts(
        path: Path, other: Path, zone: Zone, errors: Any, other_errors: Any, sigmas: Any
    ) -> tuple[Conflict, ...]:
        """Return the conflicts of two craft with errors, for `find_conflicts`."""
        first = np.zeros(1, dtype=np.int64)
        if isinstance(path.orbit, ChiefOrbit):
            pair = beside_chief(path, [errors]), beside_chief(other, [other_errors])
            _, rows = conflicts_of_all(path, other, first, first, zone, *pair, size("sigmas", sigmas))
            return tuple(Conflict(*map(float, row)) for row in rows)
        one, two = propagate_errors(path, [errors]), propagate_errors(other, [other_errors])
        found = sigma_conflicts(one, two, first, first, zone, path.orbit.mean_motion, size("sigmas", sigmas))
        return tuple(Conflict(*map(float, row[1:])) for row in found)

    @staticmethod
    def _search_of(paths: Path, errors: Any, zones: Sequence[Zone], sigmas: Any) -> Any:
        """Return the search of pairs with errors, for `screen`."""
        known = one_for_each("errors", errors, len(paths.offsets) - 1)
        if isinstance(paths.orbit, ChiefOrbit):
            each, k = beside_chief(paths, known), size("sigmas", sigmas)
            return lambda zone, first, second: conflicts_of_all(
                paths, paths, first, second, zone, each, each, k
            )
        propagated = propagate_errors(paths, known)
        return search_of(propagated, zones, paths.orbit.mean_motion, size("sigmas", sigmas))

    @property
    def _of_burns(self) -> Self:
        """Execution errors alone, with an exact state."""
        return type(self)(None, self.magnitude, self.pointing, self.impulse, self.noise)

    @property
    def _of_orders(self) -> Self:
        """Execution errors of short burns, by Gates' model."""
        return type(self)(None, impulse=(0.0, self.magnitude, 0.0, self.pointing))

    @cached_property
    def _execution(self) -> Floats:
        """Errors other than the state's, for kernels: magnitude, pointing, s1 to s4, noise (7,)."""
        return np.array([self.magnitude, self.pointing, *self.impulse, self.noise])

    def _check_for(self, path: Path) -> None:
        """Raise ValueError for thrust errors on a sampled path, and warn of mixed units."""
        n = 2.0 * np.pi / path.orbit.period
        if (self.magnitude or self.pointing or any(self.impulse)) and np.any(path.cubic_share):
            raise ValueError(
                "errors: execution errors require a path with known thrust, not a sampled path; give "
                "`state` and `noise` only"
            )
        if self.pointing and isinstance(path.orbit, ChiefOrbit) and path.arcs[:, THRUST:].any():
            raise ValueError(
                "errors: pointing errors of burns are supported about a circular orbit only, not about "
                f"{path.orbit.chief}; leave `pointing` out, or plan impulses and give `impulse`"
            )
        place, speed = (float(np.sqrt(np.trace(self.state[k : k + 3, k : k + 3]))) for k in (0, 3))
        if MIXED * n * place < speed < EXACT * n * place and not _nearly_singular(self.state):
            warnings.warn(
                f"errors: standard deviations of {speed:g} m/s and {place:g} m; are units mixed, "
                "km with m/s?",
                stacklevel=4,
            )


def _nearly_singular(state: Floats) -> bool:
    """Return True if a covariance (6, 6) leaves hardly any error along some axis."""
    sigmas = np.sqrt(np.diag(state))
    if not (sigmas > 0.0).all():
        return True
    parts = state / np.outer(sigmas, sigmas), state[:3, :3], state[3:, 3:]
    values = [np.linalg.eigvalsh(part) for part in parts]
    return any(bool(own[0] <= SINGULAR**2 * own[-1]) for own in values)


def _at_least_zero(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return a non-negative argument of a given shape."""
    given = finite(name, value)
    if given.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {given.shape}")
    if not (given >= 0.0).all():
        raise ValueError(
            f"{name}: standard deviations and densities must be at least 0, got {given.tolist()}"
        )
    return given


def one_state(name: str, value: ArrayLike) -> Floats:
    """Return an argument as the state (6,) of one craft."""
    state = finite(name, value, 6)
    if state.shape != (6,):
        raise ValueError(f"{name}: expected one state of shape (6,), got {state.shape}")
    return state


def beside_chief(path: Path, errors: list[Uncertainty | None]) -> list[Uncertainty | None]:
    """Return errors that a search of k sigmas about a chief can take; raise ValueError for noise."""
    for one in errors:
        if one is not None and one.noise:
            raise ValueError(
                "errors: process noise within k sigmas is supported about a circular orbit only, not about "
                f"{path.orbit.chief}; leave `noise` out, or use "  # type: ignore[attr-defined]
                'collision_probability with method="bound"'
            )
    return errors


def one_for_each(name: str, errors: Any, count: int) -> list[Uncertainty | None]:
    """Return the uncertainties of `count` craft, given one for all or one for each; None if exact."""
    given = list(errors) if isinstance(errors, list | tuple) else [errors] * count
    for one in given:
        if not (one is None or isinstance(one, Uncertainty)):
            raise ValueError(f"{name}: expected Uncertainty, got {shown(one)}")
    if len(given) != count:
        raise ValueError(f"{name}: {len(given)} for {count} craft; give one, or one for each")
    return given
