"""Simulate many random plans in the high-fidelity model under feedback, and count conflicts.

    python tools/simulate_plans.py --plans 1000 --results flights.csv
    python tools/simulate_plans.py --plans 150 --results held-out.csv --held-out
    python tools/simulate_plans.py --plans 400 --open-loop

Each plan has the margin of `fit_margin` at four sigmas, and is simulated once with compensated thrust. The
model has J2 and differential drag; the compensation knows only J2. Thrust is exact, or has constant errors of
up to 1 % and 1 degree, uniformly sampled. Horizon, sigmas and error model are fixed here. Orbits are at 400,
500 and 800 km, with inclinations of 30, 51.6 and 97.4 degrees and eccentricities from 0.0005 to 0.01. With
--held-out they are at 600 and 700 km and 45, 63.4 and 82 degrees, with other tasks. Each plan has its own
random stream. Each finished plan is a line of the results, and the same command continues from there; without
--results it starts anew. With --open-loop the planned thrust is simulated in the full model, and then thrust
compensated for it.
"""

import argparse
import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np

import closeform as cf

EPOCH = "2026-11-22T12:00:00"
ORBITS = (400e3, 500e3, 800e3), (30.0, 51.6, 97.4)
OTHERS = (600e3, 700e3), (45.0, 63.4, 82.0)
SIGHTS = {"10 cm, 0.3 mm/s": cf.Navigation(0.1, 3e-4), "1 m, 1 mm/s": cf.Navigation(1.0, 1e-3)}
FEEDBACKS = {"10 cm, 0.3 mm/s": cf.Feedback(60.0, 600.0), "1 m, 1 mm/s": cf.Feedback(60.0, 1200.0)}
THRUSTS = {"exact": (0.0, 0.0), "off": (0.01, np.radians(1.0))}
AIR = 5.2e-13, 500e3, 60e3  # kg/m^3 at m, m
LAG = 1.7e-7  # m/s^2: effect of 10 % more drag at 400 km, the lowest orbit
COLUMNS = ["plan", "seed", "altitude_km", "inclination_deg", "eccentricity", "craft", "duration_s", "zone_m"]
COLUMNS += ["navigation", "thrust", "rounds", "margin_m", "left_m", "plan_dv", "flown_dv"]


def fields(draws: np.random.Generator, count: int, orbits: Any = ORBITS) -> tuple[cf.Field, cf.Field]:
    """Return the force model of the simulation and the known one."""
    a = cf.elements.EARTH_RADIUS + draws.choice(orbits[0])
    e, way = 10 ** draws.uniform(-3.3, -2.0), draws.uniform(0.0, 2.0 * np.pi)
    elements = [a, draws.uniform(0.0, 6.28), e * np.cos(way), e * np.sin(way)]
    chief = cf.Chief.from_elements(EPOCH, [*elements, np.radians(draws.choice(orbits[1])), 0.3])
    ballistic = np.where(np.arange(count) % 2, 0.022, 0.02)
    return cf.Field(chief, drag=cf.Drag(*AIR, ballistic, 0.02, spin=0.0)), cf.Field(chief)


def task(draws: np.random.Generator, orbit: cf.Orbit, count: int) -> tuple[Any, Any, float, float]:
    """Return states of two relative orbits, a duration and the radius of a zone."""
    size = 10 ** draws.uniform(2.0, 3.1)
    states = draws.normal(size=(2, count, 6)) * size * np.repeat([0.5, 0.5 * orbit.mean_motion], 3)
    states[..., 4] = -2.0 * orbit.mean_motion * states[..., 0]
    duration = 60.0 * round(draws.uniform(0.25, 2.0) * orbit.period / 60.0)
    return *states, duration, draws.uniform(0.05, 0.2) * size


def rows(seed: int, held_out: bool) -> list[list[Any]]:
    """Return the results of one plan for each thrust model; none for a task without active constraints."""
    draws = np.random.Generator(np.random.Philox(key=[seed, int(held_out)]))
    count = int(draws.integers(3, 7))
    field, known = fields(draws, count, OTHERS if held_out else ORBITS)
    orbit = field.chief.orbit
    start, final, duration, radius = task(draws, orbit, count)
    zone = cf.Sphere(radius)

    def planned(margin: Any) -> cf.Plan:
        return cf.reconfigure(orbit, start, final, duration, zone, margin=margin)

    tight, found = planned(0.0), []
    chief, turning = field.chief, np.cross(field.chief.state[:3], field.chief.state[3:])
    tilt = np.degrees(np.arccos(turning[2] / np.linalg.norm(turning)))
    about = [(chief.semi_major_axis - cf.elements.EARTH_RADIUS) / 1e3, tilt, chief.eccentricity]
    for sight in SIGHTS if tight.contacts else ():
        for thrust, off in THRUSTS.items():
            how: Any = {"feedback": FEEDBACKS[sight], "navigation": SIGHTS[sight], "thrust_error": off}
            fit = cf.fit_margin(planned, known, zone, residual=LAG, **how)
            row = [0, seed, *about, count, duration, radius, sight, thrust, fit.rounds]
            if not fit.fits:  # the margin is wider than the gap between ends, as a rule
                found.append([*row, fit.greatest, np.nan, np.nan, np.nan])
                continue
            flight = cf.simulate(fit.plan, field, zones=zone, known=known, seeds=[seed], **how)
            left = (flight.least_ratio - 1.0) * radius
            dearer = fit.plan.delta_v / tight.delta_v - 1.0
            spent = flight.delta_v.sum() / fit.plan.delta_v - 1.0
            found.append([*row, fit.greatest, left, dearer, spent])
    return found


