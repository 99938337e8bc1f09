"""Simulate plans of closeform in Basilisk, and check that compensated thrust follows the certified path.

    python examples/basilisk/fly.py [folder]

Two tables in the folder are the only interface: the states at the epoch, and the thrust of each spacecraft.
Basilisk uses nothing else of closeform, and closeform nothing of Basilisk.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from simulator import Flown, World, axes_of, coefficients, fly

import closeform as cf
from closeform.dynamics.force_model.field import EARTH_ZONALS, GRAVITY_RADIUS

EPOCH = "2026-11-22T12:00:00"
AIR = 5.2e-13, 500e3, 60e3  # kg/m^3 at m, m: about mean sun
EGM96 = coefficients(Path(__file__).with_name("egm96.csv"), degree=4)
HIGHER = 1.7e-4  # of n^2 times distance: what degrees 3 and 4 make, the greatest of 4000 places
SIGHT, FEEDBACK = cf.Navigation(0.1, 3e-4), cf.Feedback(60.0, 600.0)


class Task(NamedTuple):
    """A plan, its zone, what pulls on it and what of that is known."""

    plan: cf.Plan
    zone: cf.Sphere
    room: cf.Tube
    field: cf.Field
    known: cf.Field


def task(seed: int) -> Task:
    """The first of a seed's random formations that has to give way, planned with room for feedback."""
    draws = np.random.default_rng(seed)
    while True:
        count = int(draws.integers(3, 7))
        e, way = 10 ** draws.uniform(-3.3, -2.5), draws.uniform(0.0, 2.0 * np.pi)
        shape = [
            cf.elements.EARTH_RADIUS + draws.choice([450e3, 500e3, 800e3]),
            draws.uniform(0.0, 6.28),
            e * np.cos(way),
        ]
        tilt = np.radians(draws.choice([30.0, 51.6, 97.4]))
        chief = cf.Chief.from_elements(EPOCH, [*shape, e * np.sin(way), tilt, 0.3])
        orbit, size = chief.orbit, 10 ** draws.uniform(2.0, 3.0)
        states = draws.normal(size=(2, count, 6)) * size * np.repeat([0.5, 0.5 * orbit.mean_motion], 3)
        states[..., 4] = -2.0 * orbit.mean_motion * states[..., 0]
        duration = 60.0 * round(draws.uniform(0.3, 1.3) * orbit.period / 60.0)
        zone = cf.Sphere(draws.uniform(0.05, 0.2) * size)
        tight = cf.reconfigure(orbit, *states, duration, zone)
        if not tight.contacts:
            continue
        ballistic = np.where(np.arange(count) % 2, 0.022, 0.02)
        field = cf.Field(chief, drag=cf.Drag(*AIR, ballistic, 0.02, spin=0.0))
        known = cf.Field(chief, drag=cf.Drag(*AIR, 0.02, 0.02, spin=0.0))
        far = np.linalg.norm(tight.paths.position(np.linspace(0.0, duration, 200)), axis=-1).max()
        less = (cf.compensated_thrust(tight, one).commanded for one in (field, known))
        unknown = np.linalg.norm(np.subtract(*less), axis=-1).max() + HIGHER * orbit.mean_motion**2 * far
        room = cf.tube(orbit, FEEDBACK, SIGHT, float(unknown))
        plan = cf.reconfigure(orbit, *states, duration, zone, margin=room)
        if plan.ok:
            return Task(plan, zone, room, field, known)


def end_of(one: Task) -> float:
    """Return the end of a plan [s]."""
    return float(one.plan.paths.end[0])


def world(field: cf.Field, higher: bool = False) -> World:
    """The same in Basilisk's words, or with EGM96 up to degree and order 4 on an Earth that turns."""
    cosines, sines = EGM96 if higher else np.zeros((2, 3, 3))
    if not higher:
        cosines[0, 0], cosines[2, 0] = 1.0, -EARTH_ZONALS[0] / np.sqrt(5.0)
    body = field.chief.mu, GRAVITY_RADIUS, cosines, sines, higher
    if field.drag is None:
        return World(*body)
    density, altitude, scale = field.drag.density, field.drag.altitude, field.drag.scale_height
    grounded = density * np.exp(altitude / scale), cf.elements.EARTH_RADIUS, scale  # as Basilisk has it
    return World(*body, *grounded, (field.drag.chief, *field.drag.ballistic))


