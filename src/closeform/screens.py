"""What the command line does with files of real orbits: `screen`."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from closeform.console import complain, tell_screen
from closeform.given import BAD_INPUT, UsageError, ephemerides, length


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
        How many standard deviations of --covariance are kept clear.
    body
        The zone is what each craft fills: those of two add.
    zones
        TOML file with a zone for each craft: [craft] with name and keep_out, as in a scenario.
    interpolate
        How far off states may be that are interpolated to common epochs: "1 m".
    """
    from closeform.scenario import ScenarioError
    from closeform.scenario.options import AskedZones

    shapes = {"sphere": sphere, "box": box, "ellipsoid": ellipsoid, "cylinder": cylinder}
    try:
        asked = AskedZones.of(shapes | {"covariance": covariance}, axis, sigmas, body, zones)
        frame = ephemerides(files, length("interpolate", interpolate))
        kept = asked.of_pairs(frame.names)
    except ScenarioError as error:
        complain(*error.lines)
        return BAD_INPUT
    except ValueError as error:
        raise UsageError(str(error)) from None
    from closeform.conflicts.flight import watch
    from closeform.motion.orbit import Orbit
    from closeform.report.screening import ScreenReport

    paths = Orbit(frame.mean_motion).sampled(frame.times, frame.states)
    report = ScreenReport(frame, watch(paths, frame.names, kept))
    tell_screen(report)
    return report.verdict.status
