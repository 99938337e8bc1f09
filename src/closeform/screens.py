"""What the command line does with files of real orbits: `screen` and `encounter`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from closeform.console import complain, tell_screen
from closeform.given import BAD_INPUT, UsageError, check_present, ephemerides, quantity

if TYPE_CHECKING:
    from closeform.conflicts.flight import Flight
    from closeform.exchange.common_frame import CommonFrame
    from closeform.exchange.conjunction import Conjunction
    from closeform.report.encounter import EncounterReport
    from closeform.uncertainty.uncertain_flight import UncertainFlight


def screen(
    files: Annotated[tuple[Path, ...], Parameter(name="oem")],
    /,
    *,
    sphere: str | None = None,
    box: str | None = None,
    ellipsoid: str | None = None,
    cylinder: str | None = None,
    axis: str | None = None,
    covariance: str | None = None,
    sigmas: float | None = None,
    body: Annotated[bool, Parameter(negative="")] = False,
    hard_body: str | None = None,
    zones: Path | None = None,
    interpolate: str | None = None,
) -> int:
    """Find every conflict among real ephemerides, in the orbital frame of the first.

    Parameters
    ----------
    files
        CCSDS orbit ephemeris messages, two or more, with common epochs or --interpolate.
    sphere
        Keep-out zone by its radius: "20 m".
    box
        Keep-out zone by its half-widths radial, along-track, cross-track: "20 40 20 m".
    ellipsoid
        Keep-out zone by its half-axes radial, along-track, cross-track: "20 40 20 m".
    cylinder
        Keep-out zone by its radius and half-length along --axis: "10 100 m".
    axis
        Direction of the cylinder, radial, along-track, cross-track: "0 1 0".
    covariance
        Of the position of every craft, rr tr tt nr nt nn: "25 0 400 0 0 25 m^2"; those of two add.
    sigmas
        How many standard deviations are kept clear: of --covariance, else of the ephemerides' covariances.
    body
        The zone is what each craft fills: those of two add.
    hard_body
        Radius of the sphere that each craft fills: "5 m"; those of two add.
    zones
        TOML file with a zone for each craft: [craft] with name and keep_out, as in a scenario.
    interpolate
        How far off states may be that are interpolated to common epochs: "1 m".
    """
    from closeform.scenario import ScenarioError
    from closeform.scenario.options import HARD_BODY, AskedZones
    from closeform.scenario.quantity import LENGTH

    shapes = {"sphere": sphere, "box": box, "ellipsoid": ellipsoid, "cylinder": cylinder}
    try:
        asked = AskedZones.of(
            shapes | {HARD_BODY: hard_body, "covariance": covariance}, axis, sigmas, body, zones
        )
        frame = ephemerides(files, quantity("interpolate", LENGTH, interpolate))
        kept = asked.of_pairs(frame.names)
        if asked.sigmas is not None and not any(held is not None for held in frame.covariances):
            raise ValueError("--sigmas: no ephemeris has a covariance; add blocks, or give --covariance")
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    except ValueError as error:
        raise UsageError(str(error)) from None
    from closeform.conflicts.flight import watch
    from closeform.motion.orbit import Orbit
    from closeform.report.screening import ScreenReport

    flight = watch(Orbit(frame.mean_motion).sampled(frame.times, frame.states), frame.names, kept)
    report = ScreenReport(frame, flight, uncertain(frame, flight, asked.sigmas))
    tell_screen(report)
    return report.verdict.status


def uncertain(frame: "CommonFrame", flight: "Flight", sigmas: float | None) -> "UncertainFlight | None":
    """How many sigmas pairs are clear by, and how probable it is that they meet; None if nobody asked."""
    if sigmas is None:
        return None
    from closeform.uncertainty.uncertain_flight import UncertainFlight

    return UncertainFlight.of(flight, frame.errors, sigmas)


def encounter(
    message: Path,
    /,
    *,
    radius: str | None = None,
    window: str | None = None,
    limit: float | None = None,
) -> int:
    """Tell how probable a collision is that a conjunction message warns of, however slow the two pass.

    Parameters
    ----------
    message
        CCSDS conjunction data message, key-value or XML.
    radius
        Of both bodies together: "15 m"; that of the message unless given.
    window
        How long before and after closest approach both are followed: "1420 s"; a quarter of an orbit, or as
        long as they are near each other.
    limit
        The largest probability that is accepted: 1e-4.  Above it the exit status is 1.
    """
    from closeform.exchange.cdm import read_cdm
    from closeform.exchange.message import within
    from closeform.scenario.quantity import LENGTH, TIME

    half = quantity("window", TIME, window)
    if limit is not None and not 0.0 <= limit <= 1.0:
        raise UsageError(f"--limit: a probability is from 0 to 1, got {limit:g}; give for example 1e-4")
    bodies = quantity("radius", LENGTH, radius)
    check_present(message)
    try:
        told = read_cdm(message)
        bodies = bodies or told.hard_body_radius
        if bodies is None:
            remedy = '--radius "15 m", say'
            if told.exclusion_radii:
                remedy = (
                    f'--radius "{sum(told.exclusion_radii):g} m" is what its screening excludes about both'
                )
            raise ValueError(f"{message}: tells no hard-body radius; give one: {remedy}")
        with within(message):
            report = judged(told, bodies, half, limit)
    except ValueError as error:
        raise UsageError(str(error)) from None
    tell_screen(report)
    return report.verdict.status


def judged(
    told: "Conjunction", radius: float, half_window: float | None, limit: float | None
) -> "EncounterReport":
    """The report of a message, with bodies of some radius [m] together."""
    from closeform.report.encounter import EncounterReport
    from closeform.uncertainty.clearance import clearance_in_sigmas
    from closeform.uncertainty.probability import collision_probability
    from closeform.uncertainty.short_encounter import NotPassing
    from closeform.zones.solids import Sphere

    met, zone = told.encounter(half_window), Sphere(radius)
    pair = met.path, met.other, zone, met.errors, met.other_errors
    entries = collision_probability(*pair)
    try:
        short = collision_probability(*pair, method="short-encounter")
    except NotPassing:
        short = None  # nearest at an edge of the time: the report says so
    return EncounterReport(told, radius, met, clearance_in_sigmas(*pair), entries, short, limit)
