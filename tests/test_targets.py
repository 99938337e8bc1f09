"""Named relative orbits against an integrator, dense sampling and published formulas."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import closeform as cf
from chiefs import flown as flown_about
from chiefs import orbit_of
from closeform.planning import targets

N = 1.1e-3
ORBIT = cf.Orbit(N)
DEEP = cf.Orbit(0.0)
STRAY = 1e-7  # m: what DOP853 at rtol 1e-12 leaves of some hundred metres over three orbits

FORMATIONS = {
    "safety_ellipse": targets.safety_ellipse(ORBIT, 5, 80.0, 120.0, along_track=40.0, phase=0.3),
    "separated_ring": targets.separated_ring(ORBIT, 4, 90.0, -60.0, 1.0),
    "projected_circular": targets.projected_circular(ORBIT, 6, 150.0, 0.4),
    "string_of_pearls": targets.string_of_pearls(ORBIT, 4, 75.0),
    "pendulum": targets.pendulum(ORBIT, 4, 100.0, 60.0),
}
RINGS = ("safety_ellipse", "separated_ring", "projected_circular")

lengths = st.floats(1.0, 1e4)
angles = st.floats(-10.0, 10.0)
counts = st.integers(1, 9)


def flown(n, states, times):
    """Return states (T, N, 6) by integration of theory (1)."""

    def hill(_, flat):
        x, _, z, vx, vy, vz = flat.reshape(-1, 6).T
        return np.stack([vx, vy, vz, 3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z], axis=-1).ravel()

    states = np.atleast_2d(states)
    found = solve_ivp(
        hill, (0.0, times[-1]), states.ravel(), method="DOP853", rtol=1e-12, atol=1e-12, t_eval=times
    )
    return found.y.T.reshape(len(times), *states.shape)


def gaps(states):
    """Return relative states (..., pairs, 6) of all pairs i < j."""
    first, second = np.triu_indices(states.shape[-2], 1)
    return states[..., first, :] - states[..., second, :]


def turn(count=2000):
    return np.linspace(0.0, ORBIT.period, count)


def sampled(states, times):
    """Return states (T, N, 6) of coasting spacecraft."""
    return np.moveaxis(ORBIT.coast(states, max(times[-1], 1.0)).state(times), 1, 0)


@pytest.mark.parametrize("name", FORMATIONS)
def test_formations_repeat_each_orbit(name):
    states = FORMATIONS[name]
    turns = flown(N, states, np.arange(4) * ORBIT.period)
    np.testing.assert_allclose(
        turns[:, :, :3], np.broadcast_to(states[:, :3], turns[:, :, :3].shape), atol=STRAY
    )
    np.testing.assert_allclose(states[:, 4], -2.0 * N * states[:, 0], atol=1e-12)  # no drift: d = 0


@pytest.mark.parametrize("name", RINGS)
def test_spacecraft_of_a_ring_follow_each_other(name):
    states = FORMATIONS[name]
    later = flown(N, states, np.array([0.0, ORBIT.period / len(states)]))[1]
    np.testing.assert_allclose(later[:, :3], np.roll(states, -1, axis=0)[:, :3], atol=STRAY)


def test_projected_circle():
    states = FORMATIONS["projected_circular"]
    x, y, z = np.moveaxis(flown(N, states, turn(500))[..., :3], -1, 0)
    np.testing.assert_allclose(np.hypot(y, z), 150.0, atol=STRAY)
    np.testing.assert_allclose(x, 0.5 * z, atol=STRAY)
    np.testing.assert_allclose(np.arctan2(z[0, 0], y[0, 0]), 0.4)
    np.testing.assert_allclose(np.linalg.norm(gaps(states)[0, 1:3]), 150.0)  # a hexagon


@given(st.data())
@settings(max_examples=20)
def test_safety_ellipse_amplitudes(data):
    radial, cross_track = data.draw(lengths), data.draw(lengths)
    along_track, phase = data.draw(st.floats(-1e4, 1e4)), data.draw(angles)
    states = targets.safety_ellipse(ORBIT, 3, radial, cross_track, along_track, phase)
    x, y, z = np.moveaxis(sampled(states, turn(4001))[..., :3], -1, 0)
    fine = 1e-6  # of a swing: the samples are 1.6e-3 rad apart, its half squared at the top
    assert np.abs(x).max() == pytest.approx(radial, rel=fine)
    assert np.abs(z).max() == pytest.approx(cross_track, rel=fine)
    assert np.abs(y - along_track).max() == pytest.approx(2.0 * radial, rel=fine)
    assert np.hypot(x, z).min() >= min(radial, cross_track) * (1.0 - 1e-9)
    np.testing.assert_allclose((x / radial) ** 2 + (z / cross_track) ** 2, 1.0, rtol=1e-9)
    lowest = targets.safety_ellipse(ORBIT, 1, radial, cross_track)
    np.testing.assert_allclose(lowest[0, :3], [-radial, 0.0, 0.0], atol=1e-9 * radial)


def least_across(e, i):
    """Return the least separation perpendicular to the track (D'Amico and Montenbruck 2006)."""
    both = np.linalg.norm(e + i) * np.linalg.norm(e - i)
    return np.sqrt(2.0) * abs(e @ i) / np.sqrt(e @ e + i @ i + both)


@given(
    count=st.integers(2, 9),
    e=lengths,
    i=lengths,
    sign=st.sampled_from([1.0, -1.0]),
    phase=angles,
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=30)
def test_separated_ring_is_passively_safe_at_any_along_track_offset(count, e, i, sign, phase, seed):
    states = targets.separated_ring(ORBIT, count, e, sign * i, phase)
    promised = 2.0 * np.sin(np.pi / count) * min(e, i)
    states[:, 1] += np.random.default_rng(seed).normal(
        scale=1e3, size=count
    )  # drift has carried them anywhere
    apart = gaps(sampled(states, turn()))
    least = np.hypot(apart[..., 0], apart[..., 2]).min()
    # sampled 3e-3 rad apart: (1.6e-3)^2 / 2 of the longer axis, squared, beside the shorter one
    assert promised * (1.0 - 1e-9) <= least
    assert least <= promised * np.sqrt(1.0 + 3e-6 * (max(e, i) / min(e, i)) ** 2)
    # the vectors themselves, through the elements, and the formula for those of any direction
    a = cf.elements.semi_major_axis_from_mean_motion(N)
    roe = a * cf.elements.roe_from_state(states, a, 0.7)
    for pair in gaps(roe):
        vectors = pair[2:4], pair[4:6]
        cross = vectors[0][0] * vectors[1][1] - vectors[0][1] * vectors[1][0]
        assert abs(cross) <= 1e-9 * np.linalg.norm(vectors[0]) * np.linalg.norm(vectors[1])
        assert np.sign(vectors[0] @ vectors[1]) == sign
        assert least_across(*vectors) >= promised * (1.0 - 1e-9)


def test_projected_circle_is_not_passively_safe():
    apart = gaps(sampled(FORMATIONS["projected_circular"], turn()))
    assert (np.hypot(apart[..., 0], apart[..., 2]).min(axis=0) < 1.0).all()  # of some 100 m


def test_string_of_pearls_is_at_rest():
    states = FORMATIONS["string_of_pearls"]
    np.testing.assert_allclose(flown(N, states, turn(7)) - states, 0.0, atol=1e-12)
    np.testing.assert_allclose(states[:, 1], [-112.5, -37.5, 37.5, 112.5])
    assert (states[:, [0, 2, 3, 4, 5]] == 0.0).all()


@pytest.mark.parametrize("time", [0.0, 3000.0])
def test_v_bar_hold_about_an_eccentric_chief_closes_after_a_period(time):
    """It stays on the V-bar at a distance proportional to the chief's radius, by DOP853."""
    orbit = orbit_of(0.3)
    (hold,) = targets.string_of_pearls(orbit, 1, 1.0, along_track=-200.0, time=time)
    states = flown_about(orbit, hold, time + np.linspace(0.0, orbit.period, 201))
    assert np.abs(states[-1] - hold)[:3].max() < 1e-6
    assert np.abs(states[:, [0, 2]]).max() < 1e-6
    assert states[:, 1].min() / states[:, 1].max() == pytest.approx(1.3 / 0.7, rel=1e-3)


def test_pendulum_spacing():
    states = FORMATIONS["pendulum"]
    flight = flown(N, states, turn(401))
    next_to = np.diff(flight, axis=1)
    np.testing.assert_allclose(next_to[..., 1], 100.0, atol=STRAY)
    np.testing.assert_allclose(next_to[..., 0], 0.0, atol=STRAY)
    swing = 60.0 * np.cos(N * turn(401))[:, None]
    np.testing.assert_allclose(next_to[..., 2], np.broadcast_to(swing, next_to.shape[:2]), atol=STRAY)
    np.testing.assert_allclose(flight[100, :, 2], 0.0, atol=STRAY)


def test_line_in_deep_space():
    states = targets.line(5, 75.0, [1.0, -2.0, 2.0])
    np.testing.assert_allclose(np.diff(states[:, :3], axis=0), 25.0 * np.tile([1.0, -2.0, 2.0], (4, 1)))
    np.testing.assert_allclose(states[:, :3].mean(axis=0), 0.0, atol=1e-12)
    assert (states[:, 3:] == 0.0).all()


@given(
    st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6),
    st.sampled_from(["eccentricity", "altitude_difference"]),
)
@settings(max_examples=30)
def test_removal_of_one_relative_element(state, what):
    state = np.array(state) * [1, 1, 1, N, N, N]
    changed = getattr(targets, f"without_{what}")(ORBIT, state)
    # In terms of motion: the mean and swing of x, the mean drift of y, and z, over one orbit.
    (x0, y0, z0), (x1, y1, z1) = (
        np.moveaxis(sampled(s[None], turn(1001))[:, 0, :3], -1, 0) for s in (state, changed)
    )
    fine = 1e-8 * max(1.0, np.abs([x0, y0, z0]).max())
    np.testing.assert_allclose(z1, z0, atol=fine)
    if what == "eccentricity":
        np.testing.assert_allclose(x1, x0[:-1].mean(), atol=fine)
        np.testing.assert_allclose(y1[-1] - y1[0], y0[-1] - y0[0], atol=fine)
        np.testing.assert_allclose(y1[0], y0[0] - 2.0 * state[3] / N, atol=fine)  # the guiding centre
    else:
        np.testing.assert_allclose(x1, x0 - x0[:-1].mean(), atol=fine)
        np.testing.assert_allclose(y1[-1], y1[0], atol=fine)
        np.testing.assert_allclose(y1[0], y0[0], atol=fine)


