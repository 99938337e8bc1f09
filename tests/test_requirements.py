"""Requirements on states and thrust, against a cone program, a linear program and integration."""

import clarabel
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linprog
from scipy.sparse import csc_matrix

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
START, END, TIME = np.array([0, -200.0, 0, 0, 0, 0]), np.array([0, -1.0, 0, 0, 0, 0]), 2400.0
ASTERN = [0, -1, 0]
CONE = cf.requirements.ApproachCone(axis=ASTERN, half_angle=np.radians(10), radius=0.5)
GLIDE = cf.requirements.SpeedLimit(limit=0.05, rate=1e-3, axis=ASTERN)
WAYPOINT = cf.requirements.KeepIn(zone=cf.Sphere(5.0), centre=[10, -100, 0], start=900, end=900)


class Floor(cf.requirements.StateRequirement):
    """Requirement of a user: at most 8 m below the V-bar, also in a minute at the present rate."""

    per_speed = 60.0
    slope = np.array([1.0, 0.0, 0.0, 60.0, 0.0, 0.0])

    def _margin(self, states):
        return 8.0 + states @ self.slope

    def _slope(self, states):
        return np.broadcast_to(self.slope, states.shape)


FLOOR = Floor()
QUIET = cf.requirements.NoThrust(start=600.0, end=900.0)


def hill():
    n, system = ORBIT.mean_motion, np.zeros((6, 6))
    system[:3, 3:] = np.eye(3)
    system[3, 0], system[5, 2], system[3, 4], system[4, 3] = 3 * n * n, -n * n, 2 * n, -2 * n
    return system


def planned(*requirements, **more):
    task = {"cost": "delta-v", "if_blocked": (), **more}
    return cf.reconfigure(ORBIT, [START], [END], TIME, cf.Sphere(1.0), requirements=requirements, **task)


def flown(plan, samples=40_000):
    """Return times and states of a plan's impulses, integrated by DOP853."""
    state, found, impulses = START.copy(), [], dict(plan.path.impulses)
    edges = sorted({0.0, 900.0, TIME, *impulses})
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        state[3:] += impulses.get(begin, 0.0)
        times = np.linspace(begin, end, 2 + int(samples * (end - begin) / TIME))
        leg = solve_ivp(
            lambda _, y: hill() @ y, (begin, end), state, "DOP853", t_eval=times, rtol=1e-12, atol=1e-12
        )
        found.append(np.column_stack([times, leg.y.T]))
        state = leg.y[:, -1].copy()
    state[3:] += impulses.get(TIME, 0.0)
    np.testing.assert_allclose(state, END, atol=1e-6)
    rows = np.concatenate(found)
    return rows[:, 0], rows[:, 1:]


def inside(times, states, name):
    """Return how far states are inside a requirement, by its own geometry."""
    x, y, z, *velocity = states.T
    if name == "cone":
        return (0.5 - y * np.tan(np.radians(10)) - np.hypot(x, z)) * np.cos(np.radians(10))
    if name == "glide":
        return 0.05 - 1e-3 * y - np.linalg.norm(velocity, axis=0)
    if name == "floor":
        return x + 60.0 * velocity[0] + 8.0
    near = np.abs(times - 900.0) < 1e-9
    return 5.0 - np.linalg.norm(states[near, :3] - [10, -100, 0], axis=1)


