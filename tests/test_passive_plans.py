"""Passively safe plans against integrated failures and cone programs."""

from functools import lru_cache

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from closeform.motion.joining import stack
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from ring_formations import ring_formations
from ring_transfers import RADIUS, ring_transfers

ORBIT = cf.Orbit.circular(500e3)
PERIOD = ORBIT.period
CLIENT = np.zeros(6)
NODES = 500  # of the cone program
STEP = 30.0  # s, of the integrator: its error is below 1e-4 m after three orbits
SOME = [
    *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 14, 17, 26)),
    8,
]  # of the thirty ring transfers


def hill(n):
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3, 0], matrix[3, 4], matrix[4, 3], matrix[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    return matrix


def held(matrix, time):
    """Return the transition over a time and the effect of constant thrust: (6, 6), (6, 3)."""
    both = np.zeros((9, 9))
    both[:6, :6], both[3:6, 6:] = matrix, np.eye(3)
    both = expm(both * time)
    return both[:6, :6], both[:6, 6:]


def states_after_failures(path, until, count, seed):
    """Return times, positions (T, K, 3) of K random failures and whether thrust is lost (T, K).

    Runge-Kutta steps of fourth order end where the thrust jumps or is cut.
    """
    matrix, rng = hill(path.orbit.mean_motion), np.random.default_rng(seed)
    cut = rng.uniform(path.start, path.end, size=count)
    even = np.arange(path.start, until, STEP)
    times = np.unique(np.concatenate([even, cut, path.arcs[:, 0], [path.end, until]]))
    states = np.repeat(path.state(path.start)[None], count, axis=0)
    places, lost = [states[:, :3]], [cut <= path.start]
    for start, end in zip(times[:-1], times[1:], strict=True):
        burning, step = (cut > start)[:, None], end - start
        inside = np.array([start + 1e-6 * step, 0.5 * (start + end), end - 1e-6 * step])
        thrust = path.thrust(inside) if end <= path.end else np.zeros((3, 3))

        def rate(x, half, thrust=thrust, burning=burning):
            slope = x @ matrix.T
            slope[:, 3:] += burning * thrust[half]
            return slope

        a = rate(states, 0)
        b = rate(states + 0.5 * step * a, 1)
        c = rate(states + 0.5 * step * b, 1)
        d = rate(states + step * c, 2)
        states = states + step / 6.0 * (a + 2 * b + 2 * c + d)
        places.append(states[:, :3])
        lost.append(cut <= end)
    return times, np.array(places), np.array(lost)


@lru_cache
def planned(k):
    case = ring_transfers("thirty")[k]
    return case, cf.avoid(case.path, case.client, case.zone, drift=case.drift)


@pytest.mark.parametrize("k", SOME)
def test_failures_at_random_instants_stay_outside(k):
    case, plan = planned(k)
    assert (plan.status, plan.drift) == (cf.Status.AVOIDED, case.drift)
    until = case.duration + case.drift
    _, places, lost = states_after_failures(plan.path, until, 300, seed=k)
    ratios = np.where(lost, np.linalg.norm(places, axis=2), np.inf) / RADIUS
    assert ratios.min() > 1.0 - 1e-5
    assert ratios.min() < 1.1  # the detour is no wider than necessary
    _, places, lost = states_after_failures(case.path, until, 300, seed=k)
    assert (np.where(lost, np.linalg.norm(places, axis=2), np.inf) / RADIUS).min() < 1.0


@pytest.mark.parametrize("k", SOME)
def test_plan_meets_its_ends_and_reports_its_energy(k):
    case, plan = planned(k)
    assert plan.path.state(0.0) == pytest.approx(case.initial, abs=1e-9)
    assert np.abs(plan.path.state(case.duration) - case.final).max() < 1e-6
    times = np.linspace(0.0, case.duration, 200_001)
    thrust = np.sum(plan.path.thrust(times) ** 2, axis=1)
    energy = 0.5 * np.sum(0.5 * (thrust[1:] + thrust[:-1]) * np.diff(times))
    assert plan.energy == pytest.approx(energy, rel=1e-4)  # jumps of thrust lie between samples
    assert plan.lower_bound <= plan.energy
    assert plan.extra_energy == pytest.approx(plan.energy - case.path.energy, abs=1e-9 * plan.energy)


@pytest.mark.parametrize("k", SOME)
def test_energy_equals_that_of_a_cone_program_with_the_same_planes(k):
    """Thrust is constant between nodes, which costs a little where the plan has a jump."""
    case, plan = planned(k)
    matrix, step = hill(ORBIT.mean_motion), case.duration / NODES
    times = step * np.arange(NODES)
    drift, push = held(matrix, step)
    powers = [np.eye(6)]
    for _ in range(NODES):
        powers.append(drift @ powers[-1])
    ends = np.hstack([powers[NODES - 1 - i] @ push for i in range(NODES)])
    rows, gaps = [], []
    for one in plan.contacts:
        s = one.time if np.isnan(one.failed_at) else one.failed_at
        row = np.zeros((NODES, 3))
        for i in np.flatnonzero(times < s):
            last = min(s, times[i] + step)
            row[i] = one.normal @ (expm(matrix * (one.time - last)) @ held(matrix, last - times[i])[1])[:3]
        rows.append(row.ravel())
        gaps.append(one.reach - one.normal @ (expm(matrix * one.time) @ case.initial)[:3])
    scale = 1e5  # thrust is of 1e-5 m/s^2
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_rel = settings.tol_gap_abs = settings.tol_feas = 1e-10
    a = np.vstack([ends[:3], ends[3:] * 1e3, -np.array(rows)]) / scale
    drifted = case.final - powers[NODES] @ case.initial
    b = np.concatenate([drifted[:3], drifted[3:] * 1e3, -np.array(gaps)])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows))]
    problem = sparse.csc_matrix(np.eye(3 * NODES) * step / scale), np.zeros(3 * NODES)
    solution = clarabel.DefaultSolver(*problem, sparse.csc_matrix(a), b, cones, settings).solve()
    energy = 0.5 * step * np.sum((np.array(solution.x) / scale) ** 2)
    assert plan.energy == pytest.approx(energy, rel=1e-3)


