"""Conjunction of two objects at their closest approach, as in a message."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats, instance, number, numbers, positive, sequence, shown
from closeform.exchange.ephemerides.covariance import axes, canonical, check, inertial
from closeform.motion.elements.mean_motion import EARTH_MU
from closeform.result import Result

if TYPE_CHECKING:
    from closeform.uncertainty.encounter import Encounter

# Rotation rate of the axes of ITRF about z [rad/s]: IERS Conventions 2010, 1.2. Their pole stays within 0.6".
EARTH_RATE = 7.292115e-5
INERTIAL = ("EME2000", "GCRF", "ICRF", "TOD", "MOD", "TEME")
UNIT_SLIP = 10.0  # ratio of the miss distances of message and states that indicates wrong units


@dataclass(frozen=True, eq=False, repr=False)
class ConjunctionObject(Result):
    """One of the two objects of a conjunction, at its closest approach.

    Parameters
    ----------
    name, designator : str
        Values of OBJECT_NAME and OBJECT_DESIGNATOR.
    frame : str
        REF_FRAME: an inertial one, or "ITRF", whose velocities are relative to the rotating Earth.
    state : array of shape (6,) [m, m/s]
        State in `frame`; array_like.
    covariance : array of shape (6, 6) [m^2, m^2/s, m^2/s^2]
        Covariance along the object's own radial, along-track (transverse) and cross-track (normal) axes, of
        its inertial velocity; symmetric, array_like.
    radius : float [m], optional
        Radius of the object's own body.
    catalog, international_designator, ephemeris_name, covariance_method, manoeuvrable : str, optional
        Values of CATALOG_NAME, INTERNATIONAL_DESIGNATOR, EPHEMERIS_NAME, COVARIANCE_METHOD and MANEUVERABLE.

    Raises
    ------
    ValueError
        If a text is of another type, a shape does not fit, a value is not finite, the covariance is
        not symmetric, or the frame is unknown.

    References
    ----------
    CCSDS 508.0-B, Conjunction Data Message, 3.4, 3.5 and annex E; docs/ephemerides.md.
    """

    name: str
    designator: str
    frame: str
    state: Floats
    covariance: Floats
    radius: float | None = None
    catalog: str = "SATCAT"
    international_designator: str = "UNKNOWN"
    ephemeris_name: str = "NONE"
    covariance_method: str = "CALCULATED"
    manoeuvrable: str = "N/A"

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.type == "str":
                instance(field.name, getattr(self, field.name), str)
        for name, shape in (("state", (6,)), ("covariance", (6, 6))):
            value = numbers(name, getattr(self, name))
            if value.shape != shape or not np.isfinite(value).all():
                raise ValueError(f"{name}: expected {shape} finite numbers, got {value.shape}")
            object.__setattr__(self, name, value)
        if not np.allclose(self.covariance, self.covariance.T, rtol=1e-9, atol=0.0):
            raise ValueError("covariance: not symmetric; give the same values above and below the diagonal")
        if self.radius is not None:
            positive("radius", self.radius, " m")
        if canonical(self.frame) not in INERTIAL and not self.turning:
            known = ", ".join((*INERTIAL, "ITRF"))
            raise ValueError(f"frame: {self.frame} is unknown; convert the states to one of {known}")

    @property
    def turning(self) -> bool:
        """True if the frame rotates with the Earth."""
        return canonical(self.frame).startswith("ITRF")

    @property
    def inertial_state(self) -> Floats:
        """State (6,) [m, m/s] with its inertial velocity, along the axes of `frame` at that instant."""
        if not self.turning:
            return self.state
        moved = np.cross([0.0, 0.0, EARTH_RATE], self.state[:3])
        return np.concatenate([self.state[:3], self.state[3:] + moved])

    @property
    def inertial_covariance(self) -> Floats:
        """Covariance (6, 6) [m^2, m^2/s, m^2/s^2] of the inertial state, along the axes of `frame`."""
        return inertial(self.covariance, "RTN", self.inertial_state)


@dataclass(frozen=True, eq=False, repr=False)
class Conjunction(Result):
    """Two objects at their closest approach, as in a conjunction data message (CDM).

    Parameters
    ----------
    tca : str
        Time of closest approach, ISO, UTC.
    objects : tuple of ConjunctionObject, of two
        The object whose operator is warned, then the other, in one frame; any sequence.
    miss_distance : float [m], optional
        Miss distance in the message; by default that of the states.
    hard_body_radius : float [m], optional
        Sum of the radii of both bodies; by default the sum of the objects' own, if known.
    collision_probability : float, no unit, optional
        Collision probability in the message.
    collision_probability_method : str, optional
        Method of the collision probability.
    originator, message_id, creation_date, message_for : str, optional
        Identification of the message.
    exclusion_radii : tuple of float [m], optional
        Radii of the volumes that the originator's screening excluded about each object, if a comment
        gives them.

    Raises
    ------
    ValueError
        If there are not two objects, their frames differ, a number is out of its range, a text is of another
        type, or `miss_distance` is more than ten times that of the states, or less than a tenth.

    References
    ----------
    CCSDS 508.0-B, Conjunction Data Message; docs/ephemerides.md.
    """

    tca: str
    objects: tuple[ConjunctionObject, ConjunctionObject]
    miss_distance: float | None = None
    hard_body_radius: float | None = None
    collision_probability: float | None = None
    collision_probability_method: str | None = None
    originator: str = "CLOSEFORM"
    message_id: str = "1"
    creation_date: str = ""
    message_for: str | None = None
    exclusion_radii: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.type in ("str", "str | None"):
                optional = (type(None),) if field.type == "str | None" else ()
                instance(field.name, getattr(self, field.name), str, *optional)
        radii_told = numbers("exclusion_radii", self.exclusion_radii)
        if radii_told.ndim != 1 or not ((radii_told >= 0.0) & (radii_told < np.inf)).all():
            got = shown(self.exclusion_radii)
            raise ValueError(f"exclusion_radii: expected lengths in m, at least 0, got {got}")
        object.__setattr__(self, "exclusion_radii", tuple(radii_told.tolist()))
        objects = tuple(sequence("objects", self.objects, ConjunctionObject))
        if len(objects) != 2:
            raise ValueError(f"objects: expected two, got {len(objects)}")
        first, second = objects
        object.__setattr__(self, "objects", objects)
        if canonical(first.frame) != canonical(second.frame):
            both = f"{first.frame} and {second.frame}"
            raise ValueError(f"objects: are in different frames, {both}; convert the states of one")
        apart = float(np.linalg.norm(second.state[:3] - first.state[:3]))
        stated = self.miss_distance
        if stated is None:
            object.__setattr__(self, "miss_distance", apart)
        elif not 0.0 <= number("miss_distance", stated) < np.inf:
            raise ValueError(f"miss_distance: must not be negative, got {stated:g} m")
        elif max(stated, apart) > UNIT_SLIP * min(stated, apart) + UNIT_SLIP:
            what = f"{stated:g} m, but the states are {apart:g} m apart"
            raise ValueError(f"miss_distance: {what}; check their units, km and km/s in a message")
        radii = [each.radius for each in objects]
        if self.hard_body_radius is None and None not in radii:
            object.__setattr__(self, "hard_body_radius", sum(radius or 0.0 for radius in radii))
        elif (
            self.hard_body_radius is not None
            and not 0.0 < number("hard_body_radius", self.hard_body_radius) < np.inf
        ):
            raise ValueError(
                f"hard_body_radius: must be positive and finite, got {self.hard_body_radius:g} m"
            )
        chance = self.collision_probability
        if chance is not None and not 0.0 <= number("collision_probability", chance) <= 1.0:
            raise ValueError(f"collision_probability: must be from 0 to 1, got {chance:g}")

    @property
    def relative_state(self) -> Floats:
        """State of the second relative to the first, (6,) [m, m/s], along the first's axes.

        Velocities are inertial. The axes are radial, along-track and cross-track, as RELATIVE_POSITION_R ...
        RELATIVE_VELOCITY_N of a CDM.
        """
        first, second = (each.inertial_state for each in self.objects)
        turn = axes("RTN", first)
        return np.concatenate([turn @ (second - first)[:3], turn @ (second - first)[3:]])

    def encounter(self, half_window: float | None = None, mu: float = EARTH_MU) -> Encounter:
        """Return paths and errors of both about their closest approach, in the frame of the first.

        Parameters
        ----------
        half_window : float [s], optional
            Half of the time window, as in `Encounter.of`.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        Encounter
            Input of `collision_probability` and `clearance_in_sigmas`; `path` is the second's.

        Raises
        ------
        ValueError
            If a covariance is indefinite (the message gives its smallest eigenvalue), or as `Encounter.of`.

        References
        ----------
        docs/uncertainty.md.
        """
        from closeform.uncertainty.encounter import Encounter  # imported here: reading needs no kernels

        first, second = self.objects
        for each in self.objects:
            check(f"{each.name}: covariance", each.covariance)
        states = first.inertial_state, second.inertial_state
        return Encounter.of(*states, first.covariance, second.covariance, half_window=half_window, mu=mu)

    @property
    def relative_speed(self) -> float:
        """Relative speed at the closest approach [m/s]."""
        return float(np.linalg.norm(self.relative_state[3:]))
