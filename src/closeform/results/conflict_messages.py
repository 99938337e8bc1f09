"""Conjunction data messages of a run: states, covariances and probabilities at each closest approach."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.conflicts.two_paths import PairConflict
from closeform.exchange.chief import Chief
from closeform.exchange.conjunction import Conjunction, ConjunctionObject
from closeform.exchange.covariance import axes
from closeform.exchange.exported import FileFrame
from closeform.motion.path import Path
from closeform.results.export_source import UNKNOWN, Source
from closeform.uncertainty.errors import Uncertainty
from closeform.uncertainty.propagated_errors import carried
from closeform.zones.solids import Sphere

METHOD = "CLOSEFORM-TRAJECTORY-SAMPLING"
SAMPLES, REFINEMENTS = (
    200,
    40,
)  # instants sampled in a conflict for its closest approach, repeated at most
ASSUMES = (
    "A CDM assumes a short encounter: straight relative motion and constant covariances.",
    "This conflict lasts {lasts:.1f} s at {speed:.3g} m/s; a slow encounter violates both assumptions.",
)
COUNTS = "COLLISION_PROBABILITY is that of ever being within {radius:g} m during the whole stage"


def messages(source: Source) -> Iterator[tuple[str, Conjunction, tuple[str, ...]]]:
    """Yield the file name, conjunction and comments of each conflict, before and after avoidance.

    Raises ValueError if there are no covariances or no conflicts.
    """
    scenario = source.scenario
    if scenario is None:
        raise ValueError("cdm: paths have no keep-out zones and covariances; export a run")
    known = {craft.name: craft.errors for craft in scenario.craft}
    found = [
        (stage, when, flight, met)
        for stage in source.results
        for when, flight in flights(stage)
        for met in flight.conflicts
    ]
    if not found:
        raise ValueError("cdm: this run has no conflicts; export an oem")
    for stage, when, flight, met in found:
        pair = (met.first, met.second)
        for name in pair:
            if known[name] is None:
                raise ValueError(f"cdm: {name} has no covariance; give [craft] one, or export an oem")
        yield message(source, known, stage, when, flight, met)


def flights(stage: Any) -> Iterator[tuple[str, WatchedFlight]]:
    """Yield the paths of a stage before avoidance, and those after it."""
    if stage.before is not stage.after:
        yield "before", stage.before
    if stage.flown:
        yield "after", stage.after


def message(
    source: Source, known: Any, stage: Any, when: str, flight: WatchedFlight, met: PairConflict
) -> tuple[str, Conjunction, tuple[str, ...]]:
    """Return the file name, conjunction and comments of one conflict."""
    chief, scenario = source.chief, source.scenario
    assert chief is not None  # `file_frame` has checked it
    assert scenario is not None
    pair = (met.first, met.second)
    paths = [flight.path(name) for name in pair]
    errors = [at_start(source, stage, name, known[name]) for name in pair]
    time = nearest(paths[0], paths[1], met)
    bodies = [scenario.craft[scenario.names.index(name)].hard_body for name in pair]
    first, second = (
        conjunction_object(chief, name, path, one.covariance(path, time), time, body)
        for name, path, one, body in zip(pair, paths, errors, bodies, strict=True)
    )
    within = None if None in bodies else float(sum(body or 0.0 for body in bodies))
    chance = None if within is None else probability(paths, within, errors)
    identity = f"stage-{stage.number}-{when}-{met.first}-{met.second}-{met.start:.0f}s"
    conjunction = Conjunction(
        tca=chief.instant.utc([time])[0].removesuffix("Z"),
        objects=(first, second),
        hard_body_radius=within,
        collision_probability=chance,
        collision_probability_method=None if chance is None else METHOD,
        message_id=identity,
    )
    lasts, speed = met.end - met.start, conjunction.relative_speed
    some = (*ASSUMES, COUNTS) if chance is not None else ASSUMES
    where = "as executed" if when == "after" else "plan before avoidance, not executed"
    comments = tuple(line.format(lasts=lasts, speed=speed, radius=within or 0.0) for line in some)
    return (
        identity,
        conjunction,
        (f"Stage {stage.number}, {where}; minimum clearance ratio {met.ratio:.4f}", *comments),
    )


def at_start(source: Source, stage: Any, name: str, errors: Uncertainty) -> Uncertainty:
    """Return the uncertainty of a craft at the start of a stage."""
    for earlier in source.results:
        if earlier.number < stage.number and earlier.flown:
            errors = carried(errors, earlier.after.path(name))
    return errors


def nearest(path: Path, other: Path, met: PairConflict) -> float:
    """Return the time of closest approach of two craft in conflict [s]."""
    first, last = met.start, met.end
    for _ in range(REFINEMENTS):
        times = np.linspace(first, last, SAMPLES)
        apart = np.linalg.norm(path.position(times) - other.position(times), axis=-1)
        k = int(np.argmin(apart))
        first, last = times[max(k - 1, 0)], times[min(k + 1, SAMPLES - 1)]
        if last - first < 1e-6:
            break
    return round(float(times[k]), 9)


def conjunction_object(
    chief: Chief, name: str, path: Path, covariance: Floats, time: float, body: float | None
) -> ConjunctionObject:
    """Return one object of a conjunction, with its inertial covariance along its own RTN axes."""
    relative = path.state(time)
    state = chief.inertial_from_relative(time, relative)
    frame = FileFrame(chief.frame, chief.center, chief.instant, chief)
    (inertial,) = frame.covariances(np.array([time]), relative[None], covariance[None])
    turn = np.kron(np.eye(2), axes("RTN", state))
    own = turn @ inertial @ turn.T
    return ConjunctionObject(
        name=name,
        designator=UNKNOWN,
        frame=chief.frame,
        state=state,
        covariance=0.5 * (own + own.T),
        radius=body,
        manoeuvrable="YES",
    )


def probability(paths: list[Path], within: float, errors: list[Uncertainty]) -> float:
    """Return the probability that two bodies ever touch in a stage.

    `within` [m] is the sum of their radii.
    """
    from closeform.uncertainty.probability import collision_probability  # imported late: compiles kernels

    found = collision_probability(paths[0], paths[1], Sphere(within), errors[0], errors[1])
    return float(found.value)
