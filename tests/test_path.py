"""States, thrust, totals and impulses of paths, and how paths are joined."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

import closeform as cf

N = 1.1e-3
ORBIT, DEEP = cf.Orbit(N), cf.Orbit(0.0)
ZERO = np.zeros(6)
INITIAL = np.array([120.0, -80.0, 45.0, 0.11, -0.27, 0.06])
FINAL = np.array([-60.0, 150.0, -20.0, -0.05, 0.13, 0.09])
PUSH = np.array([3e-5, -2e-5, 1e-5])


def magnitude(path):
    return lambda t: float(np.linalg.norm(path.thrust(t)))


def measured(path):
    """Return energy, delta-v and peak thrust by quadrature and refined sampling."""
    size = magnitude(path)
    breaks = np.unique([*path.arcs[:, 0], path.end])
    energy = delta_v = peak = 0.0
    for begin, end in itertools.pairwise(breaks):
        end = np.nextafter(end, begin)  # the thrust of this arc, not of the next
        t = np.linspace(begin, end, 400)
        u = np.linalg.norm(path.thrust(t), axis=-1)
        lows = t[1:-1][(u[1:-1] <= u[:-2]) & (u[1:-1] <= u[2:])]  # kinks, where thrust passes zero
        cuts = [minimize_scalar(size, bounds=(s - t[1] + t[0], s + t[1] - t[0])).x for s in lows]
        for a, b in zip([begin, *cuts], [*cuts, end], strict=False):
            delta_v += quad(size, a, b, epsabs=0, epsrel=1e-12, limit=200)[0]
        energy += quad(lambda s: 0.5 * size(s) ** 2, begin, end, epsabs=0, epsrel=1e-12, limit=200)[0]
        k = int(u.argmax())
        around = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
        top = minimize_scalar(lambda s: -size(s), bounds=around, method="bounded", options={"xatol": 1e-9})
        peak = max(peak, u[k], -top.fun)
    return energy, delta_v, peak


PATHS = {
    "transfer": ORBIT.transfer(INITIAL, FINAL, 900.0, start=-200.0),
    "transfer over turns": ORBIT.transfer(INITIAL, FINAL, 30000.0),
    "transfer in seconds": ORBIT.transfer(INITIAL, FINAL, 3.0),
    "transfer in deep space": DEEP.transfer(INITIAL, FINAL, 900.0),
    "there and back to rest": DEEP.transfer(ZERO, [100, 0, 0, 0, 0, 0], 50.0),  # thrust passes zero
    "from zero thrust": DEEP.transfer(ZERO, [1 / 6, 0, 0, 0.5, 0, 0], 1.0),
    "burn": ORBIT.burn(INITIAL, PUSH, 4000.0),
    "burn in deep space": DEEP.burn(INITIAL, PUSH, 4000.0),
    "sampled": ORBIT.sampled([0.0, 300.0, 900.0], [INITIAL, FINAL, INITIAL]),
    "sampled in deep space": DEEP.sampled([0.0, 300.0, 900.0], [INITIAL, FINAL, INITIAL]),
    "legs": cf.join([ORBIT.transfer(INITIAL, FINAL, 500.0), ORBIT.burn(FINAL, PUSH, 100.0, start=500.0)]),
}


@pytest.mark.parametrize("name", PATHS)
def test_totals_agree_with_quadrature_and_sampling(name):
    path = PATHS[name]
    energy, delta_v, peak = measured(path)
    assert path.energy == pytest.approx(energy, rel=1e-10)
    assert path.delta_v == pytest.approx(delta_v, rel=1e-9)
    assert path.peak_thrust == pytest.approx(peak, rel=1e-9)


def test_coast_costs_nothing():
    path = ORBIT.coast(INITIAL, 5000.0)
    assert (path.energy, path.delta_v, path.peak_thrust, path.impulses) == (0.0, 0.0, 0.0, ())
    np.testing.assert_array_equal(path.thrust([0.0, 2500.0, 5000.0]), 0.0)


ends = st.lists(st.floats(-1, 1), min_size=12, max_size=12).map(np.array)


@settings(deadline=None, max_examples=40)
@given(ends, st.floats(5.0, 40000.0), st.sampled_from([0.0, N]))
def test_peak_thrust_is_above_every_sample(ends, duration, n):
    lengths = np.repeat([100.0, 100.0 / min(duration, 1e3)], 3)
    path = cf.Orbit(n).transfer(ends[:6] * lengths, ends[6:] * lengths, duration)
    u = np.linalg.norm(path.thrust(np.linspace(0, duration, 2001)), axis=1)
    assert u.max() <= path.peak_thrust * (1 + 1e-9)
    assert path.peak_thrust <= u.max() * (1 + 1e-3) + 1e-300


def test_state_splits_into_position_and_velocity():
    path = ORBIT.transfer(np.stack([INITIAL, FINAL]), FINAL, 900.0)
    t = np.array([[0.0, 100.0, 200.0], [300.0, 450.0, 900.0]])
    state = path.state(t)
    assert state.shape == (2, 2, 3, 6)
    np.testing.assert_array_equal(path.position(t), state[..., :3])
    np.testing.assert_array_equal(path.velocity(t), state[..., 3:])
    assert path.thrust(t).shape == (2, 2, 3, 3)
    assert path.state(450.0).shape == (2, 6)
    assert path.state([]).shape == (2, 0, 6)


def test_times_outside_the_path_are_rejected_except_rounding():
    path = ORBIT.coast(INITIAL, 1000.0, start=50.0)
    for edge, outside in ((50.0, -1), (1050.0, 1)):
        np.testing.assert_array_equal(path.state(edge + outside * 0.9e-6), path.state(edge))
        with pytest.raises(ValueError, match="time: must lie on the path, from 50 to 1050 s"):
            path.state(edge + outside * 1.1e-6)
    for bad in (np.nan, [100.0, np.nan], np.inf):
        with pytest.raises(ValueError, match="time: must lie on the path"):
            path.state(bad)
        with pytest.raises(ValueError, match="time: must lie on the path"):
            path.thrust(bad)


def test_indexing_as_an_array():
    states = np.arange(24 * 6, dtype=float).reshape(2, 3, 4, 6)
    path = ORBIT.coast(states, 100.0)
    assert len(path) == 2
    for index in (0, -1, (1, 2), (0, 1, 3), slice(1, None), (slice(None), 1), [1, 0, 1]):
        np.testing.assert_array_equal(path[index].state(0.0), states[index])
        assert path[index].shape == states[index].shape[:-1]
    np.testing.assert_array_equal(path[..., 2].state(0.0), states[..., 2, :])
    mask = states[..., 0].sum(axis=-1) > 100
    np.testing.assert_array_equal(path[mask].state(0.0), states[mask])
    assert path[np.zeros(2, dtype=bool)].shape == (0, 3, 4)
    assert [p.shape for p in path] == [(3, 4)] * 2
    with pytest.raises(IndexError):
        path[2]
    with pytest.raises(IndexError, match="cannot be indexed"):
        path[0, 0, 0][0]
    with pytest.raises(TypeError, match="no length"):
        len(path[0, 0, 0])


def test_indexing_keeps_all_arcs():
    first = ORBIT.coast(np.stack([INITIAL, FINAL]), 10.0)
    joined = cf.join([first, ORBIT.coast(first.state(10.0), 20.0, start=10.0)])
    pair = cf.stack([PATHS["legs"], PATHS["transfer"], PATHS["sampled"]])[[2, 0]]
    np.testing.assert_array_equal(pair.state(250.0)[1], PATHS["legs"].state(250.0))
    np.testing.assert_array_equal(pair.state(250.0)[0], PATHS["sampled"].state(250.0))
    np.testing.assert_allclose(joined[1].state(25.0), ORBIT.coast(FINAL, 30.0).state(25.0), rtol=1e-12)


def test_empty_batches():
    empty = ORBIT.coast(np.zeros((0, 6)), 100.0)
    assert empty.energy.shape == empty.delta_v.shape == empty.start.shape == (0,)
    assert empty.state([1.0, 2.0]).shape == (0, 2, 6)
    assert "(0,)" in repr(empty)


# --- join and stack ---------------------------------------------------------------------------


def test_join_turns_a_velocity_jump_into_an_impulse():
    first = ORBIT.coast(INITIAL, 100.0)
    kicked = first.state(100.0) + [0, 0, 0, 0.01, -0.02, 0.03]
    path = cf.join([first, ORBIT.coast(kicked, 50.0, start=100.0)])
    assert (path.start, path.end, path.energy) == (0.0, 150.0, np.inf)
    ((time, jump),) = path.impulses
    assert time == 100.0
    np.testing.assert_allclose(jump, [0.01, -0.02, 0.03], rtol=1e-12)
    assert path.delta_v == pytest.approx(np.sqrt(14e-4), rel=1e-12)
    np.testing.assert_allclose(path.state(100.0), kicked, rtol=1e-14)  # the state after it
    np.testing.assert_allclose(path.velocity(np.nextafter(100.0, 0)), first.velocity(100.0), rtol=1e-12)


def test_short_path_between_two_impulses():
    """Two impulses a microsecond apart both count."""
    brief = ORBIT.coast(INITIAL, 1e-6)
    state = brief.state(1e-6) + [0, 0, 0, 0.3, 0, 0]
    later = ORBIT.coast(state, 1e-6, start=1e-6)
    far = ORBIT.coast(later.state(2e-6) + [0, 0, 0, 0, 0.2, 0], 500.0, start=2e-6)
    path = cf.join([brief, later, far])
    assert path.delta_v == pytest.approx(0.5, rel=1e-9)
    assert len(path.impulses) == 2


def test_join_without_a_jump():
    whole = ORBIT.transfer(INITIAL, FINAL, 900.0)
    coast = ORBIT.coast(FINAL, 300.0, start=900.0)
    path = cf.join([whole, coast])
    assert path.impulses == ()
    assert path.energy == whole.energy
    np.testing.assert_allclose(path.state([100.0, 1000.0])[1], coast.state(1000.0), rtol=1e-14)


def test_join_keeps_inner_impulses():
    """A two-impulse path ends in an arc of zero length; the next path starts after it."""
    hop = ORBIT.two_impulse(INITIAL, FINAL, 600.0)
    path = cf.join([hop, ORBIT.coast(FINAL, 300.0, start=600.0)])
    assert [time for time, _ in path.impulses] == [0.0, 600.0]
    assert path.delta_v == pytest.approx(hop.delta_v, rel=1e-12)
    np.testing.assert_allclose(path.state(600.0), FINAL, rtol=1e-12)
    before = ORBIT.coast(INITIAL, 60.0)
    again = cf.join([before, ORBIT.two_impulse(before.state(60.0), FINAL, 600.0, start=60.0)])
    assert [time for time, _ in again.impulses] == [60.0, 660.0]
    np.testing.assert_allclose(again.state(660.0), FINAL, rtol=1e-10)


def test_join_at_rest_in_the_origin():
    """Rounding at zero position and velocity is no jump."""
    for orbit in (ORBIT, DEEP):
        arrival = orbit.transfer(INITIAL, ZERO, 700.0)
        path = cf.join([arrival, orbit.coast(ZERO, 100.0, start=700.0)])
        assert path.impulses == ()
        assert path.energy == arrival.energy


def test_join_of_batches():
    begins = np.stack([INITIAL, FINAL, 2 * FINAL])
    out = ORBIT.transfer(begins, np.zeros(6) + [9, 0, 0, 0, 0, 0], 700.0)
    back = ORBIT.transfer(np.zeros(6) + [9, 0, 0, 0, 0, 0], begins, 500.0, start=700.0)
    path = cf.join([out, back])
    assert path.shape == (3,)
    np.testing.assert_allclose(path.energy, out.energy + back.energy, rtol=1e-14)
    np.testing.assert_allclose(path.state(1200.0), begins, rtol=1e-9)
    np.testing.assert_array_equal(path[1].state(300.0), out.state(300.0)[1])


@pytest.mark.parametrize("orbit", [ORBIT, DEEP, cf.Orbit.eccentric(0.1, semi_major_axis=8e6)])
def test_extended_paths_coast_on(orbit):
    states = np.stack([INITIAL, FINAL])
    short = orbit.coast(states, [500.0, 700.0])
    longer = short.extended(600.0)
    np.testing.assert_array_equal(longer.end, [600.0, 700.0])
    np.testing.assert_array_equal(longer[1].state(650.0), short[1].state(650.0))
    np.testing.assert_allclose(longer[0].state(600.0), orbit.coast(INITIAL, 600.0).state(600.0), atol=1e-9)
    assert longer[0].impulses == ()
    assert short.extended(400.0) is short


def test_path_is_extended_from_its_last_impulse():
    move = ORBIT.two_impulse(INITIAL, FINAL, 900.0)
    longer = move.extended(1500.0)
    np.testing.assert_allclose(longer.state(1500.0), ORBIT.coast(FINAL, 600.0).state(600.0), atol=1e-9)
    assert len(longer.impulses) == len(move.impulses) == 2
    with pytest.raises(ValueError, match="until"):
        move.extended(np.inf)


def test_stack_of_different_times_and_arcs():
    path = cf.stack([PATHS["legs"], PATHS["transfer"]])
    assert path.shape == (2,)
    np.testing.assert_array_equal(path.start, [0.0, -200.0])
    np.testing.assert_array_equal(path.end, [600.0, 700.0])
    np.testing.assert_array_equal(path.delta_v, [PATHS["legs"].delta_v, PATHS["transfer"].delta_v])
    with pytest.raises(ValueError, match="time: must lie on the path, from 0 to 600"):
        path.state(-100.0)  # one of the craft is not there yet


BAD = {
    "gap": (
        lambda: cf.join([ORBIT.coast(ZERO, 1.0), ORBIT.coast(ZERO, 1.0, start=1.5)]),
        "paths: one ends and the next starts 0.5 s apart",
    ),
    "position": (
        lambda: cf.join([ORBIT.coast(ZERO, 1.0), ORBIT.coast(ZERO + 1, 1.0, start=1.0)]),
        "paths: position jumps by 1 m",
    ),
    "join nothing": (lambda: cf.join([]), "paths: "),
    "join shapes": (
        lambda: cf.join([ORBIT.coast(ZERO, 1.0), ORBIT.coast(np.zeros((1, 6)), 1.0, start=1.0)]),
        "paths: all must have one shape",
    ),
    "join orbits": (
        lambda: cf.join([ORBIT.coast(ZERO, 1.0), DEEP.coast(ZERO, 1.0, start=1.0)]),
        "paths: all must be in one orbit to join",
    ),
    "stack orbits": (
        lambda: cf.stack([ORBIT.coast(ZERO, 1.0), DEEP.coast(ZERO, 1.0)]),
        "paths: all must be in one orbit to stack",
    ),
    "impulses of a batch": (
        lambda: ORBIT.coast(np.zeros((2, 6)), 1.0).impulses,
        "impulses: requires one spacecraft",
    ),
    "stack batches": (lambda: cf.stack([ORBIT.coast(np.zeros((1, 6)), 1.0)]), "paths: stack takes"),
}


@pytest.mark.parametrize("case", BAD)
def test_invalid_input(case):
    call, message = BAD[case]
    with pytest.raises(ValueError, match=message):
        call()


def test_truth_value():
    path = cf.Orbit(0.0).coast(np.zeros(6), 1.0)
    assert path
    assert cf.Orbit(0.0).coast(np.zeros((2, 6)), 1.0)
    assert not cf.Orbit(0.0).coast(np.zeros((2, 6)), 1.0)[:0]
