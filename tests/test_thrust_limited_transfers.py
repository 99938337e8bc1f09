"""Transfers within a thrust limit in the given time: convex programs, an integrator and exact cases."""

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import closeform as cf

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
REST = np.zeros(6)


def bounded(draws: np.random.Generator, orbit: cf.Orbit = ORBIT, size: float = 200.0) -> np.ndarray:
    """A state that does not drift, some hundred metres away."""
    n = orbit.mean_motion or 1e-3
    state = draws.normal(size=6) * size * np.array([1.0, 2.0, 1.0, n, 2 * n, n])
    state[4] = -2 * n * state[0]
    return state


def cases(seed: int, count: int, lowest: float, highest: float, orbit: cf.Orbit = ORBIT):
    """Ends, durations and limits in shares of the peak of the optimum without one."""
    draws = np.random.default_rng(seed)
    period = 2 * np.pi / (orbit.mean_motion or 1e-3)
    begins, ends = (np.array([bounded(draws, orbit) for _ in range(count)]) for _ in range(2))
    durations = period * draws.uniform(0.1, 3.0, count)
    free = orbit.transfer(begins, ends, durations)
    return begins, ends, durations, free, np.asarray(free.peak_thrust) * draws.uniform(lowest, highest, count)


def hill(n: float) -> np.ndarray:
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3, 0], matrix[5, 2], matrix[3, 4], matrix[4, 3] = 3 * n * n, -n * n, 2 * n, -2 * n
    return matrix


