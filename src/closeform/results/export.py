"""Export of mission results to the file formats of other tools, in a folder that is complete or absent."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

from closeform.arrays import Floats, instance, number, sequence, shown
from closeform.exchange.ccsds.aem import aem
from closeform.exchange.ccsds.ocm import ocm
from closeform.exchange.ccsds.track_messages import oem, oem_xml, opm
from closeform.exchange.chief import Chief
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.sampled_paths import tracks
from closeform.exchange.export_tracks.track import ROTATING, FileFrame, Track, file_names
from closeform.exchange.formats import spk
from closeform.exchange.formats.czml import czml
from closeform.exchange.formats.states_csv import csv_text
from closeform.exchange.formats.stk import SYSTEMS, stk
from closeform.mission.mission_result import Mission
from closeform.motion.elements.frames import inertial_from_relative
from closeform.motion.path import Path
from closeform.results.export_source import Source, source_of
from closeform.results.load import LoadedRun
from closeform.storage.publishing import folder
from closeform.storage.result_folder import Folder, summary_of

FRAME_NAMES = {"inertial": None, "hill": ROTATING, ROTATING.lower(): ROTATING}  # accepted for `frame`
ORIGIN = "FORMATION"  # centre of states relative to the formation's origin
OTHER_AXES = ("LVLH", "LVLH_ROTATING", "VVLH", "RTN", "RSW", "RIC", "QSW")
FIXED = ("EME2000", "J2000", "ICRF", "GCRF")  # inertial axes
INERTIAL_ONLY = ("cdm", "stk", "czml", "spk")


@dataclass(frozen=True, eq=False)
class Export:
    """Export in progress: its source, its frame and its `step` [s]."""

    source: Source
    frame: FileFrame
    step: float | None

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """Tracks of all craft."""
        return tracks(self.source.craft, self.frame, self.step)


Writer = Callable[[Export, Folder], None]


def export(
    result: Mission | LoadedRun | Path,
    directory: str | PathLike[str],
    to: str,
    *,
    chief: Chief | None = None,
    names: Sequence[str] | None = None,
    frame: str | None = None,
    step: float | None = None,
    overwrite: bool = False,
) -> FilePath:
    """Export executed paths to a file format of another tool.

    Parameters
    ----------
    result : Mission, LoadedRun or Path
        Result of `run` or `load`; or paths of shape (N,) or of one craft.
    directory : str or path-like
        A folder that does not exist yet, or is empty.
    to : str
        "oem", "oem-xml", "opm", "ocm", "aem", "cdm", "csv", "stk", "czml" or "spk"; docs/export.md describes
        the content of each.
    chief : Chief, optional
        The orbit of the formation's origin. Default: the chief of the scenario.
    names : sequence of str, optional
        Names of the craft of paths, in order. Default: "C1", "C2", ...
    frame : str, optional
        The name of the chief's inertial frame (default), or "RSW_ROTATING", the CCSDS name of Hill's frame.
        In deep space the name of the scenario's axes.
    step : float [s], optional
        Time between states. Default: the longest step with an interpolation error below a micrometre.
    overwrite : bool, default False
        Replace an earlier export in `directory`.

    Returns
    -------
    path-like
        The folder.

    Raises
    ------
    ValueError
        If a required chief is missing, a format or frame is unknown, the format cannot represent the result
        (an AEM requires a search, a CDM conflicts and covariances), the step is too coarse, or the folder is
        in use.
    ImportError
        If an SPK is requested without the extra `spice`.

    References
    ----------
    CCSDS 502.0-B-3, 504.0-B-2 and 508.0-B; docs/export.md.
    """
    instance("result", result, Mission, LoadedRun, Path)
    instance("directory", directory, str, PathLike)
    instance("chief", chief, Chief, type(None))
    if not isinstance(to, str) or to not in WRITERS:
        raise ValueError(f"to: {shown(to)} is not a format; use one of {', '.join(WRITERS)}")
    if step is not None and not number("step", step) > 0.0:
        raise ValueError(f"step: must be positive, got {step:g} s")
    called = None if names is None else list(sequence("names", names, str))
    source = source_of(result, chief, called)
    made = Export(source, file_frame(source, to, frame), step)
    with folder(FilePath(directory), overwrite) as under_way:
        WRITERS[to](made, under_way)
        under_way.summary(summary(made, to))
    return FilePath(directory)


def summary(made: Export, to: str) -> dict[str, Any]:
    """Return the content of `summary.json` of an export."""
    frame = made.frame
    return {
        "kind": "export",
        "to": to,
        "title": made.source.title,
        "frame": frame.name,
        "center": frame.center,
        "epoch": str(frame.epoch),
        "about": list(frame.about),
        "interpolation_error_m": max(track.error for track in made.tracks),
        "craft": {
            track.name: {"segments": len(track.pieces), "states": track.count} for track in made.tracks
        },
    }


def summary_lines(place: FilePath) -> Iterator[str]:
    """Yield the lines that describe an export to the user."""
    held = summary_of(place)
    craft = held["craft"]
    segments, states = (sum(one[key] for one in craft.values()) for key in ("segments", "states"))
    yield f"{held['to']}: {len(craft)} craft in {held['frame']} about {held['center']}, from {held['epoch']}"
    off = held["interpolation_error_m"]
    yield f"{states} states in {segments} segments; interpolation error at most {off:.1e} m"
    yield f"{len(held['files']) - 1} files in {place}"


def file_frame(source: Source, to: str, asked: str | None) -> FileFrame:
    """Return the frame of the files. Raises ValueError if the source cannot provide it."""
    instance("frame", asked, str, type(None))
    chief, epoch = source.chief, source.epoch
    wanted = FRAME_NAMES.get(asked.lower(), asked) if asked is not None else None
    if wanted is not None and wanted.upper() in OTHER_AXES:
        raise ValueError(f"frame: {asked} is not the chief's Hill frame in CCSDS; use {ROTATING}")
    if epoch is None:
        raise ValueError(f"{to}: requires an epoch; {source.remedy}")
    if source.mean_motion == 0.0:
        return in_deep_space(to, wanted, epoch)
    if wanted == ROTATING:
        if to in INERTIAL_ONLY:
            raise ValueError(f"frame: {to} holds inertial states; leave the frame out")
        hill = f"Hill's equations with a mean motion of {source.mean_motion:.15e} rad/s"
        turning = (
            f"{ROTATING}: x radial outward, y along-track, z cross-track about the formation's origin;",
            f"y and z are {'straight' if source.beside else 'arc lengths'}, velocities are relative to the "
            "rotating axes;",
            source.beside or hill,
        )
        return FileFrame(ROTATING, ORIGIN, epoch, None, turning)
    if chief is None:
        more = f", and {ROTATING} does not" * (to not in INERTIAL_ONLY)
        raise ValueError(f"{to}: inertial states require the chief's orbit{more}; {source.remedy}")
    if wanted is not None and wanted.upper() != chief.frame.upper():
        raise ValueError(f"frame: {asked} is not the chief's frame; use {chief.frame} or {ROTATING}")
    refuse_unknown(to, chief)
    if source.beside:
        about = (f"a plan from {source.beside}, mapped exactly to inertial states",)
        return FileFrame(chief.frame, chief.center, epoch, chief, about, turning_with(source, chief))
    mapped = (
        "a plan from Hill's equations relative to the chief's orbit, mapped exactly to inertial states;",
        "oblateness and drag act on the chief's orbit alone, if at all",
    )
    return FileFrame(chief.frame, chief.center, epoch, chief, mapped)


def turning_with(source: Source, chief: Chief) -> Callable[[Floats, Floats], Floats]:
    """Return the map to inertial states from the frame that turns with a scenario's chief in its model."""
    from closeform.dynamics.force_model.field import Field  # only these runs need it

    assert source.scenario is not None
    field = Field(chief, 2 if source.scenario.orbit.model == "j2" else 0)

    def mapped(times: Floats, relative: Floats) -> Floats:
        states, acceleration = field._chief_at(times)
        return inertial_from_relative(states, relative, acceleration=acceleration)

    return mapped