@given(st.data())
@settings(max_examples=20)
def test_new_member_takes_the_largest_gap(data):
    name = data.draw(st.sampled_from(["safety_ellipse", "separated_ring", "projected_circular"]))
    count = data.draw(st.integers(2, 8))
    full = {
        "safety_ellipse": targets.safety_ellipse(ORBIT, count + 1, 80.0, 120.0, 40.0),
        "separated_ring": targets.separated_ring(ORBIT, count + 1, 90.0, -60.0),
        "projected_circular": targets.projected_circular(ORBIT, count + 1, 150.0),
    }[name]
    left_out = data.draw(st.integers(0, count))
    place = targets.added_member(ORBIT, np.delete(full, left_out, axis=0))
    np.testing.assert_allclose(place, full[left_out], atol=1e-9)


def test_new_member_is_furthest_by_brute_force():
    """On an uneven ring no other phase is further from all members over an orbit."""
    phases = [0.0, 0.4, 1.9, 2.5, 4.0]
    members = np.concatenate([targets.safety_ellipse(ORBIT, 1, 80.0, 120.0, 10.0, p) for p in phases])
    place = targets.added_member(ORBIT, members)

    def clear(state):
        apart = sampled(members, turn(600)) - sampled(state[None], turn(600))
        return np.linalg.norm(apart[..., :3], axis=-1).min()

    tried = [
        targets.safety_ellipse(ORBIT, 1, 80.0, 120.0, 10.0, p)[0] for p in np.linspace(0.0, 2 * np.pi, 361)
    ]
    assert clear(place) >= max(clear(state) for state in tried) - 1e-2
    np.testing.assert_allclose(
        place, targets.safety_ellipse(ORBIT, 1, 80.0, 120.0, 10.0, (4.0 + 2 * np.pi) / 2)[0]
    )


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_new_member_extends_a_string(count):
    pearls = targets.string_of_pearls(ORBIT, count, 75.0)
    place = targets.added_member(ORBIT, pearls)
    np.testing.assert_allclose(place, pearls[-1] + [0, 75.0, 0, 0, 0, 0])
    swinging = targets.pendulum(ORBIT, count, 75.0, 40.0)
    wider = targets.pendulum(ORBIT, count + 2, 75.0, 40.0)[-1]
    np.testing.assert_allclose(targets.added_member(ORBIT, swinging), wider, atol=1e-9)
    row = targets.line(count, 75.0, [0, 3, 4])
    np.testing.assert_allclose(targets.added_member(DEEP, row)[:3], row[-1, :3] + [0, 45.0, 60.0])
    loose = pearls + np.random.default_rng(count).normal(size=(count, 6)) * [1, 1, 1, N, 0, N]
    loose[:, 4] = -2 * N * loose[:, 0]  # pearls held to a metre are still a string
    assert abs(abs(targets.added_member(ORBIT, loose)[1]) - 37.5 * (count + 1)) < 10.0


