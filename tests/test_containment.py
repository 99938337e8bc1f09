"""How far off craft are in a whole flight: by flights, by draws, by Rice's formula for a sphere."""

import numpy as np
import pytest
from scipy.stats import chi

import closeform as cf
from closeform.dynamics.outcrossings import Outcrossings

CHIEF = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, np.radians(51.6), 0.3])
FIELD, ORBIT = cf.Field(CHIEF), CHIEF.orbit
SIGHT = cf.Navigation(0.1, 3e-4)


def greatest(flights: cf.Simulation) -> np.ndarray:
    """How far off each craft is at most in each flight (S N,) [m]."""
    return flights.deviations.max(axis=-1).ravel()


@pytest.mark.parametrize(
    "law",
    [cf.Feedback(), cf.Feedback(60.0, 600.0, delay=20.0), cf.Feedback(300.0, 1800.0, 6)],
    ids=["thrust", "late", "impulses"],
)
def test_flights_leave_it_as_rarely_as_promised(law: cf.Feedback) -> None:
    """Of 4000 flights of an orbit: no more than promised, and more than half as many."""
    circle = ORBIT.coast(np.zeros((8, 6)), ORBIT.period)
    off = greatest(cf.simulate(circle, FIELD, feedback=law, navigation=SIGHT, seeds=500))
    room = cf.tube(ORBIT, law, SIGHT)
    for chance in (0.1, 0.02):
        left = (off > room.containment(ORBIT.period, 1.0 - chance)).mean()
        three = 3.0 * np.sqrt(chance * (1.0 - chance) / len(off))  # sigmas of a share of so many
        assert 0.5 * chance < left < chance + three
    assert (off > room.radius).mean() > 0.001  # four sigmas in a direction are no length, nor of a flight


def test_pushes_that_nobody_knows_and_noise_together() -> None:
    """Drag that is off by a tenth, zonals beyond J2: `residual` bounds them, and the radius holds both."""
    air = cf.Drag(5.2e-13, 500e3, 60e3, [0.022, 0.018] * 4, 0.02)
    truth = cf.Field(CHIEF, 6, air)
    known = cf.Field(CHIEF, 2, cf.Drag(5.2e-13, 500e3, 60e3, 0.02, 0.02))
    draws = np.random.default_rng(4)
    start, final = draws.normal(size=(2, 8, 6)) * 2e3 * np.repeat([0.5, 0.5 * ORBIT.mean_motion], 3)
    path = ORBIT.transfer(start, final, ORBIT.period)
    less = (cf.compensated_thrust(path, field).commanded for field in (truth, known))
    unknown = np.linalg.norm(np.subtract(*less), axis=-1).max(axis=-1)  # m/s^2
    room = cf.tube(ORBIT, cf.Feedback(), SIGHT, unknown)
    still = greatest(cf.simulate(path, truth, known=known, feedback=cf.Feedback())).reshape(-1, 8)
    assert (still <= room.model).all()
    flights = cf.simulate(path, truth, known=known, navigation=SIGHT, seeds=500)
    outside = flights.deviations.max(axis=-1) > room.containment(ORBIT.period, 0.99)
    assert outside.mean() < 0.01 + 3.0 * np.sqrt(0.01 / outside.size)


def test_crossings_of_a_sphere_are_rices() -> None:
    """Of equal axes: the density of the length, times sigma of the speed over the root of 2 pi."""
    sigma, speed, radius = 0.05, 2e-4, 0.17
    found = Outcrossings(np.diag(np.repeat([sigma, speed], 3) ** 2)[None])
    crossings = speed / np.sqrt(2.0 * np.pi) * chi.pdf(radius / sigma, 3) / sigma
    outside = chi.sf(radius / sigma, 3)
    assert found.chance(radius, 3000.0) == pytest.approx(outside + 3000.0 * crossings, rel=1e-9)


def test_crossings_of_unlike_axes_as_drawn() -> None:
    """Of states that are drawn: how many are within the sphere and a short time later outside."""
    draws = np.random.default_rng(2)
    mixed = draws.normal(size=(6, 6)) * np.repeat([0.1, 1e-3], 3)[:, None]
    mixed[0] *= 8.0  # m: one axis is the longest by far
    found = Outcrossings((mixed @ mixed.T)[None])
    states = draws.normal(size=(2_000_000, 6)) @ mixed.T
    size = np.sqrt((states[:, :3] ** 2).sum(axis=1))
    radius, step = 1.5 * float(np.sqrt(np.linalg.eigvalsh(mixed[:3] @ mixed[:3].T)[-1])), 20.0
    later = np.sqrt(((states[:, :3] + step * states[:, 3:]) ** 2).sum(axis=1))
    crossed = ((size < radius) & (later > radius)).mean()
    assert found.chance(radius, 0.0) == pytest.approx((size > radius).mean(), rel=0.03)
    crossings = found.chance(radius, step) - found.chance(radius, 0.0)
    assert crossings == pytest.approx(crossed, rel=0.1)  # some thousand of them


def test_it_grows_with_flights_craft_and_what_is_bounded() -> None:
    room = cf.tube(ORBIT, cf.Feedback(), SIGHT, [1e-7, 2e-7])
    alone = room.containment(3000.0, 0.99)
    assert alone.shape == (2,)
    assert np.diff(alone) == pytest.approx(np.diff(room.model))
    assert (room.containment(6000.0, 0.99) > alone).all()
    # ten craft leave in one of a hundred flights where one does in one of a thousand
    assert room.containment(3000.0, 0.99, craft=10) == pytest.approx(room.containment(3000.0, 0.999))
    # as surely as one direction stays within four sigmas: once in 31574
    assert room.containment(3000.0) == pytest.approx(room.containment(3000.0, 1.0 - 1.0 / 31574.4))
    assert room.probability == pytest.approx(1.0 - 3.167e-5, abs=1e-8)
    exact = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(position_bias=0.1), 1e-7)
    assert exact.containment(3000.0) == exact.radius
