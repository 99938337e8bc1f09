"""Coasts beyond Hill dynamics against other integrators, and errors of simpler models."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from simulated import MU, chief, flown

ROOT = Path(__file__).parents[1]
RATES = np.array([1.0, 1.0, 1.0, 1e3, 1e3, 1e3])  # of an orbit: positions and velocities of one size


def linearised(e: float, anomaly: float, a: float, duration: float) -> np.ndarray:
    """Return the transition matrix (6, 6) relative to an elliptic orbit, by DOP853."""
    p = a * (1.0 - e * e)
    h = np.sqrt(MU * p)

    def rates(_, y):
        r = p / (1.0 + e * np.cos(y[0]))
        turn, climb = h / r**2, MU / h * e * np.sin(y[0])
        swing = -2.0 * turn * climb / r
        x, along, z, vx, vy, vz = y[1:].reshape(6, 6)
        pulls = (
            2.0 * turn * vy + swing * along + (turn**2 + 2.0 * MU / r**3) * x,
            -2.0 * turn * vx - swing * x + (turn**2 - MU / r**3) * along,
            -MU / r**3 * z,
        )
        return np.concatenate([[turn], np.ravel([vx, vy, vz, *pulls])])

    start = np.concatenate([[anomaly], np.diag(1.0 / RATES).ravel()])
    end = solve_ivp(rates, (0.0, duration), start, "DOP853", rtol=1e-13, atol=1e-13).y[1:, -1]
    return end.reshape(6, 6) * RATES


@pytest.mark.parametrize(("e", "anomaly"), [(0.0, 0.3), (1e-3, 5.0), (0.05, 2.0), (0.3, 4.0), (0.75, -1.0)])
def test_transition_on_an_elliptic_orbit(e, anomaly):
    """The closed form of Yamanaka and Ankersen against its equations, for 1.7 orbits."""
    a = 6.9e6 / (1.0 - e)
    orbit = cf.Orbit.eccentric(e, semi_major_axis=a, true_anomaly=anomaly)
    want = linearised(e, anomaly, a, 1.7 * orbit.period)
    off = (orbit.transition(1.7 * orbit.period) - want) * RATES[:, None] / RATES
    assert np.abs(off).max() < 1e-9 * np.abs(want * RATES[:, None] / RATES).max()
    assert orbit.transition(0.0) == pytest.approx(np.eye(6), abs=1e-11)
    back = orbit.transition(-900.0, 1700.0) @ orbit.transition(900.0, 800.0)
    assert back == pytest.approx(np.eye(6), abs=1e-9)


def test_circular_orbit_gives_hill_motion():
    orbit, circle = cf.Orbit.eccentric(0.0, 6.9e6, true_anomaly=1.0), cf.Orbit.from_semi_major_axis(6.9e6)
    times = np.array([[10.0, 4000.0], [-3000.0, 20000.0]])
    assert orbit.transition(times, 50.0) == pytest.approx(circle.transition(times), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("latitude", [0.1, 2.0, 4.0])
def test_elliptic_orbit_from_elements(latitude):
    """Distance and radial velocity of the chief follow the elements."""
    known = chief(e=0.3, a=9e6, latitude=latitude)
    orbit = cf.Orbit.from_elements(known.elements)
    s = orbit.chief.mean_anomaly
    for _ in range(50):
        s = orbit.chief.mean_anomaly + 0.3 * np.sin(s)  # Kepler's equation
    place, speed = known.state[:3], known.state[3:]
    distance = 9e6 * (1.0 - 0.3 * np.cos(s))
    assert distance == pytest.approx(np.linalg.norm(place), rel=1e-12)
    climb = np.sqrt(MU * 9e6) * 0.3 * np.sin(s) / distance
    assert climb == pytest.approx(place @ speed / distance, rel=1e-9)
    assert orbit.period == pytest.approx(known.orbit.period)


@pytest.mark.parametrize("e", [0.0, 1e-2, 0.3])
def test_point_mass_field_has_the_elliptic_transition(e):
    known = chief(e, a=7e6 / (1.0 - e))
    orbit = cf.Orbit.from_elements(known.elements)
    times = np.array([-500.0, 900.0, orbit.period])
    got = cf.Field(known, 0).transition(times, 300.0) * RATES[:, None] / RATES
    want = orbit.transition(times, 300.0) * RATES[:, None] / RATES
    assert np.abs(got - want).max() < 1e-7 * np.abs(want).max()


def test_coasts_agree_with_another_integrator():
    start = np.array([[300.0, -800.0, 900.0, 0.3, -0.66, 0.4], [0.0, 200.0, -100.0, 0.1, 0.0, 0.2]])
    path = cf.Field(chief()).coast(start, 7000.0)
    assert path.shape == (2,)
    assert path.state(0.0) == pytest.approx(start, abs=1e-8)  # rounding of 7e6 m
    other = flown(path, start, 7000.0, lambda t: np.zeros((2, 3)))
    assert path.position(7000.0) == pytest.approx(other, abs=1e-5)  # m
    hill = chief().orbit.coast(start, 7000.0).position(7000.0)
    assert np.abs(hill - other).max() > 5.0
    back = flown(path, -start, 7000.0, lambda t: np.zeros((2, 3)))
    near = start @ cf.Field(chief()).transition(7000.0).T
    assert near[:, :3] == pytest.approx(0.5 * (other - back), abs=3e-3)  # m: curvature cancels, of 2 km


def test_interpolation_error_meets_its_tolerance():
    """Compare with samples a quarter as far apart."""
    field, start = cf.Field(chief(0.05), 4), [500.0, 3000.0, -2000.0, 1.0, -1.1, 2.0]
    exact = field.coast(start, 9000.0, 100.0, within=1e-6)
    times = np.linspace(100.0, 9100.0, 7001)
    counts = []
    for within in (1.0, 1e-3, 1e-5):
        path = field.coast(start, 9000.0, 100.0, within=within)
        off = np.linalg.norm(path.position(times) - exact.position(times), axis=1).max()
        assert 1e-4 * within < off < within
        counts.append(len(path.arcs))
    assert counts[0] < counts[1] < counts[2]


def test_conflicts_with_an_eccentric_chief():
    """Entries and exits agree with the transition, and not with Hill dynamics."""
    ellipse, zone = cf.Orbit.eccentric(0.05, 6.9e6 / 0.95, true_anomaly=0.4), cf.Sphere(40.0)
    met = np.array([5.0, -10.0, 20.0, 0.08, -0.05, 0.06])  # one from the other, at 4000 s
    first = np.array([0.0, 260.0, 0.0, 0.05, -0.11, 0.03])
    start = np.stack([first, first + np.linalg.solve(ellipse.transition(4000.0), met)])
    paths = ellipse.coast(start, ellipse.period)
    times = np.linspace(0.0, ellipse.period, 50_001)
    apart = ellipse.transition(times) @ (start[1] - start[0])
    inside = zone.norm(apart[:, :3]) < 1.0
    assert inside.any()
    turns = times[1:][inside[1:] != inside[:-1]]
    found = cf.find_conflicts(paths[1], paths[0], zone)
    assert np.ravel([[one.start, one.end] for one in found]) == pytest.approx(
        turns, abs=0.12
    )  # s: steps of 0.11
    hill = cf.find_conflicts(
        *(cf.Orbit.from_period(ellipse.period).coast(one, ellipse.period) for one in start[::-1]), zone
    )
    assert [round(one.start) for one in hill] != [round(one.start) for one in found]


def test_differential_drag():
    """The along-track drift is 3/2 of the acceleration difference times the square of time."""
    air = cf.Drag(5e-13, 500e3, 60e3, ballistic=[0.02, 0.03], chief=0.02, spin=0.0)
    field = cf.Field(chief(0.0), 0, air)
    path = field.coast(np.zeros((2, 6)), 9.0 * 5677.0)
    assert np.abs(path[0].position(path[0].end)).max() < 1e-4
    felt = 0.5 * 5e-13 * 0.01 * MU / 6.878e6 * np.exp((cf.elements.EARTH_RADIUS + 500e3 - 6.878e6) / 60e3)
    assert path[1].position(path[1].end)[1] == pytest.approx(1.5 * felt * (9.0 * 5677.0) ** 2, rel=0.02)


def test_acceleration_function_as_a_field():
    from test_field import textbook

    own = cf.Field(chief(), acceleration=lambda times, states: textbook(states[:, :3]))
    start = [0.0, 100.0, 50.0, 0.1, 0.0, 0.0]
    one, other = (field.coast(start, 2000.0, 500.0) for field in (own, cf.Field(chief())))
    assert one.position(2500.0) == pytest.approx(other.position(2500.0), abs=1e-4)
    lengths = [0.0, 900.0, 900.0, -300.0]
    assert own.transition(lengths) == pytest.approx(cf.Field(chief()).transition(lengths), rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("keeping_step", [False, True])
def test_obstacles_in_the_high_fidelity_model(keeping_step):
    """Motion in the model does not depend on the orbit of the planned paths."""
    field, zone = cf.Field(chief(0.01)), cf.Sphere(25.0)
    orbit = field.orbit if keeping_step else field.chief.orbit
    start = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 80.0, 10.0, 0.02, 0.0, 0.0]]
    others = field.coast(start, 1500.0, orbit=orbit)
    assert others.position(777.0) == pytest.approx(field.coast(start, 1500.0).position(777.0), abs=2e-3)
    mine = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 1500.0)
    found = cf.avoid(mine, others, zone)
    assert found.ok
    assert cf.closest_approach(found.path, others[1], zone).ratio > 1.0 - 1e-9


# --- how far other models are off -------------------------------------------------------------


@pytest.fixture(scope="module")
def tool():
    return SimpleNamespace(**runpy.run_path(str(ROOT / "tools" / "beyond_hill.py")))


def test_mean_effect_of_oblateness(tool):
    """Schweighart and Sedwick follow J2 for ten orbits from fitted starts."""
    rows = np.array([tool.deviations(seed, 0.0, 10) for seed in range(4)])
    hill, hill_fitted, averaged, averaged_fitted, ellipse, near = np.median(rows, axis=0)
    assert averaged_fitted < 0.2  # m for each kilometre and orbit
    assert hill_fitted > 5.0 * averaged_fitted
    assert averaged > 3.0
    assert hill == pytest.approx(ellipse, rel=1e-6)
    assert near < 0.5  # curvature


def test_effect_of_eccentricity(tool):
    rows = np.array([tool.deviations(seed, 0.01, 1) for seed in range(8)])
    hill, _, _, _, ellipse, near = np.median(rows, axis=0)
    assert ellipse < 0.5 * hill
    assert near < 0.01 * hill
