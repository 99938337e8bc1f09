"""Impulses of minimum delta-v, against cone programs, integrators, 50 digits and known cases."""

import clarabel
import mpmath as mp
import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linprog

import closeform as cf
from bridge import hill

N = 1.15697e-3
ORBIT = cf.Orbit(N)
CURTIS = np.array([20e3, 20e3, 20e3, -20.0, 20.0, -5.0])  # Curtis, chapter 7: to the origin in 8 h


def relative_orbit_states(rng, size, drifting=False):
    """Return states on relative orbits of a size [m], from Palmer's coordinates."""
    (wide, high), (a, b) = rng.uniform(0, size, 2), rng.uniform(0, 2 * np.pi, 2)
    e1, e2, h1, h2 = wide * np.cos(a), wide * np.sin(a), high * np.cos(b), high * np.sin(b)
    d, along = rng.uniform(-0.15, 0.15) * size * drifting, rng.uniform(-2.5, 2.5) * size
    return np.array([2 * d - e1, along + 2 * e2, h1, N * e2, N * (2 * e1 - 3 * d), N * h2])


def cases(seed, count):
    """Return random ends and durations with n T from 1e-4 to 60 and sizes from 0.1 m to 10 km."""
    rng = np.random.default_rng(seed)
    initials, finals, durations = np.empty((count, 6)), np.empty((count, 6)), np.empty(count)
    for k in range(count):
        size, kind = 10 ** rng.uniform(-1, 4), k % 6
        durations[k] = 10 ** rng.uniform(-4, np.log10(60)) / N
        for states in (initials, finals):
            if kind < 4:
                states[k] = rng.normal(size=6) * size * np.array([1, 1, 1, N, N, N])
            else:
                states[k] = relative_orbit_states(rng, size, drifting=kind == 5)
        if kind in (1, 2):
            out = [2, 5] if kind == 1 else [0, 1, 3, 4]
            initials[k, out] = finals[k, out] = 0.0
        if kind == 3:
            finals[k] = 0.0
    return initials, finals, durations


def cone_program(n, initial, final, duration, times):
    """Return the minimum sum of impulses [m/s] at given times by a cone program."""
    scale = np.array([1 / duration] * 3 + [1.0] * 3)
    gap = scale * (np.asarray(final) - expm(hill(n) * duration) @ initial)
    size, count = np.linalg.norm(gap), len(times)
    rows, costs = np.zeros((6, 4 * count)), np.zeros(4 * count)
    for k, t in enumerate(times):
        rows[:, 4 * k + 1 : 4 * k + 4] = scale[:, None] * expm(hill(n) * (duration - t))[:, 3:]
    costs[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((4 * count, 4 * count)),
        costs,
        sparse.csc_matrix(np.vstack([rows, -np.eye(4 * count)])),
        np.concatenate([gap / size, np.zeros(4 * count)]),
        [clarabel.ZeroConeT(6), *[clarabel.SecondOrderConeT(4)] * count],
        settings,
    ).solve()
    return float(solution.obj_val * size)


def test_rendezvous_of_curtis():
    """Two impulses as published; four need 28 % less."""
    two, least = (plan(CURTIS, np.zeros(6), 28800.0) for plan in (ORBIT.two_impulse, ORBIT.impulsive))
    assert two.delta_v == pytest.approx(109.66945, abs=1e-5)
    assert least.delta_v == pytest.approx(78.53298, abs=1e-5)
    assert len(least.impulses) == 4
    bound = cf.least_delta_v(ORBIT, CURTIS, np.zeros(6), 28800.0)
    assert bound.proven
    assert bound.unique
    assert bound.upper == pytest.approx(least.delta_v, rel=1e-14)


