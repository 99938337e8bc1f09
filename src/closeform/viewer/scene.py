"""Scene of a mission, the entry point of this package; web/scene.d.ts defines each field."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.report.description import fate
from closeform.search.leg import SUN
from closeform.viewer.events import events
from closeform.viewer.failures import failures
from closeform.viewer.fleet import Solids, fleet, pairs
from closeform.viewer.meetings import approaches, conflicts
from closeform.viewer.numbers import Numbers
from closeform.viewer.requirements import regions
from closeform.viewer.searches import locks, searches
from closeform.viewer.series import series
from closeform.viewer.shown import Shown
from closeform.viewer.thrusts import burns, thrusts
from closeform.viewer.tracks import error_for, tracks, tubes
from closeform.zones.outlines import drawn
from closeform.zones.zone import Zone

FORMAT = 1
MILLISECONDS = len("2026-03-01T12:00:00.000")
ORBITAL, INERTIAL = ["radial", "along-track", "cross-track"], ["x", "y", "z"]
WIDE = 1.0  # m: half-width of a scene without motion and zones


@dataclass(frozen=True, eq=False)
class Scene:
    """A `Scene` of web/scene.d.ts: its record, its numbers in base64, and the mission shown."""

    record: dict[str, Any]
    numbers: str
    shown: Shown


def scene_of(shown: Shown, pictures: Sequence[tuple[str, str]] = (), report: str | None = None) -> Scene:
    """Return the scene of a mission; its folder holds `pictures`, by name and title, and a `report`."""
    numbers, solids = Numbers(), Solids()
    zones, corners = [zone for zone in shown.around if zone is not None], shown.corners
    error = error_for(corners, min((zone.inner_radius for zone in zones), default=None))
    corners = with_room(corners, zones)
    craft = fleet(shown, solids, float(np.linalg.norm(corners[1] - corners[0])))
    ways = tracks(shown, numbers, error)
    lost = failures(shown, numbers, ways, error)
    kept = pairs(shown.zones, solids)
    record = {
        **header(shown),
        "error": error,
        "low": corners[0].tolist(),
        "high": corners[1].tolist(),
        "craft": craft,
        "zones": solids.records,
        "pairs": kept,
        "regions": regions(shown, solids),
        "stages": stages(shown),
        "tracks": ways,
        "searches": searches(shown, numbers),
        "thrusts": thrusts(shown, numbers),
        "burns": burns(shown, numbers),
        "locks": locks(shown),
        "conflicts": conflicts(shown),
        "approaches": approaches(shown),
        "failures": lost,
        "tubes": tubes(shown, numbers),
        "events": events(shown),
        "series": series(shown, numbers),
        "pictures": [{"name": name, "title": title} for name, title in pictures],
        "report": report,
    }
    return Scene(record, numbers.text, shown)


def header(shown: Shown) -> dict[str, Any]:
    """Return the general fields of the scene and its verdict."""
    results, orbit = shown.results, shown.orbit
    searched = any(result.stage.searches for result in results)
    return {
        "format": FORMAT,
        "title": shown.title,
        "opening": shown.opening,
        "verdict": shown.verdict,
        "ok": shown.ok,
        "warnings": list(shown.warnings),
        "start": results[0].start,
        "end": results[-1].end,
        "epoch": epoch_of(shown),
        "mean_motion": 2.0 * pi / orbit.period,
        "period": orbit.period if isfinite(orbit.period) else None,
        "axes": ORBITAL if isfinite(orbit.period) else INERTIAL,
        "sun": SUN.tolist() if searched else None,
    }


def epoch_of(shown: Shown) -> str | None:
    """Return the UTC of time 0 to the millisecond in the format of browsers; None without an epoch."""
    return None if shown.epoch is None else str(shown.epoch.utc([0.0])[0])[:MILLISECONDS] + "Z"


def stages(shown: Shown) -> list[dict[str, Any]]:
    """Return every `Stage` of web/scene.d.ts."""
    return [
        {
            "number": result.number,
            "kind": result.stage.verb,
            "title": fate(result),
            "start": result.start,
            "end": result.end,
            "failure": result.failure,
            "executed": result.executed,
        }
        for result in shown.results
    ]


def with_room(corners: Floats, zones: Sequence[Zone]) -> Floats:
    """Return the box (2, 3) [m], enlarged on each side by the largest zone."""
    reach = np.max([drawn(zone).extents for zone in zones], axis=0, initial=0.0) if zones else np.zeros(3)
    wide = float(np.linalg.norm(corners[1] - corners[0] + 2.0 * reach))
    reach = reach if wide > 0.0 else np.full(3, WIDE)
    return np.array([corners[0] - reach, corners[1] + reach])
