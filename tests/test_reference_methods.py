"""Reference methods of the benchmarks work as described."""

import sys
from itertools import combinations
from math import radians
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
import passages as drawn_passages
from closeform.zones.shapes import CUBE

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from cases import MEAN_MOTION, PERIOD, ZONE, cluster, lost_craft, lost_pairs, passages
from peers import boresight_scan, convex, exchange, mixed_integer, sampling, zero_crossings
from peers.motion import held, natural, position, state, transfer
from turns import Turning, margin, turns

pytestmark = pytest.mark.slow  # numba compiles these methods anew in each process
ORBIT = cf.Orbit(MEAN_MOTION)
ZONES = {False: cf.Ellipsoid(ZONE), True: cf.Box(ZONE)}
CROSSING = 2e-6  # s: SP11's crossings are bracketed to 1e-9 rad of n t, 1 µs here


def flown(initial, thrust, duration):
    """Return the state after consecutive constant thrusts, by numerical integration."""

    def rate(_, s, u):
        n = MEAN_MOTION
        gravity = [3 * n * n * s[0] + 2 * n * s[4], -2 * n * s[3], -n * n * s[2]]
        return np.concatenate([s[3:], np.array(gravity) + u])

    reached, step = np.asarray(initial), duration / len(thrust)
    for u in thrust:
        reached = solve_ivp(rate, (0, step), reached, args=(u,), rtol=1e-11, atol=1e-11).y[:, -1]
    return reached


@pytest.fixture(scope="module")
def crowd():
    """Twelve coasting spacecraft, many in conflict, and as many on transfers."""
    states = cluster(12, 60.0, seed=7)
    finals = cluster(12, 60.0, seed=8)
    coasting = (natural(states, MEAN_MOTION), ORBIT.coast(states, PERIOD))
    thrusting = (transfer(states, finals, PERIOD, MEAN_MOTION), ORBIT.transfer(states, finals, PERIOD))
    return {"coasting": coasting, "thrusting": thrusting}


def test_motion_of_the_reference_methods(crowd):
    for coefficients, paths in crowd.values():
        for t in (0.0, 0.37 * PERIOD, PERIOD):
            # 1 µm of some 100 m, 1 nm/s of some 0.1 m/s
            np.testing.assert_allclose(
                state(coefficients, t, MEAN_MOTION)[..., :3], paths.position(t), atol=1e-6
            )
            np.testing.assert_allclose(
                state(coefficients, t, MEAN_MOTION)[..., 3:], paths.velocity(t), atol=1e-9
            )


@pytest.mark.slow
@pytest.mark.parametrize("box", [False, True])
def test_zero_crossings_of_coasting_spacecraft(crowd, box):
    coefficients, paths = crowd["coasting"]
    rows = zero_crossings.conflicts(coefficients, PERIOD, MEAN_MOTION, ZONE, box=box)
    certain = cf.screen(paths, ZONES[box])
    assert len(certain) > 10
    np.testing.assert_array_equal(rows[:, :2], certain.pairs)
    np.testing.assert_allclose(rows[:, 2], certain.start, atol=CROSSING)
    np.testing.assert_allclose(rows[:, 3], certain.end, atol=CROSSING)


@pytest.mark.parametrize("box", [False, True])
def test_zero_crossings_of_thrusting_spacecraft(crowd, box):
    coefficients, paths = crowd["thrusting"]
    rows = zero_crossings.conflicts(coefficients, PERIOD, MEAN_MOTION, ZONE, box=box)
    certain = cf.screen(paths, ZONES[box])
    for i, j, start, end in rows:
        assert ((certain.pairs == (i, j)).all(axis=1) & (abs(certain.start - start) < CROSSING)).any()
        assert ((certain.pairs == (i, j)).all(axis=1) & (abs(certain.end - end) < CROSSING)).any()
    assert 0.9 * len(certain) < len(rows) <= len(certain)


def test_timelines_overlap_in_box_conflicts(crowd):
    coefficients, _ = crowd["coasting"]
    for i, j in combinations(range(3), 2):
        relative = coefficients[j] - coefficients[i]
        lines = zero_crossings.timelines(relative, PERIOD, MEAN_MOTION, ZONE)
        for axis, spells in enumerate(lines):
            inner = spells[(spells > 0) & (spells < PERIOD)]
            reached = np.abs(position(relative, inner, MEAN_MOTION)[:, axis])
            np.testing.assert_allclose(reached, ZONE[axis], atol=1e-6)  # 1 µs at 0.1 m/s
        instants = np.linspace(0, PERIOD, 1000)
        within = np.all([[((s[:, 0] <= t) & (t <= s[:, 1])).any() for t in instants] for s in lines], axis=0)
        inside = ZONES[True].norm(position(relative, instants, MEAN_MOTION)) <= 1
        np.testing.assert_array_equal(within, inside)