def test_deflection_after_failures_has_minimum_energy():
    """Compare Gram matrix, ends and energy of random contacts with dense thrust of least norm."""
    rng, duration = np.random.default_rng(5), 0.8 * PERIOD
    initial, final = rng.normal(size=(2, 6)) * [200.0, 200.0, 200.0, 0.1, 0.1, 0.1]
    path = ORBIT.transfer(initial, final, duration)
    until = duration + PERIOD
    obstacle = ORBIT.coast([500.0, 0, 0, 0, 0, 0], until)
    groups = [(cf.Ellipsoid([30.0, 50.0, 20.0]), np.array([[0, 1]]))]
    problem = Problem.of(stack([path]), stack([obstacle]), groups, PERIOD)
    failed = np.sort(rng.uniform(0.05, 0.95, 6)) * duration
    drifts = np.array([0.0, 900.0, 0.0, 4000.0, 5000.0, 300.0])
    contacts = Contacts.at(
        np.zeros(6, dtype=np.int64), failed + drifts, np.column_stack([drifts, 0.0 * drifts])
    )
    normals = rng.normal(size=(6, 3))
    contacts = contacts._replace(normals=normals / np.linalg.norm(normals, axis=1)[:, None])
    gram = problem.kernel(contacts).reshape(6, 3, 6, 3)
    gram = np.einsum("ka,kamb,mb->km", contacts.normals, gram, contacts.normals)
    assert gram == pytest.approx(gram.T, abs=1e-12 * np.abs(gram).max())
    contacts.multipliers[:] = rng.uniform(0.5, 1.0, 6) / np.diag(gram)
    shaped = problem.path(problem.planned(contacts))[0]
    assert np.abs(shaped.state(duration) - final).max() < 1e-8
    assert shaped.energy - path.energy == pytest.approx(
        0.5 * contacts.multipliers @ gram @ contacts.multipliers
    )
    pushed = problem.zones[0].matrix.T @ contacts.normals.T

    def late(one):
        flow = [expm(hill(ORBIT.mean_motion) * d)[:3] for d in drifts]
        return np.einsum("kij,kj->ki", flow, one.state(failed))

    moved = np.einsum("ik,ki->k", pushed, late(shaped) - late(path))
    assert moved == pytest.approx(gram @ contacts.multipliers, rel=1e-9)
    apart = (late(path) - obstacle.position(failed + drifts)) @ problem.zones[0].matrix.T
    apart /= np.linalg.norm(apart, axis=1)[:, None]  # outward at the place after the loss of thrust
    assert problem.normals(problem.direct, contacts, -np.inf) == pytest.approx(apart, abs=1e-9)
    matrix = hill(ORBIT.mean_motion)
    nodes = np.union1d(np.linspace(0.0, duration, 800), failed)  # thrust jumps at nodes alone
    rows = np.zeros((12, len(nodes) - 1, 3))
    for i, (start, end) in enumerate(zip(nodes[:-1], nodes[1:], strict=True)):
        push = held(matrix, end - start)[1] / np.sqrt(end - start)
        rows[:6, i] = expm(matrix * (duration - end)) @ push
        for k in np.flatnonzero(end <= failed):
            rows[6 + k, i] = pushed[:, k] @ (expm(matrix * (failed[k] + drifts[k] - end)) @ push)[:3]
    wanted = np.concatenate([np.zeros(6), gram @ contacts.multipliers])
    rows = rows.reshape(12, -1)
    scale = 1.0 / np.linalg.norm(rows, axis=1)
    least = np.linalg.lstsq(rows * scale[:, None], wanted * scale, rcond=None)[0]
    assert shaped.energy - path.energy == pytest.approx(0.5 * np.sum(least**2), rel=3e-4)  # (n h)^2


