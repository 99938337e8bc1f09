"""Screens with errors: bounds of excluded pairs against dense covariances and single pairs."""

import numpy as np
import pytest

import closeform as cf
from closeform.conflicts.tracks import follow
from closeform.uncertainty.covariance_propagation import propagate_errors
from closeform.uncertainty.sigmas.conflicts import sigma_conflicts
from closeform.uncertainty.sigmas.rejection import widened
from closeform.zones.zone import enclosing

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONES = [
    cf.Sphere(12.0),
    cf.Box([10.0, 30.0, 20.0], axes=[[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]),
    cf.Cylinder(15.0, 30.0, [1.0, 1.0, 0.0]),
]


def deviations(places, speeds):
    return np.diag([*places, *speeds]) ** 2


def flown(orbit, seed):
    """Return a path with a burn, an impulse and a coast that starts at a random time."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 500.0)
    path = orbit.burn(rng.normal(size=6) * [80, 80, 80, 0.05, 0.05, 0.05], [1e-5, 2e-5, 0], 1234.5, start)
    joint = start + 1234.5
    kicked = path.state(joint) + [0, 0, 0, 0.3, -0.1, 0.2]
    return cf.join([path, orbit.coast(kicked, 2000.0, start=joint)])


@pytest.mark.parametrize("orbit", [ORBIT, DEEP], ids=["orbit", "deep space"])
@pytest.mark.parametrize("noise", [0.0, 1e-7])
def test_interval_widths_bound_the_standard_deviations(orbit, noise):
    """Compare with singular values of the covariance on a dense grid of times."""
    errors = cf.Uncertainty(
        deviations([2, 3, 1], [2e-3, 1e-3, 4e-3]), 0.05, 0.03, (1e-3, 0.03, 2e-3, 0.02), noise
    )
    paths = cf.stack([flown(orbit, seed) for seed in range(12)])
    for zone in ZONES:
        bodies = paths.arcs, paths.offsets
        plain = follow(*bodies, *bodies, (zone,), 100)[zone]
        spread = propagate_errors(paths, [errors] * len(paths))
        wide = widened(plain, spread, zone, orbit.mean_motion, 1.0)
        added = wide.own[:, 3] - plain.own[:, 3]
        tight = []
        for k in (0, 5, 11):
            path = paths[k]
            times = np.unique([*np.linspace(path.start, path.end, 3000), path.start + 1234.5])
            moved = enclosing(zone) @ errors.covariance(path, times)[:, :3, :3] @ enclosing(zone).T
            sigma = np.sqrt(np.linalg.eigvalsh(moved)[:, -1])
            m = np.clip(np.searchsorted(plain.times, times, side="right") - 1, 0, len(plain.times) - 2)
            assert (sigma <= added[k, m]).all()
            tight.append(np.median(added[k, m] / sigma))
        assert max(tight) < 1.15  # and few are excluded in vain


@pytest.mark.parametrize("zone", ZONES[1:2], ids=["box"])
def test_excluded_pairs_have_no_conflict(zone):
    """A screen of many spacecraft finds the conflicts of each pair by itself."""
    rng = np.random.default_rng(4)
    states = rng.normal(size=(24, 6)) * [120, 500, 120, 0.1, 0.02, 0.1]
    states[:, 4] -= 2 * N * states[:, 0]
    coasts = ORBIT.coast(states, PERIOD)
    paths = cf.stack([*(coasts[k] for k in range(24)), *(flown(ORBIT, seed) for seed in range(6))])
    kinds = [
        cf.Uncertainty(
            deviations([1, s, 1], [s * 1e-3] * 3), 0.1, impulse=(0.01, 0, 0.01, 0), noise=s * 1e-10
        )
        for s in (1, 2, 5)
    ]
    errors = [None if k == 3 else kinds[k % 3] for k in range(len(paths))]
    found = cf.screen(paths, zone, errors=errors, sigmas=3.0)
    first, second = (index.astype(np.int64) for index in np.triu_indices(len(paths), 1))
    spread = propagate_errors(paths, errors)
    rows = sigma_conflicts(spread, spread, first, second, zone, N, 3.0)
    index = rows[:, 0].astype(int)
    assert len(rows) > 10
    np.testing.assert_array_equal(found.pairs, np.stack([first[index], second[index]], axis=1))
    there = np.column_stack([found.start, found.end, found.time, found.ratio])
    np.testing.assert_array_equal(there, rows[:, 1:])


@pytest.mark.slow
def test_thousand_spacecraft_with_errors():
    """Half a million pairs; errors add conflicts."""
    rng = np.random.default_rng(1)
    states = rng.normal(size=(1000, 6)) * [4e3, 13e3, 4e3, 4.4, 0, 4.4]
    states[:, 4] = -2 * N * states[:, 0]
    paths = ORBIT.coast(states, 2 * PERIOD)
    errors = cf.Uncertainty(deviations([2, 2, 1], [1e-3] * 3))
    found = cf.screen(paths, cf.Body(cf.Sphere(5.0)), errors=errors)
    assert len(found) > len(cf.screen(paths, cf.Body(cf.Sphere(5.0))))


def test_covariance_zone_cannot_be_combined_with_errors():
    paths = ORBIT.coast([[0, 0, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0]], PERIOD)
    known, errors = cf.CovarianceZone(np.eye(3), 3.0), cf.Uncertainty(np.eye(6) * 1e-6)
    for zone in (known, [known, cf.Body(cf.Sphere(2.0))], cf.PairZones.of([cf.Sphere(3.0), known])):
        with pytest.raises(ValueError, match="zone: a CovarianceZone together with errors counts them twice"):
            cf.screen(paths, zone, errors=errors)
    many = [cf.CovarianceZone(np.eye(3) * (1 + k), 3.0) for k in range(80)]  # zones that are made by need
    with pytest.raises(ValueError, match="counts them twice"):
        cf.screen(ORBIT.coast(np.zeros((80, 6)), 10.0), many, errors=errors)


def test_sampled_path_has_state_errors_and_noise():
    """Samples of weak thrust give the result of the thrust itself."""
    coast = ORBIT.burn([60, 0, 0, 0, -2 * N * 60, N * 60], [1e-6, 0, 2e-6], 2 * PERIOD)
    times = np.linspace(0.0, 2 * PERIOD, 2000)
    sampled = ORBIT.sampled(times, coast.state(times))
    assert sampled.cubic_share > 0.9
    other, zone = ORBIT.coast(np.zeros(6), 2 * PERIOD), cf.Sphere(15.0)
    errors = cf.Uncertainty(deviations([3, 6, 3], [3e-3] * 3), noise=1e-9)
    exact = cf.clearance_in_sigmas(coast, other, zone, errors)
    found = cf.clearance_in_sigmas(sampled, other, zone, errors)
    assert found.sigmas == pytest.approx(exact.sigmas, rel=1e-5)
    assert found.time == pytest.approx(exact.time, abs=1.0)
    k = 1.2 * exact.sigmas
    one = cf.find_conflicts(coast, other, zone, errors, sigmas=k)
    two = cf.find_conflicts(sampled, other, zone, errors, sigmas=k)
    three = cf.screen([sampled, other], zone, errors=[errors, None], sigmas=k)
    assert len(one) == len(two) == len(three) > 0
    np.testing.assert_allclose([(s.start, s.end) for s in two], [(s.start, s.end) for s in one], atol=0.05)
    np.testing.assert_array_equal(three.start, [conflict.start for conflict in two])
