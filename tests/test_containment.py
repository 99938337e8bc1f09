"""Containment over a whole simulation, against simulations, samples and Rice's formula."""

import numpy as np
import pytest
from scipy.stats import chi

import closeform as cf
from closeform.dynamics.control.tracking_tube import Outcrossings

CHIEF = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, np.radians(51.6), 0.3])
FIELD, ORBIT = cf.Field(CHIEF), CHIEF.orbit
SIGHT = cf.Navigation(0.1, 3e-4)


def greatest(flights: cf.Simulation) -> np.ndarray:
    """Return the largest deviation of each spacecraft in each simulation (S N,) [m]."""
    return flights.deviations.max(axis=-1).ravel()


@pytest.mark.parametrize(
    "law",
    [
        pytest.param(cf.Feedback(), marks=pytest.mark.slow),
        pytest.param(cf.Feedback(60.0, 600.0, delay=20.0), marks=pytest.mark.slow),
        cf.Feedback(300.0, 1800.0, 6),
    ],
    ids=["thrust", "late", "impulses"],
)
def test_simulations_leave_the_tube_as_rarely_as_promised(law: cf.Feedback) -> None:
    """The share outside is at most the promised one, and at least half of it."""
    circle = ORBIT.coast(np.zeros((8, 6)), ORBIT.period)
    off = greatest(cf.simulate(circle, FIELD, feedback=law, navigation=SIGHT, seeds=500))
    tube = cf.tube(ORBIT, law, SIGHT)
    for chance in (0.1, 0.02):
        left = (off > tube.containment(ORBIT.period, 1.0 - chance)).mean()
        three = 3.0 * np.sqrt(chance * (1.0 - chance) / len(off))  # three standard errors
        assert 0.5 * chance < left < chance + three
    assert (off > tube.radius).mean() > 0.001  # the radius bounds an axis at an instant


def test_unknown_forces_and_noise_are_contained() -> None:
    """The radius covers noise and unknown drag and zonals that `residual` bounds."""
    air = cf.Drag(5.2e-13, 500e3, 60e3, [0.022, 0.018] * 4, 0.02)
    truth = cf.Field(CHIEF, 6, air)
    known = cf.Field(CHIEF, 2, cf.Drag(5.2e-13, 500e3, 60e3, 0.02, 0.02))
    draws = np.random.default_rng(4)
    start, final = draws.normal(size=(2, 8, 6)) * 2e3 * np.repeat([0.5, 0.5 * ORBIT.mean_motion], 3)
    path = ORBIT.transfer(start, final, ORBIT.period)
    less = (cf.compensated_thrust(path, field).commanded for field in (truth, known))
    unknown = np.linalg.norm(np.subtract(*less), axis=-1).max(axis=-1)  # m/s^2
    tube = cf.tube(ORBIT, cf.Feedback(), SIGHT, unknown)
    still = greatest(cf.simulate(path, truth, known=known, feedback=cf.Feedback())).reshape(-1, 8)
    assert (still <= tube.model).all()
    flights = cf.simulate(path, truth, known=known, navigation=SIGHT, seeds=150)
    outside = flights.deviations.max(axis=-1) > tube.containment(ORBIT.period, 0.99)
    assert outside.mean() < 0.01 + 3.0 * np.sqrt(0.01 / outside.size)


def test_crossings_by_rices_formula() -> None:
    """Equal axes: density of the length times sigma of the speed over sqrt(2 pi)."""
    sigma, speed, radius = 0.05, 2e-4, 0.17
    found = Outcrossings(np.diag(np.repeat([sigma, speed], 3) ** 2)[None])
    crossings = speed / np.sqrt(2.0 * np.pi) * chi.pdf(radius / sigma, 3) / sigma
    outside = chi.sf(radius / sigma, 3)
    assert found.chance(radius, 3000.0) == pytest.approx(outside + 3000.0 * crossings, rel=1e-9)


def test_crossings_of_unequal_axes() -> None:
    """Count sampled states that leave the sphere within a short time."""
    draws = np.random.default_rng(2)
    mixed = draws.normal(size=(6, 6)) * np.repeat([0.1, 1e-3], 3)[:, None]
    mixed[0] *= 8.0  # m; one axis is much longer
    found = Outcrossings((mixed @ mixed.T)[None])
    states = draws.normal(size=(500_000, 6)) @ mixed.T
    size = np.sqrt((states[:, :3] ** 2).sum(axis=1))
    radius, step = 1.5 * float(np.sqrt(np.linalg.eigvalsh(mixed[:3] @ mixed[:3].T)[-1])), 20.0
    later = np.sqrt(((states[:, :3] + step * states[:, 3:]) ** 2).sum(axis=1))
    crossed = ((size < radius) & (later > radius)).mean()
    assert found.chance(radius, 0.0) == pytest.approx((size > radius).mean(), rel=0.03)
    crossings = found.chance(radius, step) - found.chance(radius, 0.0)
    assert crossings == pytest.approx(crossed, rel=0.1)


def test_containment_grows_with_duration_and_spacecraft() -> None:
    tube = cf.tube(ORBIT, cf.Feedback(), SIGHT, [1e-7, 2e-7])
    alone = tube.containment(3000.0, 0.99)
    assert alone.shape == (2,)
    assert np.diff(alone) == pytest.approx(np.diff(tube.model))
    assert (tube.containment(6000.0, 0.99) > alone).all()
    # ten spacecraft leave ten times as often
    assert tube.containment(3000.0, 0.99, craft=10) == pytest.approx(tube.containment(3000.0, 0.999))
    # default probability: four sigma of one axis, once in 31574
    assert tube.containment(3000.0) == pytest.approx(tube.containment(3000.0, 1.0 - 1.0 / 31574.4))
    assert tube.probability == pytest.approx(1.0 - 3.167e-5, abs=1e-8)
    exact = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(position_bias=0.1), 1e-7)
    assert exact.containment(3000.0) == exact.radius