@pytest.mark.parametrize("box", [False, True])
def test_sampling_agrees_with_the_screen(crowd, box):
    coefficients, paths = crowd["coasting"]
    rows = sampling.search("vector", coefficients, PERIOD, MEAN_MOTION, ZONE, box=box, thrust=False)
    np.testing.assert_array_equal(
        rows, sampling.search_numpy(coefficients, PERIOD, MEAN_MOTION, ZONE, box=box)
    )
    certain = cf.screen(paths, ZONES[box])
    np.testing.assert_array_equal(rows[:, :2], certain.pairs)
    assert (np.abs(rows[:, 2] - certain.start) <= 1).all()  # the first sample inside, at most 1 s late
    assert (np.abs(rows[:, 3] - certain.end) <= 1).all()


def test_convex_program():
    (passage,) = passages(1, seed=6)
    place = lambda t: position(passage.obstacle_path, t, MEAN_MOTION)  # noqa: E731
    shape = np.diag(1 / ZONE**2)
    found = convex.solve(passage.initial, passage.final, passage.duration, MEAN_MOTION, [place], shape)
    reached = flown(passage.initial, found.thrust, passage.duration)
    # Clarabel's 1e-8 of its unit of 100 m leaves micrometres; 1 mm and 1 µm/s are far inside that
    np.testing.assert_allclose(reached[:3], passage.final[:3], atol=1e-3)
    np.testing.assert_allclose(reached[3:], passage.final[3:], atol=1e-6)
    step = passage.duration / convex.NODES
    assert found.energy == pytest.approx(0.5 * step * np.sum(found.thrust**2), rel=1e-12)
    assert found.node_ratio == pytest.approx(1.0, abs=1e-5)
    burns, at = [], passage.initial
    for k, push in enumerate(found.thrust):
        burns.append(ORBIT.burn(at, push, step, start=k * step))
        at = burns[-1].state(burns[-1].end)
    path = ORBIT.transfer(passage.initial, passage.final, passage.duration)
    obstacle = ORBIT.coast(passage.obstacle, passage.duration)
    approach = cf.closest_approach(cf.join(burns), obstacle, ZONES[False])
    assert approach.ratio == pytest.approx(found.ratio, abs=1e-7)
    assert 1 <= approach.ratio < 1 + 1e-5
    exact = cf.avoid(path, obstacle, ZONES[False])
    # thrust held between 200 nodes costs a little more than the continuous optimum, never less
    assert exact.energy <= found.energy <= 1.001 * exact.energy


def test_mixed_integer_program():
    (passage,) = passages(1, seed=6)
    place = lambda t: position(passage.obstacle_path, t, MEAN_MOTION)  # noqa: E731
    found = mixed_integer.solve(passage.initial, passage.final, passage.duration, MEAN_MOTION, [place], ZONE)
    reached = flown(passage.initial, found.thrust, passage.duration)
    np.testing.assert_allclose(reached[:3], passage.final[:3], atol=1e-3)
    np.testing.assert_allclose(reached[3:], passage.final[3:], atol=1e-6)
    phi, gamma = held(MEAN_MOTION, passage.duration / mixed_integer.STEPS)
    at, nodes = passage.initial, np.linspace(0, passage.duration, mixed_integer.STEPS + 1)
    for t, u in zip(nodes[1:], found.thrust, strict=True):
        at = phi @ at + gamma @ u
        assert ZONES[True].norm(at[:3] - place(np.array([t]))[0]) > 1 - 1e-5  # HiGHS's feasibility
    assert found.optimal
    assert found.fuel >= found.delta_v * (1 - 1e-12)  # the sum over axes is never below the length


