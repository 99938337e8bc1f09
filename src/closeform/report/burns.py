"""The list of burns: impulses, pulses of thrusters, thrust from coast to coast; what pulses come to."""

from collections.abc import Iterator
from math import isfinite
from typing import Any

import numpy as np

from closeform.mission_result import Mission, StageResult
from closeform.report import effort
from closeform.report.picture import Picture
from closeform.report.table import MOST_ROWS, Column, Table, counted

NOTHING = 5e-7  # m/s


def speed(part: float) -> str:
    """A component [m/s]; 0 where it rounds to that."""
    return f"{part:+.6f}" if abs(part) >= NOTHING else "0"


BURN = (
    Column("craft", "craft", words=True),
    Column("at [s]", "start_s", "{:.1f}".format),
    Column("lasts [s]", "duration_s", "{:.1f}".format),
    Column("R [m/s]", "radial_m_s", speed),
    Column("T [m/s]", "along_track_m_s", speed),
    Column("N [m/s]", "cross_track_m_s", speed),
    Column("size [m/s]", "size_m_s", "{:.6f}".format),
    Column("thruster", "thruster", absent=""),
    effort.FUEL,
)
SHOT = (
    Column("craft", "craft", words=True),
    Column("pulses", "pulses"),
    Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format),
    Column("off the plan [m]", "deviation_m", "{:#.4g}".format),
    Column("at most [m]", "deviation_bound_m", "{:#.4g}".format),
    Column("dropped [m/s]", "dropped_m_s", "{:#.4g}".format),
    effort.FUEL,
)


def rows(mission: Mission, result: StageResult[Any, Any]) -> list[tuple[Any, ...]]:
    """Rows of BURN, in order of time: pulses where thrusters fire, else what the paths are pushed by."""
    found = [row for name in result.after.names for row in of_craft(mission, result, name)]
    return sorted(found, key=lambda row: row[1])


def of_craft(mission: Mission, result: StageResult[Any, Any], name: str) -> Iterator[tuple[Any, ...]]:
    """The burns of one craft."""
    from closeform.fuel.burns import burns_of, burns_of_pulses

    thruster: Any = None
    if result.pulsed is not None and name in result.pulsed.names:
        pulses, who = result.pulsed.firing.pulses, result.pulsed.names.index(name)
        burns, thruster = burns_of_pulses(pulses, who), pulses.thruster[pulses.craft == who].tolist()
    else:
        burns = burns_of(result.after.path(name))
    k = mission.scenario.names.index(name)
    so_far = [mission.burnt(result.number, k, spent) for spent in np.cumsum(burns.size).tolist()]
    columns = burns.start, burns.duration, *burns.push.T, burns.size
    for number, values in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
        burnt = so_far[number] - (so_far[number - 1] if number else 0.0)
        yield name, *values, thruster and thruster[number], burnt if isfinite(burnt) else None


def tables(mission: Mission, result: StageResult[Any, Any]) -> Iterator[Table]:
    """What pulses come to, and all burns; of very many for the page only."""
    if result.pulsed is not None:
        yield Table(
            "Pulses of thrusters", effort.shown(mission, SHOT, no_drops(result)), shots(mission, result)
        )
    found = rows(mission, result) if result.flown else []
    if found:
        plain = {"thruster"} if result.pulsed is None else set()
        title = "Burns" if result.pulsed is None else f"Burns, {counted(len(found), 'pulse')}"
        yield Table(title, effort.shown(mission, BURN, plain), found, folded=len(found) > MOST_ROWS)


def no_drops(result: StageResult[Any, Any]) -> set[str]:
    """The key of what is dropped, where nothing is."""
    assert result.pulsed is not None
    return set() if len(result.pulsed.firing.dropped) else {"dropped_m_s"}


def shots(mission: Mission, result: StageResult[Any, Any]) -> list[tuple[Any, ...]]:
    """Rows of SHOT."""
    if result.pulsed is None:
        return []
    found, firing = [], result.pulsed.firing
    for k, name in enumerate(result.pulsed.names):
        spent = float(firing.delta_v[k])
        burnt = mission.burnt(result.number, mission.scenario.names.index(name), spent)
        dropped = float(firing.dropped.impulse[firing.dropped.craft == k].sum())
        number, off, most = (
            int((firing.pulses.craft == k).sum()),
            float(firing.deviation[k]),
            float(firing.deviation_bound[k]),
        )
        found.append((name, number, spent, off, most, dropped, burnt if isfinite(burnt) else None))
    return found


def lines(result: StageResult[Any, Any]) -> Iterator[str]:
    """What room pulses were given, and whether they keep clear."""
    if result.pulsed is None:
        return
    room, firing, more = result.pulsed.room, result.pulsed.firing, 100.0 * (result.pulsed.room.larger - 1.0)
    k = int(np.argmax(firing.deviation))
    where = f"{firing.deviation[k]:.4g} m off the plan ({result.pulsed.names[k]})"
    if result.after.approaches:
        where += ", into zones" if result.after.conflicts else ", certified clear"
    yield f"Pulses lead up to {where}"
    if room.time:
        coasts = f"{room.before:.1f} s before it and {room.after:.1f} s after it"
        yield f"The plan leaves {coasts} for burns at its ends"
    if room.larger > 1.0:
        yield f"Planned for zones {more:.3g} % larger, for what pulses are off the plan"


def figures(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Any]:
    """The same for `summary.json`."""
    if result.pulsed is None:
        return {}
    room = result.pulsed.room
    return {
        "pulsed": {
            "before_s": room.before,
            "after_s": room.after,
            "zones_larger_by": room.larger,
            "craft": Table("", SHOT, shots(mission, result)).records,
        }
    }


def files(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Table]:
    """Every burn of a stage as flown."""
    return {"burns": Table("", BURN, rows(mission, result) if result.flown else [])}


def pictures(result: StageResult[Any, Any]) -> tuple[Picture, ...]:
    """Burns of everybody, and the pulses of who fires most."""
    if not result.flown:
        return ()
    who = [k for k, spent in enumerate(result.delta_v.tolist()) if spent > 0.0]
    if not who:
        return ()
    names = [result.after.names[k] for k in who]
    if result.pulsed is None:
        shown = result.after.paths[who]
        return (Picture("burns", "Burns of each craft", "burns", (shown,), {"names": names}),)
    firing, called = result.pulsed.firing, result.pulsed.names
    k = int(np.argmax(firing.delta_v))
    return (
        Picture("burns", "Pulses of each craft", "burns", (firing,), {"names": called}),
        Picture("pulses", f"Pulses of {called[k]}", "pulses", (firing, k, called[k])),
    )