def test_second_member_of_an_ellipse():
    both = targets.projected_circular(ORBIT, 2, 100.0, 0.7)
    np.testing.assert_allclose(targets.added_member(ORBIT, both[:1]), both[1], atol=1e-12)


def formations(least=2):
    """Draw spacecraft at random states or on named orbits."""
    loose = st.tuples(st.integers(least, 7), st.integers(0, 2**32 - 1)).map(
        lambda drawn: (
            np.random.default_rng(drawn[1]).normal(size=(drawn[0], 6)) * [300, 300, 300, 0.3, 0.3, 0.3]
        )
    )
    return st.one_of(loose, st.sampled_from(list(FORMATIONS.values())))


@given(formations(), st.floats(100.0, 2e4), st.floats(1.0, 10.0), st.sampled_from([ORBIT, DEEP]))
@settings(max_examples=40)
def test_scattered_pairs_reach_their_distance(states, duration, factor, orbit):
    final = targets.scattered(orbit, states, duration, factor)
    coasted = flown(orbit.mean_motion, states, np.array([0.0, duration]))[1]
    before, now, coasting = (np.linalg.norm(gaps(s)[..., :3], axis=-1) for s in (states, final, coasted))
    assert (now >= factor * before * (1.0 - 1e-9)).all()
    assert (now >= coasting * (1.0 - 1e-6)).all()
    scale = now / coasting
    np.testing.assert_allclose(scale, scale[0], rtol=1e-6)
    # the minimum scale: one pair has exactly the required distance, or no spacecraft moves
    assert (now / before).min() == pytest.approx(factor, rel=1e-9) or scale[0] == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(final.mean(axis=0), coasted.mean(axis=0), atol=1e-6 * np.abs(coasted).max())
    # ever after the relative motion is that of coasting, enlarged
    after, ever = (flown(orbit.mean_motion, s, np.array([0.0, 3000.0]))[1] for s in (final, coasted))
    np.testing.assert_allclose(gaps(after), scale[0] * gaps(ever), atol=1e-6 * scale[0] * np.abs(after).max())


