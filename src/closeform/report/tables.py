"""The tables of a run as columns, for Parquet."""

from collections.abc import Iterator
from math import isfinite
from typing import Any

import numpy as np

from closeform.conflicts.flight import Flight
from closeform.mission import Mission
from closeform.report.summary import path_summary
from closeform.search.gathering import Gathering
from closeform.stage_results import FirstLocks, Leg, Reshaping

SAMPLES = 201  # instants of each craft and stage in paths.parquet
STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
THRUST_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")


def tables(mission: Mission) -> dict[str, dict[str, Any]]:
    """Every table by its name; those of searches only where there is one."""
    found: dict[str, dict[str, Any]] = {
        "conflicts": conflict_table(mission),
        "approaches": approach_table(mission),
        "paths": path_table(mission),
        "craft": craft_table(mission),
    }
    deeds = [leg.deed for leg in mission.legs]
    if any(isinstance(deed, Gathering) for deed in deeds):
        found |= {"events": event_table(mission), "sets": set_table(mission)}
    if any(isinstance(deed, FirstLocks) for deed in deeds):
        found["locks"] = lock_table(mission)
    return found


def flights(mission: Mission) -> Iterator[tuple[Leg, str, Flight]]:
    """Every stage's flight before avoidance and after it."""
    for leg in mission.legs:
        yield leg, "before", leg.before
        yield leg, "after", leg.after


def columns(names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> dict[str, list[Any]]:
    """Rows as columns; also without any row."""
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def conflict_table(mission: Mission) -> dict[str, list[Any]]:
    """Every conflict of every stage, before and after avoidance."""
    rows = [
        (
            leg.number,
            when,
            met.first,
            met.second,
            *(getattr(met.conflict, key) for key in ("start", "end")),
            met.conflict.time,
            met.conflict.ratio,
        )
        for leg, when, flight in flights(mission)
        for met in flight.encounters
    ]
    return columns(("stage", "when", "first", "second", "start_s", "end_s", "time_s", "ratio"), rows)


def approach_table(mission: Mission) -> dict[str, list[Any]]:
    """Every pair's closest approach in every stage, before and after avoidance."""
    rows = [
        (
            leg.number,
            when,
            pair.first,
            pair.second,
            pair.approach.time,
            pair.approach.ratio,
            pair.approach.distance,
        )
        for leg, when, flight in flights(mission)
        for pair in flight.nearest
    ]
    return columns(("stage", "when", "first", "second", "time_s", "ratio", "distance_m"), rows)


def craft_table(mission: Mission) -> dict[str, list[Any]]:
    """What every craft spends in every stage as flown, and the slot it took, null where there is none."""
    rows = []
    for leg, burnt in zip(mission.legs, mission.propellant.tolist(), strict=True):
        slots = {}
        if isinstance(leg.deed, Reshaping):
            slots = dict(zip(leg.deed.movers, (int(k) + 1 for k in leg.deed.plan.slots), strict=True))
        for k, name in enumerate(mission.scenario.names):
            mass = burnt[k] if isfinite(burnt[k]) else None
            rows.append((leg.number, name, slots.get(name), *path_summary(leg.after.paths[k]).values(), mass))
    keys = ("stage", "craft", "slot", "energy_m2_s3", "delta_v_m_s", "peak_thrust_m_s2", "propellant_kg")
    return columns(keys, rows)


def path_table(mission: Mission) -> dict[str, Any]:
    """States and thrusts as flown, at equal steps of every stage, to look at and to plot."""
    names = np.array(mission.scenario.names)
    parts: list[dict[str, Any]] = []
    for leg in mission.legs:
        times = np.linspace(leg.start, leg.end, SAMPLES)
        states, thrusts = leg.after.paths.state(times), leg.after.paths.thrust(times)
        parts.append(
            {
                "stage": np.full(len(names) * SAMPLES, leg.number),
                "craft": np.repeat(names, SAMPLES),
                "time_s": np.tile(times, len(names)),
                **dict(zip(STATE_COLUMNS, states.reshape(-1, 6).T, strict=True)),
                **dict(zip(THRUST_COLUMNS, thrusts.reshape(-1, 3).T, strict=True)),
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def event_table(mission: Mission) -> dict[str, list[Any]]:
    """Every event of every gathering; times count from the start of the stage."""
    names = mission.scenario.names
    rows = [
        (
            leg.number,
            event.time,
            str(event.kind),
            names[event.first],
            names[event.second] if event.second >= 0 else None,
            event.phase,
            event.round,
            event.case,
            event.label,
            *map(float, event.delta_v),
        )
        for leg in mission.legs
        if isinstance(leg.deed, Gathering)
        for event in leg.deed.events
    ]
    keys = ("stage", "time_s", "kind", "first", "second", "phase", "round", "case", "label")
    return columns((*keys, "dvx_m_s", "dvy_m_s", "dvz_m_s"), rows)


def set_table(mission: Mission) -> dict[str, list[Any]]:
    """Which set each craft is in when a gathering ends: 0 the formation set, k a knowledge set, -1 lost."""
    rows = []
    for leg in mission.legs:
        if isinstance(leg.deed, Gathering):
            gathering = leg.deed
            label = {k: number for number, some in enumerate(gathering.sets) for k in some}
            rows += [
                (leg.number, name, group, label.get(k, -1), float(spent))
                for k, (name, group, spent) in enumerate(
                    zip(leg.after.names, gathering.groups, gathering.delta_v, strict=True)
                )
            ]
    return columns(("stage", "craft", "group", "set", "delta_v_m_s"), rows)


def lock_table(mission: Mission) -> dict[str, list[Any]]:
    """The first lock of each pair of a search without burns; null where there is none."""
    names = mission.scenario.names
    rows = []
    for leg in mission.legs:
        if isinstance(leg.deed, FirstLocks):
            found = leg.deed
            for (one, other), time, k in zip(found.pairs, found.locks.time, found.locks.leg, strict=True):
                there = found.search.legs[k] if k >= 0 else None
                when = (float(time), there.phase, there.round) if there is not None else (None, None, None)
                rows.append((leg.number, names[one], names[other], *when))
    return columns(("stage", "first", "second", "time_s", "phase", "round"), rows)
