"""Every figure that a run prints, in full and in SI units, for `summary.json`."""

from math import pi
from pathlib import Path
from typing import Any

from closeform.chapters import conflicts_known, verdict
from closeform.chapters.limits import spendings, thrusts
from closeform.chapters.searches import covered, one_round
from closeform.conflicts.flight import Flight
from closeform.mission import Mission
from closeform.scenario import Gather
from closeform.search.gathering import EventKind, Gathering
from closeform.search.schedule import Search
from closeform.stage_results import Change, FirstLocks, Leg, Reshaping


def summary(mission: Mission) -> dict[str, Any]:
    """Every figure printed, in full."""
    scenario = mission.scenario
    return {
        "title": scenario.title,
        "inputs": {Path(scenario.file).name: f"sha256:{scenario.digest}"},
        "seed": scenario.study.seed if scenario.study is not None and scenario.case is not None else None,
        "case": scenario.case,
        "status": 0 if mission.clear else 1,
        "verdict": verdict(mission),
        "warnings": list(mission.warnings),
        "mean_motion_rad_s": mission.orbit.mean_motion,
        "craft": list(scenario.names),
        "delta_v_m_s": dict(zip(scenario.names, mission.delta_v.sum(axis=0).tolist(), strict=True)),
        "propellant_kg": dict(zip(scenario.names, mission.propellant.sum(axis=0).tolist(), strict=True)),
        "stages": [leg_summary(leg) | limits_summary(mission, k) for k, leg in enumerate(mission.legs)],
    }


def leg_summary(leg: Leg) -> dict[str, Any]:
    """One stage."""
    figures: dict[str, Any] = {
        "number": leg.number,
        "name": leg.name or None,
        "do": leg.verb,
        "start_s": leg.start,
        "end_s": leg.end,
        "before": flight_summary(leg.before),
        "after": flight_summary(leg.after),
    }
    if isinstance(leg.deed, Change):
        figures["change"] = change_summary(leg.deed)
    if isinstance(leg.deed, Reshaping):
        figures["plan"] = plan_summary(leg.deed, leg.before)
    if isinstance(leg.deed, Gathering):
        rounds = leg.stage.rounds if isinstance(leg.stage, Gather) else 1
        figures["search"] = search_summary(one_round(leg.deed.search, rounds))
        figures["gathering"] = gathering_summary(leg.deed, leg)
    if isinstance(leg.deed, FirstLocks):
        figures["search"] = search_summary(leg.deed.search)
        figures["locks"] = locks_summary(leg.deed, leg.after.names)
    return figures


def limits_summary(mission: Mission, place: int) -> dict[str, Any]:
    """Who comes closest to its limits: by thrust in this stage, by what is spent up to its end."""
    if mission.legs[place].deed is None:
        return {}
    strains = (*thrusts(mission, place), *spendings(mission, place))
    found = {
        f"{at.what}_{at.unit}".replace("-", "_").replace("/", "_"): {
            "craft": at.craft,
            "used": at.used,
            "limit": at.limit,
        }
        for at in strains
    }
    return {"limits": found} if found else {}


def change_summary(change: Change) -> dict[str, Any]:
    """What a move changed."""
    avoidance = change.avoidance
    return {
        "craft": change.craft,
        "method": change.method,
        "ok": avoidance.ok,
        "status": str(avoidance.status),
        "reason": avoidance.reason,
        "extra_energy_m2_s3": avoidance.extra_energy,
        "proven": avoidance.proven,
        "exhausted": avoidance.exhausted,
        "tried": avoidance.tried,
        "contacts": [
            {"craft": change.others[at.obstacle], "time_s": at.time, "position_m": at.position.tolist()}
            for at in avoidance.contacts
        ],
        "direct": path_summary(change.direct),
        "around": path_summary(avoidance.path) if avoidance.path is not None else None,
    }


