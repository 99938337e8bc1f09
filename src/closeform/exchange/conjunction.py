"""Conjunction: what a message says of two objects that come close, at their closest approach."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from closeform.arrays import Floats, instance, number, numbers, positive, sequence, shown
from closeform.exchange.covariance import axes, canonical, check, inertial
from closeform.motion.mean_motion import EARTH_MU
from closeform.result import Result

if TYPE_CHECKING:
    from closeform.uncertainty.encounter import Encounter

# Of the axes of ITRF, about z [rad/s]: IERS Conventions 2010, 1.2.  Their pole stays within 0.6" of it.
EARTH_RATE = 7.292115e-5
INERTIAL = ("EME2000", "GCRF", "ICRF", "TOD", "MOD", "TEME")
UNIT_SLIP = 10.0  # between the miss distance that is told and that of the states


@dataclass(frozen=True, eq=False, repr=False)
class ConjunctionObject(Result):
    """One of the two objects of a conjunction, at its closest approach.

    Parameters
    ----------
    name, designator : str
        OBJECT_NAME and OBJECT_DESIGNATOR.
    frame : str
        REF_FRAME: an inertial one, or "ITRF", whose velocities are seen from the turning Earth.
    state : array of shape (6,) [m, m/s]
        In `frame`; anything array_like will do.
    covariance : array of shape (6, 6) [m^2, m^2/s, m^2/s^2]
        Along the object's own radial, along-track (transverse) and cross-track (normal) axes, of its
        inertial velocity; symmetric.  Anything array_like will do.
    radius : float [m], optional
        Of the object's own body.
    catalog, international_designator, ephemeris_name, covariance_method, manoeuvrable : str, optional
        CATALOG_NAME, INTERNATIONAL_DESIGNATOR, EPHEMERIS_NAME, COVARIANCE_METHOD and MANEUVERABLE.

    Raises
    ------
    ValueError
        If a word is no text, a shape does not fit, a value is not finite, the covariance is not symmetric, or
        the frame is unknown.

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
        """Whether the frame turns with the Earth."""
        return canonical(self.frame).startswith("ITRF")

    @property
    def inertial_state(self) -> Floats:
        """The state (6,) [m, m/s] with its inertial velocity, along the axes of `frame` at that instant."""
        if not self.turning:
            return self.state
        moved = np.cross([0.0, 0.0, EARTH_RATE], self.state[:3])
        return np.concatenate([self.state[:3], self.state[3:] + moved])

    @property
    def inertial_covariance(self) -> Floats:
        """The covariance (6, 6) [m^2, m^2/s, m^2/s^2] along the axes of `frame`, of the inertial state."""
        return inertial(self.covariance, "RTN", self.inertial_state)


@dataclass(frozen=True, eq=False, repr=False)
class Conjunction(Result):
    """Two objects at their closest approach, as a conjunction data message (CDM) tells it.

    Parameters
    ----------
    tca : str
        Time of closest approach, ISO, UTC.
    objects : tuple of ConjunctionObject, of two
        Whose operator is warned, then the other; in one frame.  Any sequence will do.
    miss_distance : float [m], optional
        As the message says; that of the states unless given.
    hard_body_radius : float [m], optional
        The sum of the radii of both bodies; unless given the sum of the objects' own, where these are.
    collision_probability : float, no unit, optional
        As the message says.
    collision_probability_method : str, optional
        By which method.
    originator, message_id, creation_date, message_for : str, optional
        Of the message.
    exclusion_radii : tuple of float [m], optional
        Of the volumes that the originator's screening excluded about each object, where a comment says them.

    Raises
    ------
    ValueError
        If there are not two objects, their frames differ, a number is out of its range, a word is no text,
        or `miss_distance` is ten times that of the states, or a tenth.

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
            raise ValueError(f"exclusion_radii: expected numbers of m, none negative, got {got}")
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
        told = self.miss_distance
        if told is None:
            object.__setattr__(self, "miss_distance", apart)
        elif not 0.0 <= number("miss_distance", told) < np.inf:
            raise ValueError(f"miss_distance: must not be negative, got {told:g} m")
        elif max(told, apart) > UNIT_SLIP * min(told, apart) + UNIT_SLIP:
            what = f"{told:g} m, but the states are {apart:g} m apart"
            raise ValueError(f"miss_distance: {what}; check their units, km and km/s in a message")
        radii = [each.radius for each in objects]
        if self.hard_body_radius is None and None not in radii:
            object.__setattr__(self, "hard_body_radius", sum(radius or 0.0 for radius in radii))
        elif (
            self.hard_body_radius is not None and not number("hard_body_radius", self.hard_body_radius) > 0.0
        ):
            raise ValueError(f"hard_body_radius: must be positive, got {self.hard_body_radius:g} m")
        chance = self.collision_probability
        if chance is not None and not 0.0 <= number("collision_probability", chance) <= 1.0:
            raise ValueError(f"collision_probability: must be from 0 to 1, got {chance:g}")

    @property
    def relative_state(self) -> Floats:
        """The second's state less the first's, (6,) [m, m/s], along the first's axes; velocities inertial.

        Radial, along-track and cross-track, as RELATIVE_POSITION_R ... RELATIVE_VELOCITY_N of a CDM.
        """
        first, second = (each.inertial_state for each in self.objects)
        turn = axes("RTN", first)
        return np.concatenate([turn @ (second - first)[:3], turn @ (second - first)[3:]])

    def encounter(self, half_window: float | None = None, mu: float = EARTH_MU) -> Encounter:
        """Paths and errors of both about their closest approach, in the Hill frame of the first.

        Parameters
        ----------
        half_window : float [s], optional
            As `Encounter.of` has it.
        mu : float [m^3/s^2], default that of the Earth
            Gravitational parameter of the body.

        Returns
        -------
        Encounter
            What `collision_probability` and `clearance_in_sigmas` take; `path` is the second's.

        Raises
        ------
        ValueError
            If a covariance is indefinite, naming the object and the least eigenvalue, or as `Encounter.of`.

        References
        ----------
        docs/uncertainty.md.
        """
        from closeform.uncertainty.encounter import Encounter  # with kernels, which reading can spare

        first, second = self.objects
        for each in self.objects:
            check(f"{each.name}: covariance", each.covariance)
        states = first.inertial_state, second.inertial_state
        return Encounter.of(*states, first.covariance, second.covariance, half_window=half_window, mu=mu)

    @property
    def relative_speed(self) -> float:
        """How fast they pass each other [m/s]."""
        return float(np.linalg.norm(self.relative_state[3:]))