def test_gap_and_ends_of_random_cases():
    """The gap is at most 1e-9 of delta-v with at most six impulses, and the end is met."""
    initials, finals, durations = cases(1, 3000)
    bound, paths = (
        cf.least_delta_v(ORBIT, initials, finals, durations),
        ORBIT.impulsive(initials, finals, durations),
    )
    assert bound.gap.max() <= 1e-9
    assert bound.gap.min() >= 0.0
    assert bound.proven.all()
    assert paths.delta_v == pytest.approx(bound.upper, rel=1e-12)
    assert (np.diff(paths.offsets) <= 8).all()
    for k in range(0, 3000, 3):
        path, size = (
            paths[k],
            np.abs(np.r_[initials[k, :3], finals[k, :3], durations[k] * initials[k, 3:]]).max(),
        )
        assert 1 <= len(path.impulses) <= 6
        end = expm(hill(N) * durations[k]) @ initials[k]
        for t, push in path.impulses:
            end = end + expm(hill(N) * (durations[k] - t))[:, 3:] @ push
        assert np.abs(end[:3] - finals[k, :3]).max() <= 1e-10 * size * (1 + N * durations[k])


def test_cost_agrees_with_a_convex_program():
    """Equal with the same impulse times, and never above with other times."""
    initials, finals, durations = cases(2, 600)
    chosen = np.flatnonzero((N * durations > 0.3) & (N * durations < 25.0))[:10]
    for k in chosen:
        path = ORBIT.impulsive(initials[k], finals[k], durations[k])
        own = [min(t, durations[k]) for t, _ in path.impulses]
        equal = np.linspace(0, durations[k], 121)
        assert path.delta_v <= cone_program(N, initials[k], finals[k], durations[k], equal) * (1 + 1e-8)
        both = np.unique(np.r_[equal[::4], own])
        assert path.delta_v == pytest.approx(
            cone_program(N, initials[k], finals[k], durations[k], both), rel=2e-8
        )


def test_weak_duality_in_fifty_digits():
    """g . c by the adjoint equation, and |p| at most 1 at 2000 times."""
    mp.mp.dps = 50
    initials, finals, durations = cases(3, 6)
    bound = cf.least_delta_v(ORBIT, initials, finals, durations)
    for k in range(6):
        a, t = mp.matrix(hill(N).tolist()), mp.mpf(float(durations[k]))
        gained = mp.expm(-a * t) * mp.matrix(finals[k].tolist()) - mp.matrix(initials[k].tolist())
        c = [mp.mpf(float(x)) for x in bound.primer.arcs[k, 6:12]]
        n = mp.mpf(N)
        costate = [2 * n * c[1] - c[3], -2 * n * c[0] - c[4], -c[5], c[0], c[1], c[2]]
        worth = sum(one * other for one, other in zip(costate, gained, strict=True))
        assert float(worth) == pytest.approx(bound.lower[k], rel=1e-11)
        p = bound.primer[k].position(np.linspace(0, durations[k], 2000))
        assert np.linalg.norm(p, axis=-1).max() <= 1 + 1e-11


def test_end_by_an_independent_integrator():
    path = ORBIT.impulsive(CURTIS, np.zeros(6), 28800.0)
    state, now = CURTIS.copy(), 0.0
    for t, push in [*path.impulses, (28800.0, np.zeros(3))]:
        if t > now:
            flown = solve_ivp(
                lambda _, s: hill(N) @ s, (now, t), state, method="DOP853", rtol=1e-13, atol=1e-9
            )
            state, now = flown.y[:, -1], t
        assert state[:3] == pytest.approx(path.position(t), abs=1e-5)
        state[3:] += push
    assert state == pytest.approx(np.zeros(6), abs=1e-5)  # m and m/s, of 30 km


