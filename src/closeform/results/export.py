"""`export`: what was flown in the files of other tools, in a folder of its own, whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

from closeform.arrays import instance, number, sequence, shown
from closeform.exchange import spk
from closeform.exchange.aem import aem
from closeform.exchange.chief import Chief
from closeform.exchange.czml import czml
from closeform.exchange.epochs import Epoch
from closeform.exchange.exported import ROTATING, FileFrame, Track, file_names
from closeform.exchange.ocm import ocm
from closeform.exchange.oem_text import oem, oem_xml, opm
from closeform.exchange.states_csv import csv_text
from closeform.exchange.stk import SYSTEMS, stk
from closeform.exchange.tracks import tracks
from closeform.mission.mission_result import Mission
from closeform.motion.path import Path
from closeform.results.export_source import Source, source_of
from closeform.results.load import LoadedRun
from closeform.storage.publishing import folder
from closeform.storage.result_folder import Folder, summary_of

SPOKEN = {"inertial": None, "hill": ROTATING, ROTATING.lower(): ROTATING}  # of a frame
ORIGIN = "FORMATION"  # the centre of what is told from the formation's origin
OTHER_AXES = ("LVLH", "LVLH_ROTATING", "VVLH", "RTN", "RSW", "RIC", "QSW")
FIXED = ("EME2000", "J2000", "ICRF", "GCRF")  # axes that do not follow the Earth's
INERTIAL_ONLY = ("cdm", "stk", "czml", "spk")


@dataclass(frozen=True, eq=False)
class Export:
    """What is being exported, in which frame, at which `step` [s]."""

    source: Source
    frame: FileFrame
    step: float | None

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """All craft."""
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
    """Write what was flown in the format of other tools.

    Parameters
    ----------
    result : Mission, LoadedRun or Path
        What `run` or `load` answers with; or paths of shape (N,) or of one craft.
    directory : str or path-like
        A folder that is not there yet, or empty.
    to : str
        "oem", "oem-xml", "opm", "ocm", "aem", "cdm", "csv", "stk", "czml" or "spk": docs/export.md says what
        is in each.
    chief : Chief, optional
        The orbit of the formation's origin; that of the scenario unless given.
    names : sequence of str, optional
        Of the craft of paths, in their order; "C1", "C2", ... unless given.
    frame : str, optional
        The chief's inertial frame by its name, which it is unless given; or "RSW_ROTATING", CCSDS's name for
        the axes of Hill's frame.  In deep space the name of the axes of the scenario.
    step : float [s], optional
        Between states; the longest that keeps interpolation within a micrometre unless given.
    overwrite : bool, default False
        Whether an earlier export in `directory` is replaced.

    Returns
    -------
    path-like
        The folder.

    Raises
    ------
    ValueError
        If there is no chief where one is needed, a word is unknown, a format does not hold what was flown (an
        AEM needs a search, a CDM conflicts and covariances), the step is too coarse, or the folder is taken.
    ImportError
        If an SPK is asked for without the extra `spice`.

    References
    ----------
    CCSDS 502.0-B-3, 504.0-B-2 and 508.0-B; docs/export.md.
    """
    instance("result", result, Mission, LoadedRun, Path)
    instance("directory", directory, str, PathLike)
    instance("chief", chief, Chief, type(None))
    if not isinstance(to, str) or to not in WRITERS:
        raise ValueError(f"to: {shown(to)} is no format; use one of {', '.join(WRITERS)}")
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
    """What `summary.json` of an export says."""
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


def told(place: FilePath) -> Iterator[str]:
    """What an export holds, in words."""
    held = summary_of(place)
    craft = held["craft"]
    segments, states = (sum(one[key] for one in craft.values()) for key in ("segments", "states"))
    yield f"{held['to']}: {len(craft)} craft in {held['frame']} about {held['center']}, from {held['epoch']}"
    off = held["interpolation_error_m"]
    yield f"{states} states in {segments} segments; between them off by up to {off:.1e} m by interpolation"
    yield f"{len(held['files']) - 1} files in {place}"


def file_frame(source: Source, to: str, asked: str | None) -> FileFrame:
    """The frame of the files. Raises ValueError where it cannot be had."""
    instance("frame", asked, str, type(None))
    chief, epoch = source.chief, source.epoch
    wanted = SPOKEN.get(asked.lower(), asked) if asked is not None else None
    if wanted is not None and wanted.upper() in OTHER_AXES:
        what = "is another frame, or each craft's own, to CCSDS"
        raise ValueError(f"frame: {asked} {what}; Hill's frame of the chief is {ROTATING}")
    if epoch is None:
        raise ValueError(f"{to}: needs an epoch; {source.remedy}")
    if source.mean_motion == 0.0:
        return in_deep_space(to, wanted, epoch)
    if wanted == ROTATING:
        if to in INERTIAL_ONLY:
            raise ValueError(f"frame: {to} holds inertial states; leave the frame out")
        turning = (
            f"{ROTATING}: x radial outward, y along-track, z cross-track about the formation's origin;",
            "y and z are arcs on its circle, velocities those that are seen in the turning axes;",
            f"Hill's equations with a mean motion of {source.mean_motion:.15e} rad/s",
        )
        return FileFrame(ROTATING, ORIGIN, epoch, None, turning)
    if chief is None:
        more = f", and {ROTATING} does not" * (to not in INERTIAL_ONLY)
        raise ValueError(f"{to}: inertial states need the chief's orbit{more}; {source.remedy}")
    if wanted is not None and wanted.upper() != chief.frame.upper():
        raise ValueError(f"frame: {asked} is not that of the chief; use {chief.frame} or {ROTATING}")
    refuse_unknown(to, chief)
    mapped = (
        "a plan by Hill's equations about the chief's orbit, mapped exactly to inertial states;",
        "forces that the plan leaves out (flattening, drag) are in the chief's orbit alone, if at all",
    )
    return FileFrame(chief.frame, chief.center, epoch, chief, mapped)


def refuse_unknown(to: str, chief: Chief) -> None:
    """Raise ValueError for a frame or body that a format has no word for."""
    known = {"stk": tuple(SYSTEMS), "spk": FIXED, "czml": FIXED}.get(to)
    if known is not None and chief.frame.upper() not in known:
        raise ValueError(f"{to}: has no word for the frame {chief.frame}; give a chief in {', '.join(known)}")
    bodies = {"spk": tuple(spk.CODES), "czml": ("EARTH",)}.get(to)
    if bodies is not None and chief.center.upper() not in bodies:
        raise ValueError(f"{to}: has no word for {chief.center}; known are {', '.join(bodies)}")


def in_deep_space(to: str, name: str | None, epoch: Epoch) -> FileFrame:
    """The scenario's own axes, which do not turn, by the name that they have elsewhere."""
    if to in INERTIAL_ONLY:
        raise ValueError(f"{to}: holds states about a body, and deep space has none; export an oem")
    if name is None or name == ROTATING:
        raise ValueError("frame: in deep space the axes are the scenario's own; name them, as ICRF")
    still = ("states are those of the plan from the formation's origin, along axes that do not turn",)
    return FileFrame(name, ORIGIN, epoch, None, still)


