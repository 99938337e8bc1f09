"""Conflicts and closest approaches against refined dense sampling, and analytic cases."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import closeform as cf
from closeform.motion.arc import WIDTH
from closeform.zones.shapes import CUBE
from pairs import draw, graze
from truth import faults

N = 1.1e-3
ORBIT, DEEP = cf.Orbit(N), cf.Orbit(0.0)
PERIOD = 2 * np.pi / N
ZERO = np.zeros(6)
REST = ORBIT.coast(ZERO, PERIOD)
COURSES = [
    ("coast", "coast"),
    ("coast", "coast"),
    ("transfer", "coast"),
    ("transfer", "transfer"),
    ("burn", "transfer"),
    ("two impulses", "coast"),
    ("legs", "kicks"),
    ("sampled", "coast"),
    ("sampled", "sampled"),
    ("sampled", "legs"),
]


def conflict_rows(path, other, zone):
    return [(c.start, c.end, c.time, c.ratio) for c in cf.find_conflicts(path, other, zone)]


def check(batch):
    """Compare conflicts and closest approaches of a batch with refined sampling."""
    extrema = batch.relative.extrema()
    count = len(batch.zones)
    found = [conflict_rows(batch.path[k], batch.other[k], batch.zones[k]) for k in range(count)]
    for pair, words in enumerate(faults(batch.relative, extrema, found)):
        assert not words, (batch.label, pair)
    _, sampled, (who, _, norms, _) = extrema
    for k, zone in enumerate(batch.zones):
        nearest = cf.closest_approach(batch.path[k], batch.other[k], zone)
        least = min(sampled[k].min(), norms[who == k].min(initial=np.inf))
        assert abs(nearest.ratio - least) <= 1e-9 * abs(least) + 1e-12 + batch.relative.rounding[k], (
            batch.label
        )
        gap = batch.path[k].position(nearest.time) - batch.other[k].position(nearest.time)
        assert nearest.distance == pytest.approx(np.linalg.norm(gap), rel=1e-9, abs=1e-12)
        assert zone.norm(gap) == pytest.approx(nearest.ratio, rel=1e-9, abs=1e-12)
    return sum(map(len, found))


@pytest.mark.parametrize(("kinds", "deep"), [(kinds, k % 2 == 1) for k, kinds in enumerate(COURSES)])
def test_dense_sampling_finds_the_same_conflicts(kinds, deep):
    rng = np.random.Generator(np.random.Philox([COURSES.index(kinds), deep]))
    total = 0
    for _ in range(1):
        batch = draw(rng, 6, kinds, deep)
        total += check(batch) + check(graze(rng, batch))
    assert total > 0


@pytest.mark.parametrize("reach", [1e-2, 1e-6, 1e-10])
def test_grazing_and_missing_are_distinguished(reach):
    rng = np.random.Generator(np.random.Philox(7))
    check(graze(rng, draw(rng, 8, None, False), reach))


# --- analytic cases ----------------------------------------------------------------------------


def test_straight_line_through_a_sphere():
    """Entry and exit are sqrt(R^2 - b^2)/v before and after the closest approach."""
    path = DEEP.coast([-100, 3, 0, 2, 0, 0], 100.0)
    (conflict,) = cf.find_conflicts(path, DEEP.coast(ZERO, 100.0), cf.Sphere(5.0))
    assert conflict.start == pytest.approx(48.0, abs=1e-11)  # 1e-12 of the norm
    assert conflict.end == pytest.approx(52.0, abs=1e-11)
    assert conflict.time == pytest.approx(50.0, abs=1e-5)  # flat there: 1e-11 of the ratio
    assert conflict.ratio == pytest.approx(0.6, rel=1e-9)


@settings(deadline=None, max_examples=20)
@given(
    st.lists(st.floats(-100, 100), min_size=3, max_size=3).map(np.array),
    st.lists(st.floats(-10, 10).map(lambda v: round(v, 6)), min_size=3, max_size=3).map(np.array),
    st.sampled_from([cf.Box([3.0, 5.0, 8.0]), cf.Sphere(5.0)]),
)
def test_straight_lines_through_boxes_and_spheres(place, velocity, zone):
    if zone.shape == CUBE:
        widths = np.array([3.0, 5.0, 8.0])
        with np.errstate(divide="ignore", invalid="ignore"):
            gates = np.sort([(-widths - place) / velocity, (widths - place) / velocity], axis=0)
        still = velocity == 0
        gates[:, still] = np.where(np.abs(place[still]) <= widths[still], [[-np.inf], [np.inf]], np.nan)
        begin, end = (np.nan, np.nan) if np.isnan(gates).any() else (gates[0].max(), gates[1].min())
        assume(np.isnan(begin) or abs(end - begin) > 1e-6)
        met = begin < end
    else:
        a, b, c = velocity @ velocity, place @ velocity, place @ place - 25.0
        assume(a > 1e-12 and abs(b * b - a * c) > 1e-6 * (b * b + abs(a * c)))
        met = b * b > a * c
        root = np.sqrt(max(b * b - a * c, 0.0))
        begin, end = (-b - root) / a, (-b + root) / a
    for edge in (begin, end):  # not on the edges of the common time
        assume(np.isnan(edge) or min(abs(edge), abs(edge - 100)) > 1e-6)
    found = cf.find_conflicts(DEEP.coast([*place, *velocity], 100.0), DEEP.coast(ZERO, 100.0), zone)
    if not met or end < 0 or begin > 100:
        assert found == ()
    else:
        (conflict,) = found
        # promised where the norm changes by more than 1e-6 per second
        assert conflict.start == pytest.approx(max(begin, 0.0), abs=1e-6)
        assert conflict.end == pytest.approx(min(end, 100.0), abs=1e-6)


@pytest.mark.parametrize("start", [0.0, 1e6])
def test_conflict_of_a_millisecond_is_found(start):
    """A pass at 10 km/s through the rim of a sphere lasts 1 ms."""
    speed, radius, moment = 10e3, 50.0, 7.3 * PERIOD
    depth = radius - np.sqrt(radius**2 - (speed * 0.5e-3) ** 2)
    deputy = cf.Orbit(N).coast([0, 0, radius - depth, speed, 0, 0], 5.0, start=start + moment)
    chief = ORBIT.coast(ZERO, 10 * PERIOD, start=start)
    before = ORBIT.transition(-2.0) @ deputy.state(start + moment)
    whole = ORBIT.coast(before, 4.0, start=start + moment - 2.0)
    (conflict,) = cf.find_conflicts(whole, chief, cf.Sphere(radius))
    assert conflict.end - conflict.start == pytest.approx(1e-3, rel=1e-3)
    assert conflict.time == pytest.approx(start + moment, abs=1e-7)


SHAPES = {
    "box": cf.Box([5.0, 10.0, 20.0]),
    "ellipsoid": cf.Ellipsoid([5.0, 10.0, 20.0]),
    "tilted": cf.Ellipsoid([10.0, 10.0, 10.0], axes=[[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]),
    "sphere": cf.Sphere(10.0),
    "side of a cylinder": cf.Cylinder(10.0, 30.0, axis=[1, 0, 0]),
    "end of a cylinder": cf.Cylinder(30.0, 10.0, axis=[0, 1, 0]),
    "half-spaces": cf.HalfSpaces([*np.eye(3), *-np.eye(3)], [5.0, 10.0, 20.0] * 2),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("offset", [1e-8, 1e-10, 3e-12])
def test_leader_and_follower_at_constant_offset(shape, offset):
    """A constant ratio gives no conflict outside and one inside."""
    for orbit in (ORBIT, DEEP):
        chief = orbit.coast(ZERO, 100 * PERIOD)
        for side, count in ((1, 0), (-1, 1)):
            follower = orbit.coast([0, 10 * (1 + side * offset), 0, 0, 0, 0], 100 * PERIOD)
            found = cf.find_conflicts(follower, chief, SHAPES[shape])
            assert len(found) == count
            if found:
                assert (found[0].start, found[0].end) == (0.0, 100 * PERIOD)
            near = cf.closest_approach(follower, chief, SHAPES[shape])
            assert near.ratio == pytest.approx(1 + side * offset, rel=1e-12)


def circle(duration, start=0.0):
    """Return the general circular orbit with |r| = 200 m."""
    e = 100.0
    return ORBIT.coast([-e, 0, np.sqrt(3) * e, 0, 2 * e * N, 0], duration, start=start)


@pytest.mark.parametrize("turns", [1, 100])
@pytest.mark.parametrize("offset", [1e-6, 1e-9, 3e-12])
def test_general_circular_orbit_against_its_own_sphere(turns, offset):
    path, chief = circle(turns * PERIOD), ORBIT.coast(ZERO, turns * PERIOD)
    assert cf.find_conflicts(path, chief, cf.Sphere(200 * (1 - offset))) == ()
    (conflict,) = cf.find_conflicts(path, chief, cf.Sphere(200 * (1 + offset)))
    assert (conflict.start, conflict.end) == (0.0, turns * PERIOD)


@pytest.mark.parametrize(
    "offset", [1e-12, 7.5e-13, 6e-13, 5.1e-13, 5e-13, 4.9e-13, 3e-13, 2.5e-13, 1e-13, 0, -1e-13]
)
def test_conflict_on_the_surface_is_not_split(offset):
    """Within 1e-12 of the surface there is at most one conflict."""
    for start in (0.0, 1e9):
        path, chief = circle(10 * PERIOD, start), ORBIT.coast(ZERO, 10 * PERIOD, start=start)
        assert len(cf.find_conflicts(path, chief, cf.Sphere(200 / (1 + offset)))) <= 1


def test_coincident_spacecraft_have_one_conflict():
    for path in (circle(PERIOD), ORBIT.transfer(ZERO, [100, 0, 0, 0, 0, 0], 900.0), REST):
        for zone in SHAPES.values():
            (conflict,) = cf.find_conflicts(path, path, zone)
            assert (conflict.start, conflict.end, conflict.ratio) == (path.start, path.end, 0.0)
            assert cf.closest_approach(path, path, zone).distance == 0.0


def test_collision_has_ratio_zero():
    """Spacecraft that collide have a ratio of 0 at the time of the collision."""
    there = ORBIT.coast([0, 0, 0, 0.3, -0.2, 0.1], 2000.0, start=1000.0)
    back = ORBIT.transition(-1000.0) @ there.state(1000.0)
    for zone in SHAPES.values():
        near = cf.closest_approach(ORBIT.coast(back, 2000.0), REST, zone)
        assert near.ratio < 1e-12
        assert near.time == pytest.approx(1000.0, abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_start_on_the_surface(shape):
    zone = SHAPES[shape]
    for rate, count in ((-0.5, 1), (0.5, 1), (0.0, 1)):
        path = DEEP.coast([0, 10.0, 0, 0, rate, 0], 10.0)
        found = cf.find_conflicts(path, DEEP.coast(ZERO, 10.0), zone)
        assert len(found) == count
        assert found[0].start == 0.0
        assert found[0].end == {-0.5: 10.0, 0.0: 10.0}.get(rate, pytest.approx(0.0, abs=1e-10))
        assert zone.norm(path.position(found[0].end)) <= 1 + 1e-12


@pytest.mark.parametrize("n", [1e-300, 1e-160, 1e-100, 1e-50, 1e-20, 1e-10, 1e-7])
def test_deep_space_is_the_limit_of_conflicts(n):
    """Small mean motions neither underflow nor overflow."""
    zone = cf.Sphere(10.0)
    for orbit in (cf.Orbit(n), DEEP):
        path, other = orbit.coast([0, -100, 0, 0, 1, 0], 200.0), orbit.coast(ZERO, 200.0)
        (conflict,) = cf.find_conflicts(path, other, zone)
        assert (conflict.start, conflict.end) == pytest.approx((90.0, 110.0), abs=1e-2)  # n = 1e-7
        assert cf.closest_approach(path, other, zone).time == pytest.approx(100.0, abs=1e-2)


def test_edges_of_the_common_time():
    zone = cf.Sphere(10.0)
    through = DEEP.coast([-50, 0, 0, 1, 0, 0], 100.0)  # inside from 40 to 60 s
    for start, end, expected in (
        (0, 100, (40, 60)),
        (45, 100, (45, 60)),
        (0, 50, (40, 50)),
        (45, 55, (45, 55)),
        (50, 50 + 1e-6, (50, 50 + 1e-6)),
    ):
        other = DEEP.coast(ZERO, end - start, start=start)
        (conflict,) = cf.find_conflicts(through, other, zone)
        assert (conflict.start, conflict.end) == pytest.approx(expected, abs=1e-10)
        assert conflict.start <= conflict.time <= conflict.end
    for start, duration in ((0.0, 39.9), (60.1, 30.0)):
        assert cf.find_conflicts(through, DEEP.coast(ZERO, duration, start=start), zone) == ()


def test_one_instant_in_common():
    zone = cf.Sphere(10.0)
    path, other = DEEP.coast([-5, 0, 0, 1, 0, 0], 10.0), DEEP.coast(ZERO, 10.0, start=10.0)
    (conflict,) = cf.find_conflicts(path, other, zone)
    assert (conflict.start, conflict.end, conflict.time) == (10.0, 10.0, 10.0)
    assert conflict.ratio == pytest.approx(0.5)
    assert cf.closest_approach(path, other, zone).ratio == pytest.approx(0.5)


def test_one_instant_in_common_at_rest():
    """The search ends without motion and without time to halve."""
    path, other = DEEP.coast([5, 0, 0, 0, 0, 0], 10.0), DEEP.coast(ZERO, 10.0, start=10.0)
    assert cf.closest_approach(path, other, cf.Sphere(10.0)).ratio == 0.5
    (conflict,) = cf.find_conflicts(path, other, cf.Sphere(10.0))
    assert (conflict.start, conflict.end, conflict.ratio) == (10.0, 10.0, 0.5)


def test_no_common_time():
    zone = cf.Sphere(10.0)
    path, other = DEEP.coast(ZERO, 10.0), DEEP.coast(ZERO, 10.0, start=10.1)
    assert cf.find_conflicts(path, other, zone) == ()
    near = cf.closest_approach(path, other, zone)
    assert near.ratio == near.distance == np.inf
    assert np.isnan(near.time)


def test_crossings_of_a_hundred_orbits():
    """Cross-track motion enters and leaves the zone twice an orbit, at known times."""
    swing, half = 100.0, 7.0
    path = ORBIT.coast([0, 0, swing, 0, 0, 0], 100 * PERIOD)
    found = cf.find_conflicts(path, ORBIT.coast(ZERO, 100 * PERIOD), cf.Sphere(half))
    assert len(found) == 200
    late = np.arcsin(half / swing)
    middle = np.pi / 2 + np.pi * np.arange(200)
    # phases up to 628 rad: rounding of n t is 1e-13, of t 1e-10 s
    np.testing.assert_allclose([c.start for c in found], (middle - late) / N, rtol=0, atol=1e-8)
    np.testing.assert_allclose([c.end for c in found], (middle + late) / N, rtol=0, atol=1e-8)
    assert max(c.ratio for c in found) < 1e-9


def test_slow_drift():
    """A slow drift enters the zone after 106 orbits."""
    d, ahead = 1.0, 1000.0
    path = ORBIT.coast([2 * d, ahead, 0, 0, -3 * N * d, 0], 200 * PERIOD)
    (conflict,) = cf.find_conflicts(path, ORBIT.coast(ZERO, 200 * PERIOD), cf.Box([5.0, 20.0, 5.0]))
    assert conflict.start == pytest.approx((ahead - 20) / (3 * N * d), abs=1e-6)
    assert conflict.end == pytest.approx((ahead + 20) / (3 * N * d), abs=1e-6)


def test_impulse_on_the_surface():
    out = DEEP.coast([20, 0, 0, -1, 0, 0], 10.0)
    for radius, count in ((10.0 * (1 - 1e-9), 0), (10.0 * (1 + 1e-9), 1)):
        path = cf.join([out, DEEP.coast([10, 0, 0, 1, 0, 0], 10.0, start=10.0)])
        found = cf.find_conflicts(path, DEEP.coast(ZERO, 20.0), cf.Sphere(radius))
        assert len(found) == count
        assert cf.closest_approach(path, DEEP.coast(ZERO, 20.0), cf.Sphere(radius)).time == 10.0


def test_sampled_motion_agrees_with_closed_form():
    """Closed-form and densely sampled motion have the same conflicts."""
    path = ORBIT.coast([60, -150, 20, 0, -0.132, 0.03], PERIOD)
    times = np.linspace(0, PERIOD, 1200)
    nodes = ORBIT.sampled(times, path.state(times))
    zone = cf.Ellipsoid([40.0, 80.0, 40.0])
    direct, through = cf.find_conflicts(path, REST, zone), cf.find_conflicts(nodes, REST, zone)
    assert len(direct) == len(through) > 0
    for a, b in zip(direct, through, strict=True):  # nodes 4.8 s apart: 1e-9 m, a few cm/s
        assert (a.start, a.end) == pytest.approx((b.start, b.end), abs=1e-6)


def test_the_search_ends_a_few_ulps_before_the_end():
    """Found by tools/certify.py: a step below the last bit of the time must not be tried for ever."""
    orbit = cf.Orbit(8.489333621301617e-05)
    duration = 45.726171541353537
    state = [-55.16707588648363, -87.82255784911099, -46.12278022423288]
    state += [-0.23647073012871034, 2.99366989949006, -0.5494185380258668]
    row = np.zeros((1, WIDTH))
    row[0, :3] = 0.0, duration, orbit.mean_motion
    row[0, 6:12] = [-98.7934213621146, -95.23623878378649, -33.50285600905398] + [
        1.6091543057921243,
        -0.4111683934731182,
        0.2201206435901759,
    ]
    row[0, 12:18] = [-0.2891342182042344, 0.5146596061808080, -0.027051111264987094] + [
        0.011615787720621752,
        -0.022236617179038014,
        0.0017779149302004972,
    ]
    other = cf.Path(orbit, row, np.array([0, 1]), ())
    path = orbit.coast(state, duration)
    zone = cf.Box([1 / 0.02684799081709792, 1 / 0.05102226696012412, 1 / 0.01654090632916684])
    near = cf.closest_approach(path, other, zone)
    times = np.linspace(0, duration, 100_001)
    sampled = zone.norm(path.position(times) - other.position(times))
    # a corner of the box, passed at 0.1 zones per second and sampled every 0.5 ms
    assert sampled.min() - 1e-4 < near.ratio <= sampled.min() + 1e-12


# --- properties -------------------------------------------------------------------------------

states = st.lists(st.floats(-1, 1), min_size=6, max_size=6).map(
    lambda s: np.array(s) * np.repeat([100.0, 0.1], 3)
)
MIRROR = np.array([1, -1, 1, -1, 1, -1.0])


def alike(found, others, within):
    assert len(found) == len(others)
    for a, b in zip(found, others, strict=True):
        assert (a.start, a.end, a.ratio) == pytest.approx((b.start, b.end, b.ratio), abs=within)


def clear_cut(path, other, zone):
    """No grazing: the answer is the same for a zone a millionth larger or smaller."""
    counts = {len(cf.find_conflicts(path, other, zone.enlarged(1 + e))) for e in (-1e-6, 0.0, 1e-6)}
    assume(len(counts) == 1)
    return cf.find_conflicts(path, other, zone)


@settings(deadline=None, max_examples=20)
@given(
    states,
    states,
    states,
    st.floats(60.0, 20000.0),
    st.sampled_from([ORBIT, DEEP]),
    st.sampled_from(list(SHAPES)),
)
def test_swapped_spacecraft_and_shifted_time(a, b, c, duration, orbit, shape):
    zone = SHAPES[shape].enlarged(3.0)
    path, other = orbit.transfer(a, c, duration), orbit.coast(b, duration)
    found = clear_cut(path, other, zone)
    alike(found, cf.find_conflicts(other, path, zone), 1e-6)
    later = orbit.transfer(a, c, duration, start=1e5), orbit.coast(b, duration, start=1e5)
    shifted = cf.find_conflicts(*later, zone)
    alike(found, [cf.Conflict(s.start - 1e5, s.end - 1e5, s.time, s.ratio) for s in shifted], 1e-4)


@settings(deadline=None, max_examples=20)
@given(
    states,
    states,
    states,
    st.floats(60.0, 20000.0),
    st.sampled_from([ORBIT, DEEP]),
    st.sampled_from(["box", "ellipsoid", "sphere"]),
)
def test_reversed_frame_has_the_conflicts_in_reverse(a, b, c, duration, orbit, shape):
    """(x, y, z, t) -> (x, -y, z, -t) maps motions to motions, and these zones to themselves."""
    zone = SHAPES[shape].enlarged(3.0)
    path, other = orbit.transfer(a, c, duration), orbit.coast(b, duration)
    found = clear_cut(path, other, zone)
    back = orbit.transfer(c * MIRROR, a * MIRROR, duration)
    back_other = orbit.coast(other.state(duration) * MIRROR, duration)
    mirrored = cf.find_conflicts(back, back_other, zone)
    turned = [cf.Conflict(duration - s.end, duration - s.start, s.time, s.ratio) for s in reversed(mirrored)]
    alike(found, turned, 1e-3)  # crossings as flat as 1e-6/s, on motions equal to 1e-9 m


# --- batches, the last possible conflict ------------------------------------------------------


def test_closest_approach_broadcasts():
    rng = np.random.Generator(np.random.Philox(3))
    some = ORBIT.coast(rng.normal(size=(3, 1, 6)) * np.repeat([100, 0.1], 3), 3000.0)
    more = ORBIT.coast(rng.normal(size=(4, 6)) * np.repeat([100, 0.1], 3), 2000.0, start=500.0)
    near = cf.closest_approach(some, more, cf.Sphere(10.0))
    assert near.time.shape == near.ratio.shape == near.distance.shape == (3, 4)
    for i in range(3):
        for j in range(4):
            one = cf.closest_approach(some[i, 0], more[j], cf.Sphere(10.0))
            assert (one.time, one.ratio) == (near.time[i, j], near.ratio[i, j])
            assert one.distance == near.distance[i, j] == pytest.approx(10 * one.ratio, rel=1e-9)


@settings(deadline=None, max_examples=20)
@given(states, st.floats(-1, 1), st.sampled_from(list(SHAPES)))
def test_no_conflict_after_the_last_possible_time(state, drift, shape):
    """Compare theory (6) with a search over 60 orbits."""
    zone = SHAPES[shape]
    state = state * 0.3
    state[4] = N * (drift - 2 * state[0])  # d = drift, in metres
    path, other = ORBIT.coast(state, 60 * PERIOD), ORBIT.coast(ZERO, 60 * PERIOD)
    last = cf.last_possible_conflict(path, other, zone)
    times = np.linspace(0, 60 * PERIOD, 8001)
    inside = zone.norm(path.position(times)) <= 1
    if inside.any():
        assert times[inside].max() <= last + 1e-9 * abs(last)
    ends = [c.end for c in cf.find_conflicts(path, other, zone)]
    assert max(ends, default=-np.inf) <= last + 1e-9 * abs(last)


def test_last_possible_conflict_of_known_motion():
    d, ahead = 1.0, 1000.0
    path = ORBIT.coast([2 * d, ahead, 0, 0, -3 * N * d, 0], 10.0)
    zone = cf.Box([5.0, 20.0, 5.0])
    assert cf.last_possible_conflict(path, REST, zone) == pytest.approx(1020 / (3 * N * d), rel=1e-12)
    far = ORBIT.coast([20.0, 0, 0, 0, -30 * N, 0], 10.0)
    assert cf.last_possible_conflict(far, REST, zone) == -np.inf
    assert cf.last_possible_conflict(circle(10.0), REST, cf.Sphere(300.0)) == np.inf
    both = cf.last_possible_conflict(
        ORBIT.coast(np.zeros((2, 1, 6)), 10.0), ORBIT.coast(np.zeros((3, 6)), 10.0), zone
    )
    assert both.shape == (2, 3)


def test_last_possible_conflict_of_paths_at_different_times():
    """The bound does not depend on the duration of the given paths."""
    state = [1, -2000, 0, 0, -2e-3, 0]
    later = ORBIT.coast(ZERO, 100.0, start=20000.0)
    short = cf.last_possible_conflict(ORBIT.coast(state, 100.0), later, cf.Sphere(50.0))
    long = cf.last_possible_conflict(ORBIT.coast(state, 30000.0), later, cf.Sphere(50.0))
    assert short == pytest.approx(long, rel=1e-9)


# --- invalid input, and interpreted kernels ---------------------------------------------------

COAST = ORBIT.coast(ZERO, 10.0)
BAD = {
    "batch": (
        lambda: cf.find_conflicts(ORBIT.coast(np.zeros((2, 6)), 1.0), COAST, cf.Sphere(1.0)),
        "path, other",
    ),
    "orbits": (lambda: cf.find_conflicts(DEEP.coast(ZERO, 1.0), COAST, cf.Sphere(1.0)), "other: must be in"),
    "approach orbits": (
        lambda: cf.closest_approach(DEEP.coast(ZERO, 1.0), COAST, cf.Sphere(1.0)),
        "other: must be in",
    ),
    "last deep": (
        lambda: cf.last_possible_conflict(DEEP.coast(ZERO, 1.0), DEEP.coast(ZERO, 1.0), cf.Sphere(1.0)),
        "path: the bound requires an orbit",
    ),
    "last thrust": (
        lambda: cf.last_possible_conflict(ORBIT.burn(ZERO, [1, 0, 0], 1.0), COAST, cf.Sphere(1.0)),
        "path, other: the bound requires coasting",
    ),
}


def test_invalid_input_is_named():
    for case in BAD:
        call, message = BAD[case]
        with pytest.raises(ValueError, match=message):
            call()


@pytest.mark.parametrize(
    ("start", "end"),
    [
        (-56.56828300358712, 218.69680303663452),
        (-35.593119898395194, 482.3283249006789),
        (-76.61218623535792, 82.74469361126117),
    ],
)
def test_no_time_after_the_common_end(start, end):
    """Times relative to the start may round to a double after the end."""
    assert start + (end - start) > end
    incoming = DEEP.sampled([start, end], [[1000.0, 0, 0, -0.4, 0, 0], [50.0, 0, 0, -0.4, 0, 0]])
    rest = DEEP.coast(ZERO, 2.0 * (end - start), start=start)
    approach = cf.closest_approach(incoming, rest, cf.Sphere(10.0))
    assert approach.time == end
    (stay,) = cf.find_conflicts(incoming, rest, cf.Sphere(100.0))
    assert stay.time == stay.end == end
    (row,) = cf.screen([incoming, rest], cf.Sphere(100.0)).conflicts
    assert row.time == row.end == end


SMALL = """
    import sys
    import closeform as cf
    orbit = cf.Orbit(1.1e-3)
    path = orbit.coast([60, 30, 20, 0, -0.132, 0.03], 3000.0)
    other = orbit.transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)
    for zone in (cf.Box([40, 80, 40]), cf.Sphere(80.0)):
        for c in cf.find_conflicts(path, other, zone):
            print(c.start.hex(), c.end.hex(), c.ratio.hex())
    print(other.delta_v.hex(), other.peak_thrust.hex(), other.energy.hex())
"""


def run(**environment):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", textwrap.dedent(SMALL)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout


@pytest.mark.slow
def test_compiled_and_interpreted_kernels_agree():
    """Compiled and interpreted kernels agree to rounding."""
    compiled, plain = run(), run(NUMBA_DISABLE_JIT="1")
    numbers = [[float.fromhex(word) for word in text.split()] for text in (compiled, plain)]
    assert len(numbers[0]) >= 6
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-9)