def plan_summary(deed: Reshaping, direct: Flight) -> dict[str, Any]:
    """How a formation moved together; slots count from 1."""
    plan = deed.plan
    return {
        "ok": plan.ok,
        "status": str(plan.status),
        "reason": plan.reason,
        "method": deed.method,
        "measures": list(deed.measures),
        "blocked": list(deed.blocked) or None,
        "asked_s": deed.asked,
        "energy_m2_s3": plan.energy,
        "delta_v_m_s": plan.delta_v,
        "lower_bound_m2_s3": plan.lower_bound,
        "gap": plan.gap,
        "proven": plan.proven,
        "tried": plan.tried,
        "craft": {
            name: {
                "slot": int(plan.slots[k]) + 1,
                "start_s": float(plan.starts[k]),
                "end_s": float(plan.starts[k] + plan.durations[k]),
                "direct": path_summary(direct.path(name)),
                "flown": path_summary(plan.paths[k]) if plan.paths is not None else None,
            }
            for k, name in enumerate(deed.movers)
        },
        "touches": [
            {
                "pair": [deed.names[at.first], deed.names[at.second]],
                "time_s": at.time,
                "normal": at.normal.tolist(),
                "force_m_s3": at.force,
            }
            for at in plan.touches
        ],
    }


def search_summary(search: Search) -> dict[str, Any]:
    """A search, of a gathering one round: angles in radians, shares of the sky from 0 to 1."""
    names = dict.fromkeys(phase for phase, *_ in search.phases)
    return {
        "duration_s": search.duration,
        "slew_rate_rad_s": search.slew_rate,
        "tip_angle_rad": search.tip_angle,
        "sun_limit_rad": search.sun_limit,
        "sun_angle_rad": search.sun_angle,
        "sun_drift_rad": search.sun_drift,
        "longest_alignment_s": pi / search.slew_rate,
        "near_field_m": search.near_field,
        "near_field_of_pair_m": 2.0 * search.near_field,
        "coverage": {name or "all": covered(search, name) for name in (*names, None)},
        "phases": [
            {"phase": phase, "round": number, "start_s": start, "end_s": end}
            for phase, number, start, end in search.phases
        ],
        "legs": [
            {
                "phase": leg.phase,
                "round": leg.round,
                "start_s": leg.start,
                "end_s": leg.end,
                "about": leg.about,
                "angle_rad": leg.angle,
                "sun_angle_rad": leg.sun_angle,
            }
            for leg in search.legs
        ],
    }


def gathering_summary(gathering: Gathering, leg: Leg) -> dict[str, Any]:
    """A gathering; times count from the start of the stage."""
    names = leg.after.names
    return {
        "ok": gathering.ok,
        "status": str(gathering.status),
        "reason": leg.failure,
        "duration_s": gathering.duration,
        "rounds": gathering.rounds,
        "sun_motion_rad": gathering.search.sun_drift * gathering.duration / gathering.search.duration,
        "burns": gathering.burns,
        "totals_m_s": gathering.totals,
        "delta_v_m_s": dict(zip(names, map(float, gathering.delta_v), strict=True)),
        "total_delta_v_m_s": float(gathering.delta_v.sum()),
        "sets": [[names[k] for k in some] for some in gathering.sets],
        "lost": [names[k] for k in gathering.lost],
        "locks": sum(event.kind is EventKind.LOCK for event in gathering.events),
        "burns_count": sum(event.kind is not EventKind.LOCK for event in gathering.events),
        "conflicts_known": [known for _, known in conflicts_known(leg, gathering)],
    }


def locks_summary(found: FirstLocks, names: tuple[str, ...]) -> dict[str, Any]:
    """First locks; times count from the start of the stage."""
    locked = found.locks.leg >= 0
    return {
        "pairs": len(found.pairs),
        "locked": int(locked.sum()),
        "last_s": float(found.locks.time[locked].max()) if locked.any() else None,
        "missing": [[names[i], names[j]] for i, j in found.missing],
    }


def path_summary(path: Any) -> dict[str, float]:
    """What one path costs."""
    return {
        "energy_m2_s3": path.energy,
        "delta_v_m_s": path.delta_v,
        "peak_thrust_m_s2": path.peak_thrust,
    }


def flight_summary(flight: Flight) -> dict[str, Any]:
    """Conflicts and the closest pair."""
    close = flight.closest
    return {
        "conflicts": [
            {
                "pair": [met.first, met.second],
                "start_s": met.conflict.start,
                "end_s": met.conflict.end,
                "time_s": met.conflict.time,
                "ratio": met.conflict.ratio,
            }
            for met in flight.encounters
        ],
        "closest": None
        if close is None
        else {
            "pair": [close.first, close.second],
            "time_s": close.approach.time,
            "ratio": close.approach.ratio,
            "distance_m": close.approach.distance,
        },
    }
