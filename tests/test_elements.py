"""Elements and frames against published numbers, classical formulas, mpmath and integration."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from closeform.motion.elements.elements import (
    elements_from_inertial,
    inertial_from_elements,
)
from closeform.motion.elements.frames import inertial_from_relative, relative_from_inertial
from closeform.motion.elements.mean_motion import (
    EARTH_MU,
    EARTH_RADIUS,
    altitude_from_mean_motion,
    mean_motion_from_altitude,
    mean_motion_from_period,
    mean_motion_from_semi_major_axis,
    period_from_mean_motion,
    semi_major_axis_from_mean_motion,
)
from closeform.motion.elements.palmer import (
    palmer_from_state,
    state_from_palmer,
)
from closeform.motion.elements.roe import (
    elements_from_roe,
    roe_from_elements,
    roe_from_state,
    scaled_roe_from_state,
    state_from_roe,
    state_from_scaled_roe,
)

ROUND_TRIP = 1e-12  # of the scale of the state: 7 micrometres on an orbit, 1e-12 of an angle

MODES = (
    {"along_track": "straight"},
    {"along_track": "arc"},
    {"along_track": "arc", "radius": 6.9e6},
)

angles = st.floats(-3.1, 3.1)
inclinations = st.floats(0.01, 3.13)


def six(most):
    """Draw six numbers that are not subnormal relative to the tolerance."""
    number = st.floats(-most, most).filter(lambda x: x == 0.0 or abs(x) > 1e-280)
    return st.lists(number, min_size=6, max_size=6)


@st.composite
def orbits(draw, largest=0.9):
    """Draw orbital elements [a, u, ex, ey, i, O] between low and geostationary orbit."""
    e, w = draw(st.floats(0.0, largest)), draw(angles)
    a, u, node = draw(st.floats(6.6e6, 4.3e7)), draw(angles), draw(angles)
    return np.array([a, u, e * np.cos(w), e * np.sin(w), draw(inclinations), node])


def palmer_motion(n, state, t):
    """Theory (5), from Palmer's coordinates at t = 0."""
    e1, e2, d, drift, h1, h2 = palmer_from_state(state, n)
    e, epsilon, h, eta = np.hypot(e1, e2), np.arctan2(e2, e1), np.hypot(h1, h2), np.arctan2(h2, h1)
    x = 2 * d - e * np.cos(n * t + epsilon)
    y = drift - 3 * n * d * t + 2 * e * np.sin(n * t + epsilon)
    return np.stack([x, y, h * np.cos(n * t - eta)], axis=-1)


def scaled(state):
    return state / np.repeat(np.linalg.norm(state.reshape(-1, 2, 3), axis=-1).max(0), 3)


@pytest.mark.parametrize("mu", [EARTH_MU, 4.282837e13, 4.89])  # Earth, Mars, the asteroid Bennu
@given(a=st.floats(3e2, 1e9))
@settings(max_examples=25)
def test_mean_motion_round_trips(mu, a):
    n = mean_motion_from_semi_major_axis(a, mu)
    assert semi_major_axis_from_mean_motion(n, mu) == pytest.approx(a, rel=1e-14)
    assert mean_motion_from_period(period_from_mean_motion(n)) == pytest.approx(n, rel=1e-14)
    height = altitude_from_mean_motion(n, mu, 250.0)
    assert mean_motion_from_altitude(height, mu, 250.0) == pytest.approx(n, rel=1e-13)


def test_mean_motion_of_the_geostationary_orbit():
    # 42 164.2 km for the sidereal day of 86 164.09 s (any textbook)
    n = mean_motion_from_period(86164.0905)
    assert semi_major_axis_from_mean_motion(n) == pytest.approx(42164.17e3, abs=10.0)
    assert altitude_from_mean_motion(n) == pytest.approx(42164.17e3 - EARTH_RADIUS, abs=10.0)


def test_published_natural_motion():
    # Vallado, example 6-14, to the digits printed there
    n = mean_motion_from_altitude(590e3, 398600.4415e9, 6378136.3)
    position = palmer_motion(n, [0, 0, 0, -0.1, -0.04, -0.02], 300.0)
    np.testing.assert_allclose(position, [-33.345724432, -1.473560307, -5.894530312], atol=2e-9)
    # Tudat, unitTestClohessyWiltshirePropagator.cpp
    n = mean_motion_from_semi_major_axis(6.778137e6, 3.986004418e14)
    position = palmer_motion(n, [45, 37, 12, 0.08, 0.03, 0.01], 1800.0)
    np.testing.assert_allclose(
        position, [380.6450080201250, -543.7424675454679, 2.509547637285142], rtol=1e-13
    )