def test_energy_grows_with_horizon_and_zone():
    case = ring_transfers("thirty")[8]
    client = ORBIT.coast(CLIENT, case.duration + 3.0 * PERIOD)
    longer = [
        cf.avoid(case.path, client, case.zone, drift=share * PERIOD).energy for share in (0.0, 1.0, 2.0)
    ]
    assert (np.diff(longer) >= -1e-3 * longer[0]).all()  # iterations stop when the energy changes by 1e-3
    larger = [cf.avoid(case.path, client, cf.Sphere(r), drift=PERIOD).energy for r in (20.0, 27.0, 33.0)]
    assert (np.diff(larger) >= -1e-3 * larger[0]).all()


@pytest.mark.slow
def test_shadow_price_is_the_slope_of_energy_over_zone_size():
    """Failures of a whole interval are active; rounding moves where iterations stop by 3e-4 of the energy."""
    radii = np.array([19.9, 19.98, 19.99, 19.999, 20.0, 20.001, 20.01, 20.02, 20.1])
    begin = cf.targets.safety_ellipse(ORBIT, 1, 150.0, 150.0, along_track=200.0)[0]
    path = ORBIT.transfer(begin, [25.0, 0.0, 0.0, 0.0, -50.0 * ORBIT.mean_motion, 0.0], PERIOD)
    client = ORBIT.coast(CLIENT, 3.0 * PERIOD)
    plans = [cf.avoid(path, client, cf.Sphere(r), drift=2.0 * PERIOD) for r in radii]
    energy = np.array([plan.energy for plan in plans])
    assert (np.diff(energy) >= -3e-4 * energy[0]).all()
    slope = np.polyfit(radii, energy, 1)[0]
    assert np.array([plan.price for plan in plans]) == pytest.approx(slope, rel=0.08)
    for radius, plan in zip(radii[::4], plans[::4], strict=True):
        _, places, lost = states_after_failures(plan.path, 3.0 * PERIOD, 400, seed=1)
        nearest = np.where(lost, np.linalg.norm(places, axis=2), np.inf).min() / radius
        assert 1.0 - 1e-5 < nearest < 1.001


def test_safe_path_is_returned_unchanged():
    state = cf.targets.safety_ellipse(ORBIT, 2, 100.0, 100.0)
    path = ORBIT.coast(state[0], PERIOD)
    plan = cf.avoid(path, ORBIT.coast(CLIENT, 4.0 * PERIOD), cf.Sphere(30.0), drift=3.0 * PERIOD)
    assert np.array_equal(plan.path.arcs, path.arcs)
    assert (plan.status, plan.drift) == (cf.Status.CLEAR, 3.0 * PERIOD)