def program(n: float, begin, end, duration: float, limit: float, sparing: bool, steps: int = 240):
    """Least energy or delta-v of thrusts constant for each step, by a convex program; None if impossible."""
    h = duration / steps
    block = np.zeros((9, 9))
    block[:6, :6], block[3:6, 6:] = hill(n) * h, np.eye(3) * h
    step = expm(block)
    units = np.repeat([1.0 / duration, 1.0], 3)
    gain, flow = [], np.eye(6)
    for _ in range(steps):
        gain.insert(0, units[:, None] * (flow @ step[:6, 6:]) * limit)
        flow = flow @ step[:6, :6]
    missing = units * (end - flow @ begin)
    size = np.abs(missing).max()
    count = 4 * steps if sparing else 3 * steps
    columns = np.array([k for k in range(count) if not sparing or k % 4])
    gains = np.zeros((6, count))
    gains[:, columns] = np.hstack(gain) / size
    rows, right = np.zeros((4 * steps, count)), np.zeros(4 * steps)
    for k in range(steps):
        rows[4 * k + 1 : 4 * k + 4, columns[3 * k : 3 * k + 3]] = -np.eye(3)
        right[4 * k] = 0.0 if sparing else 1.0
        if sparing:
            rows[4 * k, 4 * k] = -1.0
    cones = [clarabel.ZeroConeT(6)] + [clarabel.SecondOrderConeT(4)] * steps
    blocks, rights = [sparse.csc_matrix(gains), sparse.csc_matrix(rows)], [missing / size, right]
    quadratic, linear = sparse.eye(count, format="csc") / steps, np.zeros(count)
    if sparing:
        most = sparse.csc_matrix((np.ones(steps), (range(steps), range(0, count, 4))), shape=(steps, count))
        blocks, rights = [*blocks, most], [*rights, np.ones(steps)]
        cones.append(clarabel.NonnegativeConeT(steps))
        quadratic, linear = sparse.csc_matrix((count, count)), np.zeros(count)
        linear[::4] = 1.0 / steps
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    matrix = sparse.vstack(blocks).tocsc()
    found = clarabel.DefaultSolver(quadratic, linear, matrix, np.concatenate(rights), cones, settings).solve()
    if str(found.status) != "Solved":
        return None
    return found.obj_val * duration * (limit if sparing else limit**2)


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
@pytest.mark.parametrize("orbit", [ORBIT, DEEP], ids=["orbit", "deep space"])
def test_convex_programs_agree_on_cost_and_feasibility(orbit, cost):
    """The programs hold thrust for 1/240 of the time, which costs some 1e-4 more and never less."""
    begins, ends, durations, free, limits = cases(5, 8, 0.6, 1.1, orbit)
    for begin, end, duration, limit in zip(begins, ends, durations, limits, strict=True):
        least = program(orbit.mean_motion, begin, end, duration, limit, cost == "delta-v")
        if least is None:
            with pytest.raises(ValueError, match=r"^max_acceleration: a thrust of .* is enough$"):
                orbit.transfer(begin, end, duration, 0.0, limit, cost)
            continue
        path = orbit.transfer(begin, end, duration, 0.0, limit, cost)
        ours = path.energy if cost == "energy" else path.delta_v
        assert -1e-7 <= least / ours - 1 <= 2e-3


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_paths_meet_their_ends_within_the_limit(cost):
    """Energy is never below the free optimum's, and delta-v never above that of the least energy."""
    begins, ends, durations, free, limits = cases(7, 60, 1.0, 3.0)
    limits[::2] *= 0.9 if cost == "energy" else 1.0
    limits[0] = free.peak_thrust[0] * 0.97
    possible = 0
    for k in range(len(limits)):
        try:
            path = ORBIT.transfer(begins[k], ends[k], durations[k], 0.0, limits[k], cost)
        except ValueError:  # of limits below the free peak
            assert limits[k] < free.peak_thrust[k]
            continue
        possible += 1
        off = np.abs(path.state(durations[k]) - ends[k]) * np.repeat([1.0, durations[k]], 3)
        scale = max(np.abs(begins[k]).max(), np.abs(ends[k]).max())
        assert off.max() <= 3e-9 * max(scale, np.abs(begins[k][3:]).max() * durations[k])
        assert path.peak_thrust <= limits[k] * (1 + 1e-9)
        assert path.start == 0.0
        assert path.end == durations[k]
        if cost == "energy":
            assert path.energy >= free.energy[k] * (1 - 1e-9)
        else:
            assert path.delta_v <= free.delta_v[k] * (1 + 1e-9)
    assert possible > 50


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_path_agrees_with_an_integrator(cost):
    """It is fed with `path.thrust`, arc by arc, as thrust jumps between them."""
    begins, ends, durations, _, limits = cases(11, 3, 0.9, 1.5)
    matrix = hill(ORBIT.mean_motion)
    for begin, end, duration, limit in zip(begins, ends, durations, limits * 1.2, strict=True):
        path = ORBIT.transfer(begin, end, duration, 50.0, limit, cost)
        state = begin
        for arc in path.arcs:
            inner = np.array([arc[0], arc[1]])

            def rates(t, s, inner=inner, path=path):
                middle = np.clip(t, *(inner + np.array([1e-9, -1e-9]) * (inner[1] - inner[0])))
                return matrix @ s + np.concatenate([np.zeros(3), path.thrust(middle)])

            state = solve_ivp(rates, inner, state, "DOP853", rtol=1e-11, atol=1e-10).y[:, -1]
        scale = max(np.abs(begin).max(), np.abs(end).max())
        np.testing.assert_allclose(state[:3], end[:3], atol=1e-7 * scale)
        np.testing.assert_allclose(state[3:] * duration, end[3:] * duration, atol=1e-6 * scale)


def test_rest_to_rest_in_deep_space_is_exact():
    """Along a line: least peak 4 L/T^2; delta-v by two burns, U t^2 - U T t + L = 0."""
    final = [30.0, 40.0, 120.0, 0, 0, 0]
    length, duration = 130.0, 1000.0
    least = 4 * length / duration**2
    with pytest.raises(ValueError, match="is enough") as refused:
        DEEP.transfer(REST, final, duration, 0.0, 0.99 * least)
    named = float(str(refused.value).split(";")[1].split()[0])
    assert named == pytest.approx(least, rel=3e-6)
    assert DEEP.transfer(REST, final, duration, 0.0, named).peak_thrust <= named * (1 + 1e-9)
    for factor in (1.01, 1.3, 10.0, 1000.0):
        limit = factor * least
        burn = (duration - np.sqrt(duration**2 - 4 * length / limit)) / 2
        path = DEEP.transfer(REST, final, duration, 0.0, limit, "delta-v")
        assert path.delta_v == pytest.approx(2 * limit * burn, rel=1e-6)
        assert path.peak_thrust == pytest.approx(limit, rel=2e-3)