def test_palmer_motion_agrees_with_integration():
    n, state = 1.1e-3, np.array([120.0, -300.0, 40.0, 0.2, -0.1, 0.05])

    def hill(_, s):
        return [*s[3:], 3 * n * n * s[0] + 2 * n * s[4], -2 * n * s[3], -n * n * s[2]]

    t = np.linspace(0.0, 2e4, 50)
    truth = solve_ivp(hill, (0, t[-1]), state, method="DOP853", rtol=1e-12, atol=1e-12, t_eval=t).y.T
    # 1e-9 of the 10 km that it drifts: what the integrator's tolerance leaves after 1000 steps
    np.testing.assert_allclose(palmer_motion(n, state, t), truth[:, :3], atol=1e-5)


@given(n=st.floats(1e-7, 1e-2), state=six(1e4))
@settings(max_examples=50)
def test_palmer_round_trip(n, state):
    state = np.array(state) * [1, 1, 1, n, n, n]
    back = state_from_palmer(palmer_from_state(state, n), n)
    scale = max(np.abs(state[:3]).max(), np.abs(state[3:]).max() / n)
    assert np.abs((back - state) / [1, 1, 1, n, n, n]).max() <= ROUND_TRIP * scale


@given(orbit=orbits())
@settings(max_examples=50)
def test_elements_round_trip(orbit):
    state = inertial_from_elements(orbit)
    back = elements_from_inertial(state)
    # Position to 1e-12; near perigee at e = 0.9 it follows angles ten times as fast.
    loose = 1.0 / (1.0 - np.hypot(orbit[2], orbit[3])) ** 2
    np.testing.assert_allclose(back[0], orbit[0], rtol=ROUND_TRIP * loose)
    np.testing.assert_allclose(back[2:5], orbit[2:5], atol=ROUND_TRIP * loose)
    turns = (back[[1, 5]] - orbit[[1, 5]]) / (2 * np.pi)
    np.testing.assert_allclose(turns - np.round(turns), 0.0, atol=ROUND_TRIP * loose)
    again = inertial_from_elements(back)
    assert np.linalg.norm((again - state)[:3]) <= ROUND_TRIP * loose * np.linalg.norm(state[:3])
    assert np.linalg.norm((again - state)[3:]) <= ROUND_TRIP * loose * np.linalg.norm(state[3:])


