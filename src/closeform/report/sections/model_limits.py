"""Limits of the model: the model error of Hill's equations, and which figures are certified or estimated."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.simulation_verdict import mission_error
from closeform.mission.verdict import metres
from closeform.motion.chief.oblate_or_supplied import OblateChief
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.elements.mean_motion import EARTH_MU, EARTH_RADIUS, semi_major_axis_from_mean_motion
from closeform.report.description import Column, Section, Table, plan_of

# Upper bounds; the median and 95 % errors at the end of a plan follow another rule: theory (84).
# For a craft ahead on the same circle, along a straight axis, the model error in one orbit is 6 pi d^2 / a.
# The others are measured: docs/models.md (a chief of e = 0.001) and docs/ephemerides.md (GRACE-A and B).
CURVATURE, ECCENTRICITY, FLATTENING = 6.0 * pi, 25.0, (0.012, 0.027)
EXAMPLE = 0.001  # eccentricity used as an example if it is unknown
TENTH = 0.1  # of the smallest zone: a deviation that is no longer negligible
LOOKS = 201  # instants per flight at which the distance from the origin is sampled
DEVIATIONS = (
    Column("neglected effect", "cause", words=True),
    Column("rule, for one orbit", "rule", words=True),
    Column("here [m]", "deviation_m", "{:.3g}".format),
    Column("a tenth of the smallest zone at", "limit", words=True),
)
BOUNDS = "Upper bounds on the model error within one orbit, by cause"
SURE = Column("figure", "figure", words=True), Column("certainty", "words", words=True)
LOCKS = (
    "Locks",
    "certified for the attitudes and clocks as given (ideal without errors); no lock is missed",
)


@dataclass(frozen=True)
class Circle:
    """Circular reference orbit: mean motion [rad/s], `mu` [m^3/s^2], and the true eccentricity if known."""

    mean_motion: float
    mu: float = EARTH_MU
    eccentricity: float | None = None


@dataclass(frozen=True)
class Reach:
    """Largest distance [m] from the frame's origin in the given flights, with its `craft` and time [s].

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
    executed = [result for result in mission.results if result.executed]
    sure = certain([*certainties(executed)])
    if not executed:
        return Section("Limits of the model", tables=(sure,))
    reach = Reach.of([result.after for result in executed])
    n, mu, chief = 2.0 * pi / mission.orbit.period, mission.scenario.orbit.mu, mission.scenario.chief
    orbit = Circle(n, mu or EARTH_MU) if chief is None else Circle(n, chief.mu, chief.eccentricity)
    (exact, far), tables = beyond(reach, mission.orbit, orbit, executed[-1].end)
    return Section("Limits of the model", (exact, *beside(mission, executed), far), (*tables, sure))


def beside(mission: Mission, executed: list[StageResult[Any, Any]]) -> Iterator[str]:
    """Yield the line on inexact results: predicted in a field, uncertain, or simulated."""
    found = []
    if some := [one.number for one in executed if one.validity is not None]:
        field = next(one.validity.field for one in executed if one.validity is not None)
        found.append(f"predictions in the high-fidelity model with {field} ({numbered(some)})")
    if some := [one.number for one in executed if one.uncertain is not None]:
        found.append(f"sigmas and probabilities, for errors as given ({numbered(some)})")
    if some := [one.number for one in executed if one.commanded is not None]:
        found.append(f"paths with the errors drawn for this case ({numbered(some)})")
    if mission.flights is not None:
        found.append("simulations in the high-fidelity model, integrated with drawn errors")
    if found:
        yield f"Exceptions: {'; '.join(found)}. Their certainty is stated below."


def numbered(stages: list[int]) -> str:
    """Return stage numbers as text."""
    return f"stage{'s' * (len(stages) != 1)} {', '.join(map(str, stages))}"


def certain(rows: list[tuple[str, str]]) -> Table:
    """Return the table of the certainty of each figure."""
    return Table("Certified and estimated figures", SURE, rows)


def beyond(
    reach: Reach, motion: Any, orbit: Circle, duration: float
) -> tuple[tuple[str, str], tuple[Table, ...]]:
    """Return lines and tables on the model error of `motion` at a reach, in a flight of a duration [s]."""
    where = f"{reach.distance:.1f} m ({reach.craft}, {reach.time:.1f} s)"
    far = f"Largest distance from the frame's origin: {where}"
    if not orbit.mean_motion:
        off = 0.5e-9 * duration**2
        return (
            "Paths, conflicts and plans are exact for craft without other forces than their own thrust, with "
            "initial states as given.",
            "The model neglects solar radiation pressure and leaks: a difference of 1 nm/s² between craft "
            f"moves them {off:.3g} m apart in {duration:.1f} s, four times as far in twice the time. {far}.",
        ), ()
    rows, model = [*deviations(reach, orbit)], "Hill's equations: a circular orbit, a point mass"
    if isinstance(motion, ChiefOrbit):
        model, known = motion._model, ["eccentricity"]
        known += ["oblateness"] * isinstance(motion.chief, OblateChief)
        rows = [row for row in rows if not any(cause in row[0] for cause in known)]
    orbits = duration * orbit.mean_motion / (2.0 * pi)
    return (
        f"Paths, conflicts and plans are exact for {model}, small separations, no force but gravity and the "
        "craft's own thrust, initial states as given.",
        f"{far}. The table bounds the model error per orbit; the mission lasts {orbits:.3g} orbits. Enlarge "
        "zones by the error that builds up until states are measured again.",
    ), (Table(BOUNDS, DEVIATIONS, rows),)


