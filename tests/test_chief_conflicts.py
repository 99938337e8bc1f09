"""Conflicts beside a chief on an ellipse: beside Hill's search, dense samples, and motion along a surface."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import closeform as cf

ZONES = {
    "sphere": cf.Sphere(40.0),
    "ellipsoid": cf.Ellipsoid([20.0, 45.0, 25.0]),
    "box": cf.Box([30.0, 20.0, 40.0]),
    "cylinder": cf.Cylinder(30.0, 25.0, axis=[0, 1, 0]),
    "faces": cf.HalfSpaces(np.vstack([np.eye(3), -np.eye(3)[:2]]), [30.0, 40.0, 20.0, 30.0, 20.0]),
}


def eccentric(e, anomaly=1.0):
    return cf.Orbit.eccentric(e, perigee_altitude=700e3, true_anomaly=anomaly)


def scattered(orbit, count, size, seed):
    """Return states of spacecraft within some hundred metres, most without along-track drift."""
    random = np.random.default_rng(seed)
    units = np.array([1.0, 1.0, 1.0] + [2.0 * np.pi / orbit.period] * 3)
    change = (orbit.transition(orbit.period) - np.eye(6)) * units / units[:, None]
    drift = np.linalg.svd(change)[2][0]
    states = random.normal(size=(count, 6)) * size
    return (states - 0.99 * np.outer(states @ drift, drift)) * units


def paths_of(orbit, count, seed, thrust):
    states = scattered(orbit, count, 80.0, seed)
    if not thrust:
        return orbit.coast(states, 1.2 * orbit.period, start=321.0)
    return orbit.transfer(states, scattered(orbit, count, 80.0, seed + 1), 0.8 * orbit.period, start=321.0)


@pytest.mark.parametrize("thrust", [False, True])
@pytest.mark.parametrize("zone", ZONES.values(), ids=ZONES)
def test_a_circular_chief_has_the_conflicts_of_hill_equations(zone, thrust):
    orbit, hill = cf.Orbit.eccentric(0.0, semi_major_axis=7e6), cf.Orbit.from_semi_major_axis(7e6)
    paths = paths_of(orbit, 40, 3, thrust)
    times = paths.start[0], paths.end[0]
    known = hill.coast(paths.state(times[0]), times[1] - times[0], times[0])
    if thrust:
        known = hill.transfer(paths.state(times[0]), paths.state(times[1]), times[1] - times[0], times[0])
    found, truth = cf.screen(paths, zone), cf.screen(known, zone)
    assert np.array_equal(found.pairs, truth.pairs)
    assert np.allclose(found.start, truth.start, rtol=0, atol=1e-6)
    assert np.allclose(found.end, truth.end, rtol=0, atol=1e-6)
    assert np.allclose(found.ratio, truth.ratio, rtol=0, atol=1e-9)
    near, nearest = (cf.closest_approach(p[:20], p[20:], zone) for p in (paths, known))
    assert np.allclose(near.ratio, nearest.ratio, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("thrust", [False, True])
@pytest.mark.parametrize("e", [0.01, 0.3, 0.8])
@pytest.mark.parametrize("zone", ZONES.values(), ids=ZONES)
def test_no_conflict_is_missed_or_invented(zone, e, thrust):
    """Every sample is inside in a conflict and outside between them; pairs without one are outside."""
    orbit = eccentric(e)
    paths = paths_of(orbit, 24, 11, thrust)
    found = cf.screen(paths, zone)
    assert len(found) > 3
    times = np.linspace(paths.start[0], paths.end[0], 3001)
    places = paths.position(times)
    for i in range(len(paths)):
        for j in range(len(paths)) if not zone.symmetric else range(i + 1, len(paths)):
            if i == j:
                continue
            norms = zone.norm(places[i] - places[j])
            mine = np.flatnonzero((found.pairs == (i, j)).all(axis=1))
            inside = np.zeros(len(times), dtype=bool)
            for k in mine:
                inside |= (times > found.start[k] + 1e-6) & (times < found.end[k] - 1e-6)
                around = (times >= found.start[k] - 1e-6) & (times <= found.end[k] + 1e-6)
                norms[around & ~inside] = 1.0
            assert (norms[inside] <= 1.0 + 1e-9).all()
            assert (norms[~inside] >= 1.0 - 1e-9).all()


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_ends_lie_on_the_surface_and_ratios_are_minima(e):
    orbit = eccentric(e)
    paths = paths_of(orbit, 60, 5, True)
    found, start, end = cf.screen(paths, ZONES["ellipsoid"]), paths.start[0], paths.end[0]
    assert len(found) > 20

    def norm(k, time):
        one, other = found.pairs[k]
        return ZONES["ellipsoid"].norm(paths[int(one)].position(time) - paths[int(other)].position(time))

    for k in range(len(found)):
        for time in (found.start[k], found.end[k]):
            if start < time < end:
                assert norm(k, time) == pytest.approx(1.0, abs=1e-9)
        assert norm(k, found.time[k]) == pytest.approx(found.ratio[k], rel=1e-9)
        inside = np.linspace(found.start[k], found.end[k], 50)
        assert norm(k, inside).min() >= found.ratio[k] * (1.0 - 1e-9)


def test_screening_finds_what_single_searches_find():
    orbit = eccentric(0.5)
    paths = paths_of(orbit, 30, 8, False)
    found = cf.screen(paths, ZONES["box"])
    rows = iter(zip(found.start, found.end, found.time, found.ratio, strict=True))
    for i in range(30):
        for j in range(i + 1, 30):
            for one in cf.find_conflicts(paths[i], paths[j], ZONES["box"]):
                start, end, _, ratio = next(rows)
                assert one.start == pytest.approx(start, abs=1e-9)
                assert one.end == pytest.approx(end, abs=1e-9)
                assert one.ratio == pytest.approx(ratio, abs=1e-12)
    assert next(rows, None) is None


def test_paths_with_other_times_and_joints_are_compared_over_their_common_time():
    orbit = eccentric(0.4)
    still = orbit.coast(np.zeros(6), 2.0 * orbit.period, start=-500.0)
    visits = cf.join(
        [
            orbit.transfer([0, 300, 0, 0, 0, 0], [0, -300, 0, 0, 0, 0], 300.0, start=100.0),
            orbit.two_impulse([0, -300, 0, 0, 0, 0], [0, 300, 5, 0, 0, 0], 300.0, start=400.0),
            orbit.transfer([0, 300, 5, 0, 0, 0], [0, 20, 0, 0, 0, 0], 200.0, start=700.0),
        ]
    )
    first, second, third = cf.find_conflicts(visits, still, cf.Sphere(50.0))
    assert 100.0 < first.start < first.end < 400.0 < second.start < second.end < 700.0 < third.start
    assert third.end == visits.end
    least = min(first.ratio, second.ratio, third.ratio)
    assert cf.closest_approach(visits, still, cf.Sphere(50.0)).ratio == pytest.approx(least, rel=1e-12)
    both = cf.screen([still, visits], cf.Sphere(50.0))
    assert np.allclose(both.start, [first.start, second.start, third.start], atol=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9])
def test_joined_paths_of_all_kinds_are_searched_between_their_joints(e):
    """Coasts, transfers, impulses and burns at random times, and from and to the joints of the table."""
    orbit, random = cf.Orbit.eccentric(e, perigee_altitude=500e3), np.random.default_rng(5)
    units = np.array([100.0] * 3 + [200.0 * np.pi / orbit.period] * 3)
    angles = orbit.chief.table.joints
    joints = (angles - e * np.sin(angles)) / orbit.chief.mean_motion
    paths = []
    for k in range(16):
        time = float(random.choice(joints)) if k % 3 == 0 else random.uniform(-0.3, 0.5) * orbit.period
        state, parts = random.normal(size=6) * units, []
        for m in range(random.integers(1, 5)):
            length = random.uniform(0.02, 0.5) * orbit.period
            after = joints[joints > time + 0.001 * orbit.period]
            if k % 4 == 1 and m == 0 and len(after):
                length = float(after[0] - time)
            kind = ("coast", "transfer", "impulsive", "burn")[random.integers(4)]
            more = {"coast": [], "burn": [random.normal(size=3) * 1e-5]}.get(
                kind, [random.normal(size=6) * units]
            )
            parts.append(getattr(orbit, kind)(state, *more, length, time))
            state, time = parts[-1].state(parts[-1].end), float(parts[-1].end)
        paths.append(cf.join(parts))
    found = cf.screen(paths, ZONES["cylinder"])
    rows = iter(zip(found.start, found.end, strict=True))
    for i in range(16):
        for j in range(i + 1, 16):
            single = cf.find_conflicts(paths[i], paths[j], ZONES["cylinder"])
            for one in single:
                assert np.allclose((one.start, one.end), next(rows), rtol=0, atol=1e-7)
            begin, end = max(paths[i].start, paths[j].start), min(paths[i].end, paths[j].end)
            if begin < end:
                times = np.linspace(begin, end, 300)
                norms = ZONES["cylinder"].norm(paths[i].position(times) - paths[j].position(times))
                for one in single:
                    norms[(times > one.start - 1e-5) & (times < one.end + 1e-5)] = 1.0
                assert norms.min() >= 1.0 - 1e-9
    assert next(rows, None) is None


def test_no_common_time_is_no_conflict():
    orbit = eccentric(0.4)
    one, other = orbit.coast(np.zeros(6), 100.0), orbit.coast(np.zeros(6), 100.0, start=100.5)
    assert cf.find_conflicts(one, other, cf.Sphere(1.0)) == ()
    assert cf.closest_approach(one, other, cf.Sphere(1.0)).ratio == np.inf


def test_one_common_instant_is_searched():
    orbit = eccentric(0.4)
    for begin in (0.0, 777.0, orbit.period - 1.0):
        one = orbit.coast(np.zeros(6), 100.0, begin)
        other = orbit.coast([0, 0.5, 0, 0, 0, 0], 100.0, begin + 100.0)
        (met,) = cf.find_conflicts(one, other, cf.Sphere(1.0))
        assert met.start == met.end == met.time == begin + 100.0
        assert met.ratio == pytest.approx(0.5)


@pytest.mark.parametrize("e", [0.0, 0.2, 0.7])
def test_a_grazing_pass_is_found_to_rounding(e):
    """A zone as large as the closest approach: one conflict a little larger, none a little smaller."""
    orbit = eccentric(e)
    for seed in range(12):
        pair = scattered(orbit, 2, 100.0, seed)
        one, other = orbit.coast(pair, orbit.period, start=50.0)

        def distance(time, one=one, other=other):
            return np.linalg.norm(one.position(time) - other.position(time))

        times = np.linspace(50.0, 50.0 + orbit.period, 2000)
        k = np.linalg.norm(one.position(times) - other.position(times), axis=1).argmin()
        if not 0 < k < 1999:
            continue
        low = minimize_scalar(
            distance, bounds=(times[k - 1], times[k + 1]), method="bounded", options={"xatol": 1e-9}
        )
        assert cf.find_conflicts(one, other, cf.Sphere(low.fun * (1.0 - 1e-8))) == ()
        (touch,) = cf.find_conflicts(one, other, cf.Sphere(low.fun * (1.0 + 1e-8)))
        assert touch.time == pytest.approx(low.x, abs=0.1)
        assert len(cf.find_conflicts(one, other, cf.Sphere(low.fun))) <= 1


@pytest.mark.parametrize(
    "zone", [cf.Sphere(50.0), cf.Box([50.0, 50.0, 50.0]), cf.Cylinder(50.0, 60.0, axis=[1, 0, 0])]
)
def test_motion_along_the_surface_ends_in_bounded_work(zone):
    """In a circular orbit a spacecraft that holds 50 m behind another is on the surface all along."""
    orbit = cf.Orbit.eccentric(0.0, semi_major_axis=7e6)
    one, other = (
        orbit.coast(np.zeros(6), 30 * orbit.period),
        orbit.coast([0, -50, 0, 0, 0, 0], 30 * orbit.period),
    )
    (touch,) = cf.find_conflicts(one, other, zone)
    assert (touch.start, touch.end) == (0.0, one.end)
    assert touch.ratio == pytest.approx(1.0, abs=1e-10)
    away = orbit.coast([0, -50.000001, 0, 0, 0, 0], 30 * orbit.period)
    assert cf.find_conflicts(one, away, zone) == ()


def test_other_orbits_are_refused():
    zone = cf.Sphere(1.0)
    one, other = eccentric(0.3).coast(np.zeros(6), 10.0), eccentric(0.3, 1.1).coast(np.zeros(6), 10.0)
    with pytest.raises(ValueError, match="other: must be in the orbit of path"):
        cf.find_conflicts(one, other, zone)
    with pytest.raises(ValueError, match="other: must be in the orbit of path"):
        cf.find_conflicts(cf.Orbit.circular(500e3).coast(np.zeros(6), 10.0), other, zone)