def refuse_unknown(to: str, chief: Chief) -> None:
    """Raise ValueError for a frame or central body that a format cannot represent."""
    known = {"stk": tuple(SYSTEMS), "spk": FIXED, "czml": FIXED}.get(to)
    if known is not None and chief.frame.upper() not in known:
        raise ValueError(f"{to}: cannot represent frame {chief.frame}; give a chief in {', '.join(known)}")
    bodies = {"spk": tuple(spk.CODES), "czml": ("EARTH",)}.get(to)
    if bodies is not None and chief.center.upper() not in bodies:
        raise ValueError(f"{to}: cannot represent center {chief.center}; use one of {', '.join(bodies)}")


def in_deep_space(to: str, name: str | None, epoch: Epoch) -> FileFrame:
    """Return the scenario's non-rotating axes under the name of a standard frame."""
    if to in INERTIAL_ONLY:
        raise ValueError(f"{to}: requires a central body, and deep space has none; export an oem")
    if name is None or name == ROTATING:
        raise ValueError("frame: missing; in deep space name the axes of the scenario, for example ICRF")
    still = ("states of the plan relative to the formation's origin, along non-rotating axes",)
    return FileFrame(name, ORIGIN, epoch, None, still)


def of_each(suffix: str, text: Callable[[Track, FileFrame], str]) -> Writer:
    """Return a writer of one file per craft with the given text."""

    def write(made: Export, place: Folder) -> None:
        for name, track in zip(file_names([one.name for one in made.tracks]), made.tracks, strict=True):
            place.text(f"{name}.{suffix}", text(track, made.frame))

    return write