def test_more_thrust_never_costs_more():
    """Down to that of impulses: in deep space, from rest to rest, 2 L/T."""
    begins, ends, durations, free, _ = cases(13, 4, 1.0, 1.0)
    for k in range(4):
        limits = free.peak_thrust[k] * np.array([1.0, 1.1, 1.5, 2.0, 4.0, 10.0, 30.0])
        spent = ORBIT.transfer(begins[k], ends[k], durations[k], 0.0, limits, "delta-v").delta_v
        assert (np.diff(spent) <= 1e-6 * spent[:-1]).all()
        energies = ORBIT.transfer(begins[k], ends[k], durations[k], 0.0, limits).energy
        np.testing.assert_allclose(energies, free.energy[k], rtol=1e-9)
    path = DEEP.transfer(REST, [100.0, 0, 0, 0, 0, 0], 1000.0, 0.0, 1.0, "delta-v")
    assert path.delta_v == pytest.approx(0.2, rel=2e-4)


def test_symmetries_of_mirroring_and_scaling():
    begins, ends, durations, free, _ = cases(17, 6, 1.0, 1.0)
    limits = free.peak_thrust * 1.05
    mirror, scale = np.array([1.0, 1, -1, 1, 1, -1]), 1e3
    for cost in ("energy", "delta-v"):
        path = ORBIT.transfer(begins, ends, durations, 0.0, limits, cost)
        other = ORBIT.transfer(
            begins * mirror * scale, ends * mirror * scale, durations, 5.0, limits * scale, cost
        )
        np.testing.assert_allclose(other.delta_v, path.delta_v * scale, rtol=1e-6)
        back = ORBIT.transfer(
            ends * [1, -1, 1, -1, 1, -1], begins * [1, -1, 1, -1, 1, -1], durations, 0.0, limits, cost
        )
        np.testing.assert_allclose(back.delta_v, path.delta_v, rtol=1e-6)  # time runs backwards


def test_inactive_limit_changes_nothing():
    begins, ends, durations, free, _ = cases(19, 5, 1.0, 1.0)
    path = ORBIT.transfer(begins, ends, durations, 0.0, free.peak_thrust * 1.001)
    assert len(path.arcs) == 5
    np.testing.assert_allclose(path.energy, free.energy, rtol=1e-9)


def test_bound_within_a_limit_agrees_with_its_primer():
    """Weak duality: the value of the transfer less the limit times the integral of max(|p| - 1, 0)."""
    begins, ends, durations, free, _ = cases(37, 6, 1.0, 1.0)
    limits = 1.5 * free.peak_thrust
    bound = cf.least_delta_v(ORBIT, begins, ends, durations, limits)
    path = ORBIT.transfer(begins, ends, durations, 0.0, limits, "delta-v")
    np.testing.assert_allclose(bound.upper, path.delta_v, rtol=1e-12)
    assert bound.proven.all()
    assert (cf.least_delta_v(ORBIT, begins, ends, durations).lower <= bound.upper).all()
    for k in range(6):
        times = np.linspace(0.0, durations[k], 200_001)
        p = bound.primer[k].position(times)
        excess = np.maximum(np.linalg.norm(p, axis=1) - 1.0, 0.0)
        worth = np.einsum("ij,ij->i", p, free[k].thrust(times))  # any thrust that makes the transfer
        dual = np.trapezoid(worth - limits[k] * excess, times)
        assert bound.lower[k] == pytest.approx(dual, rel=1e-7)


def test_infinite_limit_gives_impulses():
    begins, ends, durations, free, _ = cases(31, 3, 1.0, 1.0)
    least = ORBIT.transfer(begins, ends, durations, cost="delta-v")
    np.testing.assert_array_equal(least.delta_v, ORBIT.impulsive(begins, ends, durations).delta_v)
    limited = ORBIT.transfer(begins, ends, durations, 0.0, 300 * free.peak_thrust, "delta-v")
    assert (least.delta_v <= limited.delta_v).all()
    np.testing.assert_allclose(limited.delta_v, least.delta_v, rtol=1e-3)


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_natural_motion_needs_no_thrust(cost):
    begin = bounded(np.random.default_rng(3))
    end = ORBIT.coast(begin, 2000.0).state(2000.0)
    path = ORBIT.transfer(begin, end, 2000.0, 0.0, 1e-6, cost)
    assert path.delta_v < 1e-10


