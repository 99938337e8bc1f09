"""START HERE: the scene of a mission, all that its page shows; web/scene.d.ts says what each field means."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission_result import Mission
from closeform.plots.zones_and_tracks import drawn
from closeform.report.run import RunReport
from closeform.report.section import fate
from closeform.search.leg import SUN
from closeform.viewer.events import events
from closeform.viewer.failures import failures
from closeform.viewer.fleet import around, fleet, pairs
from closeform.viewer.meetings import approaches, conflicts
from closeform.viewer.numbers import Numbers
from closeform.viewer.searches import locks, searches
from closeform.viewer.series import series
from closeform.viewer.solids import Solids
from closeform.viewer.thrusts import burns, thrusts
from closeform.viewer.tracks import box, error_for, tracks
from closeform.viewer.tubes import tubes
from closeform.zones.zone import Zone

FORMAT = 1
MILLISECONDS = len("2026-03-01T12:00:00.000")
ORBITAL, INERTIAL = ["radial", "along-track", "cross-track"], ["x", "y", "z"]
WIDE = 1.0  # m, of a scene in which nothing moves and nobody has a zone


@dataclass(frozen=True, eq=False)
class Scene:
    """A `Scene` of web/scene.d.ts: its record, and the numbers that it points to, in base64."""

    record: dict[str, Any]
    numbers: str


def scene_of(mission: Mission, pictures: Sequence[tuple[str, str]] = (), report: str | None = None) -> Scene:
    """The scene of a mission, whose folder holds `pictures`, by name and title, and a `report`."""
    numbers, solids = Numbers(), Solids()
    zones = [zone for k in range(len(mission.scenario.craft)) if (zone := around(mission, k)) is not None]
    corners = box(mission)
    error = error_for(corners, min((zone.inner_radius for zone in zones), default=None))
    corners = with_room(corners, zones)
    craft = fleet(mission, solids, float(np.linalg.norm(corners[1] - corners[0])))
    ways = tracks(mission, numbers, error)
    lost = failures(mission, numbers, ways, error)
    kept = pairs(mission.scenario.zones, solids)
    record = {
        **header(mission),
        "error": error,
        "low": corners[0].tolist(),
        "high": corners[1].tolist(),
        "craft": craft,
        "zones": solids.records,
        "pairs": kept,
        "stages": stages(mission),
        "tracks": ways,
        "searches": searches(mission, numbers),
        "thrusts": thrusts(mission, numbers),
        "burns": burns(mission, numbers),
        "locks": locks(mission),
        "conflicts": conflicts(mission),
        "approaches": approaches(mission),
        "failures": lost,
        "tubes": tubes(mission, numbers),
        "events": events(mission),
        "series": series(mission, numbers),
        "pictures": [{"name": name, "title": title} for name, title in pictures],
        "report": report,
    }
    return Scene(record, numbers.text)


def header(mission: Mission) -> dict[str, Any]:
    """What the scene is, and how it ended."""
    results, orbit = mission.results, mission.orbit
    searched = any(result.stage.searches for result in results)
    return {
        "format": FORMAT,
        "title": mission.scenario.title,
        "opening": RunReport(mission).opening,
        "verdict": str(mission.verdict),
        "ok": mission.verdict.ok,
        "warnings": list(mission.warnings),
        "start": results[0].start if results else 0.0,
        "end": results[-1].end if results else 0.0,
        "epoch": epoch_of(mission),
        "mean_motion": orbit.mean_motion,
        "period": orbit.period if isfinite(orbit.period) else None,
        "axes": ORBITAL if orbit.mean_motion else INERTIAL,
        "sun": SUN.tolist() if searched else None,
    }


def epoch_of(mission: Mission) -> str | None:
    """UTC at time 0 to the millisecond, as browsers read it; None without an epoch."""
    epoch = mission.scenario.epoch
    return None if epoch is None else str(epoch.utc([0.0])[0])[:MILLISECONDS] + "Z"


def stages(mission: Mission) -> list[dict[str, Any]]:
    """Every `Stage`."""
    return [
        {
            "number": result.number,
            "kind": result.stage.verb,
            "title": fate(result),
            "start": result.start,
            "end": result.end,
            "failure": result.failure,
            "flown": result.flown,
        }
        for result in mission.results
    ]


def with_room(corners: Floats, zones: Sequence[Zone]) -> Floats:
    """A box (2, 3) with room for the largest of some zones on each side."""
    reach = np.max([drawn(zone).extents for zone in zones], axis=0, initial=0.0) if zones else np.zeros(3)
    wide = float(np.linalg.norm(corners[1] - corners[0] + 2.0 * reach))
    reach = reach if wide > 0.0 else np.full(3, WIDE)
    return np.array([corners[0] - reach, corners[1] + reach])