def test_scattering_about_the_centroid_has_minimum_cost():
    states, duration = FORMATIONS["separated_ring"] + [50, 20, -30, 0, -0.11, 0], 1500.0
    final = targets.scattered(ORBIT, states, duration, 3.0)
    least = ORBIT.transfer(states, final, duration).energy.sum()
    for shift in np.eye(6) * [1, 1, 1, 1e-3, 1e-3, 1e-3]:
        for sign in (1.0, -1.0):
            assert ORBIT.transfer(states, final + sign * shift, duration).energy.sum() > least


@given(
    formations(1),
    st.floats(100.0, 2e4),
    st.lists(st.floats(-500.0, 500.0), min_size=3, max_size=3),
    lengths,
    st.sampled_from([ORBIT, DEEP]),
)
@settings(max_examples=40)
def test_scattering_from_a_point(states, duration, point, distance, orbit):
    coasted = flown(orbit.mean_motion, states, np.array([0.0, duration]))[1]
    away = np.linalg.norm(coasted[:, :3] - point, axis=1)
    if away.min() < 1e-3:
        return
    final = targets.scattered_from(orbit, states, duration, point, distance)
    now = np.linalg.norm(final[:, :3] - point, axis=1)
    slack = 1e-6 * max(1.0, np.abs(coasted).max() * 1e-3)  # of the integrator
    assert (now >= distance * (1.0 - 1e-9)).all()
    np.testing.assert_allclose(now - away, max(0.0, distance - away.min()), atol=slack)
    sine = np.cross((final[:, :3] - point) / now[:, None], (coasted[:, :3] - point) / away[:, None])
    np.testing.assert_allclose(sine, 0.0, atol=1e-3)
    apart, coasting = (np.linalg.norm(gaps(s)[..., :3], axis=-1) for s in (final, coasted))
    assert (apart >= coasting - slack).all()
    drift = [2.0 * orbit.mean_motion * s[:, 0] + s[:, 4] for s in (final, coasted)]
    np.testing.assert_allclose(*drift, atol=1e-8 * max(1.0, np.abs(final).max()))