def test_batches_broadcast_and_name_infeasible_members():
    begins, ends, durations, free, _ = cases(23, 4, 1.0, 1.0)
    limits = np.array([1.0, 2.0, 5.0])[:, None] * free.peak_thrust
    paths = ORBIT.transfer(begins, ends, durations, 10.0, limits, "delta-v")
    assert paths.shape == (3, 4)
    alone = ORBIT.transfer(begins[1], ends[1], durations[1], 10.0, limits[2, 1], "delta-v")
    assert paths[2, 1].delta_v == pytest.approx(alone.delta_v, rel=1e-12)
    limits[2, 1] = 0.2 * free.peak_thrust[1]
    with pytest.raises(ValueError, match=r"^max_acceleration: craft 2, 1: a thrust of "):
        ORBIT.transfer(begins, ends, durations, 10.0, limits)
    assert ORBIT.transfer(np.empty((0, 6)), ends[0], 10.0, 0.0, 1.0).shape == (0,)


def test_conflicts_of_saturated_paths_agree_with_dense_sampling():
    """Conflicts with the same path a moment later and with a coast agree with dense samples."""
    begins, ends, durations, free, _ = cases(29, 2, 1.0, 1.0)
    path = ORBIT.transfer(begins[0], ends[0], 3000.0, 0.0, free.peak_thrust[0] * 30, "delta-v")
    other = ORBIT.coast(path.state(1500.0) * 1.01, 3000.0)
    zone = cf.Sphere(150.0)
    times = np.linspace(0.0, 3000.0, 60_001)
    ratio = zone.norm(path.position(times) - other.position(times))
    found = cf.closest_approach(path, other, zone)
    assert ratio.min() * (1 - 1e-6) <= found.ratio <= ratio.min() + 1e-12


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"max_acceleration": 0.0}, "max_acceleration: must be positive"),
        ({"cost": "fuel"}, 'cost: expected "energy" or "delta-v", got \'fuel\''),
    ],
)
def test_invalid_input_is_named(arguments, named):
    with pytest.raises(ValueError, match="^" + named):
        ORBIT.transfer(np.zeros((2, 6)), [100.0, 0, 0, 0, 0, 0], 600.0, **arguments)


@pytest.mark.parametrize("limit", [0.1, 1.0, 10.0])
def test_high_limits(limit):
    """Burns of seconds in transfers of an hour cost little more than impulses."""
    orbit = cf.Orbit.circular(500e3)
    n, rng = orbit.mean_motion, np.random.default_rng(5)
    for _ in range(25):
        a, b = rng.normal(size=(2, 6)) * np.array([300.0] * 3 + [300.0 * n] * 3)
        duration = orbit.period * rng.uniform(0.3, 2.0)
        path = orbit.transfer(a, b, duration, max_acceleration=limit, cost="delta-v")
        lower = cf.least_delta_v(orbit, a, b, duration).lower
        assert lower * (1.0 - 1e-9) <= path.delta_v <= lower * (1.0 + 1e-3 / limit)
        assert path.peak_thrust <= limit * (1.0 + 1e-9)
        assert not path.impulses
        assert np.abs(path.state(0.0) - a).max() == 0.0
        assert np.abs(path.state(duration) - b)[:3].max() < 1e-5  # m, of hundreds
        assert np.abs(path.state(duration) - b)[3:].max() < 1e-8


