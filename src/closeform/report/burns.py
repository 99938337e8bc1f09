"""Burns of a stage: impulses, thruster pulses and continuous thrust, and the effect of pulses."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from math import isfinite
from typing import Any

import numpy as np

from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.stage_burns import burns_in
from closeform.report import effort
from closeform.report.picture import Picture
from closeform.report.table import MOST_ROWS, Column, Table, counted

NOTHING = 5e-7  # m/s: half of the last printed digit
TELLING = 1e-5  # m/s: the smallest burn that is listed


def speed(part: float) -> str:
    """Return a component of velocity [m/s] as text, "0" if it rounds to zero."""
    return f"{part:+.6f}" if abs(part) >= NOTHING else "0"


BURN = (
    Column("craft", "craft", words=True),
    Column("at [s]", "start_s", "{:.1f}".format, since="mission"),
    Column("lasts [s]", "duration_s", "{:.1f}".format),
    Column("R [m/s]", "radial_m_s", speed),
    Column("T [m/s]", "along_track_m_s", speed),
    Column("N [m/s]", "cross_track_m_s", speed),
    Column("size [m/s]", "size_m_s", "{:.6f}".format),
    Column("thruster", "thruster", absent=""),
    effort.FUEL,
)
SIZE = [column.key for column in BURN].index("size_m_s")
SHOT = (
    Column("craft", "craft", words=True),
    Column("pulses", "pulses"),
    Column("planned [m/s]", "planned_m_s", "{:#.6g}".format),
    Column("fired [m/s]", "delta_v_m_s", "{:#.6g}".format),
    Column("off plan [m]", "deviation_m", "{:#.4g}".format),
    Column("at most [m]", "deviation_bound_m", "{:#.4g}".format),
    Column("dropped [m/s]", "dropped_m_s", "{:#.4g}".format),
    effort.FUEL,
)


@dataclass(frozen=True, eq=False)
class StageBurns:
    """Burns that are executed in a stage."""

    mission: Mission
    result: StageResult[Any, Any]

    @cached_property
    def rows(self) -> list[tuple[Any, ...]]:
        """Rows of BURN in order of time: pulses of thrusters, or else the thrust of the paths."""
        return burns_in(self.result, partial(self.mission.burnt, self.result.number))

    @cached_property
    def shots(self) -> list[tuple[Any, ...]]:
        """Rows of SHOT, one per spacecraft that fires pulses."""
        if self.result.pulsed is None:
            return []
        found, firing = [], self.result.pulsed.firing
        for k, name in enumerate(self.result.pulsed.names):
            planned = effort.asked(self.mission, self.result, name, firing.planned[k])
            spent = float(firing.delta_v[k])
            burnt = self.mission.burnt(self.result.number, self.mission.scenario.names.index(name), spent)
            dropped = float(firing.dropped.impulse[firing.dropped.craft == k].sum())
            number, off, most = (
                int((firing.pulses.craft == k).sum()),
                float(firing.deviation[k]),
                float(firing.deviation_bound[k]),
            )
            fuel = burnt if isfinite(burnt) else None
            found.append((name, number, planned, spent, off, most, dropped, fuel))
        return found

    @property
    def tables(self) -> Iterator[Table]:
        """The tables of pulses and of burns; long ones are folded."""
        pulsed = self.result.pulsed
        if pulsed is not None:
            drops = set() if len(pulsed.firing.dropped) else {"dropped_m_s"}
            yield Table("Pulses of thrusters", effort.shown(self.mission, SHOT, drops), self.shots)
        if self.result.flown and self.rows:
            plain = {"thruster"} if pulsed is None else set()
            title = "Burns" if pulsed is None else f"Burns, {counted(len(self.rows), 'pulse')}"
            columns = effort.shown(self.mission, BURN, plain)
            some = [row for row in self.rows if row[SIZE] >= TELLING]
            if left := len(self.rows) - len(some):
                title += f", without {left} below {1e3 * TELLING:g} mm/s, which burns.parquet has"
            yield Table(title, columns, some, folded=len(some) > MOST_ROWS)

    @property
    def figures(self) -> dict[str, Any]:
        """The results of pulses, for `summary.json`."""
        if self.result.pulsed is None:
            return {}
        room = self.result.pulsed.room
        return {
            "pulsed": {
                "before_s": room.before,
                "after_s": room.after,
                "zones_larger_by": room.larger,
                "short": self.result.pulsed.short,
                "craft": Table("", SHOT, self.shots).records,
            }
        }

    @property
    def files(self) -> dict[str, Table]:
        """All burns of an executed stage, for Parquet."""
        return {"burns": Table("", BURN, self.rows if self.result.flown else [])}


def lines(mission: Mission, result: StageResult[Any, Any]) -> Iterator[str]:
    """Yield the delta-v and the deviation of pulses, and the margins of the plan for them."""
    if result.pulsed is None:
        return
    room, firing, more = result.pulsed.room, result.pulsed.firing, 100.0 * (result.pulsed.room.larger - 1.0)
    k = int(np.argmax(firing.deviation))
    where = f"{firing.deviation[k]:.4g} m off the plan ({result.pulsed.names[k]})"
    if result.after.approaches:
        where += ", into zones" if result.after.conflicts else ", certified clear"
    names, fired = result.pulsed.names, float(np.sum(firing.delta_v))
    planned = sum(effort.asked(mission, result, name, firing.planned[k]) for k, name in enumerate(names))
    yield f"Delta-v fired {fired:.6g} m/s, for {planned:.6g} m/s planned"
    yield f"Pulses lead up to {where}"
    if room.time:
        coasts = f"{room.before:.1f} s before it and {room.after:.1f} s after it"
        yield f"The plan leaves {coasts} for burns at its ends"
    if room.larger > 1.0:
        yield f"Planned for zones {more:.3g} % larger, for what pulses are off the plan"
    if result.pulsed.short is not None:
        yield f"Pulses would need more room, but for {result.pulsed.short}"


def pictures(result: StageResult[Any, Any]) -> tuple[Picture, ...]:
    """Return pictures of the burns of all spacecraft, and of the pulses of the one that fires most."""
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
