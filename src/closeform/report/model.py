"""Limits of the model: the model error of Hill's equations, and which figures are certified or estimated."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.mission.mission_result import Mission, StageResult
from closeform.motion.mean_motion import EARTH_MU, semi_major_axis_from_mean_motion
from closeform.report.section import Section, plan_of
from closeform.report.table import Column, Table

# Upper bounds; the median and 95 % errors at the end of a plan follow another rule: theory (84).
# For a craft ahead on the same circle, along a straight axis, the model error in one orbit is 6 pi d^2 / a.
# The others are measured: docs/validity.md (a chief of e = 0.001) and docs/ephemerides.md (GRACE-A and B).
CURVATURE, ECCENTRICITY, FLATTENING = 6.0 * pi, 25.0, (0.012, 0.027)
EXAMPLE = 0.001  # eccentricity used as an example if it is unknown
TENTH = 0.1  # of the smallest zone: a deviation that is no longer negligible
LOOKS = 201  # instants per flight at which the distance from the origin is sampled
DEVIATIONS = (
    Column("what the model leaves out", "cause", words=True),
    Column("rule, for one orbit", "rule", words=True),
    Column("here [m]", "deviation_m", "{:.3g}".format),
    Column("a tenth of the smallest zone from", "limit", words=True),
)
SURE = Column("figure", "figure", words=True), Column("how sure it is", "words", words=True)
LOCKS = (
    "Who finds whom",
    "certified for the attitudes and clocks as given, ideal where no errors are: no lock is missed, however "
    "short",
)


@dataclass(frozen=True)
class Circle:
    """Circular reference orbit: mean motion [rad/s], `mu` [m^3/s^2], and the true eccentricity if known."""

    mean_motion: float
    mu: float = EARTH_MU
    eccentricity: float | None = None


@dataclass(frozen=True)
class Reach:
    """Largest distance [m] from the frame's origin in some flights, with its `craft` and time [s].

    `smallest`: the smallest extent of all zones [m], None if there is none.
    """

    craft: str
    distance: float
    time: float
    smallest: float | None

    @classmethod
    def of(cls, flights: list[WatchedFlight]) -> "Reach":
        """Return the reach of consecutive flights, from LOOKS instants of each."""
        found: list[tuple[float, float, str]] = []
        for flight in flights:
            times = np.linspace(float(np.max(flight.paths.start)), float(np.min(flight.paths.end)), LOOKS)
            far: Floats = np.linalg.norm(flight.paths.position(times), axis=-1)
            craft, when = np.unravel_index(int(np.argmax(far)), far.shape)
            found.append((float(far[craft, when]), float(times[when]), flight.names[int(craft)]))
        distance, time, name = max(found)
        zones = {near.zone for flight in flights for near in flight.approaches}
        reaches = [float(np.min(zone.extents)) for zone in zones if np.isfinite(zone.extents).all()]
        return cls(name, distance, time, min(reaches, default=None))


def section(mission: Mission) -> Section:
    """Return the section on the limits of a mission's figures."""
    flown = [result for result in mission.results if result.flown]
    sure = certain([*certainties(flown)])
    if not flown:
        return Section("Limits of the model", tables=(sure,))
    reach = Reach.of([result.after for result in flown])
    n, mu, chief = mission.orbit.mean_motion, mission.scenario.orbit.mu, mission.scenario.chief
    orbit = Circle(n, mu or EARTH_MU) if chief is None else Circle(n, chief.mu, chief.eccentricity)
    (exact, far), tables = beyond(reach, orbit, flown[-1].end)
    lines = exact, *beside(mission, flown), far
    return Section("Limits of the model", lines, (*tables, sure))


def beside(mission: Mission, flown: list[StageResult[Any, Any]]) -> Iterator[str]:
    """Yield the line on inexact results: predicted in a field, uncertain, or simulated."""
    told = []
    if some := [one.number for one in flown if one.validity is not None]:
        field = next(one.validity.field for one in flown if one.validity is not None)
        told.append(f"what is predicted in the field of {field} ({numbered(some)})")
    if some := [one.number for one in flown if one.uncertain is not None]:
        told.append(f"sigmas and probabilities, of errors as given ({numbered(some)})")
    if some := [one.number for one in flown if one.commanded is not None]:
        told.append(f"paths with the errors that this case has drawn ({numbered(some)})")
    if mission.flights is not None:
        told.append("flights in the field, integrated with errors as drawn")
    if told:
        yield f"Not so: {'; '.join(told)}. How sure these are stands below."