@pytest.mark.parametrize("e", [0.0, 1e-9, 0.001, 0.3, 0.97])
def test_elements_agree_with_the_classical_ones(e):
    a, i, node, w, mean = 2.4e7, 1.1, 2.0, -0.7, 0.4
    eccentric = brentq(lambda x: x - e * np.sin(x) - mean, 0.0, 3.0, xtol=1e-15)
    true = 2 * np.arctan(np.sqrt((1 + e) / (1 - e)) * np.tan(eccentric / 2))
    p = a * (1 - e * e)
    in_plane = p / (1 + e * np.cos(true)) * np.array([np.cos(true), np.sin(true), 0.0])
    speed = np.sqrt(EARTH_MU / p) * np.array([-np.sin(true), e + np.cos(true), 0.0])

    def about(axis, angle):
        c, s = np.cos(angle), np.sin(angle)
        return np.array(
            [[c, -s, 0], [s, c, 0], [0, 0, 1]] if axis == "z" else [[1, 0, 0], [0, c, -s], [0, s, c]]
        )

    turn = about("z", node) @ about("x", i) @ about("z", w)
    state = np.concatenate([turn @ in_plane, turn @ speed])
    elements = [a, mean + w, e * np.cos(w), e * np.sin(w), i, node]
    assert np.abs(scaled(inertial_from_elements(elements)) - scaled(state)).max() < 1e-12
    np.testing.assert_allclose(elements_from_inertial(state), elements, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("mode", MODES)
@given(chief=orbits(0.5), deputy=orbits(0.5))
@settings(max_examples=40)
def test_frame_round_trip(mode, chief, deputy):
    chief, deputy = inertial_from_elements(chief), inertial_from_elements(deputy)
    back = inertial_from_relative(chief, relative_from_inertial(chief, deputy, **mode), **mode)
    # Angles of a craft near the axis of the chief's orbit hold fewer digits along-track.
    normal = np.cross(chief[:3], chief[3:])
    flat = np.linalg.norm(np.cross(deputy[:3], normal)) / np.linalg.norm(deputy[:3]) / np.linalg.norm(normal)
    for part in (slice(0, 3), slice(3, 6)):
        scale = max(np.linalg.norm(deputy[part]), np.linalg.norm(chief[part]))
        assert np.linalg.norm((back - deputy)[part]) <= ROUND_TRIP * scale / flat**2


@pytest.mark.parametrize("mode", MODES)
def test_velocity_is_the_rate_of_the_position(mode):
    """50-digit differences of the position in the frame, along exact two-body motion."""
    chief = inertial_from_elements([7e6, 0.4, 0.2, 0.1, 1.0, 0.3])
    deputy = inertial_from_elements([7.1e6, 0.45, 0.21, 0.08, 1.02, 0.33])
    radius = mode.get("radius")

    def moved(state, h):
        r, v = mpmath.matrix(state[:3]), mpmath.matrix(state[3:])
        pull = -EARTH_MU / mpmath.norm(r) ** 3 * r
        return r + h * v + h * h / 2 * pull, v + h * pull

    def dot(p, q):
        return sum(p[k] * q[k] for k in range(3))

    def cross(p, q):
        return mpmath.matrix(
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
        )

    def position(h):
        (r, v), (q, _) = moved(chief, h), moved(deputy, h)
        radial, normal = r / mpmath.norm(r), cross(r, v) / mpmath.norm(cross(r, v))
        x, y, z = dot(q, radial), dot(q, cross(normal, radial)), dot(q, normal)
        if mode["along_track"] == "straight":
            return mpmath.matrix([x - mpmath.norm(r), y, z])
        circle = radius or mpmath.norm(r)
        above = mpmath.asin(z / mpmath.norm(q))
        return mpmath.matrix([mpmath.norm(q) - mpmath.norm(r), circle * mpmath.atan2(y, x), circle * above])

    with mpmath.workdps(50):
        h = mpmath.mpf("1e-15")
        rate = (position(h) - position(-h)) / (2 * h)
        truth = np.array([float(value) for value in [*position(0), *rate]])
    relative = relative_from_inertial(chief, deputy, **mode)
    np.testing.assert_allclose(relative[:3], truth[:3], atol=1e-8)  # a few ulp of 7e6 m
    np.testing.assert_allclose(relative[3:], truth[3:], atol=1e-11)  # a few ulp of 7e3 m/s


def test_frame_of_a_circular_orbit():
    a, n = 7e6, mean_motion_from_semi_major_axis(7e6)
    chief = np.array([a, 0, 0, 0, a * n, 0])
    deputy = inertial_from_relative(chief, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(deputy, [a + 1, 2, 3, -2 * n, n * (a + 1), 0], rtol=1e-15, atol=1e-12)
    quarter = relative_from_inertial(chief, [0, a, 0, -a * n, 0, 0], "arc")
    np.testing.assert_allclose(quarter, [0, a * np.pi / 2, 0, 0, 0, 0], atol=1e-8)
    assert not relative_from_inertial(chief, chief, "arc").any()


def test_relative_elements_of_brahe():
    """brahe 1.4, test_state_oe_to_roe (R = 6 378 136.3 m); its angles are in degrees."""
    degree = np.pi / 180
    a = 6378136.3 + 700e3

    def elements(a, e, i, node, w, mean):
        w *= degree
        return [a, mean * degree + w, e * np.cos(w), e * np.sin(w), i * degree, node * degree]

    chief = elements(a, 0.001, 97.8, 15.0, 30.0, 45.0)
    deputy = elements(a + 1e3, 0.0015, 97.85, 15.05, 30.05, 45.05)
    roe = roe_from_elements(chief, deputy) / [1, degree, 1, 1, degree, degree]
    published = [
        1.412801276516814e-4,
        9.321422137829084e-2,
        4.323577088687794e-4,
        2.511333388799496e-4,
        5.0e-2,
        4.95373920235754e-2,
    ]
    np.testing.assert_allclose(roe, published, atol=1e-12)  # the tolerance of its own test


@given(chief=orbits(0.5), roe=st.lists(st.floats(-0.01, 0.01), min_size=6, max_size=6))
@settings(max_examples=60)
def test_exact_relative_elements_round_trip(chief, roe):
    deputy = elements_from_roe(chief, roe)
    np.testing.assert_allclose(roe_from_elements(chief, deputy), roe, rtol=0, atol=ROUND_TRIP)
    again = inertial_from_elements(elements_from_roe(chief, roe_from_elements(chief, deputy)))
    assert np.abs(scaled(again) - scaled(inertial_from_elements(deputy))).max() < 10 * ROUND_TRIP


@given(roe=six(1e-3), latitude=angles, a=st.floats(6.6e6, 4.3e7))
@settings(max_examples=60)
def test_linear_relative_elements_round_trip(roe, latitude, a):
    back = roe_from_state(state_from_roe(roe, a, latitude), a, latitude)
    np.testing.assert_allclose(back, roe, rtol=0, atol=ROUND_TRIP * np.abs(roe).max())


def test_linear_and_exact_relative_elements_agree_to_second_order():
    a, latitude = 7e6, 0.8
    chief = np.array([a, latitude, 0.0, 0.0, 1.0, 0.2])
    direction = np.array([0.3, 1.0, -0.5, 0.4, 0.6, -0.7])
    sizes = 1e-3 / 2.0 ** np.arange(6)  # 7 km down to 200 m: the difference stays above rounding
    errors = []
    for size in sizes:
        deputy = elements_from_roe(chief, size * direction)
        state = relative_from_inertial(*inertial_from_elements([chief, deputy]))
        errors.append(np.abs(roe_from_state(state, a, latitude) - size * direction).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def two_body(t, state):
    position = state[:3]
    return np.concatenate([state[3:], -EARTH_MU * position / np.linalg.norm(position) ** 3])


def test_scaled_relative_elements_are_constant_in_two_body_motion():
    """Chief and deputy integrated for 0.7 orbits; what the elements change falls with separation squared.

    The deputy's inertial start is put together here: rotating axes, their rate, and no frame of ours.
    """
    a, u, inclination = 7e6, 0.8, 1.0
    n = np.sqrt(EARTH_MU / a**3)
    duration = 0.7 * 2.0 * np.pi / n
    node = np.array([1.0, 0.0, 0.0])
    across = np.array([0.0, np.cos(inclination), np.sin(inclination)])
    normal = np.cross(node, across)

    def axes(latitude):
        radial = np.cos(latitude) * node + np.sin(latitude) * across
        return np.stack([radial, np.cross(normal, radial), normal])

    direction = np.array([0.03, 1.0, -0.5, 0.4, 0.6, -0.7])
    sizes = 8e3 / 2.0 ** np.arange(6)  # 8 km down to 250 m
    errors = []
    for size in sizes:
        start = state_from_scaled_roe(size * direction, n, u)
        turned = start[3:] + np.cross([0.0, 0.0, n], start[:3] + [a, 0.0, 0.0])
        inertial = np.concatenate([(start[:3] + [a, 0.0, 0.0]) @ axes(u), turned @ axes(u)])
        end = solve_ivp(two_body, (0.0, duration), inertial, "DOP853", rtol=1e-13, atol=1e-8).y[:, -1]
        later = u + n * duration
        place = axes(later) @ end[:3]
        velocity = axes(later) @ end[3:] - np.cross([0.0, 0.0, n], place)
        state = np.concatenate([place - [a, 0.0, 0.0], velocity])
        expected = size * direction
        expected[1] -= 1.5 * n * duration * expected[0]
        errors.append(np.abs(scaled_roe_from_state(state, n, later) - expected).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_scaled_relative_elements_give_damicos_motion():
    """Relative motion in terms of the elements, his equations written down once more."""
    rng = np.random.default_rng(4)
    scaled, u, n = rng.normal(size=(50, 6)) * 300.0, rng.uniform(-np.pi, np.pi, 50), 1.1e-3
    da, dl, dex, dey, dix, diy = scaled.T
    x = da - dex * np.cos(u) - dey * np.sin(u)
    y = dl + 2.0 * (dex * np.sin(u) - dey * np.cos(u))
    z = dix * np.sin(u) - diy * np.cos(u)
    vx, vz = n * (dex * np.sin(u) - dey * np.cos(u)), n * (dix * np.cos(u) + diy * np.sin(u))
    vy = n * (-1.5 * da + 2.0 * (dex * np.cos(u) + dey * np.sin(u)))
    states = state_from_scaled_roe(scaled, n, u)
    np.testing.assert_allclose(states, np.stack([x, y, z, vx, vy, vz], axis=-1), rtol=0, atol=1e-11)


@given(scaled=six(1e5), latitude=angles, n=st.floats(1e-5, 1e-2))
@settings(max_examples=60)
def test_scaled_relative_elements_round_trip(scaled, latitude, n):
    back = scaled_roe_from_state(state_from_scaled_roe(scaled, n, latitude), n, latitude)
    np.testing.assert_allclose(back, scaled, rtol=0, atol=ROUND_TRIP * np.abs(scaled).max())


def test_relative_elements_across_the_node():
    chief, deputy = [7e6, 3.141, 0, 0, 1.0, 3.141], [7e6, -3.141, 0, 0, 1.0, -3.141]
    step = 2 * np.pi - 6.282
    expected = [0, step * (1 + np.cos(1.0)), 0, 0, 0, step * np.sin(1.0)]
    np.testing.assert_allclose(roe_from_elements(chief, deputy), expected, atol=1e-15)


def test_coincident_spacecraft_have_zero_relative_elements():
    chief = [7e6, 0.3, 0.001, 0.002, 0.9, 0.1]
    assert not roe_from_elements(chief, chief).any()
    assert not roe_from_state(np.zeros(6), 7e6, 0.3).any()


def test_leading_shapes_broadcast():
    chief = inertial_from_elements([7e6, 0.3, 0.001, 0.002, 0.9, 0.1])
    deputies = np.stack([[chief] * 3] * 2)
    for mode in MODES:
        relative = relative_from_inertial(chief, deputies, **mode)
        assert relative.shape == inertial_from_relative(chief, relative, **mode).shape == (2, 3, 6)
    assert roe_from_state(deputies * 0, [7e6, 7.1e6, 7.2e6], 0.1).shape == (2, 3, 6)
    assert state_from_scaled_roe(np.ones((4, 1, 6)), 1e-3, [0.1, 0.2]).shape == (4, 2, 6)
    assert scaled_roe_from_state(np.ones(6), [1e-3, 2e-3], 0.1).shape == (2, 6)
    assert palmer_from_state(np.ones((4, 1, 6)), [1e-3, 2e-3]).shape == (4, 2, 6)
    assert roe_from_elements(elements_from_inertial(chief), elements_from_inertial(deputies)).shape == (
        2,
        3,
        6,
    )
    assert mean_motion_from_altitude([1e5, 2e5]).shape == (2,)


STATE = [7e6, 0, 0, 0, 7.5e3, 0]


def test_invalid_input_is_reported_in_one_line():
    for call, message in [
        (lambda: palmer_from_state(STATE, 0.0), "mean_motion: must be positive"),
        (lambda: mean_motion_from_semi_major_axis(-7e6), "semi_major_axis: must be positive, got -7e"),
        (lambda: mean_motion_from_altitude(-7e6), r"altitude \+ radius: must be positive"),
        (lambda: elements_from_inertial([7e6, 0, 0, 0, 12e3, 0]), "must be an ellipse"),
        (lambda: elements_from_inertial([7e6, 0, 0, 1e3, 0, 0]), "must span an orbital plane"),
        (lambda: inertial_from_elements([7e6, 0, 1.0, 0, 1, 0]), "elements: the orbit must be an ellipse"),
        (
            lambda: roe_from_elements([7e6, 0, 0, 0, 1e-7, 0], [7e6, 0, 0, 0, 1, 0]),
            "chief: orbits of inclination 0",
        ),
        (lambda: elements_from_roe([7e6, 0, 0, 0, 1, 0], [-1, 0, 0, 0, 0, 0]), "roe: the orbit must be"),
        (
            lambda: relative_from_inertial(STATE, STATE, "curved"),
            'along_track: must be "straight" or "arc", got',
        ),
        (lambda: relative_from_inertial(STATE, STATE, radius=7e6), "radius: only used with"),
        (lambda: relative_from_inertial([0] * 6, STATE), "chief: position and velocity must span"),
        (lambda: relative_from_inertial(STATE, [0, 0, 7e6, 0, 0, 0], "arc"), "on the axis of the chief"),
    ]:
        with pytest.raises(ValueError, match=message) as caught:
            call()
        assert "\n" not in str(caught.value)
