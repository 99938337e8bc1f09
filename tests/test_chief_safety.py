"""Passive safety after a loss of thrust about any chief: against Hill's verdicts and dense samples."""

import numpy as np
import pytest
from scipy.optimize import minimize

import closeform as cf
from closeform.motion.chief.bernstein import basis_at
from closeform.motion.chief.yamanaka_ankersen import KeplerChief

UNITS = np.array([200.0, 200.0, 200.0, 0.2, 0.2, 0.2])
KINDS = ("transfer", "two_impulse", "impulsive")


def larger(zone, factor):
    half = np.array([1.0, 2.0, 1.0]) * factor
    return cf.Ellipsoid(half) if zone == "ellipsoid" else cf.Box(half)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("zone", ["ellipsoid", "box"])
def test_a_circular_chief_is_as_safe_as_in_hill_equations(kind, zone):
    orbit, hill = cf.Orbit.eccentric(0.0, semi_major_axis=7e6), cf.Orbit.from_semi_major_axis(7e6)
    random = np.random.default_rng(3)
    for _ in range(5):
        ends, length = random.normal(size=(2, 6)) * UNITS, random.uniform(0.2, 1.2) * hill.period
        until = length + 100.0 + 1.3 * hill.period
        mine, known = (getattr(o, kind)(*ends, length, 100.0) for o in (orbit, hill))
        still, client = (o.coast(np.zeros(6), until) for o in (orbit, hill))
        least = cf.drift_approach(known, client, larger(zone, 1.0), until).ratio
        assert cf.passively_safe(mine, still, larger(zone, least * 0.9999), until)
        assert not cf.passively_safe(mine, still, larger(zone, least * 1.0001), until)


def nearest_drift(path, other, zone, until):
    """Return the least norm of drifts from dense samples of failures, refined by Nelder and Mead's method."""

    def norms(failed, times):
        drift = path.orbit.coast(path.state(failed), until - failed, failed)
        return zone.norm(drift.position(times) - other.position(times))

    found = []
    for failed in np.linspace(path.start, path.end, 60):
        times = np.linspace(failed, until, 500)
        here = norms(failed, times)
        found.append((here.min(), failed, times[here.argmin()]))

    def at(x):
        failed = min(max(x[0], path.start), path.end)
        return float(norms(failed, min(max(x[1], failed), until)))

    starts = sorted(found)[:4]
    options = {"xatol": 1e-6, "fatol": 1e-9}
    return min(minimize(at, one[1:], method="Nelder-Mead", options=options).fun for one in starts)


@pytest.mark.parametrize("e", [0.05, 0.4, 0.8])
def test_verdicts_are_those_of_dense_samples(e):
    orbit, random = cf.Orbit.eccentric(e, perigee_altitude=700e3), np.random.default_rng(9)
    for k in range(4):
        ends, begin = random.normal(size=(2, 6)) * UNITS, random.uniform(0.0, orbit.period)
        path = orbit.transfer(*ends, random.uniform(0.2, 1.0) * orbit.period, begin)
        until = path.end + 0.8 * orbit.period
        other = orbit.coast(0.02 * random.normal(size=6) * UNITS, until)
        zone = "ellipsoid" if k % 2 else "box"
        least = nearest_drift(path, other, larger(zone, 1.0), until)
        assert cf.passively_safe(path, other, larger(zone, least * 0.995), until)
        assert not cf.passively_safe(path, other, larger(zone, least * 1.005), until)
        found = cf.drift_approach(path, other, larger(zone, 1.0), until)
        assert 0.89 * found.ratio <= found.lower <= least * (1.0 + 1e-9)
        assert found.ratio == pytest.approx(least, rel=2e-4)
        drift = orbit.coast(path.state(found.failed_at), until - found.failed_at, found.failed_at)
        gap = drift.position(found.time) - other.position(found.time)
        assert larger(zone, 1.0).norm(gap) == pytest.approx(found.ratio, rel=1e-8)
        assert found.distance == pytest.approx(np.linalg.norm(gap), rel=1e-8)