@pytest.mark.parametrize("duration", [1e-3, 10.0, 1e5])
def test_deep_space(duration):
    """Two impulses with a proof, unique except along one line."""
    orbit, rng = cf.Orbit(0.0), np.random.default_rng(4)
    initial, final = rng.normal(size=(2, 6))
    path, two = orbit.impulsive(initial, final, duration), orbit.two_impulse(initial, final, duration)
    assert path.delta_v == pytest.approx(two.delta_v, rel=1e-13)
    bound = cf.least_delta_v(orbit, initial, final, duration)
    assert bound.lower == bound.upper
    assert bound.unique
    ends = bound.primer.position([0.0, duration])
    assert np.linalg.norm(ends, axis=-1) == pytest.approx(1.0, abs=1e-14)
    rest = cf.least_delta_v(orbit, np.zeros(6), [0, 300, 0, 0, 0, 0], duration)
    assert rest.lower == pytest.approx(2 * 300 / duration, rel=1e-14)
    ahead = cf.least_delta_v(orbit, np.zeros(6), [duration, 0, 0, 2, 0, 0], duration)
    assert ahead.lower == pytest.approx(2.0, rel=1e-14)
    assert not ahead.unique  # accelerating halfway costs the same


def test_known_minima():
    """n times the change of inclination or, with unlimited time, n times that of drift."""
    for orbits in (0.5, 0.8, 3.0, 7.3):
        lower = cf.least_delta_v(ORBIT, [0, 0, 100, 0, 0, 0], np.zeros(6), orbits * ORBIT.period)
        assert lower.lower == pytest.approx(N * 100, rel=1e-10)
        assert lower.unique == (orbits == 0.5)  # of pushes half an orbit apart any share does
    raised = [2.0 * 50, 0, 0, 0, -3.0 * N * 50, 0]  # a circular orbit 100 m above: d = 50 m
    bound = cf.least_delta_v(ORBIT, np.zeros(6), raised, 2.5 * ORBIT.period)
    assert bound.lower >= N * 50 * (1 - 1e-12)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_impulses_along_a_constant_primer_are_optimal(side):
    """Impulses along a primer of constant length are optimal."""
    rng = np.random.default_rng(6)
    for _ in range(30):
        duration, phase = rng.uniform(0.3, 4.0) * ORBIT.period, rng.uniform(0, 2 * np.pi)
        times, sizes = rng.uniform(0, duration, 7), rng.uniform(0, 1, 7)
        f = N * times + phase
        p = np.stack([0.5 * np.cos(f), -np.sin(f), side * np.sqrt(0.75) * np.cos(f)], axis=1)
        initial = relative_orbit_states(rng, 100.0)
        final = expm(hill(N) * duration) @ initial
        for t, push in zip(times, sizes[:, None] * p, strict=True):
            final = final + expm(hill(N) * (duration - t))[:, 3:] @ push
        bound = cf.least_delta_v(ORBIT, initial, final, duration)
        assert bound.upper == pytest.approx(sizes.sum(), rel=1e-9)
        assert bound.proven
        assert cf.delta_v_bound(ORBIT, initial, final, duration) == pytest.approx(sizes.sum(), rel=1e-11)


def test_closed_form_bound():
    """The bound is below the minimum and often exact."""
    initials, finals, durations = cases(7, 2000)
    quick, bound = (f(ORBIT, initials, finals, durations) for f in (cf.delta_v_bound, cf.least_delta_v))
    assert (quick <= bound.upper * (1 + 1e-11)).all()
    rng = np.random.default_rng(8)
    a, b = (np.array([relative_orbit_states(rng, 200.0) for _ in range(300)]) for _ in range(2))
    durations = rng.uniform(1.0, 3.0, 300) * ORBIT.period
    quick, bound = cf.delta_v_bound(ORBIT, a, b, durations), cf.least_delta_v(ORBIT, a, b, durations)
    exact = quick >= bound.upper * (1 - 1e-9)
    assert 0.3 < exact.mean() < 0.5
    assert not (bound.unique & exact).any()
    matrix = cf.delta_v_bound(ORBIT, a[:5, None], b[:4], 5000.0)
    assert matrix.shape == (5, 4)
    assert matrix[3, 2] == cf.delta_v_bound(ORBIT, a[3], b[2], 5000.0)


