"""Commands for orbit files: `screen`, `encounter` and `export`."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from closeform.cli.console import complain, kept, print_report, say, stderr, stdout, working
from closeform.cli.inputs import BAD_INPUT, CLEAR, UsageError, check_present, ephemerides, quantity

if TYPE_CHECKING:
    from closeform.conflicts.flight import WatchedFlight
    from closeform.exchange.ccsds.conjunction import Conjunction
    from closeform.exchange.common_frame import CommonFrame
    from closeform.report.page import Command, CommandReport
    from closeform.report.picture import Shot
    from closeform.storage.result_folder import Folder
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
    cdm: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Find every conflict among ephemerides, in the Hill frame of the first.

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
        Position covariance of every object, rr tr tt nr nt nn: "25 0 400 0 0 25 m^2"; the covariances of a
        pair add.
    sigmas
        Number of standard deviations to keep clear, of --covariance or else of the ephemerides' covariances.
    body
        Treat the zone as the body of each object; the bodies of two objects add.
    hard_body
        Radius of the sphere that encloses each object: "5 m"; the radii of a pair add.
    zones
        TOML file with a zone for each object: [craft] with name and keep_out, as in a scenario.
    interpolate
        Largest error of states that are interpolated to common epochs: "1 m".
    cdm
        Write a conjunction data message for each conflict into cdm/ of the results.
    out
        Folder for the results. Default: NAME-screen-results in the current folder, with NAME of the first
        file and a number if that folder exists.
    overwrite
        Replace finished results.
    """
    from closeform.scenario import ScenarioError
    from closeform.scenario.options import HARD_BODY, AskedZones
    from closeform.scenario.quantity import LENGTH

    shapes = {"sphere": sphere, "box": box, "ellipsoid": ellipsoid, "cylinder": cylinder}
    place = free(out, files[0] if files else Path("none"), "screen", overwrite)
    try:
        asked = AskedZones.of(
            shapes | {HARD_BODY: hard_body, "covariance": covariance}, axis, sigmas, body, zones
        )
        frame = ephemerides(files, quantity("interpolate", LENGTH, interpolate))
        own = asked.of_each(frame.names)
        held_clear = asked.of_pairs(own, frame.names)
        if asked.sigmas is not None and not any(held is not None for held in frame.covariances):
            raise ValueError("--sigmas: no ephemeris has a covariance; add blocks, or give --covariance")
        if cdm:
            from closeform.results.conjunction_messages import require_covariances, screening_messages

            require_covariances(frame, own)
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    except ValueError as error:
        raise UsageError(str(error)) from None
    from closeform.conflicts.flight import watch
    from closeform.report.page import Command, CommandReport
    from closeform.report.screening import Screened, screen_report

    options: dict[str, object] = {
        "axis": axis,
        "covariance": covariance,
        "sigmas": sigmas,
        "body": body,
        "hard-body": hard_body,
    }
    options |= {"zones": zones, "interpolate": interpolate, "cdm": cdm}
    command = Command("screen", files, {**shapes, **options}, [zones] if zones is not None else [], out)

    def report() -> CommandReport:
        flight = watch(frame.paths, frame.names, held_clear)
        names = [file.name for file in files]
        messages = tuple(screening_messages(frame, flight, own, names)) if cdm else None
        known = uncertain(frame, flight, asked.sigmas)
        return screen_report(Screened(frame, flight, held_clear, known), command, messages)

    return left(report, place, overwrite)


def free(out: Path | None, file: Path, command: str, overwrite: bool) -> Path:
    """Return the folder for the results of a command on a file.

    Without `out`, it has a default name, with a number if that folder exists.  Raises FolderError if the
    folder must not be written.
    """
    from closeform.storage.publishing import check_free

    usual = f"{file.stem}-{command}-results"
    place, number = out or Path(usual), 1
    while out is None and not overwrite and os.path.lexists(place):
        number += 1
        place = Path(f"{usual}-{number}")
    check_free(place, overwrite)
    return place


def left(made: "Callable[[], CommandReport]", place: Path, overwrite: bool) -> int:
    """Make a report, write its results, print it, and return the exit status."""
    from closeform.storage.publishing import folder
    from closeform.storage.result_folder import written

    def viewer(under_way: "Folder", pictures: "Sequence[Shot]") -> None:
        from closeform.viewer import page  # loads matplotlib while the other process draws
        from closeform.viewer.shown import Shown

        page.write(Shown.of_report(report), under_way, pictures)

    notes = stderr()
    with working(notes, "looking") as tell, folder(place, overwrite) as under_way:
        report = made()
        with written(place):
            report.write(under_way, tell, viewer)
    with kept(place):
        print_report(report, place)
    status: int = report.verdict.status
    return status


