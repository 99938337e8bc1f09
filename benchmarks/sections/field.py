"""High-fidelity model: model error, compensated thrust, simulation under feedback."""

import numpy as np

import closeform as cf
from tables import Figure, Report, Table, seconds
from timing import say, timed

EPOCH = "2026-11-22T12:00:00"
CHIEF = cf.Chief.from_elements(EPOCH, [6.878e6, 0.7, 1e-3, 0.0, np.radians(51.6), 0.3])
FIELD, ORBIT = cf.Field(CHIEF), CHIEF.orbit
SIGHT = cf.Navigation(0.1, 3e-4)


def formation(seed: int, count: int, turns: float) -> tuple[cf.Plan, cf.Sphere]:
    """Return a plan between relative orbits, and its zone."""
    draws = np.random.default_rng(seed)
    size = 10 ** draws.uniform(2.0, 3.0)
    states = draws.normal(size=(2, count, 6)) * size * np.repeat([0.5, 0.5 * ORBIT.mean_motion], 3)
    states[..., 4] = -2.0 * ORBIT.mean_motion * states[..., 0]
    zone = cf.Sphere(0.12 * size)
    return cf.reconfigure(ORBIT, *states, turns * ORBIT.period, zone), zone


def long_flight(repeats: int) -> float:
    """Return the time [s] of thirty days of station keeping, by eight impulses within two orbits."""
    orbit, angle = FIELD.orbit, np.arange(8) * np.pi / 4.0
    n, r = orbit.mean_motion, 500.0
    places = r * np.array([np.sin(angle) / 2.0, np.cos(angle), np.sin(angle)])
    speeds = n * r * np.array([np.cos(angle) / 2.0, -np.sin(angle), np.cos(angle)])
    circle = orbit.coast(np.vstack([places, speeds]).T, 30.0 * 86400.0)
    law = cf.Feedback(orbit.period, 2.0 * orbit.period, 8)
    return timed(lambda: cf.simulate(circle, FIELD, feedback=law, navigation=SIGHT), min(repeats, 3))[0]


def new_plans(plan: cf.Plan, zone: cf.Sphere) -> float:
    """Return the time [s] of a simulation with a new plan each five minutes."""
    return timed(lambda: cf.simulate(plan, FIELD, "replan", navigation=SIGHT, zones=zone), 1)[0]


def updates(plan: cf.Plan, repeats: int) -> float:
    """Return the time [s] of one feedback update of all spacecraft, with one minute of simulation."""
    many, few = (
        timed(lambda flights=flights: cf.simulate(plan, FIELD, navigation=SIGHT, seeds=flights), repeats)[0]
        for flights in (41, 1)
    )
    return (many - few) / 40.0 / np.ceil(float(plan.paths.end[0]) / 60.0)


def measure(quick: bool) -> Report:
    repeats, flights, count = (1, 10, 4) if quick else (9, 100, 60)
    plan, zone = formation(3, 8, 1.0)
    checked, _ = timed(lambda: cf.validity(plan, FIELD, zone), repeats)
    commanded, _ = timed(lambda: cf.compensated_thrust(plan, FIELD), repeats)
    flown, many = timed(
        lambda: cf.simulate(plan, FIELD, navigation=SIGHT, zones=zone, seeds=flights), repeats
    )
    rows = [
        ["validity", seconds(checked), ""],
        ["compensated_thrust, every 10 s", seconds(commanded), ""],
        [
            f"simulate, {flights} samples, navigation each minute",
            seconds(flown),
            f"{many.greatest_end:.3f} m maximum end error",
        ],
    ]
    lasting, anew, update = long_flight(repeats), new_plans(plan, zone), updates(plan, repeats)
    kicked = ORBIT.impulsive(plan.paths.state(0.0), plan.paths.state(plan.paths.end[0]), ORBIT.period)
    changed, _ = timed(lambda: cf.compensated_thrust(kicked, FIELD), repeats)
    rows += [
        ["compensated_thrust, impulses", seconds(changed), ""],
        ["simulate, 8 spacecraft, 30 days of station keeping by impulses", seconds(lasting), ""],
        ["simulate, one sample, new plan each five minutes", seconds(anew), ""],
        ["feedback update, 8 spacecraft", seconds(update), "with the simulation until the next"],
    ]
    kept, lost = [], []
    for seed in range(count):
        if seed % 20 == 0:
            say(f"  plan {seed} of {count}")
        one, _ = formation(seed, 4, 0.25 + 1.75 * (seed % 8) / 7.0)
        if not one.ok:
            continue
        kept.append(cf.simulate(one, FIELD, "open").ends.max())
        lost.append(cf.simulate(one, FIELD, "open", cancel=False).ends.max())
    rows += [
        [
            f"open loop, {len(kept)} plans, planned thrust",
            "",
            f"{np.median(lost):.3g} m end error, maximum {max(lost):.3g}",
        ],
        [
            "open loop, compensated thrust",
            "",
            f"{1e3 * np.median(kept):.3g} mm end error, maximum {1e3 * max(kept):.3g}",
        ],
    ]
    note = "500 km, 51.6 deg, e = 0.001, J2; 4 or 8 spacecraft, some 100 m to 1 km apart; one core."
    middle, worst = float(np.median(kept)), float(max(kept))
    return Report(
        [Table("Plans in the high-fidelity model", ["task", "time", "result"], rows, [note])],
        [
            Figure("validity, 8 spacecraft", "<= 5 ms", seconds(checked), bool(checked <= 5e-3)),
            Figure(
                "100 simulations of 8 spacecraft, one orbit", "<= 0.5 s", seconds(flown), bool(flown <= 0.5)
            ),
            Figure("feedback update, 8 spacecraft", "<= 50 µs", seconds(update), bool(update <= 50e-6)),
            Figure(
                "8 spacecraft, 30 days of station keeping", "<= 5 s", seconds(lasting), bool(lasting <= 5.0)
            ),
            Figure(
                "force model known: end error, median", "<= 1 mm", f"{1e3 * middle:.2g} mm", middle <= 1e-3
            ),
            Figure(
                "force model known: end error, maximum", "<= 3 cm", f"{1e3 * worst:.2g} mm", worst <= 0.03
            ),
        ],
    )