def test_either_spacecraft_may_fail():
    """The zone is around `other`, whichever fails: half-spaces tell the sides apart."""
    orbit = cf.Orbit.eccentric(0.3, perigee_altitude=700e3)
    one = orbit.coast([0, -300, 0, 0, 0, 0], 3000.0)
    two = orbit.two_impulse([0, 0, 0, 0, 0, 0], [0, -120, 0, 0, 0, 0], 3000.0)
    both = cf.join([two, orbit.coast(two.state(3000.0), 2000.0, 3000.0)])
    longer = cf.join([one, orbit.coast(one.state(3000.0), 2000.0, 3000.0)])
    zone = cf.HalfSpaces(
        [[0, 1, 0], [0, -1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]], [1e-3, 250.0, 60.0, 60.0, 9.0]
    )
    for path, other, failing in ((longer, both, "other"), (both, longer, "path")):
        found = cf.passively_safe(path, other, zone, 5000.0, failing=failing)
        samples = []
        for failed in np.linspace(0.0, 5000.0, 60)[:-1]:
            drift = orbit.coast(both.state(failed), 5000.0 - failed, failed)
            times = np.linspace(failed, 5000.0, 300)
            gap = longer.position(times) - drift.position(times)
            samples.append(zone.norm(gap if failing == "other" else -gap).min())
        assert found == (min(samples) > 1.0)
    assert not cf.passively_safe(longer, both, zone, 5000.0, failing="either") or min(samples) > 1.0


@pytest.mark.parametrize("kind", ["two_impulse", "impulsive"])
def test_interrupted_impulses_are_bounded_near_the_worst_of_many_samples(kind):
    """After long drifts the nearest share of an impulse is one of many minima, some of them narrow."""
    orbit, zone = cf.Orbit.eccentric(0.7, perigee_altitude=700e3), cf.Sphere(50.0)
    random = np.random.default_rng(3)
    for _ in range(3):
        ends, begin = random.normal(size=(2, 6)) * UNITS, random.uniform(0.0, orbit.period)
        path = getattr(orbit, kind)(*ends, random.uniform(0.3, 1.0) * orbit.period, begin)
        until = path.end + 2.5 * orbit.period
        other, least = orbit.coast(np.zeros(6), until), np.inf
        for at, jump in path.impulses:
            states = np.repeat(path.state(at)[None], 2001, axis=0)
            states[:, 3:] -= np.linspace(1.0, 0.0, 2001)[:, None] * jump
            drifts = orbit.coast(states, until - at, np.full(2001, at))
            least = min(least, cf.closest_approach(drifts, other, zone).ratio.min())
        found = cf.drift_approach(path, other, zone, until)
        assert 0.998 * found.ratio <= found.lower <= found.ratio <= least * (1.0 + 1e-9)


def test_batches_and_j2():
    orbit = cf.Orbit.perturbed(0.001, 1.1, perigee_altitude=600e3, span=30_000.0)
    ends = np.array([[0, -900, 0, 0, 0, 0], [0, -250, 0, 0, 0, 0.0]])
    paths = orbit.transfer(ends, ends / 2, 5000.0, 100.0)
    other, zone = orbit.coast(np.zeros(6), 20_000.0), cf.Sphere(100.0)
    least = [nearest_drift(paths[k], other, zone, 20_000.0) for k in range(2)]
    assert cf.passively_safe(paths, other, zone, 20_000.0).tolist() == [one > 1.0 for one in least]
    found = cf.drift_approach(paths, other, zone, 20_000.0)
    assert found.ratio == pytest.approx(least, rel=2e-4, abs=1e-3)
    assert (found.lower <= found.ratio).all()
    assert found.failing.tolist() == ["path", "path"]


def test_returns_stay_within_their_bounds():
    """Steps after the returned state lead where the thrust leads: Phi (x + returns c) = Phi x + R c."""
    for e in (0.0, 0.3, 0.8):
        table = KeplerChief(1.0, e, 0.0).table
        for u in (0.2, 0.9):
            at = basis_at(np.array(u))
            rows, back = (np.einsum("b,kcib->kic", at, one) for one in (table.rows, table.returns))
            off = np.abs(rows[:, :, :6] @ back - rows[:, :, 6:])[:, :3].max()
            assert off <= 1e-11 * np.abs(rows[:, :, :6]).max()
        assert table.return_errors.max() <= 1e-11 * np.abs(table.returns).max() + 1e-11