@pytest.mark.parametrize("orbit", [ORBIT, DEEP])
def test_regathering_restores_the_orbits(orbit):
    states = FORMATIONS["separated_ring"] + [30, 5, 2, 0.01, 0.02, 0.03]  # drifting as well
    truth = flown(orbit.mean_motion, states, np.array([0.0, 4321.0, 9000.0]))
    home = targets.regathered(orbit, states, 4321.0)
    np.testing.assert_allclose(home, truth[1], atol=1e-6)
    np.testing.assert_allclose(targets.regathered(orbit, home, 9000.0 - 4321.0), truth[2], atol=1e-6)
    np.testing.assert_allclose(targets.regathered(orbit, states[0], 0.0), states[0])


RING = FORMATIONS["projected_circular"]
TWINS = np.array([RING[0], RING[1], RING[2], RING[1]])
# Craft 0 and 2 meet after 100 s in deep space; craft 1 stands aside.
MEETING = np.array([[0, 0, 0, 1.0, 0, 0], [0, 50, 0, 0, 0, 0], [200.0, 0, 0, -1.0, 0, 0]])

REFUSED = {
    "orbit: safety_ellipse is undefined in deep space": lambda: targets.safety_ellipse(DEEP, 3, 1.0, 1.0),
    "count: expected a whole number of at least 1, got 0": lambda: targets.string_of_pearls(ORBIT, 0, 1.0),
    "radial: must be positive": lambda: targets.safety_ellipse(ORBIT, 3, -1.0, 1.0),
    "inclination: 0 gives": lambda: targets.separated_ring(ORBIT, 3, 1.0, 0.0),
    "states: every place that continues": lambda: targets.added_member(DEEP, RING[:1]),
    "factor: must be at least 1": lambda: targets.scattered(ORBIT, RING, 100.0, 0.5),
    "craft 1 and 3 are at the same position at the start": lambda: targets.scattered(
        ORBIT, TWINS, 100.0, 2.0
    ),
    "craft 0 and 2 are at the same position after 100 s": lambda: targets.scattered(
        DEEP, MEETING, 100.0, 2.0
    ),
    "coasting brings craft 2 to it": lambda: targets.scattered_from(DEEP, MEETING, 50.0, [150, 0, 0], 9.0),
}


def test_invalid_input():
    for words in REFUSED:
        with pytest.raises(ValueError, match=words):
            REFUSED[words]()
