"""Encounters in the turning frame of the primary, against explicitly rotated states and covariances."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf

RADIUS = 6878137.0
SPEED = np.sqrt(cf.elements.EARTH_MU / RADIUS)
TILT = np.radians(51.0)
PRIMARY = np.array([RADIUS, 0.0, 0.0, 0.0, SPEED * np.cos(TILT), SPEED * np.sin(TILT)])
GAP = np.array([3.0, 20.0, 8.0, 0.03, 0.01, -0.02])
KNOWN = np.diag([4.0, 30.0, 3.0, 0.03, 0.004, 0.003]) ** 2
OTHER = np.diag([40.0, 8.0, 5.0, 0.01, 0.02, 0.008]) ** 2


def axes(state):
    """Return radial, along-track and cross-track axes as rows."""
    radial = state[:3] / np.linalg.norm(state[:3])
    normal = np.cross(state[:3], state[3:])
    normal /= np.linalg.norm(normal)
    return np.array([radial, np.cross(normal, radial), normal])


def to_rotating_frame(state):
    """Return the matrix (6, 6) from inertial differences to the rotating frame of a chief."""
    rate = np.linalg.norm(np.cross(state[:3], state[3:])) / (state[:3] @ state[:3])
    spin = rate * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    turn = axes(state)
    return np.block([[turn, np.zeros((3, 3))], [-spin @ turn, turn]])


def relative_covariance(encounter, time):
    return encounter.errors.covariance(encounter.path, time) + encounter.other_errors.covariance(
        encounter.other, time
    )


def close(found, expected, share):
    sizes = np.sqrt(np.diag(expected))
    assert (np.abs(found - expected) / np.outer(sizes, sizes)).max() < share


@pytest.mark.parametrize("eccentricity", [0.0, 0.004, 0.6])
def test_state_and_covariances_at_closest_approach(eccentricity):
    """Covariances are rotated from each object's axes into the primary's frame."""
    primary = PRIMARY * np.array([1, 1, 1, *[np.sqrt(1 + eccentricity)] * 3])
    secondary = primary + GAP
    encounter = cf.Encounter.of(primary, secondary, KNOWN, OTHER)
    assert np.allclose(encounter.path.state(0.0), to_rotating_frame(primary) @ GAP, atol=1e-7)
    assert not encounter.other.state(0.0).any()
    own = [np.kron(np.eye(2), axes(state)) for state in (primary, secondary)]
    inertial = own[0].T @ KNOWN @ own[0] + own[1].T @ OTHER @ own[1]
    close(
        relative_covariance(encounter, 0.0),
        to_rotating_frame(primary) @ inertial @ to_rotating_frame(primary).T,
        1e-8,
    )
    assert encounter.eccentricity == pytest.approx(eccentricity, abs=1e-9)
    assert encounter.distance == pytest.approx(np.linalg.norm(GAP[:3]))
    assert encounter.speed == pytest.approx(np.linalg.norm(GAP[3:]), rel=1e-6)
    assert encounter.warnings == ()


def test_inertial_and_local_axes_agree():
    own = [np.kron(np.eye(2), axes(state)) for state in (PRIMARY, PRIMARY + GAP)]
    turned = [one.T @ matrix @ one for one, matrix in zip(own, (KNOWN, OTHER), strict=True)]
    inertial = cf.Encounter.of(PRIMARY, PRIMARY + GAP, *turned, axes="inertial")
    rtn = cf.Encounter.of(PRIMARY, PRIMARY + GAP, KNOWN, OTHER)
    for time in (inertial.path.start, 0.0, inertial.path.end):
        close(relative_covariance(inertial, time), relative_covariance(rtn, time), 1e-9)


def two_body(_, y):
    return np.concatenate([y[3:], -cf.elements.EARTH_MU * y[:3] / np.linalg.norm(y[:3]) ** 3])


@pytest.mark.parametrize("eccentricity", [0.0, 0.7])
def test_propagated_covariance_agrees_with_samples(eccentricity):
    """Samples in two-body motion; curvature contributes up to 1e-4."""
    primary = PRIMARY * np.array([1, 1, 1, *[np.sqrt(1 + eccentricity)] * 3])
    encounter = cf.Encounter.of(primary, primary + GAP, KNOWN, OTHER)
    end = encounter.path.end
    assert end == pytest.approx(0.25 * 2 * np.pi * RADIUS / SPEED / (1 - eccentricity) ** 1.5)
    flown = {}
    for name, state, matrix in (("first", primary, KNOWN), ("second", primary + GAP, OTHER)):
        own = np.kron(np.eye(2), axes(state)).T @ np.sqrt(matrix)
        for k, column in enumerate([np.zeros(6), *own.T]):
            flown[name, k] = solve_ivp(
                two_body, (0.0, end), state + column, rtol=1e-12, atol=1e-9, method="DOP853"
            ).y[:, -1]
    chief = flown["first", 0]
    frame = to_rotating_frame(chief)
    columns = [frame @ (flown[name, k] - flown[name, 0]) for name in ("first", "second") for k in range(1, 7)]
    close(relative_covariance(encounter, end), sum(np.outer(c, c) for c in columns), 3e-4)
    assert np.allclose(encounter.path.state(end)[:3], (frame @ (flown["second", 0] - chief))[:3], atol=1e-2)


def test_window_of_fast_encounters():
    fast = cf.Encounter.of(PRIMARY, PRIMARY + [100.0, 0, 0, 0, 0, 9e3], KNOWN, OTHER)
    assert fast.path.end * fast.speed == pytest.approx(0.01 * RADIUS)
    assert -fast.path.start == fast.path.end == fast.other.end
    slow = cf.Encounter.of(PRIMARY, PRIMARY + GAP, KNOWN, OTHER, half_window=100.0)
    assert (slow.path.start, slow.path.end) == (-100.0, 100.0)


def test_model_error_gives_a_warning():
    (line,) = cf.Encounter.of(PRIMARY, PRIMARY + [0, 2e4, 0, 0, 0, 0], KNOWN, OTHER).warnings
    assert "curvature of the orbit is 29 m" in line  # d^2 / 2 r