def least_by_cones(name, count=121, samples=241, energy=False):
    """Return the minimum delta-v of impulses at `count` times that keep a requirement at sampled times.

    With `energy`, the minimum control energy of a thrust that these impulses replace in equal periods.
    """
    fires, seen = np.linspace(0.0, TIME, count), np.linspace(0.0, TIME, samples)
    fires = TIME * (np.arange(count) + 0.5) / count if energy else fires
    flow = {t: expm(hill() * t) for t in np.unique(np.concatenate([fires, seen]))}
    width = 4 * count  # impulses (3 each), and bounds on their sizes
    cost = np.concatenate([np.zeros(3 * count), np.full(count, 0.0 if energy else 1.0)])
    square = np.diag(np.append(np.full(3 * count, count / TIME if energy else 0.0), np.zeros(count)))
    rows, rhs, cones = [], [], []

    def state_rows(t):
        later = [expm(hill() * (t - s))[:, 3:] if s <= t else np.zeros((6, 3)) for s in fires]
        return np.concatenate(later, axis=1), flow[t] @ START

    arrive, coast = state_rows(TIME)
    rows.append(np.hstack([arrive, np.zeros((6, count))]))
    rhs.append(END - coast)
    cones.append(clarabel.ZeroConeT(6))
    for k in range(count):  # |v_k| <= size_k
        block = np.zeros((4, width))
        block[0, 3 * count + k] = -1.0
        block[1:, 3 * k : 3 * k + 3] = -np.eye(3)
        rows.append(block)
        rhs.append(np.zeros(4))
        cones.append(clarabel.SecondOrderConeT(4))
    tan = np.tan(np.radians(10))
    for t in [900.0] if name == "waypoint" else seen:
        move, base = state_rows(t)
        if name == "cone":
            outer, given = np.array([[0, -tan, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.5, 0, 0])
            matrix = np.hstack([outer, np.zeros((3, 3))])
        elif name == "glide":
            matrix, given = np.zeros((4, 6)), np.array([0.05, 0, 0, 0])
            matrix[0, 1], matrix[1:, 3:] = -1e-3, np.eye(3)
        elif name == "floor":
            matrix, given = np.array([[1.0, 0, 0, 60.0, 0, 0]]), np.array([8.0])
        else:
            matrix, given = np.zeros((4, 6)), np.array([5.0, -10.0, 100.0, 0.0])
            matrix[1:, :3] = np.eye(3)
        rows.append(np.hstack([-matrix @ move, np.zeros((len(matrix), count))]))
        rhs.append(matrix @ base + given)
        cones.append(clarabel.SecondOrderConeT(len(matrix)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    problem = csc_matrix(square), cost, csc_matrix(np.vstack(rows)), np.concatenate(rhs)
    solved = clarabel.DefaultSolver(*problem, cones, settings).solve()
    assert str(solved.status) == "Solved"
    return solved.obj_val


@pytest.mark.parametrize(
    ("name", "requirement", "dearer"),
    [("cone", CONE, 0.01), ("glide", GLIDE, 0.06), ("waypoint", WAYPOINT, 0.01), ("floor", FLOOR, 0.02)],
)
def test_requirement_is_kept_at_hardly_more_than_the_least_cost(name, requirement, dearer):
    """The path keeps it when integrated; no bound is above the cone program on a grid of times."""
    plan, free = planned(requirement), planned()
    assert inside(*flown(free), name).min() < -1e-3
    assert plan.status == cf.Status.AVOIDED
    assert inside(*flown(plan), name).min() >= -1e-6
    least = least_by_cones(name)
    assert free.delta_v < plan.lower_bound <= least * (1 + 1e-4)
    assert plan.delta_v <= least * (1 + dearer)


class Ring(Floor):
    """Not convex: outside of a ball."""

    def _margin(self, states):
        return np.linalg.norm(states[..., :3], axis=-1) - 50.0

    def _slope(self, states):
        return np.pad(states[..., :3] / np.linalg.norm(states[..., :3], axis=-1)[..., None], ((0, 0), (0, 3)))


class Steep(Floor):
    """Slope larger than stated."""

    per_speed = 1.0


@pytest.mark.parametrize(("requirement", "word"), [(Ring(), "Ring._margin"), (Steep(), "Steep.per_speed")])
@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_requirement_without_a_certificate_is_refused(requirement, word, cost):
    with pytest.raises(ValueError, match=word):
        planned(requirement, cost=cost)


@pytest.mark.parametrize(
    ("name", "requirement"), [("cone", CONE), ("glide", GLIDE), ("waypoint", WAYPOINT), ("floor", FLOOR)]
)
def test_requirement_is_kept_at_the_least_energy(name, requirement):
    """The thrust is integrated; energy and bound are those of the cone program on a grid of times."""
    plan = planned(requirement, cost="energy")
    times = np.union1d(np.linspace(0.0, TIME, 4001), 900.0)
    leg = solve_ivp(
        lambda t, y: hill() @ y + np.append(np.zeros(3), plan.path.thrust(min(t, TIME))),
        *((0.0, TIME), START, "DOP853", times),
        rtol=1e-10,
        atol=1e-10,
        max_step=20.0,
    )
    np.testing.assert_allclose(leg.y[:, -1], END, atol=1e-4)
    assert inside(times, leg.y.T, name).min() >= -1e-4
    assert requirement.holds(plan.path)
    assert not requirement.holds(planned(cost="energy").path)
    least = least_by_cones(name, energy=True)
    assert plan.lower_bound <= least * (1 + 2e-3)
    assert plan.energy == pytest.approx(least, rel=5e-3)


def test_requirements_at_minimum_energy_combine_with_zones_and_other_spacecraft():
    """Two exchange their places in a box, 30 m wide, past a rock; no box moves one of them less."""
    box = cf.requirements.KeepIn(zone=cf.Box([15.0, 200.0, 15.0]))
    ends = np.zeros((2, 6))
    ends[:, 1] = -100.0, 100.0
    rock = ORBIT.coast([-5.0, 40.0, 0.0, 0, 0, 0], 2000.0)
    task = {"obstacles": rock, "if_blocked": ()}
    wide, plan = (
        cf.reconfigure(ORBIT, ends, ends[::-1], 2000.0, cf.Sphere(12.0), requirements=need, **task)
        for need in ((), box)
    )
    assert plan.ok
    states = plan.paths.state(np.linspace(0.0, 2000.0, 20_001))
    assert np.abs(states[..., [0, 2]]).max() <= 15.0 + 1e-6
    assert np.linalg.norm(states[0, :, :3] - states[1, :, :3], axis=1).min() >= 12.0 - 1e-6
    assert wide.lower_bound <= plan.lower_bound <= plan.energy
    assert not all(box.holds(wide.paths[k]) for k in range(2))


def test_requirements_combine_with_zones_and_quiet_times():
    """A corridor with a speed limit and a quiet time, past an obstacle at its side."""
    rock = ORBIT.coast([6.0, -60.0, 0.0, 0, 0, 0], 2 * TIME)
    plan = planned(CONE, GLIDE, QUIET, obstacles=rock, max_acceleration=[np.inf])
    assert plan.ok
    times, states = flown(plan)
    assert min(inside(times, states, name).min() for name in ("cone", "glide")) >= -1e-6
    assert cf.closest_approach(plan.path, rock, cf.Sphere(1.0)).ratio >= 1.0
    assert not any(600.0 < time < 900.0 for time, _ in plan.path.impulses)


def safe_approach(duration):
    """Return a plan to a hold point at 20 m, outside 10 m for an orbit after any loss of thrust."""
    hold, station = [0, -20.0, 0, 0, 0, 0], ORBIT.coast(np.zeros(6), duration + 2 * ORBIT.period)
    wanted = {"obstacles": station, "cost": "delta-v", "if_blocked": (), "requirements": [CONE, GLIDE]}
    return cf.reconfigure(ORBIT, [START], [hold], duration, cf.Sphere(10.0), drift=ORBIT.period, **wanted)


def check_safe_approach(plan):
    """Check the corridor, the speed and the drifts until an orbit after the arrival, by dense samples."""
    path, last = plan.path, plan.path.end + ORBIT.period
    times = np.linspace(0.0, path.end, 20_001)
    states = path.state(times)
    assert min(inside(None, states, name).min() for name in ("cone", "glide")) >= -1e-6
    drifted = np.linspace(0.0, last, 400)
    flow = np.array([expm(hill() * t)[:3] for t in drifted])
    distances = np.linalg.norm(np.einsum("tij,kj->tki", flow, states[::50]), axis=-1)
    assert distances[drifted[:, None] + times[::50] <= last].min() >= 10.0 - 1e-3


def test_passively_safe_plan_keeps_a_corridor_and_a_speed_limit():
    plan = safe_approach(TIME)
    check_safe_approach(plan)
    assert plan.lower_bound <= plan.delta_v <= 1.02 * plan.lower_bound


@pytest.mark.slow
@pytest.mark.parametrize("orbits", [1.0, 1.2, 1.5])
def test_longer_safe_approach_from_a_hold_point_costs_no_more(orbits):
    """The chaser may wait at the hold point, where it stays without thrust."""
    short, long = (safe_approach(share * ORBIT.period) for share in (0.75, orbits))
    check_safe_approach(long)
    assert long.lower_bound <= long.delta_v <= 1.01 * short.delta_v


@pytest.mark.parametrize(
    ("drift", "place", "radius"), [(None, -100.0, 60.0), (0.3 * ORBIT.period, 60.0, 40.0)]
)
def test_longer_transfer_between_hold_points_costs_no_more(drift, place, radius):
    """Waiting is free there, with a station between them, and with a loss of thrust near a station ahead."""
    costs = []
    for orbits in (0.3, 0.5, 0.75, 1.0, 1.3):
        station = ORBIT.coast([0, place, 0, 0, 0, 0], 2.0 * ORBIT.period)
        given = {"obstacles": station, "cost": "delta-v", "if_blocked": (), "drift": drift}
        task = ORBIT, [START], [END], orbits * ORBIT.period, cf.Sphere(radius)
        costs.append(cf.reconfigure(*task, **given).delta_v)
    assert (np.array(costs) <= 1.01 * np.minimum.accumulate(costs)).all()


@pytest.mark.parametrize("limit", [1e-2, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_burns_keep_requirements_within_a_thrust_limit(limit):
    burns = planned(CONE, max_acceleration=limit)
    assert burns.ok
    assert burns.path.peak_thrust <= limit * (1 + 1e-9)
    assert inside(None, burns.path.state(np.linspace(0, TIME, 20_001)), "cone").min() >= -1e-6
    impulses = planned(CONE)
    assert impulses.lower_bound <= burns.delta_v < 1.02 * impulses.delta_v


def angles_to(axes, thrusts):
    """Return the angles between axes (..., 3) and thrusts (..., 3)."""
    sizes = np.linalg.norm(axes, axis=-1) * np.linalg.norm(thrusts, axis=-1)
    return np.arccos(np.clip((np.asarray(axes) * thrusts).sum(axis=-1) / sizes, -1.0, 1.0))


RADIAL = [cf.requirements.ThrustExclusion(direction=[x, 0, 0], half_angle=np.radians(40)) for x in (1, -1)]


@pytest.mark.parametrize("end", [END, np.array([20, -50, 30, 0, 0.02, 0.01])])
def test_thrust_stays_out_of_cones_at_hardly_more_than_the_least_cost(end):
    """A linear program over a grid of times and allowed directions is the least cost, to its spacing."""
    plan = cf.reconfigure(ORBIT, [START], [end], TIME, None, cost="delta-v", requirements=RADIAL)
    thrusts = np.array([jump for _, jump in plan.path.impulses])
    for axis in ([1, 0, 0], [-1, 0, 0]):
        assert angles_to(axis, thrusts).min() >= np.radians(40)
    turn, lean = np.meshgrid(
        np.radians(np.arange(0, 360, 10)), np.radians([40, 50, 60, 75, 90, 105, 120, 130, 140])
    )
    allowed = np.stack([np.cos(lean), np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn)]).reshape(
        3, -1
    )
    reach = np.hstack([expm(hill() * (TIME - t))[:, 3:] @ allowed for t in np.linspace(0.0, TIME, 61)])
    scale = np.array([1, 1, 1, 1e3, 1e3, 1e3])
    ends = scale * (end - expm(hill() * TIME) @ START)
    least = linprog(np.ones(reach.shape[1]), A_eq=scale[:, None] * reach, b_eq=ends).fun
    assert plan.lower_bound <= least * (1 + 1e-3)
    assert plan.delta_v <= 1.005 * least


def test_no_two_impulses_are_nearer_than_a_millionth_of_the_time():
    """An ephemeris of both would have epochs that no other one shares; the arrival counts as well."""
    station = ORBIT.coast(np.zeros(6), TIME)
    plume = cf.requirements.Plume(half_angle=np.radians(20), range=50.0, others=station)
    sun = cf.requirements.ThrustExclusion(direction=[-1, 0.5, 0], half_angle=0.5, rate=-ORBIT.mean_motion)
    for requirements in ((CONE, plume), (sun,)):
        times = [time for time, _ in planned(*requirements).path.impulses]
        assert np.diff(np.unique([0.0, *times, TIME])).min() >= 1e-6 * TIME


def test_exhaust_misses_the_other_spacecraft_of_a_plan():
    """Two spacecraft separate, and neither fires at the other; each impulse is checked by itself."""
    begin, end = np.zeros((2, 6)), np.zeros((2, 6))
    begin[:, 1], end[:, 1] = [-20, 20], [-100, 100]
    plume = cf.requirements.Plume(half_angle=np.radians(30), range=60.0)
    task = ORBIT, begin, end, 200.0, cf.Sphere(5.0)
    struck = 0
    for plan in (
        cf.reconfigure(*task, cost="delta-v"),
        cf.reconfigure(*task, cost="delta-v", requirements=plume),
    ):
        for own, other in ((0, 1), (1, 0)):
            for time, jump in plan.paths[own].impulses:
                away = plan.paths[other].position(time) - plan.paths[own].position(time)
                if np.linalg.norm(away) < 60.0:
                    struck += angles_to(away, -jump) < np.radians(30)
        assert struck == 2  # of the first plan


@pytest.mark.parametrize("limit", [3.7e-4, 1e-3, 1e-2])
def test_burns_dock_with_exhaust_that_misses_the_station(limit):
    """The least limit in this corridor is 1.84e-4 m/s^2, by a cone program; half of the first."""
    station = ORBIT.coast(np.zeros(6), TIME)
    plume = cf.requirements.Plume(half_angle=np.radians(20), range=50.0, others=station)
    plan, free = planned(CONE, plume, max_acceleration=limit), planned(CONE, plume)
    assert plan.ok
    times = np.linspace(0.0, TIME, 100_001)
    states, thrusts = plan.path.state(times), plan.path.thrust(times)
    assert np.linalg.norm(thrusts, axis=1).max() <= limit * (1 + 1e-9)
    assert inside(None, states, "cone").min() >= -1e-6
    near = thrusts.any(axis=1) & (np.linalg.norm(states[:, :3], axis=1) < 50.0)
    assert angles_to(-states[near, :3], -thrusts[near]).min() >= np.radians(20)
    assert plan.delta_v <= 1.1 * free.delta_v


@pytest.mark.parametrize(
    ("requirement", "more", "word"),
    [
        (CONE, {"max_acceleration": 1.7e-4}, "thrust limit"),
        (cf.requirements.SpeedLimit(limit=0.08), {}, "m/s"),
        (cf.requirements.NoThrust(start=0.0, end=2000.0), {"max_acceleration": 4e-4}, " s at"),
    ],
)
def test_plan_that_is_not_found_names_the_requirement(requirement, more, word):
    plan = planned(requirement, **more)
    assert plan.status == cf.Status.NOT_FOUND
    for told in ("craft 0", requirement.called, word):
        assert told in plan.reason


@pytest.mark.parametrize(
    "engine", [{"max_acceleration": 1e-3}, {"thrusters": cf.Thrusters(np.vstack([np.eye(3), -np.eye(3)]))}]
)
def test_burns_and_thrusters_keep_out_of_a_turning_cone(engine):
    n, wide = ORBIT.mean_motion, np.radians(60)
    sun = cf.requirements.ThrustExclusion(direction=[-1, 0.3, 0], half_angle=wide, rate=-n)
    plan = planned(sun, **engine)
    assert plan.ok
    impulses = plan.path.impulses
    times = np.array([time for time, _ in impulses]) if impulses else np.linspace(0.0, TIME, 100_001)[1:-1]
    thrusts = np.array([jump for _, jump in impulses]) if impulses else plan.path.thrust(times)
    fires = thrusts.any(axis=1)
    c, s = np.cos(n * times[fires]), np.sin(n * times[fires])
    axes = np.stack([-c + 0.3 * s, 0.3 * c + s, 0.0 * c], axis=1)
    assert angles_to(axes, thrusts[fires]).min() >= wide - 1e-9
    assert not sun.holds(planned(**engine).path)


def test_certificate_of_thrust_decides_to_a_hair():
    """A cone turns past the constant thrust of a burn, and is nearest to it between samples."""
    space = cf.Orbit(0.0)
    burn = cf.reconfigure(
        space, [np.zeros(6)], [[0, 0, 50, 0, 0, 1.0]], 100.0, None, cost="delta-v", max_acceleration=0.011
    )
    times = np.linspace(0.0, 100.0, 20_001)
    thrusts = burn.path.thrust(times)
    fires = np.linalg.norm(thrusts, axis=1) > 0.0
    axes = np.stack([np.cos(0.02 * times), np.sin(0.02 * times), 0.4 + 0.0 * times], axis=1)
    least = angles_to(axes[fires], thrusts[fires]).min()
    for off in (-1e-5, 1e-5):
        cone = cf.requirements.ThrustExclusion(direction=[1, 0, 0.4], half_angle=least + off, rate=0.02)
        assert cone.holds(burn.path) is (off < 0.0)


def test_certificate_finds_what_samples_miss():
    """A parabola leaves a keep-in box by a hair between two samples."""
    space = cf.Orbit(0.0)
    drift = space.coast([0, 0, 0, 1.0, 0, 0], 100.0)
    for room, holds in ((100.0 + 1e-9, True), (100.0 - 1e-9, False)):
        assert cf.requirements.KeepIn(zone=cf.Box([room, 1.0, 1.0])).holds(drift) is holds
    arc = ORBIT.coast([0, 0, 10.0, 0, 0, 0], 0.9 * ORBIT.period)  # z = 10 cos nt, farthest inside at the half
    dip = cf.requirements.KeepIn(zone=cf.Sphere(10.0), centre=[0, 0, 1e-8], start=1.0)
    assert not dip.holds(arc)
    assert cf.requirements.KeepIn(zone=cf.Sphere(10.0 + 2e-8), centre=[0, 0, 1e-8], start=1.0).holds(arc)


def test_worst_margin_lies_between_samples():
    """The least of many samples agrees, also far above the surface."""
    states = np.random.default_rng(1).normal(size=(10, 6)) * np.repeat([100.0, 0.1], 3)
    speed = cf.requirements.SpeedLimit(limit=5.0, rate=1e-3, axis=[0.3, -1.0, 0.2])
    for drift in ORBIT.coast(states, 0.7 * ORBIT.period):
        for wide in (speed, cf.requirements.KeepIn(zone=cf.Ellipsoid([4000.0, 8000.0, 4000.0]))):
            least = wide.margin(drift.state(np.linspace(0.0, drift.end, 50_001))).min()
            assert wide.worst_margin(drift) == pytest.approx(least, rel=1e-6)


def test_end_outside_is_refused_with_its_reason():
    narrow = cf.requirements.ApproachCone(axis=[0, 1, 0], half_angle=0.1, radius=0.5)
    plan = planned(narrow)
    assert plan.status == cf.Status.END_OUTSIDE
    assert "approach corridor" in plan.reason


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: planned(QUIET, cost="energy"), "requirements: at minimum energy"),
        (lambda: planned(3.0), "requirements: "),
        (lambda: cf.requirements.ApproachCone(axis=[0, 0, 0], half_angle=0.1, radius=1), "axis: "),
        (lambda: cf.requirements.ApproachCone(axis=ASTERN, half_angle=2.0, radius=1), "half_angle: "),
        (lambda: cf.requirements.ApproachCone(axis=ASTERN, half_angle=0.1, radius=0), "radius: "),
        (lambda: cf.requirements.SpeedLimit(limit=0.0), "limit: "),
        (lambda: cf.requirements.SpeedLimit(limit=0.1, rate=1e-3), "axis: required with rate"),
        (lambda: cf.requirements.KeepIn(zone=5.0), "zone: "),
        (lambda: cf.requirements.NoThrust(start=5.0, end=5.0), "end: must be after start"),
        (lambda: cf.requirements.Plume(half_angle=0.0, range=5.0), "half_angle: "),
        (lambda: cf.requirements.Plume(half_angle=0.3, range=5.0, others=3.0), "others: "),
        (lambda: cf.requirements.Plume(half_angle=0.3, range=5.0).holds(planned().path), "others: give"),
        (lambda: cf.requirements.ThrustExclusion(direction=[0, 0, 0], half_angle=0.3), "direction: "),
    ],
)
def test_bad_requirements_are_named(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


SCENARIO = """\
closeform = 1
title = "Docking"

[orbit]
altitude = "500 km"

[craft]
name = ["Station", "Chaser"]
position = ["0 0 0 m", "0 -200 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "0.5 m" }

[[stage]]
do = "coast"
for = "5 min"

[[stage]]
do = "avoid"
craft = "Chaser"
to = { position = "0 -1 0 m", velocity = "0 0 0 m/s" }
within = "40 min"
cost = "delta-v"
corridor = { axis = [0, -1, 0], half_angle = "10 deg", radius = "0.5 m" }
waypoints = [{ at = "20 min", position = "0 -80 0 m", tolerance = "20 m" }]
no_thrust = [{ after = "10 min", until = "15 min" }]
plume = { half_angle = "20 deg", range = "30 m" }
thrust_exclusion = [{ direction = [0, 0, 1], half_angle = "30 deg", frame = "inertial", until = "30 min" }]
"""


def run(folder, text):
    file = folder / "docking.toml"
    file.write_text(text)
    return cf.run(file)


def test_stage_keeps_its_requirements_and_judges_the_executed_path(tmp_path):
    mission = run(tmp_path, SCENARIO)
    stage = mission.results[1]
    assert mission.verdict.ok
    kinds = "approach corridor", "waypoint", "time without thrust", "plume limit", "direction without thrust"
    assert {one.kind for one in stage.asked} == set(kinds)
    times, path = np.linspace(300.0, 2700.0, 20_001), stage.after.path("Chaser")
    assert inside(None, path.state(times), "cone").min() >= -1e-6
    assert np.linalg.norm(path.state(1500.0)[:3] - [0, -80, 0]) <= 20.0
    assert not any(900.0 < time < 1200.0 for time, _ in path.impulses)
    for time, jump in path.impulses:
        if np.linalg.norm(away := path.position(time)) < 30.0:
            assert angles_to(away, jump) >= np.radians(20)  # the station is at the origin
    wide = path.orbit.impulsive(path.state(300.0), path.state(2700.0), 2400.0, 300.0)
    assert not all(one.met for one in stage.result.kept(wide))


@pytest.mark.parametrize("end", [-10.0, -10.00005])
def test_end_on_the_surface_costs_no_more_than_one_inside(end):
    """Half an orbit to a face of a keep-in box, whose other faces the path touches."""
    orbit = cf.Orbit.circular(600e3)
    box = cf.requirements.KeepIn(zone=cf.Box([20.0, 130.0, 100.0]), centre=[0, -140, 0])
    given = {"cost": "delta-v", "requirements": [box], "if_blocked": ()}
    on, inside = (
        cf.reconfigure(orbit, [[0, -250, 0, 0, 0, 0]], [[0, y, 0, 0, 0, 0]], orbit.period / 2, None, **given)
        for y in (end, -10.001)
    )
    assert on.ok
    assert inside.ok
    assert on.delta_v <= 1.001 * inside.delta_v


@pytest.mark.parametrize("limit", [0.03, 0.05])
def test_speed_limit_holds_up_to_the_last_impulse(limit):
    """Half an orbit from 250 m to rest at 10 m: the last impulse must not brake from above the limit."""
    orbit = cf.Orbit.circular(600e3)
    corridor = cf.requirements.ApproachCone(axis=[0, -1, 0], half_angle=np.radians(12), radius=0.5)
    glide = cf.requirements.SpeedLimit(limit=limit, rate=1e-3, axis=[0, -1, 0])
    ends = [[0, -250, 0, 0, 0, 0]], [[0, -10, 0, 0, 0, 0]]
    given = {"cost": "delta-v", "requirements": [corridor, glide], "if_blocked": ()}
    plan = cf.reconfigure(orbit, *ends, orbit.period / 2, None, **given)
    assert plan.ok
    states = plan.path.state(np.linspace(0.0, plan.path.end, 20_001)[1:-1])
    speeds = np.linalg.norm(states[:, 3:], axis=1)
    assert (speeds <= limit - 1e-3 * states[:, 1] + 1e-9).all()
    assert plan.delta_v <= 1.03 * plan.lower_bound


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('cost = "delta-v"', "", 'no_thrust needs cost = "delta-v"'),
        ("axis = [0, -1, 0]", "axis = [0, 0, 0]", "axis has no direction"),
        ('"10 deg"', '"95 deg"', r"half_angle: .* must be below 90 deg"),
        ('until = "15 min"', 'until = "5 min"', "until must be later than after"),
    ],
)
def test_bad_scenario_requirements_are_named(tmp_path, old, new, message):
    with pytest.raises(ValueError, match=message):
        run(tmp_path, SCENARIO.replace(old, new))
