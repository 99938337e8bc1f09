"""Failures of thrust and the drift after them, against refined dense sampling."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize, minimize_scalar

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONES = [
    cf.Ellipsoid([20.0, 40.0, 20.0]),
    cf.Box([20.0, 40.0, 30.0]),
    cf.Cylinder(20.0, 40.0, axis=[0.3, 1.0, 0.2]),
    cf.HalfSpaces([[1, 0.1, 0], [-1, 0.1, 0], [0, 0.1, 1], [0, 0.1, -1], [0, -1, 0]], [30, 30, 30, 30, 40]),
]


def hill(n):
    a = np.zeros((6, 6))
    a[:3, 3:] = np.eye(3)
    a[3, 0], a[3, 4], a[4, 3], a[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    return a


def some_states(rng):
    state = rng.normal(size=6) * np.r_[60, 250, 60, 0.05, 0.1, 0.05]
    state[4] = -2 * N * state[0] + rng.normal() * 2e-3
    return state


def after_loss(path, s, t):
    """Return positions at times t after a loss of thrust at s, by matrix exponentials."""
    state = path.state(s)
    a = hill(path.orbit.mean_motion)
    return np.array([(expm(a * (one - s)) @ state)[:3] for one in np.atleast_1d(t)])


def sampled_minimum(path, other, zone, until, instants=120, times=600):
    """Return the minimum ratio of a grid over failure instants and times, refined locally."""
    s = np.linspace(path.start, path.end, instants)
    t = np.linspace(path.start, until, times)
    a = hill(path.orbit.mean_motion)
    flow = np.array([expm(a * (one - path.start)) for one in t])
    back = np.array([expm(-a * (one - path.start)) for one in s])
    states = np.einsum("sij,sj->si", back, path.state(s))
    there = np.einsum("tij,sj->sti", flow[:, :3], states) - other.position(t)
    norms = zone.norm(there)
    norms[t[None] < s[:, None]] = np.inf

    def norm_at(p):
        at = min(max(p[0], path.start), path.end)
        when = min(max(p[1], at), until)
        return float(zone.norm(after_loss(path, at, when)[0] - other.position(when)))

    best = np.inf
    for k in np.argsort(norms, axis=None)[:40:13]:
        i, j = np.unravel_index(k, norms.shape)
        fine = {"xatol": 1e-7, "fatol": 1e-12, "maxiter": 400}
        found = minimize(norm_at, [s[i], t[j]], method="Nelder-Mead", options=fine)
        best = min(best, found.fun)
    return best


@pytest.mark.parametrize(
    ("seed", "zone"), list(enumerate(ZONES)), ids=[type(zone).__name__ for zone in ZONES]
)
def test_closest_approach_after_loss_of_thrust(zone, seed):
    """The ratio is not above dense sampling, and the reported failure attains it."""
    rng = np.random.Generator(np.random.Philox(seed))
    duration = rng.uniform(0.3, 1.5) * PERIOD
    until = duration + rng.uniform(0.2, 2.0) * PERIOD
    path = ORBIT.transfer(some_states(rng), some_states(rng), duration)
    if seed % 2:
        other = ORBIT.coast(some_states(rng) * 0.1, until)
    else:
        other = ORBIT.transfer(0.1 * some_states(rng), 0.1 * some_states(rng), until)
    found = cf.drift_approach(path, other, zone, until)
    gap = after_loss(path, found.failed_at, found.time)[0] - other.position(found.time)
    # 1e-9 of the ratio, and 1e-9 of rounding of matrix exponentials
    assert abs(zone.norm(gap) - found.ratio) <= 2e-9 * max(1.0, abs(found.ratio))
    assert abs(np.linalg.norm(gap) - found.distance) <= 1e-6
    assert found.ratio <= sampled_minimum(path, other, zone, until) + 1e-9
    assert cf.passively_safe(path, other, zone, until) == (found.ratio > 1.0)


@pytest.mark.parametrize(
    ("zone", "seed"),
    [
        (ZONES[0], 6),
        (ZONES[1], 1),
        pytest.param(ZONES[2], 5, marks=pytest.mark.slow),
        pytest.param(ZONES[1], 6, marks=pytest.mark.slow),
    ],
    ids=["ellipsoid, any ends", "box, rings", "cylinder, rings", "box, any ends"],
)
def test_verdict_after_fifteen_orbits(zone, seed):
    """The verdict changes within 1e-3 of the minimum of a dense sampling.

    Rings stay clear by their cross-track separation; other relative orbits return along the track.
    """
    rng = np.random.Generator(np.random.Philox(key=[2, seed]))
    ends = [some_states(rng), some_states(rng)]
    if seed % 2:
        sizes = rng.uniform(60.0, 150.0, (2, 2))
        ends = [cf.targets.safety_ellipse(ORBIT, 1, *size, phase=rng.uniform(0.0, 6.0))[0] for size in sizes]
    path = ORBIT.transfer(*ends, rng.uniform(0.5, 1.5) * PERIOD)
    until = path.end + 15.0 * PERIOD
    other = ORBIT.transfer(0.1 * some_states(rng), [0.0, 5.0, 0.0, 0.0, 0.0, 0.0], 0.4 * PERIOD)
    other = cf.join([other, ORBIT.coast(other.state(other.end), until - other.end, start=other.end)])
    least = sampled_minimum(path, other, zone, until, 200, 3000)
    assert cf.passively_safe(path, other, zone.enlarged(least * 0.999), until)
    assert not cf.passively_safe(path, other, zone.enlarged(least * 1.001), until)


def after_failure(path, until, rng, failure, t):
    """Return positions at times t after a random failure, by matrix exponentials."""
    n = path.orbit.mean_motion
    a = hill(n)
    s = rng.uniform(path.start, path.end)
    whole = cf.join([path, path.orbit.coast(path.state(path.end), until - path.end + 1.0, start=path.end)])
    nominal = whole.position(t)
    drifts = after_loss(path, s, t)
    if isinstance(failure, cf.ThrustLost):
        return np.where(t[:, None] >= s, drifts, nominal)
    if isinstance(failure, cf.DegradedThrust):
        share = rng.uniform(failure.least, 1.0)
        return np.where(t[:, None] >= s, share * nominal + (1.0 - share) * drifts, nominal)
    if isinstance(failure, cf.MissedBurns):
        gone = nominal.copy()
        for time, jump in path.impulses:
            lost = rng.choice([0.0, 1.0, rng.random()]) * (1.0 - failure.least)
            kick = np.r_[np.zeros(3), jump]
            for k in np.flatnonzero(t >= time):
                gone[k] -= lost * (expm(a * (t[k] - time)) @ kick)[:3]
        return gone
    stuck = rng.uniform(0.0, failure.longest)
    held = path.thrust(s) if failure.acceleration is None else failure.acceleration
    wide = np.zeros((9, 9))  # constant thrust as three more states
    wide[:6, :6], wide[3:6, 6:] = a, np.eye(3)
    after = (expm(wide * stuck) @ np.r_[path.state(s), held])[:6]
    return np.array(
        [
            nominal[k]
            if one < s
            else (expm(wide * (one - s)) @ np.r_[path.state(s), held])[:3]
            if one < s + stuck
            else (expm(a * (one - s - stuck)) @ after)[:3]
            for k, one in enumerate(t)
        ]
    )


FAILURES = [
    cf.ThrustLost(),
    cf.MissedBurns(),
    cf.MissedBurns(0.6),
    cf.DegradedThrust(0.3),
    cf.StuckOnThrust(300.0),
    cf.StuckOnThrust(60.0, [1e-4, -2e-4, 5e-5]),
]


@pytest.mark.parametrize(
    ("failure", "failing"),
    [
        (one, failing) if (k + j) % 3 == 0 else pytest.param(one, failing, marks=pytest.mark.slow)
        for k, one in enumerate(FAILURES)
        for j, failing in enumerate(("path", "other", "either", "both"))
    ],
    ids=str,
)
def test_no_sampled_failure_comes_closer(failure, failing):
    """Random failures at random instants do not come closer than the reported ratio."""
    rng = np.random.Generator(np.random.Philox(7))
    duration, until = 0.8 * PERIOD, 1.7 * PERIOD
    ends = np.array([some_states(rng) for _ in range(4)])
    impulsive = isinstance(failure, cf.MissedBurns)
    fly = ORBIT.two_impulse if impulsive else ORBIT.transfer
    path, other = (fly(ends[k], ends[k + 2], 0.4 * PERIOD if impulsive else duration) for k in (0, 1))
    flies_on = [
        cf.join([one, ORBIT.coast(one.state(one.end), until - one.end, start=one.end)])
        for one in (path, other)
    ]
    given = [path, other]
    if failing in ("path", "either"):
        given[1] = flies_on[1]
    if failing in ("other", "either"):
        given[0] = flies_on[0]
    zone = ZONES[0]
    found = cf.drift_approach(*given, zone, until, failure, failing)
    assert cf.passively_safe(*given, zone, until, failure, failing) == (found.ratio > 1.0)
    least = np.inf
    for _ in range(100):
        t = rng.uniform(0.0, until, 4)
        r = [one.position(t) for one in flies_on]
        fails = {"either": rng.choice(["path", "other"])}.get(failing, failing)
        if fails in ("path", "both"):
            r[0] = after_failure(path, until, rng, failure, t)
        if fails in ("other", "both"):
            r[1] = after_failure(other, until, rng, failure, t)
        least = min(least, zone.norm(r[0] - r[1]).min())
    assert found.ratio <= least + 1e-9


def ellipse(d, along, e=100.0, eps=0.3, h=80.0, eta=0.8):
    """Return the state of a relative orbit by its drift, position and two vectors (docs/theory.md, 5)."""
    place = [2 * d - e * np.cos(eps), along + 2 * e * np.sin(eps), h * np.cos(eta)]
    return np.array([*place, N * e * np.sin(eps), N * (2 * e * np.cos(eps) - 3 * d), N * h * np.sin(eta)])


def test_slow_endless_drift_tends_to_the_vector_separation():
    """The limit is the smallest singular value of the cross-track ellipse."""
    across = np.array([[-100 * np.cos(0.3), 100 * np.sin(0.3)], [80 * np.cos(0.8), 80 * np.sin(0.8)]])
    limit = np.linalg.svd(across)[1][1] / 50.0
    zone, other = cf.Sphere(50.0), ORBIT.coast(np.zeros(6), 9.0)
    slow = [
        cf.drift_approach(ORBIT.coast(ellipse(d, 500.0), 9.0), other, zone, np.inf) for d in (0.03, 0.003)
    ]
    assert all(one.time > 100 * PERIOD for one in slow)  # closest after about 900 and 9000 orbits
    assert abs(slow[0].ratio - limit) < 1e-3  # 2 d / R
    assert abs(slow[1].ratio - limit) < 1e-4
    away = cf.drift_approach(ORBIT.coast(ellipse(-0.03, 500.0), 9.0), other, zone, np.inf)
    assert away.ratio > 6.0  # it drifts away


@pytest.mark.parametrize("seed", [1, 6])
def test_ratio_falls_with_the_horizon(seed):
    rng = np.random.Generator(np.random.Philox(seed))
    path = ORBIT.transfer(some_states(rng), some_states(rng), PERIOD)
    other = ORBIT.coast(np.zeros(6), 31 * PERIOD)
    ratios = [cf.drift_approach(path, other, ZONES[0], k * PERIOD).ratio for k in (1, 3, 10, 31)]
    ratios.append(cf.drift_approach(path, other, ZONES[0], np.inf).ratio)
    assert (np.diff(ratios) <= 1e-9).all()


def test_split_paths_and_swapped_spacecraft_change_nothing():
    rng = np.random.Generator(np.random.Philox(11))
    path = ORBIT.transfer(some_states(rng), some_states(rng), PERIOD)
    other = ORBIT.coast(0.1 * some_states(rng), 3 * PERIOD)
    arcs = np.repeat(path.arcs, 2, axis=0)
    split = 0.37 * PERIOD
    arcs[0, 1] = arcs[1, 0] = split
    arcs[1, 6:12] = path.state(split)
    arcs[1, 12:18] = expm(hill(N) * split) @ path.arcs[0, 12:18]  # thrust is a natural motion
    halves = cf.Path(ORBIT, arcs, np.array([0, 2]), ())
    zone, until = ZONES[0], 3 * PERIOD
    whole = cf.drift_approach(path, other, zone, until)
    assert abs(cf.drift_approach(halves, other, zone, until).ratio - whole.ratio) <= 2e-9
    swapped = cf.drift_approach(other, path, zone, until, failing="other")
    assert abs(swapped.ratio - whole.ratio) <= 2e-9
    assert swapped.failing == "other"


def test_drift_screen_agrees_with_each_pair():
    rng = np.random.Generator(np.random.Philox(5))
    starts, ends = (rng.normal(size=(5, 6)) * np.r_[80, 200, 80, 0, 0, 0] for _ in range(2))
    fleet, until = ORBIT.transfer(starts, ends, PERIOD), 2 * PERIOD
    zone = cf.Sphere(15.0)
    found = cf.drift_screen(fleet, zone, until)
    unsafe = []
    for i in range(5):
        for j in range(5):
            other = cf.join([fleet[j], ORBIT.coast(fleet[j].state(PERIOD), PERIOD, start=PERIOD)])
            if i != j and not cf.passively_safe(fleet[i], other, zone, until):
                unsafe.append((i, j))
    assert unsafe == [tuple(pair) for pair in found.pairs.tolist()]
    assert 0 < len(found) < 20
    assert (found.ratio <= 1.0).all()
    flown_on = cf.join([fleet, ORBIT.coast(fleet.state(PERIOD), PERIOD, start=PERIOD)])
    i, j = found.pairs.T
    least = cf.drift_approach(fleet[i], flown_on[j], zone, until).ratio
    assert np.abs(found.ratio - least).max() <= 1e-3


def test_straight_lines_in_deep_space():
    """Loss of thrust while braking leaves a straight line."""
    deep = cf.Orbit(0.0)
    path = deep.transfer([-500, 40, 0, 1.0, 0, 0], [-60, 30, 0, 0, 0, 0], 900.0)
    other, zone = deep.coast(np.zeros(6), 4000.0), cf.Sphere(20.0)
    found = cf.drift_approach(path, other, zone, 4000.0)
    assert found.ratio <= sampled_minimum(path, other, zone, 4000.0) + 1e-9
    gap = after_loss(path, found.failed_at, found.time)[0]
    assert abs(zone.norm(gap) - found.ratio) <= 1e-9


def test_no_common_time():
    path = ORBIT.transfer(np.zeros(6), [0, 100, 0, 0, 0, 0], 900.0)
    late = ORBIT.coast(np.zeros(6), 900.0, start=2000.0)
    found = cf.drift_approach(path, late, ZONES[0], 1000.0)
    assert np.isnan(found.time)
    assert np.isinf(found.ratio)
    assert cf.passively_safe(path, late, ZONES[0], 1000.0)


@pytest.mark.parametrize("seed", [58, 92])
def test_stuck_thrust_ends_with_the_drift(seed):
    """The reported failure is attained before the drift ends with the path."""
    rng = np.random.Generator(np.random.Philox(seed))
    path = ORBIT.transfer(0.3 * some_states(rng), 0.3 * some_states(rng), rng.uniform(0.3, 0.8) * PERIOD)
    client, longest = ORBIT.coast(np.zeros(6), path.end), 0.3 * PERIOD
    found = cf.drift_approach(path, client, cf.Sphere(20.0), path.end, cf.StuckOnThrust(longest))
    wide = np.zeros((9, 9))  # constant thrust as three more states
    wide[:6, :6], wide[3:6, 6:] = hill(N), np.eye(3)
    begin = np.r_[path.state(found.failed_at), path.thrust(found.failed_at)]

    def norm_of(stuck):
        after = (expm(wide * stuck) @ begin)[:6]
        drift = expm(hill(N) * (found.time - found.failed_at - stuck)) @ after
        return np.linalg.norm(drift[:3]) / 20.0

    holds = np.linspace(0.0, min(longest, found.time - found.failed_at), 60)
    k = int(np.argmin([norm_of(stuck) for stuck in holds]))
    low, high = holds[max(k - 1, 0)], holds[min(k + 1, 59)]
    fine = minimize_scalar(norm_of, bounds=(low, high), method="bounded", options={"xatol": 1e-6})
    attained = min(fine.fun, norm_of(low), norm_of(high))  # a bounded search excludes its ends
    assert found.lower - 1e-6 <= attained <= found.ratio + 1e-6


def test_lower_bound_of_the_ratio():
    """`lower` bounds the ratio where the search ends before its tolerance of 1e-9."""
    orbit = cf.Orbit.circular(500e3)
    one = orbit.transfer([60, -250, 60, 0, 0, 0], [-40, 120, 30, 0, 0, 0], 4000.0)
    two = orbit.transfer([0, 10, 0, 0, 0, 0], [10, -10, 0, 0, 0, 0], 4000.0)
    box = cf.Box([20.0, 40.0, 20.0])
    both = cf.drift_approach(one, two, box, 6000.0, cf.DegradedThrust(), "both")
    assert both.lower <= both.ratio
    alone = cf.drift_approach(one, two.orbit.coast(two.state(0.0), 6000.0), box, 6000.0)
    assert alone.ratio - 1e-9 * max(1.0, alone.ratio) <= alone.lower <= alone.ratio
    assert both.lower <= cf.drift_approach(one, two, box, 6000.0, cf.ThrustLost(), "both").ratio
