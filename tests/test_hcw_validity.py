"""Model error of Hill's equations against two-body motion.

The figures are those of docs/models.md.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from closeform import Orbit
from closeform.motion.elements.elements import inertial_from_elements
from closeform.motion.elements.frames import relative_from_inertial
from closeform.motion.elements.mean_motion import EARTH_MU
from closeform.motion.elements.roe import elements_from_roe

A = 6.85e6  # m
DRIFTLESS = np.array([0.0, 1.0, 0.3, 0.2, 0.1, 0.3])  # in every direction, one period: no drift
AHEAD = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])  # on the chief's own orbit


def flown(state, times):
    def pull(_, s):
        return [*s[3:], *(-EARTH_MU / np.linalg.norm(s[:3]) ** 3 * s[:3])]

    tolerances = {"rtol": 1e-13, "atol": 1e-7}  # below a micrometre over one orbit
    return solve_ivp(pull, (0, times[-1]), state, method="DOP853", t_eval=times, **tolerances).y.T


def error_of_one_orbit(separation, direction, eccentricity=0.0, **mode):
    """Return the largest distance [m] between Hill's and two-body motion in one orbit."""
    chief = np.array([A, 0.3, eccentricity * np.cos(1.0), eccentricity * np.sin(1.0), 1.55, 0.4])
    orbit = Orbit.from_semi_major_axis(A)
    times = np.linspace(0.0, orbit.period, 61)
    deputy = elements_from_roe(chief, separation / A * direction)
    truth = relative_from_inertial(
        *(flown(inertial_from_elements(s), times) for s in (chief, deputy)), **mode
    )
    predicted = orbit.coast(truth[0], orbit.period).position(times)
    return np.linalg.norm(predicted - truth[:, :3], axis=1).max()


@pytest.mark.parametrize("along_track", ["straight", "arc"])
def test_error_is_quadratic_in_separation(along_track):
    sizes = 8e3 / 2.0 ** np.arange(5)  # down to 500 m, where it is still above 0.1 m
    errors = [error_of_one_orbit(size, DRIFTLESS, along_track=along_track) for size in sizes]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_error_of_eccentricity_is_linear_in_separation():
    sizes = 100.0 / 2.0 ** np.arange(3)  # small, so that the square above is out of sight
    errors = [error_of_one_orbit(size, DRIFTLESS, 0.001) for size in sizes]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)


ARC = {"along_track": "arc"}
CIRCLE = {"along_track": "arc", "radius": A}


@pytest.mark.parametrize(
    ("eccentricity", "separation", "straight", "arc", "circle"),
    [
        (0.0, 100.0, 0.028, 0.0, 0.0),
        (0.0, 1e3, 2.75, 0.0, 0.0),
        (0.0, 1e4, 275.0, 0.0, 0.0),
        (0.0, 2.25e5, 139e3, 0.0, 0.0),
        (0.001, 100.0, 1.24, 1.21, 0.0056),
        (0.001, 1e3, 14.9, 12.1, 0.056),
        (0.001, 1e4, 397.0, 121.0, 0.56),
        (0.001, 2.25e5, 142e3, 2732.0, 12.5),
    ],
)
def test_documented_error_ahead(eccentricity, separation, straight, arc, circle):
    measured = [error_of_one_orbit(separation, AHEAD, eccentricity, **mode) for mode in ({}, ARC, CIRCLE)]
    # Three digits are printed; the zeros are exact in theory, and the integrator leaves micrometres.
    np.testing.assert_allclose(measured, [straight, arc, circle], rtol=0.02, atol=1e-5)


@pytest.mark.parametrize(
    ("eccentricity", "separation", "straight", "arc", "circle"),
    [
        (0.0, 100.0, 0.0196, 0.00854, 0.00854),
        (0.0, 1e3, 1.96, 0.854, 0.854),
        (0.0, 1e4, 196.0, 85.5, 85.5),
        (0.0, 2.25e5, 103e3, 44.3e3, 44.3e3),
        (0.001, 100.0, 0.462, 0.489, 2.42),
        (0.001, 1e3, 2.91, 5.65, 24.9),
        (0.001, 1e4, 155.0, 133.0, 327.0),
        (0.001, 2.25e5, 102e3, 45.5e3, 50.1e3),
    ],
)
def test_documented_error_in_every_direction(eccentricity, separation, straight, arc, circle):
    modes = ({}, ARC, CIRCLE)
    measured = [error_of_one_orbit(separation, DRIFTLESS, eccentricity, **mode) for mode in modes]
    np.testing.assert_allclose(measured, [straight, arc, circle], rtol=0.02)