def test_unsafe_end_is_rejected_with_its_ratio_and_an_alternative():
    ellipse = cf.targets.safety_ellipse(ORBIT, 1, 100.0, 100.0)[0]
    drifting = np.array([5.0, -300.0, 0.0, 0.0, -7.5 * ORBIT.mean_motion, 0.0])  # drifts along track
    client = ORBIT.coast(CLIENT, 9.0 * PERIOD)
    towards = (
        drifting
        if ORBIT.coast(drifting, PERIOD).position(PERIOD)[1] > -300.0
        else drifting * [-1, 1, 1, 1, -1, 1]
    )
    path = ORBIT.transfer(ellipse, towards, PERIOD)
    plan = cf.avoid(path, client, cf.Sphere(30.0), drift=8.0 * PERIOD, names=["client"])
    assert (plan.status, plan.path) == (cf.Status.END_UNSAFE, None)
    least = cf.closest_approach(
        ORBIT.coast(towards, 8.0 * PERIOD), ORBIT.coast(CLIENT, 8.0 * PERIOD), cf.Sphere(30.0)
    )
    assert f"the end of its plan path reaches {least.ratio:.2f} x zone from client" in plan.reason
    assert "a safety_ellipse with radial and cross_track of 39 m around client" in plan.reason
    named = ORBIT.coast(cf.targets.safety_ellipse(ORBIT, 1, 39.0, 39.0)[0], PERIOD)
    assert cf.closest_approach(named, ORBIT.coast(CLIENT, PERIOD), cf.Sphere(30.0)).ratio >= 1.3 - 1e-9


def test_arrival_at_the_start_of_a_failed_spacecraft_is_rejected():
    """A spacecraft at rest on the V-bar that fails at the start stays there."""
    places = np.array([[0.0, 100.0, 0.0], [0.0, -100.0, 0.0], [0.0, 300.0, 0.0]])
    begins = np.hstack([places, np.zeros((3, 3))])
    plan = cf.reconfigure(ORBIT, begins, begins[[1, 0, 2]], 0.7 * PERIOD, cf.Sphere(15.0), drift=0.2 * PERIOD)
    assert (plan.status, plan.blocked, plan.paths) == (cf.Status.END_UNSAFE, (0, 1), None)
    assert "start of its plan craft 0 reaches 0.00 x zone from craft 1, which has arrived" in plan.reason
    assert len(plan.measures) == 8
    beside = begins[[1, 0, 2]]
    beside[:2, 1] += 40.0
    given = ORBIT, begins, beside, 0.7 * PERIOD, cf.Sphere(15.0)
    other = cf.reconfigure(*given, drift=0.2 * PERIOD, if_blocked=())
    assert other.status != cf.Status.END_UNSAFE


def test_single_spacecraft_without_obstacles_is_safe():
    begins = cf.targets.safety_ellipse(ORBIT, 1, 100.0, 100.0)
    ends = cf.targets.safety_ellipse(ORBIT, 1, 150.0, 120.0)
    for zone in (cf.Sphere(20.0), [None]):
        plan = cf.reconfigure(ORBIT, begins, ends, PERIOD, zone, drift=PERIOD)
        assert (plan.status, plan.drift, plan.contacts) == (cf.Status.CLEAR, PERIOD, ())
        assert plan.energy == plan.lower_bound