def exported(one: Task, known: cf.Field, folder: Path, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Writes the start (N + 1, 6) and the thrust (N, K, 3) in the middle of each step, and reads them."""
    chief = one.field.chief_states([0.0])[0]
    felt = known.accelerations(0.0, chief, 0.02)
    craft = cf.elements.inertial_from_relative(chief, one.plan.paths.state(0.0), acceleration=felt)
    rows = np.vstack([chief, craft])
    head = "x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    np.savetxt(folder / "start.csv", rows, "%.17g", ",", header=head, comments="")
    columns = cf.compensated_thrust(one.plan, known, every=0.5 * step).columns()
    head = "craft,time_s,ux_m_s2,uy_m_s2,uz_m_s2"
    rows = np.stack([columns[name] for name in head.split(",")], axis=1)
    np.savetxt(folder / "thrust.csv", rows, "%.17g", ",", header=head, comments="")
    start = np.loadtxt(folder / "start.csv", delimiter=",", skiprows=1)
    thrust = np.loadtxt(folder / "thrust.csv", delimiter=",", skiprows=1)
    return start, thrust[:, 2:].reshape(len(start) - 1, -1, 3)[:, 1::2]


def seen(one: Task, chief: np.ndarray, craft: np.ndarray) -> np.ndarray:
    """Relative states of craft (..., 6) in the axes of a chief (..., 6), as they turn."""
    felt = one.known.accelerations(0.0, chief, 0.02)
    return cf.elements.relative_from_inertial(chief, craft, acceleration=felt)


def open_loop(
    one: Task, known: cf.Field, folder: Path, step: float, higher: bool = False
) -> tuple[Flown, np.ndarray]:
    """The table played by Basilisk: what it says, and relative states (N, T, 6)."""
    start, thrust = exported(one, known, folder, step)
    flown = fly(start, lambda t, _: thrust[:, round(t / step)], end_of(one), world(one.field, higher), step)
    return flown, relative(one, flown)


def relative(one: Task, flown: Flown) -> np.ndarray:
    """Relative states (N, T, 6) of a flight."""
    return np.moveaxis(seen(one, flown.states[:, :1], flown.states[:, 1:]), 0, 1)


def tracked(one: Task, seed: int, folder: Path, step: float = 10.0) -> tuple[Flown, np.ndarray]:
    """Measured each minute, with errors, and brought back; Earth of degree 4, of which J2 is known."""
    start, thrust = exported(one, one.known, folder, step)
    draws, paths = np.random.default_rng([seed, 1]), one.plan.paths
    sizes = np.repeat([SIGHT.position, SIGHT.velocity], 3)
    last: dict[str, Any] = {}

    def law(now: float, states: np.ndarray) -> np.ndarray:
        if round(now / step) % round(FEEDBACK.every / step) == 0:
            measured = seen(one, states[0], states[1:]) + sizes * draws.normal(size=(len(thrust), 6))
            off = measured - paths.state(now)
            last.update(begun=now, back=paths.orbit.transfer(off, np.zeros(6), FEEDBACK.horizon))
        back: np.ndarray = last["back"].thrust(now + 0.5 * step - last["begun"])
        return thrust[:, round(now / step)] + back

    flown = fly(start, law, end_of(one), world(one.field, higher=True), step)
    return flown, relative(one, flown)


def off_plan(one: Task, times: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return the maximum deviation of each spacecraft (N,) [m]."""
    return np.linalg.norm((states - one.plan.paths.state(times))[..., :3], axis=2).max(axis=1)


def held(one: Task, start: np.ndarray, thrust: np.ndarray, step: float) -> np.ndarray:
    """Inertial states (T, N + 1, 6) by closeform's field, with steps and thrust held as Basilisk has them."""
    drag, half, rows = one.field.drag, 0.5 * step, [start]
    assert drag is not None
    ballistic = [drag.chief, *drag.ballistic]
    push = np.zeros((len(start), 3))

    def rates(states: np.ndarray) -> np.ndarray:
        return np.hstack([states[:, 3:], one.field.accelerations(0.0, states, ballistic) + push])

    for asked in np.moveaxis(thrust, 1, 0):
        push[:] = 0.0
        first = rates(rows[-1])
        place, speed, felt = rows[-1][0, :3], rows[-1][0, 3:], first[0, 3:]
        push[1:] = asked @ axes_of(place + half * speed + 0.5 * half**2 * felt, speed + half * felt)
        first = rates(rows[-1])
        second = rates(rows[-1] + half * first)
        third = rates(rows[-1] + half * second)
        last = rates(rows[-1] + step * third)
        rows.append(rows[-1] + step / 6.0 * (first + 2.0 * second + 2.0 * third + last))
    return np.array(rows)


def same_field(folder: Path) -> tuple[float, list[tuple[float, float]]]:
    """How far Basilisk and closeform are apart at most [m], with J2, drag and the same thrust.

    Of thrust that both hold for 10 s; and of `fly`, where it turns with the axes, by what Basilisk holds [s].
    """
    one = task(1)
    ours = cf.simulate(one.plan, one.field, "open")
    path, apart = ours.orbit.sampled(ours.times, ours.states[0]), []
    for step in (10.0, 2.0, 1.0, 0.5):
        flown, states = open_loop(one, one.field, folder, step)
        between = np.linalg.norm(states[..., :3] - path.position(flown.times), axis=2).max()
        apart.append((step, float(between)))
    flown, states = open_loop(one, one.field, folder, 10.0)
    alike = held(one, *exported(one, one.field, folder, 10.0), 10.0)
    between = (states - relative(one, flown._replace(states=alike)))[..., :3]
    return float(np.linalg.norm(between, axis=2).max()), apart


def higher_field(folder: Path) -> list[tuple[str, float]]:
    """How far off a craft ends [m] where Earth is EGM96's of degree 4, and less of it is known."""
    one = task(1)
    ends = []
    for words, zonals in (("J2", 2), ("J2 to J4", EARTH_ZONALS[:3])):
        known = cf.Field(one.field.chief, zonals, one.field.drag)
        _, states = open_loop(one, known, folder, 2.0, higher=True)
        off = states[:, -1, :3] - one.plan.paths.position(end_of(one))
        ends.append((words, float(np.linalg.norm(off, axis=1).max())))
    return ends


def least_ratio(path: cf.Path, zone: cf.Zone) -> float:
    """Of all pairs, between states too."""
    i, j = np.triu_indices(len(path), 1)
    return float(cf.closest_approach(path[i], path[j], zone).ratio.min())


class Kept(NamedTuple):
    """How near their paths craft were in a flight under feedback, and how near their tube said [m]."""

    whole: float  # in any direction, at all times
    radius: float  # along one direction, at an instant
    off: float  # flown, as `whole`
    room: float  # of a pair, added to its zone
    left: float  # of that


def twelve_flights(folder: Path) -> list[Kept]:
    """Flights under feedback, of the tasks of twelve seeds."""
    found = []
    for seed in range(1, 13):
        one = task(seed)
        flown, states = tracked(one, seed, folder)
        path = one.plan.paths.orbit.sampled(flown.times, states)
        least = least_ratio(path, one.zone)
        off = float(off_plan(one, flown.times, states).max())
        whole = float(one.room.containment(end_of(one), craft=len(one.plan.paths)))
        left = (least - 1.0) * one.zone.radius
        found.append(Kept(whole, float(one.room.radius), off, one.room.of_a_pair, left))
    return found


def main(folder: Path) -> None:
    alike, same = same_field(folder)
    print("J2, drag and the same thrust: relative positions of closeform and Basilisk apart at most")
    print(f"  both hold it for 10 s: {1e3 * alike:8.3f} mm")
    print("  as cf.simulate has it, turning with the axes, and Basilisk")
    for step, apart in same:
        print(f"  holds it for {step:6.1f} s: {1e3 * apart:8.3f} mm")
    assert max(alike, same[-1][1]) < 1e-3
    print("EGM96 of degree 4 on an Earth that turns, open loop; ends off the plan")
    for words, off in (higher := higher_field(folder)):
        print(f"  thrust less the residual of {words:9s} {off:7.3f} m")
    assert max(off for _, off in higher) < 1.0
    print("Under feedback, in that field with 10 % more drag on each other craft; J2 and drag known")
    print("  tube, whole flight [m]  tube, one direction [m]  off at most [m]  room of a pair [m]  left [m]")
    for one in (flights := twelve_flights(folder)):
        print(f"{one.whole:24.3f} {one.radius:24.3f} {one.off:16.3f} {one.room:19.3f} {one.left:9.3f}")
    assert all(one.left > 0.0 and one.off <= one.whole for one in flights)
    print("all within the tube of a whole flight, which one in 30 000 leaves; no zone entered")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as made:
            main(Path(made))