@pytest.mark.parametrize(
    ("group", "seed"),
    [
        ("one ellipsoid", 2),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in (("one box", 5), ("tilted", 3))),
    ],
)
def test_exchange_of_planes(group, seed):
    case = drawn_passages.passage(group, seed)
    zones = [zone.matrix for zone in case.zones], [zone.shape == CUBE for zone in case.zones]
    n, places = case.orbit.mean_motion, case.obstacles.position
    task = exchange.Exchange(case.initial, case.final, case.duration, n, places, *zones)
    times = np.linspace(0, 1, 1001)
    unit, free = task.unit, np.zeros(task.free.shape[-1])
    # a hundred linear pieces of thrust follow the optimum's to some 1e-7 of the way
    np.testing.assert_allclose(
        (task.states(free, times) * unit)[:, :3], case.path.position(case.duration * times), atol=1e-4
    )
    found = task.solve(seed)[0]
    path = task.states(found.steer, times) * unit
    np.testing.assert_allclose(path[[0, -1], :3], [case.initial[:3], case.final[:3]], atol=1e-6)
    for zone, other in zip(case.zones, places(case.duration * times), strict=True):
        assert zone.norm(path[:, :3] - other).min() >= 1 - 1e-5
    single = cf.avoid(case.path, case.obstacles, case.zones)
    assert found.extra <= 1.001 * single.extra_energy
    if single.proven:
        assert found.extra >= (1 - 1e-5) * single.extra_energy


# ---- first locks


@pytest.fixture(scope="module")
def lost():
    """The search of S04 and pairs of which some lock late."""
    search = cf.Search.modified(cf.Sensor(radians(70)), radians(0.25), radians(25))
    return search, *lost_pairs(1000, seed=9)


def scans(search, positions, velocities, step):
    """Return the first samples of each scan."""
    work = (positions, velocities, search.sensor.cosine, step)
    looks = boresight_scan.boresights(search, step)
    return {
        "table": boresight_scan.scan("table", looks, *work, 2),
        "vector": boresight_scan.scan("vector", looks, *work, 2),
        "turning": boresight_scan.scan("turning", boresight_scan.turns(search), *work, 2),
        "numpy": boresight_scan.scan_numpy(looks, *work, blocks=False),
        "blocks": boresight_scan.scan_numpy(looks, *work, blocks=True),
    }


@pytest.mark.parametrize("step", [60.0])
def test_boresight_scans_find_the_first_sample_in_both_cones(lost, step):
    """Compare with the turns of S04 at all samples of some pairs."""
    search, positions, velocities = lost
    found = scans(*lost, step)
    turning = Turning(turns("modified", radians(70)), radians(0.25))
    times = step * np.arange(int(search.duration / step) + 1)
    boresights = turning.boresight(times)
    for k in range(0, 1000, 20):
        missing, _ = margin(boresights, positions[k] + times[:, None] * velocities[k], radians(70))
        inside = missing <= 0.0
        assert found["table"][k] == (np.argmax(inside) if inside.any() else -1)
    for way, samples in found.items():
        np.testing.assert_array_equal(samples, found["table"], err_msg=way)


def test_boresight_scans_are_late_by_one_step_at_most(lost):
    search, positions, velocities = lost
    exact = cf.lock_times(*lost).time
    looks = boresight_scan.boresights(search, 1.0)
    found = boresight_scan.scan("table", looks, positions, velocities, search.sensor.cosine, 1.0, 1)
    late = found - exact
    assert late.min() >= 0.0
    assert (late[exact == 0.0] == 0.0).all()
    assert (late > 1.0).sum() <= 3  # first locks between two samples: some 50 of a million
    assert late[(exact > 0.0) & (late <= 1.0)].mean() == pytest.approx(0.5, abs=0.04)


def test_boresight_scans_report_pairs_without_a_lock():
    """No tip of 21 deg reaches a pair on the sun line with cones of 30 deg."""
    search = cf.Search.basic(cf.Sensor(radians(30)), radians(0.25), radians(25))
    positions = np.array([[0.0, 0.0, 100.0], [100.0, 0.0, 0.0], [0.0, 0.0, -5.0]])
    found = scans(search, positions, np.zeros((3, 3)), 1.0)
    assert {way: samples.tolist() for way, samples in found.items()} == {way: [-1, 0, -1] for way in found}


def test_distribution_of_lost_spacecraft():
    positions, velocities = lost_pairs(20_000, seed=1)
    assert np.abs(positions).max(axis=0) == pytest.approx(1000.0, rel=0.02)  # of two corners
    assert np.abs(velocities).max(axis=0) == pytest.approx(0.4, rel=0.02)
    # a difference of two uniform numbers of half-width a has the variance 2 a^2 / 3
    assert positions.std(axis=0) == pytest.approx(500.0 * np.sqrt(2 / 3), rel=0.01)
    craft, speeds = lost_craft(1000, 40, seed=1)
    assert np.linalg.norm(craft, axis=-1).max() == pytest.approx(300.0, rel=1e-3)  # 8 times five: twice 150 m
    assert np.linalg.norm(speeds, axis=-1).max() == pytest.approx(0.06, rel=1e-3)
    assert (np.linalg.norm(craft, axis=-1) < 150.0).mean() == pytest.approx(1 / 8, abs=0.01)