def of_each(suffix: str, text: Callable[[Track, FileFrame], str]) -> Writer:
    """A file of each craft with such a text."""

    def write(made: Export, place: Folder) -> None:
        for name, track in zip(file_names([one.name for one in made.tracks]), made.tracks, strict=True):
            place.text(f"{name}.{suffix}", text(track, made.frame))

    return write


def write_aem(made: Export, place: Folder) -> None:
    """An AEM of each craft that searched."""
    found = made.source.attitudes
    if not found:
        raise ValueError("aem: nobody searches, and only searches have attitudes; export an oem")
    for name, (craft, turns) in zip(file_names(list(found)), found.items(), strict=True):
        place.text(f"{name}.aem", aem(craft, made.source.designators[craft], made.frame, turns))


def write_cdm(made: Export, place: Folder) -> None:
    """A CDM of each conflict."""
    from closeform.exchange.cdm import write_cdm
    from closeform.results.conflict_messages import messages  # with kernels, which no other format needs

    found = list(messages(made.source))
    names = file_names([name for name, _, _ in found])
    for name, (_, conjunction, comments) in zip(names, found, strict=True):
        write_cdm(place.path / f"{name}.cdm", conjunction, comments=comments)


def write_csv(made: Export, place: Folder) -> None:
    """One table of all craft."""
    place.text("states.csv", csv_text(made.tracks, made.frame))


def write_czml(made: Export, place: Folder) -> None:
    """One CZML of all craft."""
    place.text("formation.czml", czml(made.tracks, made.frame, made.source.title))


def write_spk(made: Export, place: Folder) -> None:
    """One kernel of all craft, and their names."""
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
