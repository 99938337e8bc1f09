"""Passive safety of all pairs of a formation, with failures of both and endless drift."""

import numpy as np
import pytest

import closeform as cf
from pairs import carried

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONE = cf.Sphere(20.0)
PRECISE = 1e-3  # of the ratios of a screen


def transfers(seed, count, along=300.0):
    """Return transfers within 100 m across and `along` the track, half of them ending at rest."""
    rng = np.random.Generator(np.random.Philox(seed))
    ends = rng.normal(size=(2, count, 6)) * np.r_[80, along, 80, 0, 0, 0.1]
    ends[:, :, 4] = -2 * N * ends[:, :, 0]
    ends[1, ::2, 0] = ends[1, ::2, 4] = 0.0
    return ORBIT.transfer(*ends, PERIOD)


@pytest.mark.parametrize(
    "zone", [ZONE, cf.Cylinder(15.0, 30.0, axis=[0.2, 1.0, 0.1])], ids=["sphere", "cylinder"]
)
def test_failures_of_both_spacecraft(zone):
    """Unsafe pairs are those of single searches, confirmed by matrix exponentials."""
    fleet, until = transfers(4, 6, 2000.0), 2.5 * PERIOD
    found = cf.drift_screen(fleet, zone, until, failing="both")
    first, second = np.triu_indices(6, 1)
    safe = cf.passively_safe(fleet[first], fleet[second], zone, until, failing="both")
    unsafe = np.stack([first, second], axis=1)[~safe]
    assert found.pairs.tolist() == unsafe.tolist()
    assert 0 < len(found) < len(first)
    assert found.failed_at.shape == (len(found), 2)
    states = [
        carried(
            N,
            np.stack([fleet[k].state(at) for k, at in zip(craft, failed, strict=True)]),
            found.time - failed,
        )
        for craft, failed in zip(found.pairs.T, found.failed_at.T, strict=True)
    ]
    norms = zone.norm((states[0] - states[1])[:, :3])
    assert np.abs(norms - found.ratio).max() < 1e-9  # they are what those failures lead to
    least = cf.drift_approach(fleet[unsafe[:, 0]], fleet[unsafe[:, 1]], zone, until, failing="both").ratio
    assert np.abs(found.ratio - least).max() < PRECISE


def test_both_failing_is_never_safer():
    fleet, until = transfers(5, 6), 2 * PERIOD
    either = cf.drift_screen(fleet, ZONE, until)
    both = cf.drift_screen(fleet, ZONE, until, failing="both")
    assert {tuple(sorted(pair)) for pair in either.pairs.tolist()} <= {
        tuple(pair) for pair in both.pairs.tolist()
    }
    assert set(either.columns()) == {"first", "second", "failed_at_s", "time_s", "ratio"}
    assert set(both.columns()) == {*either.columns(), "other_failed_at_s"}


def test_endless_drift_is_never_safer():
    """Ratios agree with `drift_approach`."""
    fleet = transfers(6, 7)
    long, for_ever = (cf.drift_screen(fleet, ZONE, until) for until in (1000 * PERIOD, np.inf))
    least = {tuple(pair): ratio for pair, ratio in zip(for_ever.pairs.tolist(), for_ever.ratio, strict=True)}
    assert {tuple(pair) for pair in long.pairs.tolist()} <= least.keys()
    assert len(long) > 0
    assert len(for_ever) < 42
    for pair, ratio in zip(long.pairs.tolist(), long.ratio, strict=True):
        assert least[tuple(pair)] <= ratio + PRECISE
    found = cf.drift_approach(fleet[for_ever.pairs[:, 0]], fleet[for_ever.pairs[:, 1]], ZONE, np.inf)
    assert np.abs(found.ratio - for_ever.ratio).max() < PRECISE
    met = np.isfinite(for_ever.time)
    i, j = for_ever.pairs[met].T
    failed, time = for_ever.failed_at[met], for_ever.time[met]
    ours = np.stack([fleet[k].state(at) for k, at in zip(i, failed, strict=True)])
    planned = np.stack([fleet[k].state(min(at, PERIOD)) for k, at in zip(j, time, strict=True)])
    gap = carried(N, ours, time - failed) - carried(N, planned, np.maximum(time - PERIOD, 0.0))
    # a drift of 1e4 m an orbit for hundreds of them, to nine digits
    assert np.abs(ZONE.norm(gap[:, :3]) - for_ever.ratio[met]).max() < 1e-6


def test_endless_drift_beside_coasting_spacecraft():
    """Pairs and ratios agree with `passively_safe` and `drift_approach`."""
    fleet = transfers(7, 4)
    rings = cf.targets.separated_ring(ORBIT, 3, 60.0, 60.0)
    flown = cf.stack([*(fleet[k] for k in range(4)), *(ORBIT.coast(state, PERIOD) for state in rings)])
    found = cf.drift_screen(flown, ZONE, np.inf)
    mine = found.pairs[:, 1] >= 4
    pairs = [(i, j) for i in range(7) for j in range(4, 7) if i != j]
    unsafe = [(i, j) for i, j in pairs if not cf.passively_safe(flown[i], flown[j], ZONE, np.inf)]
    assert unsafe == [tuple(pair) for pair in found.pairs[mine].tolist()]
    assert 0 < len(unsafe) < len(pairs)
    for (i, j), ratio in zip(unsafe, found.ratio[mine], strict=True):
        assert abs(cf.drift_approach(flown[i], flown[j], ZONE, np.inf).ratio - ratio) < PRECISE


def test_undecided_pairs_are_reported():
    """Reported pairs include those that violate and exclude those that cannot."""
    fleet, until = transfers(312, 5), 20 * PERIOD
    failure, zone = cf.StuckOnThrust(60.0, [0.0, 2e-4, 0.0]), cf.Box([15, 25, 12])
    told = {tuple(pair) for pair in cf.drift_screen(fleet, zone, until, failure).pairs.tolist()}
    flown = cf.join([fleet, ORBIT.coast(fleet.state(PERIOD), until - PERIOD, start=PERIOD)])
    meet, may = set(), set()
    for i, j in np.argwhere(~np.eye(5, dtype=bool)):
        found = cf.drift_approach(fleet[i], flown[j], zone, until, failure)
        meet |= {(i, j)} if found.ratio <= 1.0 else set()
        may |= {(i, j)} if found.lower <= 1.0 else set()
    assert meet <= told <= may
    assert len(told) == 11
