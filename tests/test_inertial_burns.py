"""Thrust that is constant in inertial axes: motion, effort and conflicts."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf

N = 1.1e-3
ORBIT = cf.Orbit(N)
STATE = np.array([80.0, -150.0, 40.0, 0.05, -0.1, 0.03])
PUSH = np.array([3e-4, -2e-4, 5e-4])


def integrated(n, state, push, start, end):
    """Return the state at `end` by an independent integrator."""

    def rates(t, s):
        c, q = np.cos(n * t), np.sin(n * t)
        u = [push[0] * c + push[1] * q, push[1] * c - push[0] * q, push[2]]
        return [*s[3:], 3 * n * n * s[0] + 2 * n * s[4] + u[0], -2 * n * s[3] + u[1], -n * n * s[2] + u[2]]

    return solve_ivp(rates, (start, end), state, method="DOP853", rtol=3e-14, atol=1e-10).y[:, -1]


@pytest.mark.parametrize("n", [0.0, 1e-5, N])
@pytest.mark.parametrize("duration", [1.0, 500.0, 5000.0, 40000.0])
def test_state_agrees_with_an_independent_integrator(n, duration):
    path = cf.Orbit(n).burn(STATE, PUSH, duration, start=700.0, frame="inertial")
    true = integrated(n, STATE, PUSH, 700.0, 700.0 + duration)
    scale = np.abs(true).max() + np.linalg.norm(PUSH) * duration**2
    assert np.abs(path.state(700.0 + duration) - true).max() < 1e-11 * scale  # the integrator's own error


def test_response_in_thirty_digits():
    """Compare with the inverse of exact Laplace transforms, for n t up to 30."""
    mpmath.mp.dps = 30
    for t in (0.1, 27000.0):
        n, hx, hy = mpmath.mpf(N), mpmath.mpf(float(PUSH[0])), mpmath.mpf(float(PUSH[1]))

        def forced(s, n=n, hx=hx, hy=hy):
            c, q = mpmath.cos(n * s), mpmath.sin(n * s)
            return hx * c + hy * q, hy * c - hx * q

        def kernel(s, t=t, n=n, forced=forced):
            a = n * (t - s)
            u, v = forced(s)
            return (
                mpmath.sin(a) * u / n + 2 * (1 - mpmath.cos(a)) * v / n,
                -2 * (1 - mpmath.cos(a)) * u / n + (4 * mpmath.sin(a) / n - 3 * (t - s)) * v,
            )

        cuts = mpmath.linspace(0, t, 12)
        true = [mpmath.quad(lambda s, k=k: kernel(s)[k], cuts) for k in range(2)]
        got = ORBIT.burn(np.zeros(6), PUSH, t, frame="inertial").position(t)
        for k in range(2):
            assert abs(got[k] - true[k]) < 1e-13 * (abs(true[0]) + abs(true[1]))


def test_effort_of_constant_thrust():
    path = ORBIT.burn(STATE, PUSH, 9000.0, frame="inertial")
    size = np.linalg.norm(PUSH)
    assert path.delta_v == pytest.approx(size * 9000.0, rel=1e-9)
    assert path.energy == pytest.approx(0.5 * size**2 * 9000.0, rel=1e-9)
    assert path.peak_thrust == pytest.approx(size, rel=1e-9)
    assert np.allclose(np.linalg.norm(path.thrust(np.linspace(0, 9000, 50)), axis=1), size, rtol=1e-14)


def test_conflicts_agree_with_dense_sampling():
    """Spacecraft with inertial thrust pass a coasting one."""
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 6000.0, 60001)
    other = ORBIT.coast(STATE, 6000.0)
    zone, met = cf.Ellipsoid([300.0, 500.0, 250.0]), 0
    for _ in range(15):
        start, push = STATE + rng.normal(size=6) * [200, 300, 200, 0.2, 0.2, 0.2], rng.normal(size=3) * 5e-5
        path = ORBIT.burn(start, push, 6000.0, frame="inertial")
        norms = zone.norm(path.position(t) - other.position(t))
        close = cf.closest_approach(path, other, zone)
        assert close.ratio <= norms.min() * (1 + 1e-9)
        assert close.ratio >= norms.min() - 1e-5  # 0.05 s at some m/s
        stays = cf.find_conflicts(path, other, zone)
        inside = norms < 1.0
        assert len(stays) == (np.diff(inside.astype(int)) == 1).sum() + inside[0]
        met += len(stays)
    assert met > 4


def test_unknown_frame_is_refused():
    with pytest.raises(ValueError, match=r"^frame: must be 'orbit' or 'inertial', got 'body'$"):
        ORBIT.burn(STATE, PUSH, 60.0, frame="body")