def test_either_of_two_spacecraft_may_fail():
    """Two spacecraft swap places on a ring around a client; one fails, the other continues."""
    begins = cf.targets.separated_ring(ORBIT, 2, 100.0, 100.0)
    ends = cf.targets.separated_ring(ORBIT, 2, 120.0, 110.0, 0.8 * np.pi)
    duration, zone = 1.3 * PERIOD, cf.Sphere(30.0)
    final = (ORBIT.transition(duration) @ ends[:, :, None])[..., 0]
    client = ORBIT.coast(CLIENT, duration + PERIOD)
    plan = cf.reconfigure(ORBIT, begins, final, duration, zone, obstacles=client, drift=PERIOD)
    assert (plan.ok, plan.drift) == (True, PERIOD)
    until = duration + PERIOD
    alone = [
        cf.reconfigure(ORBIT, begins, final, duration, zone, obstacles=client).paths[k] for k in range(2)
    ]
    safe = []
    for paths in (plan.paths, alone):
        ratios = []
        for k in range(2):
            times, places, lost = states_after_failures(paths[k], until, 100, seed=k)
            coast = ORBIT.coast(paths[1 - k].state(duration), PERIOD, duration)
            there = np.where(
                (times <= duration)[:, None],
                paths[1 - k].position(np.minimum(times, duration)),
                coast.position(np.clip(times, duration, until)),
            )
            for other in (there[:, None], np.zeros(3)):
                ratios.append(np.where(lost, np.linalg.norm(places - other, axis=2), np.inf).min() / RADIUS)
        safe.append(min(ratios))
    assert safe[0] > 1.0 - 1e-5
    assert safe[1] < 1.0


@pytest.mark.parametrize(
    ("cost", "phase"),
    [
        ("energy", np.pi / 3),
        pytest.param("energy", 0.0, marks=pytest.mark.slow),
        pytest.param("delta-v", 0.0, marks=pytest.mark.slow),
        pytest.param("delta-v", np.pi / 3, marks=pytest.mark.slow),
    ],
)
def test_transfer_from_a_hold_point_to_a_safety_ellipse(phase, cost):
    """A plan costs cm/s, or none is returned; there are no km/s impulses that leave the area."""
    client = ORBIT.coast(CLIENT, 2 * PERIOD)
    ellipse = cf.targets.safety_ellipse(ORBIT, 1, 50.0, 50.0)[0]
    hold, final = [0, 200, 0, 0, 0, 0], ORBIT.transition(phase / (2 * np.pi) * PERIOD) @ ellipse
    plan = cf.avoid(ORBIT.transfer(hold, final, PERIOD), client, cf.Sphere(20.0), drift=PERIOD, cost=cost)
    assert plan.ok or plan.path is None
    assert plan.ok or phase > 0.0
    if plan.ok:
        assert plan.path.delta_v < 0.3
        _, places, lost = states_after_failures(plan.path, 2 * PERIOD, 100, seed=1)
        assert np.where(lost, np.linalg.norm(places, axis=2), np.inf).min() > 20.0 * (1.0 - 1e-5)


@pytest.mark.parametrize(
    ("count", "number", "budget"),
    [
        pytest.param(*one, marks=pytest.mark.slow)
        for one in ((4, 0, None), (8, 0, None), (12, 0, None), (12, 1, 1))
    ],
)
def test_rings_of_many_spacecraft_are_reconfigured_safely(count, number, budget):
    """Each spacecraft fails at random instants and keeps clear of the others.

    In the last case the iterations do not converge; the returned plan is safe.
    """
    case = ring_formations(count)[number]
    asked = case.orbit, case.initial, case.final, case.duration, case.zone
    plan = cf.reconfigure(*asked, drift=case.drift, budget=budget)
    assert (plan.status, plan.drift) == (cf.Status.AVOIDED, case.drift)
    until, rows = case.duration + case.drift, np.arange(count)
    flights = [states_after_failures(plan.paths[k], until, 40, seed=k) for k in rows]
    for k, (times, places, lost) in enumerate(flights):
        for j in rows[rows != k]:
            coast = case.orbit.coast(plan.paths[j].state(case.duration), case.drift, case.duration)
            there = np.where(
                (times <= case.duration)[:, None],
                plan.paths[j].position(np.minimum(times, case.duration)),
                coast.position(np.clip(times, case.duration, until)),
            )
            apart = np.linalg.norm(places - there[:, None], axis=2)
            assert np.where(lost, apart, np.inf).min() > case.zone.radius * (1.0 - 1e-5)


HOP = cf.Orbit.circular(600e3)  # its period is 5801 s


