"""Conflicts of a run as conjunction messages: states, covariances and probabilities at closest approach."""

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

METHOD = "CLOSEFORM-HISTORIES"
LOOKED_AT, REFINED = (
    200,
    40,
)  # instants of a conflict among which the nearest is looked for, and how often again
ASSUMES = (
    "A CDM assumes a short encounter: straight relative motion, and covariances that hold for all of it.",
    "These two are within their zone for {lasts:.1f} s at {speed:.3g} m/s: slow ones break both.",
)
COUNTS = "COLLISION_PROBABILITY counts who is ever inside {radius:g} m along the whole stage"


def messages(source: Source) -> Iterator[tuple[str, Conjunction, tuple[str, ...]]]:
    """Of each conflict the name of its file, the conjunction and comments, before avoidance and after it.

    Raises ValueError where there are no covariances or no conflicts.
    """
    scenario = source.scenario
    if scenario is None:
        raise ValueError("cdm: paths have no zones and covariances of their own; export a run")
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
    """What is flown in a stage, and what would have been."""
    if stage.before is not stage.after:
        yield "before", stage.before
    if stage.flown:
        yield "after", stage.after


def message(
    source: Source, known: Any, stage: Any, when: str, flight: WatchedFlight, met: PairConflict
) -> tuple[str, Conjunction, tuple[str, ...]]:
    """One conflict."""
    chief, scenario = source.chief, source.scenario
    assert chief is not None  # the frame was made
    assert scenario is not None
    pair = (met.first, met.second)
    paths = [flight.path(name) for name in pair]
    errors = [at_start(source, stage, name, known[name]) for name in pair]
    time = nearest(paths[0], paths[1], met)
    bodies = [scenario.craft[scenario.names.index(name)].hard_body for name in pair]
    first, second = (
        told(chief, name, path, one.covariance(path, time), time, body)
        for name, path, one, body in zip(pair, paths, errors, bodies, strict=True)
    )
    within = None if None in bodies else float(sum(body or 0.0 for body in bodies))
    chance = None if within is None else probability(paths, within, errors)
    identity = f"stage-{stage.number}-{when}-{met.first}-{met.second}-{met.start:.0f}s"
    told_of = Conjunction(
        tca=chief.instant.utc([time])[0].removesuffix("Z"),
        objects=(first, second),
        hard_body_radius=within,
        collision_probability=chance,
        collision_probability_method=None if chance is None else METHOD,
        message_id=identity,
    )
    lasts, speed = met.end - met.start, told_of.relative_speed
    some = (*ASSUMES, COUNTS) if chance is not None else ASSUMES
    where = "as flown" if when == "after" else "of the plan before avoidance, which is not flown"
    told_in = tuple(line.format(lasts=lasts, speed=speed, radius=within or 0.0) for line in some)
    return identity, told_of, (f"Stage {stage.number}, {where}; zone entered to {met.ratio:.4f}", *told_in)


def at_start(source: Source, stage: Any, name: str, errors: Uncertainty) -> Uncertainty:
    """The errors of a craft when a stage begins."""
    for earlier in source.results:
        if earlier.number < stage.number and earlier.flown:
            errors = carried(errors, earlier.after.path(name))
    return errors


def nearest(path: Path, other: Path, met: PairConflict) -> float:
    """When two craft in conflict are nearest to each other [s]."""
    first, last = met.start, met.end
    for _ in range(REFINED):
        times = np.linspace(first, last, LOOKED_AT)
        apart = np.linalg.norm(path.position(times) - other.position(times), axis=-1)
        k = int(np.argmin(apart))
        first, last = times[max(k - 1, 0)], times[min(k + 1, LOOKED_AT - 1)]
        if last - first < 1e-6:
            break
    return round(float(times[k]), 9)


def told(
    chief: Chief, name: str, path: Path, covariance: Floats, time: float, body: float | None
) -> ConjunctionObject:
    """One of the two at a time, with its covariance along its own axes, of inertial velocities."""
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
    """That two bodies with `within` [m] between their centres ever touch in a stage."""
    from closeform.uncertainty.probability import collision_probability  # with kernels of its own

    found = collision_probability(paths[0], paths[1], Sphere(within), errors[0], errors[1])
    return float(found.value)