@pytest.mark.parametrize(("factor", "seed"), [(3e3, 42), (1e5, 43)])
def test_short_burns_cost_little_more_than_the_bound(factor, seed):
    """The bound from its primer alone, by sums, closer where craft burn; the end by matrix exponentials.

    The bound of impulses is below by half a burn at an end: by 5e-5 at 3000 times the peak.
    """
    begins, ends, durations, free, _ = cases(seed, 15, 1.0, 1.0)
    limits = factor * free.peak_thrust
    bound = cf.least_delta_v(ORBIT, begins, ends, durations, limits)
    paths = ORBIT.transfer(begins, ends, durations, 0.0, limits, "delta-v")
    np.testing.assert_array_equal(bound.upper, paths.delta_v)
    assert bound.proven.all()
    assert (bound.upper <= (1.0 + 1e-6) * bound.lower).all()
    assert (bound.lower <= (1.0 + 1e-9) * bound.upper).all()
    for k, path in enumerate(paths):
        even = np.linspace(0.0, durations[k], 50_001)
        worth = np.einsum("ij,ij->i", bound.primer[k].position(even), free[k].thrust(even))
        burning = [arc[:2] for arc in path.arcs if path.thrust(0.5 * (arc[0] + arc[1])).any()]
        around = [np.linspace(a - (b - a), b + (b - a), 4001) for a, b in burning]
        times = np.unique(np.clip(np.concatenate([even[::100], *around]), 0.0, durations[k]))
        excess = np.maximum(np.linalg.norm(bound.primer[k].position(times), axis=1) - 1.0, 0.0)
        dual = np.trapezoid(worth, even) - limits[k] * np.trapezoid(excess, times)
        assert bound.lower[k] == pytest.approx(dual, rel=1e-7)
        state = begins[k]
        for arc in path.arcs:
            block = np.zeros((9, 9))
            block[:6, :6], block[3:6, 6:] = hill(ORBIT.mean_motion), np.eye(3)
            thrust = path.thrust(0.5 * (arc[0] + arc[1]))
            assert np.linalg.norm(thrust) <= limits[k] * (1.0 + 1e-9)
            state = (expm(block * (arc[1] - arc[0])) @ np.concatenate([state, thrust]))[:6]
        assert np.abs(state - ends[k])[:3].max() < 1e-7  # m, of hundreds
        assert np.abs(state - ends[k])[3:].max() < 1e-10


def test_burns_belong_to_their_spacecraft(monkeypatch):
    """Costly short burns use another method; the next member of the batch may be infeasible."""
    begins, ends, durations, free, _ = cases(42, 12, 1.0, 1.0)
    limits = free.peak_thrust * np.tile([1100.0, 0.3], 6)
    monkeypatch.setattr("closeform.motion.minimum_delta_v.within_limit.WORST", -1.0)
    for k in range(0, 12, 2):
        two = slice(k, k + 2)
        with pytest.raises(ValueError, match=r"^max_acceleration: craft 1: a thrust of "):
            ORBIT.transfer(begins[two], ends[two], durations[two], 0.0, limits[two], "delta-v")


@pytest.mark.parametrize("start", [0.0, 1e9])
@pytest.mark.parametrize("limit", [1e3, 1e6, 1e12, 9.99e59])  # numbers must be below 1e60
def test_shortest_burns_are_complete(limit, start):
    """Of m/s within fractions of a tick of the clock: neither the end nor the limit suffers from rounding."""
    begins, ends, durations, _, _ = cases(44, 6, 1.0, 1.0)
    free = ORBIT.impulsive(begins, ends, durations, start)
    bound = cf.least_delta_v(ORBIT, begins, ends, durations, limit)
    assert (np.abs(bound.gap) <= 1e-6).all()
    np.testing.assert_allclose(bound.upper, free.delta_v, rtol=1e-6)
    paths = ORBIT.transfer(begins, ends, durations, start, limit, "delta-v")
    np.testing.assert_allclose(paths.delta_v, free.delta_v, rtol=1e-6)
    assert (paths.peak_thrust <= limit * (1.0 + 1e-9)).all()
    tick = np.spacing(start + durations.max())
    for path, end in zip(paths, ends, strict=True):
        missed = np.abs(path.state(path.end) - end)
        assert missed[:3].max() < 1e-8 + tick  # craft move by less than 1 m/s
        assert missed[3:].max() < 1e-11 + ORBIT.mean_motion * tick