def range_of_shares(bound, k, initial, final, duration):
    """Return the largest range of an impulse's share among minimum plans, by a linear program."""
    times = np.linspace(0, duration, 4001)
    p = bound.primer[k].position(times)
    length = np.linalg.norm(p, axis=-1)
    high = np.flatnonzero(length > 1 - 2e-5)
    scale = np.array([1 / duration] * 3 + [1.0] * 3)
    moves = ORBIT.transition(duration - times[high])[:, :, 3:]
    columns = scale[:, None] * np.einsum("kij,kj->ki", moves, p[high] / length[high, None]).T
    gap = scale * (final - ORBIT.transition(duration) @ initial) / bound.upper[k]
    ranges = []
    for group in np.split(np.arange(len(high)), np.flatnonzero(np.diff(high) > 1) + 1):
        share = np.isin(np.arange(len(high)), group) * 1.0
        sides = np.vstack([columns, -columns]), np.concatenate([gap, -gap]) + 1e-4
        ends = [linprog(way * share, *sides) for way in (1, -1)]
        ranges.append(-ends[1].fun - ends[0].fun)
    return max(ranges)


def test_uniqueness_agrees_with_a_linear_program():
    """A linear program finds the same freedom of equal-cost plans."""
    rng = np.random.default_rng(8)
    a, b = (np.array([relative_orbit_states(rng, 200.0) for _ in range(300)]) for _ in range(2))
    durations = rng.uniform(1.0, 3.0, 300) * ORBIT.period
    bound = cf.least_delta_v(ORBIT, a, b, durations)
    exact = cf.delta_v_bound(ORBIT, a, b, durations) >= bound.upper * (1 - 1e-9)
    some = np.flatnonzero(~exact)[:25]
    free = np.array([range_of_shares(bound, k, a[k], b[k], durations[k]) for k in some])
    assert 5 < bound.unique[some].sum() < 20
    assert (free[bound.unique[some]] < 0.1).all()
    assert (free[~bound.unique[some]] > 0.1).all()


def least(initial, final, duration):
    return cf.least_delta_v(ORBIT, initial, final, duration).upper


def test_invariants():
    """Reversal, reflection, shift and scale keep the cost."""
    initials, finals, durations = cases(9, 300)
    value = least(initials, finals, durations)
    back = np.array([1, -1, 1, -1, 1, -1.0])  # y and time reversed leaves Hill's equations as they are
    assert least(finals * back, initials * back, durations) == pytest.approx(value, rel=1e-8)
    mirror = np.array([1, 1, -1, 1, 1, -1.0])
    assert least(initials * mirror, finals * mirror, durations) == pytest.approx(value, rel=1e-8)
    assert least(7 * initials, 7 * finals, durations) == pytest.approx(7 * value, rel=1e-8)
    drift = initials[::-1]
    moved = np.einsum("kij,kj->ki", ORBIT.transition(durations), drift)
    shifted = least(initials + drift, finals + moved, durations)
    sizes = np.abs(np.c_[initials, drift, moved]).max(axis=1) / np.abs(np.c_[initials, finals]).max(axis=1)
    steady = sizes * (1 + N * durations) < 1e3  # of larger coasts rounding is left
    assert shifted[steady] == pytest.approx(value[steady], rel=1e-8)
    other = least(initials, finals[::-1], durations)
    middle = least(initials, 0.3 * finals + 0.7 * finals[::-1], durations)
    assert (middle <= (0.3 * value + 0.7 * other) * (1 + 1e-8)).all()


def test_longer_transfers_cost_no_more():
    """Between natural motions more time never costs more."""
    rng = np.random.default_rng(10)
    durations = np.linspace(0.1, 4.0, 80) * ORBIT.period
    for drifting in (False, True):
        a, b = relative_orbit_states(rng, 300.0, drifting), relative_orbit_states(rng, 300.0, drifting)
        value = least(a, ORBIT.transition(durations) @ b, durations)
        assert (np.diff(value) <= 1e-9 * value[:-1]).all()
        assert value[-1] < 0.9 * value[0]