def write_aem(made: Export, place: Folder) -> None:
    """Write an AEM of each craft that searched."""
    found = made.source.attitudes
    if not found:
        raise ValueError("aem: no craft searches, and only searches have attitudes; export an oem")
    for name, (craft, turns) in zip(file_names(list(found)), found.items(), strict=True):
        place.text(f"{name}.aem", aem(craft, made.source.designators[craft], made.frame, turns))


def write_cdm(made: Export, place: Folder) -> None:
    """Write a CDM of each conflict."""
    from closeform.exchange.ccsds.cdm import write_cdm
    from closeform.results.conjunction_messages import messages  # imported late: compiles kernels

    found = list(messages(made.source, made.frame))
    names = file_names([name for name, _, _ in found])
    for name, (_, conjunction, comments) in zip(names, found, strict=True):
        write_cdm(place.path / f"{name}.cdm", conjunction, comments=comments)


def write_csv(made: Export, place: Folder) -> None:
    """Write one table of all craft."""
    place.text("states.csv", csv_text(made.tracks, made.frame))


def write_czml(made: Export, place: Folder) -> None:
    """Write one CZML document of all craft."""
    place.text("formation.czml", czml(made.tracks, made.frame, made.source.title))


def write_spk(made: Export, place: Folder) -> None:
    """Write one SPK kernel of all craft, and a text kernel with their names."""
    spk.write_spk(place.path / "formation.bsp", made.tracks, made.frame)
    place.text("formation.tf", spk.names(made.tracks))


WRITERS: dict[str, Writer] = {
    "oem": of_each("oem", oem),
    "oem-xml": of_each("xml", oem_xml),
    "opm": of_each("opm", opm),
    "ocm": of_each("ocm", ocm),
    "aem": write_aem,
    "cdm": write_cdm,
    "csv": write_csv,
    "stk": of_each("e", stk),
    "czml": write_czml,
    "spk": write_spk,
}