def distances_after_failure(path, lost, share, until):
    """Return distances from the origin after loss of thrust, by the closed form of Hill motion.

    A `share` of an impulse at that instant is executed.
    """
    n, state, at = HOP.mean_motion, path.state(path.start), path.start
    jumps = list(path.impulses)
    state[3:] -= sum((jump for time, jump in jumps if time == path.start), np.zeros(3))

    def coasted(state, t):
        x, y, z, u, v, w = state
        s, c = np.sin(n * t), np.cos(n * t)
        place = [
            (4 - 3 * c) * x + s / n * u + 2 / n * (1 - c) * v,
            6 * (s - n * t) * x + y - 2 / n * (1 - c) * u + (4 * s - 3 * n * t) / n * v,
            c * z + s / n * w,
        ]
        speed = [
            3 * n * s * x + c * u + 2 * s * v,
            -6 * n * (1 - c) * x - 2 * s * u + (4 * c - 3) * v,
            -n * s * z + c * w,
        ]
        return np.stack(np.broadcast_arrays(*place, *speed), axis=-1)

    for time, jump in jumps:
        if time > lost:
            break
        state, at = coasted(state, time - at), time
        state[3:] += jump * (share if time == lost else 1.0)
    return np.linalg.norm(coasted(state, np.linspace(lost - at, until - at, 6000))[:, :3], axis=1)


@pytest.mark.parametrize("orbits", [0.5, 1.0, *(pytest.param(k, marks=pytest.mark.slow) for k in (0.7, 1.5))])
def test_radial_hop_is_found_with_any_duration(orbits):
    """The hop is half an orbit with two radial impulses of n d / 4; it waits on the V-bar otherwise."""
    n, duration, day = HOP.mean_motion, orbits * HOP.period, 86400.0
    start, end = [0, -500, 0, 0, 0, 0], [0, -50, 0, 0, 0, 0]
    client, zone = HOP.coast(np.zeros(6), duration + day), cf.Sphere(30.0)
    plan = cf.avoid(HOP.transfer(start, end, duration), client, zone, drift=day, cost="delta-v")
    assert plan.ok, plan.reason
    assert plan.delta_v <= 2 * n * 450.0 / 4 * (1 + 1e-3)
    assert np.abs(plan.path.state(duration) - end).max() < 1e-6
    for time, _ in plan.path.impulses:
        for share in (0.0, 0.3, 0.7, 1.0):
            assert distances_after_failure(plan.path, time, share, duration + day).min() > 30.0
    if orbits == 0.5:
        for _, jump in plan.path.impulses:
            assert np.abs(jump) == pytest.approx([n * 450.0 / 4, 0, 0], abs=1e-9)


@pytest.mark.parametrize("orbits", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
def test_hop_of_low_energy_is_safe(orbits):
    duration, drift = orbits * HOP.period, 3.0 * HOP.period
    start, end = [0, -500, 0, 0, 0, 0], [0, -50, 0, 0, 0, 0]
    client = HOP.coast(np.zeros(6), duration + drift)
    plan = cf.avoid(HOP.transfer(start, end, duration), client, cf.Sphere(30.0), drift=drift)
    assert plan.ok, plan.reason
    assert plan.lower_bound <= plan.energy < np.inf
    assert plan.path.state(0.0) == pytest.approx(start, abs=1e-9)
    assert np.abs(plan.path.state(duration) - end).max() < 1e-6
    _, places, lost = states_after_failures(plan.path, duration + drift, 100, seed=1)
    assert np.where(lost, np.linalg.norm(places, axis=2), np.inf).min() > 30.0 * (1 - 1e-5)


@pytest.mark.slow
def test_two_spacecraft_hop_along_track():
    """Each of two spacecraft keeps clear of a client."""
    starts = np.array([[0, -500.0, 0, 0, 0, 0], [0, 500.0, 0, 0, 0, 0]])
    ends, duration, drift = starts * 0.2, HOP.period, 2.0 * HOP.period
    client = HOP.coast(np.zeros(6), duration + drift)
    plan = cf.reconfigure(
        HOP,
        starts,
        ends,
        duration,
        cf.Sphere(30.0),
        obstacles=client,
        drift=drift,
        cost="delta-v",
        if_blocked=(),
    )
    assert plan.ok, plan.reason
    assert plan.delta_v <= 2 * 2 * HOP.mean_motion * 400.0 / 4 * (1 + 1e-3)
    for path in plan.paths:
        for time, _ in path.impulses:
            for share in (0.0, 0.5, 1.0):
                assert distances_after_failure(path, time, share, duration + drift).min() > 30.0