@pytest.mark.parametrize("n", [0.0, N])
def test_natural_motion_needs_no_impulse(n):
    orbit, initial = cf.Orbit(n), np.array([10.0, -3.0, 5.0, 0.01, 0.02, 0.0])
    final = orbit.coast(initial, 9000.0).state(9000.0)
    path, bound = orbit.impulsive(initial, final, 9000.0), cf.least_delta_v(orbit, initial, final, 9000.0)
    assert path.impulses == ()
    assert path.delta_v == bound.lower == bound.upper == bound.gap == 0.0
    assert path.state(9000.0) == pytest.approx(final, abs=1e-9)


def test_batches_broadcast():
    """Batches of any shape have the results of their members."""
    rng = np.random.default_rng(11)
    a, b = (np.array([relative_orbit_states(rng, 100.0) for _ in range(k)]) for k in (9, 12))
    starts = rng.uniform(0, 1e4, (9, 1))
    paths = ORBIT.impulsive(a[:, None], b, 4000.0, starts)
    assert paths.shape == (9, 12)
    assert paths.start == pytest.approx(np.broadcast_to(starts, (9, 12)))
    for i, j in ((0, 0), (3, 7), (8, 11)):
        one = ORBIT.impulsive(a[i], b[j], 4000.0, starts[i, 0])
        assert (one.arcs == paths[i, j].arcs).all()
    assert ORBIT.impulsive(np.empty((0, 6)), np.zeros(6), 4000.0).shape == (0,)


def test_long_transfers_are_refused():
    with pytest.raises(ValueError, match=r"duration: .* at most 100 orbits, got 101; coast for the rest"):
        ORBIT.impulsive(CURTIS, np.zeros(6), 101 * ORBIT.period)
    assert cf.least_delta_v(ORBIT, CURTIS, np.zeros(6), 99 * ORBIT.period).proven


def test_transfer_cost_table_has_the_minimum():
    """The minimum agrees with the full matrix of slots and durations."""
    rng = np.random.default_rng(12)
    slots, initial = (
        np.array([relative_orbit_states(rng, 60.0) for _ in range(30)]),
        relative_orbit_states(rng, 200.0, drifting=True),
    )
    durations = np.linspace(0.15, 2.5, 20) * ORBIT.period
    found = cf.transfer_cost_table(ORBIT, initial, slots, durations)
    finals = np.einsum("dij,sj->dsi", ORBIT.transition(durations), slots)
    costs = least(initial, finals, durations[:, None])
    assert found.delta_v == pytest.approx(costs.min(axis=1), rel=1e-9)
    assert costs[np.arange(20), found.slot] == pytest.approx(found.delta_v, rel=1e-9)
    assert (found.lower <= found.delta_v).all()
    assert found.lower == pytest.approx(found.delta_v, rel=1e-9)
    assert (np.diff(found.delta_v) <= 1e-9 * found.delta_v[0]).all()
    assert found.examined < 200
    assert (found.final == finals[np.arange(20), found.slot]).all()
    path = ORBIT.impulsive(initial, found.final[7], durations[7])
    assert path.delta_v == pytest.approx(found.delta_v[7], rel=1e-12)


@pytest.mark.parametrize(
    ("slots", "duration", "message"),
    [
        (np.empty((0, 6)), [900.0], r"slots: expected shape \(S, 6\) for at least one slot, got \(0, 6\)"),
        (
            np.zeros((2, 6)),
            900.0,
            r"duration: expected shapes \(6,\) and \(D,\), got \(6,\) and \(\)",
        ),
    ],
)
def test_transfer_cost_table_refuses_invalid_input(slots, duration, message):
    with pytest.raises(ValueError, match=message):
        cf.transfer_cost_table(ORBIT, CURTIS, slots, duration)
