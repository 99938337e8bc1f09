"""Conjunction data messages of a run: states, covariances and probabilities at each closest approach."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.conflicts.two_paths import PairConflict
from closeform.exchange.ccsds.conjunction import INERTIAL as FRAMES
from closeform.exchange.ccsds.conjunction import Conjunction, ConjunctionObject
from closeform.exchange.common_frame import CommonFrame
from closeform.exchange.ephemerides.covariance import axes, canonical
from closeform.exchange.ephemerides.propagated_covariance import covariance_at
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.track import FileFrame
from closeform.motion.path import Path
from closeform.results.export_source import UNKNOWN, Source
from closeform.uncertainty.covariance_propagation import uncertainty_at_end
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.combined_zones import Body, CovarianceZone, OwnZone
from closeform.zones.made_table import is_sphere
from closeform.zones.solids import Sphere

METHOD = "CLOSEFORM-TRAJECTORY-SAMPLING"
SAMPLES, REFINEMENTS = 200, 40  # instants sampled for a closest approach, and refinements at most
ASSUMES = (
    "A CDM assumes a short encounter: straight relative motion and constant covariances.",
    "The objects stay within their zone for {lasts:.1f} s at {speed:.3g} m/s; slow encounters violate both.",
)
COUNTS = "COLLISION_PROBABILITY: the objects come within {radius:g} m of each other during the whole stage"
COUNTS_ABOUT = "COLLISION_PROBABILITY: the objects come within {radius:g} m within {window:.0f} s of TCA"
DESIGNATOR = re.compile(r"\d{4}-\d{3}[A-Z]{1,3}")  # international, as 1998-067A


Message = tuple[str, Conjunction, tuple[str, ...]]  # name of its file, and comments


def messages(source: Source, frame: FileFrame) -> Iterator[Message]:
    """Yield a conjunction message for each conflict of a run, before avoidance and after it.

    States are inertial, as in the `frame`.

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
        yield message(source, frame, known, stage, when, flight, met)


def flights(stage: Any) -> Iterator[tuple[str, WatchedFlight]]:
    """Yield the paths of a stage before avoidance, and those after it."""
    if stage.before is not stage.after:
        yield "before", stage.before
    if stage.executed:
        yield "after", stage.after


