"""Kernels of Hill's equations against 60-digit inverse Laplace transforms."""

import mpmath as mp
import numba
import numpy as np
import pytest

from closeform.motion import hill
from truth import Reference

N = 1.1e-3

# Parts of kernels have no entry from Python: give them one.
powers = numba.njit(lambda n, t: hill.inverse_transforms(n, t))
oscillation = numba.njit(lambda n, t: hill.oscillation(n, t))
drift = numba.njit(lambda n, t, x, y, z, u, v, w: hill.coast(n, t, x, y, z, u, v, w))
forced = numba.njit(lambda n, t, x, y, z, u, v, w: hill.driven(n, t, x, y, z, u, v, w))
costate = numba.njit(lambda n, x, y, z, u, v, w: hill.costate(n, x, y, z, u, v, w))
response = numba.njit(lambda n, t, matrix: hill.response(n, t, matrix))


def transform(m, doubled, n, t):
    """Return 1/(s^m (s^2 + n^2)) or 1/(s^m (s^2 + n^2)^2) at time t, as a power series in (n t)^2."""
    lead = m + (4 if doubled else 2) - 1
    total, k = mp.mpf(0), 0
    while True:
        term = (-1) ** k * ((k + 1) if doubled else 1) * (n * t) ** (2 * k) / mp.factorial(lead + 2 * k)
        total += term
        if abs(term) < mp.mpf(10) ** -90 and k > n * t:
            return total * t**lead
        k += 1


@pytest.mark.parametrize(
    "angle",
    [0.0, 1e-12, 1e-6, 1e-2, 0.5, 0.999999, 1.0, 1.999999, 2.0, 2.000001, 5.0, 40.0, -1e-3, -1.5, -30.0],
)
def test_transforms(angle):
    """Errors are below 1e-13 of the scale of each power of time."""
    with mp.workdps(120):
        t = angle / N if angle else 500.0
        n = N if angle else 0.0
        exact = [transform(m, False, mp.mpf(n), mp.mpf(t)) for m in range(5)]
        exact += [transform(m, True, mp.mpf(n), mp.mpf(t)) for m in range(-2, 5)]
        exact = np.array([float(e) for e in exact])
    got = np.array(powers(n, t))
    leads = [1, 2, 3, 4, 5, 1, 2, 3, 4, 5, 6, 7]
    # each in units of t (or 1/n where that is shorter, times t for what grows with time)
    short = min(abs(t), 1 / N)
    for g, e, lead in zip(got, exact, leads, strict=True):
        assert abs(g - e) <= 1e-13 * max(abs(e), short ** (lead - 1) * abs(t)), lead
    np.testing.assert_allclose(oscillation(n, t), got[:3], rtol=1e-9, atol=1e-12 * short)


def test_series_and_closed_form_agree():
    t = hill.SERIES_BELOW / N
    below, above = powers(N, t * (1 - 1e-15)), powers(N, t * (1 + 1e-15))
    np.testing.assert_allclose(below, above, rtol=1e-12)  # Q_-2 cancels a little there


@pytest.mark.parametrize("t", [1.0, 800.0, 5000.0, -800.0, -5000.0, -60000.0])
def test_drift_in_both_directions_of_time(t):
    start = (120.0, -80.0, 45.0, 0.11, -0.27, 0.06)
    true = [float(c) for c in Reference(N).coast(start, t)]
    np.testing.assert_allclose(drift(N, t, *start), true, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("t", [3.0, 800.0, 5000.0])
def test_forced_response_is_the_gramian(t):
    """From rest a costate reaches W(t) Phi(T-t)' mu (7, 8)."""
    zero = np.zeros(6)
    final = np.array([10.0, -20.0, 5.0, 0.01, 0.02, -0.03])
    state, thrust, _ = Reference(N).transfer(zero, final, 6000.0)
    u = np.array([float(c) for c in thrust(0.0)])
    w = np.array([float(mp.diff(lambda s, k=k: thrust(s)[k], 0.0)) for k in range(3)])
    true = [float(c) for c in state(t)]
    np.testing.assert_allclose(forced(N, t, *u, *w), true, rtol=1e-9, atol=1e-9 * abs(final).max())
    matrix = np.empty((6, 6))
    response(N, t, matrix)
    np.testing.assert_allclose(matrix @ [*u, *w], forced(N, t, *u, *w), rtol=1e-12, atol=1e-15)


def test_costate_pairing_is_constant_along_a_coast():
    """costate . state is constant under natural motion."""
    state = (120.0, -80.0, 45.0, 0.11, -0.27, 0.06)
    push = (1e-5, -2e-5, 3e-5, 1e-8, 2e-8, -1e-8)

    def pairing(t):
        x, u = drift(N, t, *state), drift(N, t, *push)
        return np.dot(costate(N, *u), x[:3]) + np.dot(u[:3], x[3:])

    for t in (10.0, 1000.0, 7000.0):
        assert pairing(t) == pytest.approx(pairing(0.0), rel=1e-10)