def done(path: Path | None) -> list[dict[str, str]]:
    """Return the complete lines of finished plans."""
    if path is None or not path.exists():
        return []
    with path.open(newline="") as lines:
        kept = [row for row in csv.DictReader(lines) if None not in row.values()]
    ways = len(SIGHTS) * len(THRUSTS)
    return kept[: len(kept) // ways * ways]


def told(lines: list[dict[str, str]]) -> int:
    """Print a table for each thrust model, and return the number of zones entered."""
    print(
        "navigation       thrust   plans  no room  entered  least left  margin: median  95 %   most", end=""
    )
    print("  plan's dv  flown: median    95 %")
    bad = 0
    for sight in SIGHTS:
        for thrust in THRUSTS:
            some = [row for row in lines if row["navigation"] == sight and row["thrust"] == thrust]
            of = {name: np.array([float(row[name]) for row in some]) for name in COLUMNS[-4:]}
            made = np.isfinite(of["left_m"])
            margin, left, dearer, spent = (of[name][made] for name in COLUMNS[-4:])
            bad += int((left < 0.0).sum())
            print(
                f"{sight:16s} {thrust:6s} {made.sum():7d} {(~made).sum():8d} {(left < 0.0).sum():8d} "
                f"{left.min():9.3f} m {np.median(margin):13.3f} m {np.quantile(margin, 0.95):5.2f} m "
                f"{margin.max():4.1f} m {np.median(dearer):9.3%} {np.median(spent):13.2%} "
                f"{np.quantile(spent, 0.95):8.1%}"
            )
    return bad


def open_loop(seed: int) -> list[float]:
    """Return the eccentricity, and the deviation at the end without and with compensation, of one task."""
    draws = np.random.Generator(np.random.Philox(key=[seed, 2]))
    count = int(draws.integers(3, 7))
    field, _ = fields(draws, count)
    path = field.chief.orbit.transfer(*task(draws, field.chief.orbit, count)[:3])
    off, kept = (cf.simulate(path, field, "open", cancel=one).ends.max() for one in (False, True))
    return [field.chief.eccentricity, float(off), float(kept)]


def told_open(number: int) -> None:
    """Print a table of simulations in open loop, by eccentricity."""
    found = np.array([open_loop(seed) for seed in range(number)])
    print("eccentricity    plans  off: median  compensated: median       most")
    for low, high in ((0.0, 1e-3), (1e-3, 3e-3), (3e-3, 1e-2)):
        some = found[(found[:, 0] > low) & (found[:, 0] <= high)][:, 1:].T
        off, kept = some
        print(
            f"to {high:<10g} {len(off):8d} {np.median(off):9.1f} m "
            f"{1e3 * np.median(kept):17.3f} mm {1e3 * kept.max():7.3f} mm"
        )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--plans", type=int, default=1000)
    parser.add_argument("--results", type=Path)
    parser.add_argument("--held-out", action="store_true")
    parser.add_argument("--open-loop", action="store_true")
    asked = parser.parse_args()
    if asked.open_loop:
        told_open(asked.plans)
        return 0
    lines = done(asked.results)
    if asked.results is not None:
        with asked.results.open("w", newline="") as out:  # without a line that was cut off
            csv.DictWriter(out, COLUMNS).writeheader()
            csv.DictWriter(out, COLUMNS).writerows(lines)
    ways = len(SIGHTS) * len(THRUSTS)
    seed = int(lines[-1]["seed"]) + 1 if lines else 0
    while len(lines) < ways * asked.plans:
        plan = len(lines) // ways
        for row in rows(seed, asked.held_out):
            row[0] = plan
            lines.append(dict(zip(COLUMNS, map(str, row), strict=True)))
        if asked.results is not None and len(lines) // ways > plan:
            with asked.results.open("a", newline="") as out:
                csv.DictWriter(out, COLUMNS).writerows(lines[-ways:])
        print(f"\r{len(lines) // ways} of {asked.plans}", end="", file=sys.stderr, flush=True)
        seed += 1
    print("\r", end="", file=sys.stderr)
    return told(lines) > 0


if __name__ == "__main__":
    sys.exit(main())