def deviations(reach: Reach, orbit: Circle) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of DEVIATIONS on an orbit."""
    radius = float(semi_major_axis_from_mean_motion(orbit.mean_motion, orbit.mu))
    far, least = reach.distance, None if reach.smallest is None else TENTH * reach.smallest
    bend = CURVATURE * far**2 / radius
    limit = None if least is None else f"{sqrt(least * radius / CURVATURE):.3g} m from the origin"
    yield "curvature of the orbit", "6π d²/a, for d from the origin", bend, limit
    limit = None if least is None or not far else f"e = {least / (ECCENTRICITY * far):.2g} at this distance"
    rule = f"up to {ECCENTRICITY:g} e d, for an eccentricity e"
    known = orbit.eccentricity
    cause = (
        f"eccentricity, e = {EXAMPLE:g} as an example"
        if known is None
        else f"the chief's eccentricity, e = {known:.5f}"
    )
    yield cause, rule, (EXAMPLE if known is None else known) * ECCENTRICITY * far, limit
    if orbit.mu == EARTH_MU:
        low, high = FLATTENING
        limit = None if least is None else f"{least / high:.3g} m from the origin"
        rule = f"{1e3 * low:g} to {1e3 * high:g} m per km, as measured for GRACE"
        yield "the Earth's oblateness", rule, high * far, limit


def certainties(executed: list[StageResult[Any, Any]]) -> Iterator[tuple[str, str]]:
    """Yield the rows of SURE for the contents of a mission."""
    if any(result.after.pairs for result in executed):
        yield (
            "Conflicts, closest approaches",
            "certified: none is missed, however short; times to 1e-6 s, ratios to 1e-9",
        )
    if any(plan_of(result) for result in executed):
        yield (
            "Cost of a plan",
            "the minimum found; its lower bound is certified for these ends and times, and a proven minimum "
            "cannot be improved",
        )
    for field in dict.fromkeys(one.validity.field for one in executed if one.validity is not None):
        yield (
            f"Model error with {field}",
            "predicted for uncompensated thrust, to a few per cent; with compensated thrust the certified "
            "figures hold there: closeform simulate",
        )
    if any(result.passive is not None for result in executed):
        yield (
            "Passive safety",
            "certified for every instant of failure and the whole free drift, one failing craft at a time",
        )
    if any(result.stage.searches for result in executed):
        yield LOCKS
    if any(result.pulsed is not None for result in executed):
        yield (
            "Pulses of thrusters",
            "certified as fired; the bound on their deviation holds",
        )
    yield from of_errors(any(result.uncertain is not None for result in executed))


def of_errors(known: bool) -> Iterator[tuple[str, str]]:
    """Yield the rows of SURE on uncertainty, if it is known."""
    if known:
        yield (
            "Sigmas",
            "certified for Gaussian errors of the given size, unless a state is exact along some direction",
        )
        yield "Probability of collision", "estimated: its 95 % interval covers sampling and quadrature errors"


def predicted(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the predicted deviations of a stage in its high-fidelity model, or a note on their absence."""
    if result.validity is None:
        missing = mission.scenario.field is not None and not result.executed
        return ("Model error: not predicted, since these paths are not executed",) * missing
    from closeform.dynamics.simulation.validity import in_words  # most runs do not need these kernels

    return in_words(result.validity, result.after.names)


def margin(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the keep-out margin of a plan as text."""
    asked = getattr(result.stage, "margin", None)
    plan = plan_of(result)
    if not asked or plan is None:
        return ()
    why = ", for the tracking error of feedback" if asked == "auto" else ""
    padded = np.unique(np.asarray(plan.padding))
    least, most = (f"{one:.3g}" for one in (padded[padded > 0.0].min(initial=np.inf), padded[-1]))
    of = f"{most} m" if float(least) >= float(most) else f"{least} to {most} m, by pair"
    return (f"Keep-out margin: {of}{why}",)


def error_figures(result: StageResult[Any, Any]) -> dict[str, Any]:
    """Return the predicted model error and the keep-out margin for `summary.json`."""
    found, names, plan = result.validity, result.after.names, plan_of(result)
    asked = getattr(result.stage, "margin", None)
    kept = {} if not asked or plan is None else {"margin_m": float(np.max(plan.padding))}
    if found is None:
        return kept
    return kept | {
        "in_field": {
            "field": found.field,
            "ends_m": dict(zip(names, found.ends.tolist(), strict=True)),
            "residual_m_s2": dict(zip(names, found.residual.tolist(), strict=True)),
            "least_ratio": float(found.simulated.min(initial=np.inf)),
            "planned_ratio": float(found.planned.min(initial=np.inf)),
        }
    }


def estimate(mission: Mission) -> Iterator[str]:
    """Yield the estimated model error of a mission around the Earth without a high-fidelity model."""
    error = mission_error(mission)
    if error is None:
        return
    neglected, half, most = error
    e, hill = neglected.eccentricity, mission.scenario.orbit.model == "hill"
    where = f"at {(neglected.radius - EARTH_RADIUS) / 1e3:.0f} km, e " + (
        "not known" if e is None else f"= {e:.5f}"
    )
    where = where if hill else f"with a semi-latus rectum of {neglected.radius / 1e3:.0f} km"
    whose = "the craft" if len(mission.scenario.craft) == 1 else "the craft with the largest error"
    model = "Hill's equations" if hill else "the eccentric model"
    yield f"Model error of {model} (estimate): about {metres(half)}, 95 % within {metres(most)}"
    yield f"    for {whose}, {where}"
