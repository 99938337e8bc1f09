"""Drift without an end, against long ends, and against slow drifts flown by the textbook's matrix."""

import numpy as np

import closeform as cf
from pairs import carried

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
OTHER = ORBIT.coast(np.zeros(6), PERIOD)
LONG = ORBIT.coast(np.zeros(6), 10_002 * PERIOD)
ZONES = [cf.Ellipsoid([15, 25, 12]), cf.Sphere(20.0)]


def transfers(seed, count):
    """From one safety ellipse to another, on which the craft comes to rest; and beside what."""
    rng = np.random.Generator(np.random.Philox(seed))
    ellipse = cf.targets.safety_ellipse
    for k in range(count):
        first, last = rng.uniform(80, 200, 2), rng.uniform(10, 80, 2)
        there = ellipse(ORBIT, 1, *last, along_track=rng.uniform(-50, 50))[0]
        here = ellipse(ORBIT, 1, *first, along_track=rng.uniform(-50, 50), phase=rng.uniform(0, 6))[0]
        yield ORBIT.transfer(here, there, rng.uniform(0.3, 1.2) * PERIOD), ZONES[k % 2]


def slow_drifts(path, zone, s):
    """Least norms of some failures close to `s` that drift past the zone, by the textbook."""
    off = np.geomspace(1e-3, 1e2, 300)
    instants = np.concatenate([s - off, s + off])
    instants = instants[(instants >= path.start) & (instants <= path.end)]
    states = path.state(instants)
    drift = -6.0 * np.pi * (2.0 * states[:, 0] + states[:, 4] / N)  # [m] per orbit
    phases = np.linspace(0.0, PERIOD, 2000)
    least = []
    for state, by in zip(states, drift, strict=True):
        if not 1e-9 < abs(by) < 5.0:
            continue
        ahead = carried(N, np.tile(state, (len(phases), 1)), phases)[:, :3]
        turns = np.maximum(np.round(-ahead[:, 1] / by), 0.0)  # which of its orbits is nearest in that phase
        ahead[:, 1] += turns * by
        least.append(zone.norm(ahead).min())
    return np.array(least)


def test_no_end_is_the_least_over_all_ends():
    """The same where a failure in the first hundred orbits is the worst; the verdict is that of the ratio."""
    late = soon = 0
    for path, zone in transfers(9, 40):
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        assert cf.passively_safe(path, OTHER, zone, np.inf) == (found.lower > 1.0)
        assert found.ratio - found.lower < 2e-9 * max(1.0, found.ratio)
        until = cf.drift_approach(path, LONG, zone, path.end + 150 * PERIOD)
        assert found.ratio <= until.ratio + 1e-9 * max(1.0, until.ratio)
        if found.time < path.end + 100 * PERIOD:
            assert abs(found.ratio - until.ratio) < 2e-9 * max(1.0, until.ratio)
            soon += 1
            continue
        late += 1
        if found.time == np.inf:
            norms = slow_drifts(path, zone, found.failed_at)
            assert found.ratio - 1e-3 < norms.min() < found.ratio + 5e-3
    assert min(late, soon) >= 8


def test_fast_drifts_that_are_gone_for_good_do_not_count():
    """Where slow ones stay clear: once told 0.95 for a failure that drifts 1.3 km each orbit."""
    safe = 0
    for path, zone in transfers(2, 20):
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        if found.lower > 1.0:
            safe += 1
            for orbits in (300, 1000):
                assert cf.passively_safe(path, LONG, zone, path.end + orbits * PERIOD)
        if found.time == np.inf:
            state = path.state(found.failed_at)
            assert abs(2.0 * state[0] + state[4] / N) < 1e-6  # [m]: it stands still
    assert safe >= 5


def test_half_spaces_without_an_end_have_no_bound_where_drift_leads_into_them():
    """A slow drift down the track goes ever deeper into all that is below a plane across it."""
    zone = cf.HalfSpaces([[0, 1, 0]], [50.0])
    by = -0.1  # [m] per orbit
    d = -by / (3 * np.pi)
    drifting = ORBIT.coast([d, 200, 0, 0, -1.5 * N * d, 0], PERIOD)
    found = cf.drift_approach(drifting, OTHER, zone, np.inf)
    assert found.lower == -np.inf
    assert not cf.passively_safe(drifting, OTHER, zone, np.inf)


def test_batches_of_no_craft_have_empty_answers():
    none = ORBIT.coast(np.zeros((0, 6)), PERIOD)
    for until in (2 * PERIOD, np.inf):
        assert cf.passively_safe(none, none, ZONES[1], until, failing="both").shape == (0,)
    assert cf.drift_approach(none, OTHER, ZONES[1], np.inf).ratio.shape == (0,)
    assert len(cf.drift_screen(none, ZONES[1], 2 * PERIOD)) == 0