def message(
    source: Source,
    frame: FileFrame,
    known: Any,
    stage: Any,
    when: str,
    flight: WatchedFlight,
    met: PairConflict,
) -> Message:
    """Return the message of one conflict."""
    scenario = source.scenario
    assert scenario is not None
    pair = (met.first, met.second)
    paths = [flight.path(name) for name in pair]
    errors = [at_start(source, stage, name, known[name]) for name in pair]
    time = nearest(lambda times: paths[0].position(times) - paths[1].position(times), met)
    bodies = [scenario.craft[scenario.names.index(name)].body_radius for name in pair]
    first, second = (
        conjunction_object(frame, name, path, one.covariance(path, time), time, body)
        for name, path, one, body in zip(pair, paths, errors, bodies, strict=True)
    )
    within = None if None in bodies else float(sum(body or 0.0 for body in bodies))
    chance = None if within is None else probability(paths, within, errors)
    identity = f"stage-{stage.number}-{when}-{met.first}-{met.second}-{met.start:.0f}s"
    conjunction = Conjunction(
        tca=frame.utc(np.array([time]))[0].removesuffix("Z"),
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


def require_covariances(frame: CommonFrame, own: Sequence[OwnZone]) -> None:
    """Raise ValueError, before a long search, if a CDM cannot describe each object of a screening."""
    chief = frame.ephemerides[0][0]
    if canonical(chief.center) != "EARTH" or canonical(chief.frame) not in FRAMES:
        what = f"CENTER_NAME {chief.center} with REF_FRAME {chief.frame} has no equivalent in a CDM"
        raise ValueError(f"--cdm: {what}; use EARTH and one of {', '.join(FRAMES)}")
    for name, segments, zone in zip(frame.names, frame.ephemerides, own, strict=True):
        if not isinstance(zone, CovarianceZone) and not any(one.covariances for one in segments):
            remedy = "add a covariance block to its ephemeris, or give --covariance with --sigmas"
            raise ValueError(f"--cdm: {name} has no covariance, which a CDM must state; {remedy}")


def screening_messages(
    frame: CommonFrame, flight: WatchedFlight, own: Sequence[OwnZone], files: Sequence[str]
) -> Iterator[Message]:
    """Yield a conjunction message for each conflict of a screening.

    Object identifiers are those of the ephemerides in `files`, and states are interpolated in them. Bodies
    are the spheres among the `own` zones.
    """
    for met in flight.conflicts:
        yield screening_message(frame, met, own, files)


def screening_message(
    frame: CommonFrame, met: PairConflict, own: Sequence[OwnZone], files: Sequence[str]
) -> Message:
    """Return the message of one conflict of a screening."""
    epoch = Epoch(frame.epoch, frame.time_system)

    def between(times: Floats) -> Floats:
        one, other = (frame.inertial_states(name, times) for name in (met.first, met.second))
        return (one - other)[:, :3]

    time = nearest(between, met)
    first, second = (screened_object(frame, name, time, own, files) for name in (met.first, met.second))
    identity = f"{met.first}-{met.second}-{met.start:.0f}s"
    conjunction = Conjunction(
        tca=epoch.utc([time])[0].removesuffix("Z"), objects=(first, second), message_id=identity
    )
    start, end = epoch.utc([met.start, met.end], 3)
    zone = f"Within the screening zone from {start} to {end}; minimum clearance ratio {met.ratio:.4f}"
    lasts, speed = met.end - met.start, conjunction.relative_speed
    comments = [zone, *(line.format(lasts=lasts, speed=speed) for line in ASSUMES)]
    if (within := conjunction.hard_body_radius) is not None:
        try:
            about = conjunction.encounter()
            chance = probability([about.path, about.other], within, [about.errors, about.other_errors])
            conjunction = replace(
                conjunction, collision_probability=chance, collision_probability_method=METHOD
            )
            comments.append(COUNTS_ABOUT.format(radius=within, window=about.path.end))
        except ValueError as error:
            comments.append(f"No COLLISION_PROBABILITY: {error}")
    return identity, conjunction, tuple(comments)


def screened_object(
    frame: CommonFrame, name: str, time: float, own: Sequence[OwnZone], files: Sequence[str]
) -> ConjunctionObject:
    """Return an object of a screening at a closest approach, with the latest covariance of its ephemeris."""
    k, (state,) = frame.names.index(name), frame.inertial_states(name, [time])
    segments, zone = frame.ephemerides[k], own[k]
    known = [(one, start) for one, start in zip(segments, frame._starts(k), strict=True) if one.covariances]
    if known:
        one, start = next((pair for pair in reversed(known) if pair[1] <= time), known[0])
        found = covariance_at(one, time - start, frame.mean_motion**2 * frame.radius**3)
        assert found is not None  # the segment has covariances
        turn = np.kron(np.eye(2), axes("RTN", state))
        covariance = turn @ found[0] @ turn.T
    else:
        assert isinstance(zone, CovarianceZone)  # by require_covariances
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = zone.covariance
    first = segments[0]
    international = DESIGNATOR.fullmatch(first.object_id) is not None
    return ConjunctionObject(
        name=first.name,
        designator=first.object_id,
        frame=canonical(first.frame),
        state=state,
        covariance=0.5 * (covariance + covariance.T),
        radius=zone.zone.radius if isinstance(zone, Body) and is_sphere(zone.zone) else None,
        catalog="SATCAT" if first.object_id.isdigit() else UNKNOWN,
        international_designator=first.object_id if international else UNKNOWN,
        ephemeris_name=files[k],
        covariance_method="CALCULATED" if known else "DEFAULT",
        manoeuvrable="YES" if frame.manoeuvres[k] else "N/A",
    )


def at_start(source: Source, stage: Any, name: str, errors: Uncertainty) -> Uncertainty:
    """Return the uncertainty of a craft at the start of a stage."""
    for earlier in source.results:
        if earlier.number < stage.number and earlier.executed:
            errors = uncertainty_at_end(errors, earlier.after.path(name))
    return errors


def nearest(between: Callable[[Floats], Floats], met: PairConflict) -> float:
    """Return when two craft in conflict are nearest to each other [s], by the vector `between` them."""
    first, last = met.start, met.end
    for _ in range(REFINEMENTS):
        times = np.linspace(first, last, SAMPLES)
        apart = np.linalg.norm(between(times), axis=-1)
        k = int(np.argmin(apart))
        first, last = times[max(k - 1, 0)], times[min(k + 1, SAMPLES - 1)]
        if last - first < 1e-6:
            break
    return round(float(times[k]), 9)


def conjunction_object(
    frame: FileFrame, name: str, path: Path, covariance: Floats, time: float, body: float | None
) -> ConjunctionObject:
    """Return one object of a conjunction, with its inertial covariance along its own RTN axes."""
    at, relative = np.array([time]), path.state(time)[None]
    (state,), (inertial,) = frame.states(at, relative), frame.covariances(at, relative, covariance[None])
    turn = np.kron(np.eye(2), axes("RTN", state))
    own = turn @ inertial @ turn.T
    return ConjunctionObject(
        name=name,
        designator=UNKNOWN,
        frame=frame.name,
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