def uncertain(
    frame: "CommonFrame", flight: "WatchedFlight", sigmas: float | None
) -> "UncertainFlight | None":
    """Return the sigma clearances and collision probabilities of pairs; None without requested `sigmas`."""
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
    out: Path | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Compute the probability of collision of a conjunction message, also for slow encounters.

    Parameters
    ----------
    message
        CCSDS conjunction data message, key-value or XML.
    radius
        Sum of the radii of both bodies: "15 m". Default: that of the message.
    window
        Time to evaluate before and after closest approach: "1420 s". Default: a quarter of an orbit, or the
        time for which the objects are near each other.
    limit
        Largest accepted probability: 1e-4.  Above it the exit status is 1.
    out
        Folder for the results. Default: NAME-encounter-results in the current folder, with a number if that
        folder exists.
    overwrite
        Replace finished results.
    """
    from closeform.exchange.ccsds.cdm import read_cdm
    from closeform.exchange.ccsds.entries import within
    from closeform.report.page import Command
    from closeform.scenario.quantity import LENGTH, TIME

    half = quantity("window", TIME, window)
    if limit is not None and not 0.0 < limit <= 1.0:
        raise UsageError(
            f"--limit: must be a probability above 0 and at most 1, got {limit:g}; give for example 1e-4"
        )
    bodies = quantity("radius", LENGTH, radius)
    check_present(message)
    place = free(out, message, "encounter", overwrite)
    command = Command("encounter", [message], {"radius": radius, "window": window, "limit": limit}, out=out)
    try:
        conjunction = read_cdm(message)
        bodies = bodies or conjunction.hard_body_radius
        if bodies is None:
            remedy = 'for example --radius "15 m"'
            if conjunction.exclusion_radii:
                both = sum(conjunction.exclusion_radii)
                remedy = f'--radius "{both:g} m" is the sum of the exclusion radii of its screening'
            raise ValueError(f"{message}: contains no hard-body radius; give one: {remedy}")
        with within(message):
            report = judged(conjunction, bodies, half, limit, command)
    except ValueError as error:
        raise UsageError(str(error)) from None
    return left(lambda: report, place, overwrite)


def judged(
    message: "Conjunction", radius: float, half_window: float | None, limit: float | None, command: "Command"
) -> "CommandReport":
    """Return the report of a conjunction message, for a combined `radius` [m] of both bodies.

    `half_window` [s] is the time before and after closest approach, and `limit` is the largest accepted
    probability.
    """
    from closeform.report.screening import Met, encounter_report
    from closeform.uncertainty.clearance import clearance_in_sigmas
    from closeform.uncertainty.collision.short_encounter import NotPassing
    from closeform.uncertainty.probability import collision_probability
    from closeform.zones.solids import Sphere

    met, zone = message.encounter(half_window), Sphere(radius)
    pair = met.path, met.other, zone, met.errors, met.other_errors
    entries = collision_probability(*pair)
    try:
        short = collision_probability(*pair, method="short-encounter")
    except NotPassing:
        short = None  # closest approach at an end of the window, which the report states
    found = Met(message, radius, met)
    return encounter_report(found, clearance_in_sigmas(*pair), entries, short, limit, command)


def export(
    directory: Path,
    /,
    *,
    to: str,
    out: Path | None = None,
    frame: str | None = None,
    step: str | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Export a run to other tools: ephemerides, manoeuvres, attitudes, conjunctions.

    Parameters
    ----------
    directory
        Result folder of a run of a scenario with an epoch.
    to
        Format: oem, oem-xml, opm, ocm, aem, cdm, csv, stk, czml or spk.
    out
        Folder for the files. Default: NAME-TO in the current folder.
    frame
        The chief's inertial frame by its name (default), or RSW_ROTATING, the axes of Hill's frame.
    step
        Interval between states: "10 s". Default: as long as interpolation allows.
    overwrite
        Replace an earlier export.
    """
    from closeform.scenario.quantity import TIME

    apart = quantity("step", TIME, step)
    from closeform.results.export import export as write
    from closeform.results.export import summary_lines
    from closeform.results.load import LoadedRun, load
    from closeform.storage.result_folder import FolderError

    place = out if out is not None else Path(f"{directory.resolve().name}-{to}")
    run = load(directory)
    if not isinstance(run, LoadedRun):
        raise UsageError(
            f"{directory}: holds a study, which keeps no paths; run one case with --case, and export that"
        )
    try:
        write(run, place, to, frame=frame, step=apart, overwrite=overwrite)
    except FolderError:
        raise
    except (ValueError, ImportError) as error:
        raise UsageError(f"{directory}: {error}") from None
    for line in summary_lines(place):
        say(stdout(), line)
    return CLEAR