def numbered(stages: list[int]) -> str:
    """Return stage numbers in words."""
    return f"stage{'s' * (len(stages) != 1)} {', '.join(map(str, stages))}"


def certain(rows: list[tuple[str, str]]) -> Table:
    """Return the table of the certainty of each figure."""
    return Table("What is certified, and what is estimated", SURE, rows)


def beyond(reach: Reach, orbit: Circle, duration: float) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Return lines and tables on the model error at a given reach, in a flight of a duration [s]."""
    far = (
        f"{reach.craft} is farthest out: {reach.distance:.1f} m from the frame's origin at {reach.time:.1f} s"
    )
    if not orbit.mean_motion:
        off = 0.5e-9 * duration**2
        return (
            "Paths, conflicts and plans are exact for craft on which nothing acts but their own thrust, and "
            "whose states at the start are as given.",
            f"Sunlight and leaks are not in it: two craft that differ by 1 nm/s² are {off:.3g} m off after "
            f"{duration:.1f} s, and four times as much after twice the time. {far}.",
        ), ()
    orbits = duration * orbit.mean_motion / (2.0 * pi)
    lines = (
        "Paths, conflicts and plans are exact for Hill's equations: a circular orbit, a point mass, small "
        "separations, no force but the craft's own thrust, states at the start as given.",
        f"{far}. Real motion leaves the model by what stands below, in each of the {orbits:.3g} orbits "
        "flown: zones are to be larger by as much as is expected until states are measured again.",
    )
    title = "How far off the model may be within one orbit, cause by cause, at most"
    return lines, (Table(title, DEVIATIONS, [*deviations(reach, orbit)]),)


def deviations(reach: Reach, orbit: Circle) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of DEVIATIONS on an orbit."""
    radius = float(semi_major_axis_from_mean_motion(orbit.mean_motion, orbit.mu))
    far, least = reach.distance, None if reach.smallest is None else TENTH * reach.smallest
    bend = CURVATURE * far**2 / radius
    limit = None if least is None else f"{sqrt(least * radius / CURVATURE):.3g} m from the origin"
    yield "the curvature of the orbit", "6π d²/a, for d from the origin", bend, limit
    limit = None if least is None or not far else f"e = {least / (ECCENTRICITY * far):.2g} at this distance"
    rule = f"up to {ECCENTRICITY:g} e d, for an eccentricity e"
    known = orbit.eccentricity
    told = f"an orbit of e = {EXAMPLE:g}, say" if known is None else f"the chief's e = {known:.5f}"
    yield told, rule, (EXAMPLE if known is None else known) * ECCENTRICITY * far, limit
    if orbit.mu == EARTH_MU:
        low, high = FLATTENING
        limit = None if least is None else f"{least / high:.3g} m from the origin"
        rule = f"{1e3 * low:g} to {1e3 * high:g} m per km, as measured for GRACE"
        yield "the Earth's flattening", rule, high * far, limit


def certainties(flown: list[StageResult[Any, Any]]) -> Iterator[tuple[str, str]]:
    """Yield the rows of SURE for the contents of a mission."""
    if any(result.after.pairs for result in flown):
        yield (
            "Conflicts, closest approaches",
            "certified: searched in closed form between all instants, none is missed however short; "
            "times to 1e-6 s, ratios to 1e-9",
        )
    if any(plan_of(result) for result in flown):
        yield (
            "Cost of a plan",
            "the least that was found; its lower bound is certified for these ends and times, and it is the "
            "least there is where it is called proven",
        )
    for field in dict.fromkeys(one.validity.field for one in flown if one.validity is not None):
        yield (
            f"In the field of {field}",
            "predicted of what is flown as planned, to a few per cent; thrust corrected for it flies the "
            "plan, and what is certified of it holds there: closeform simulate",
        )
    if any(result.passive is not None for result in flown):
        yield (
            "Passive safety",
            "certified for every instant of failure and all of the drift, of one craft that fails at a time",
        )
    if any(result.stage.searches for result in flown):
        yield LOCKS
    if any(result.pulsed is not None for result in flown):
        yield (
            "Pulses of thrusters",
            "flown as they are fired, and certified clear; their bound on deviation holds",
        )
    yield from of_errors(any(result.uncertain is not None for result in flown))


def of_errors(known: bool) -> Iterator[tuple[str, str]]:
    """Yield the rows of SURE on uncertainty, if it is known."""
    if known:
        yield (
            "Sigmas",
            "certified for Gaussian errors of the sizes given; not where states are known exactly along some "
            "direction",
        )
        yield "Probability of collision", "estimated: its interval of 95 % holds sampling and quadrature"
