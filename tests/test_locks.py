"""First locks against refined sampling of the papers' sequences of turns."""

from math import inf, pi, radians, sin
from threading import Thread

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from turns import Turning, first_lock, margin, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = Search.modified(Sensor(radians(70)), RATE, LIMIT)
S04_TURNS = Turning(turns("modified", radians(70)), RATE)
COUNTEREXAMPLE = [2.08, 25.2, -305.6], [0.0, 0.0, 0.0831]  # S04 section V


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


def s04_pairs(count, seed):
    """Return pairs of S04 section V: in a cube of 1 km, with components within 20 cm/s."""
    draw = generator(seed).uniform(-1.0, 1.0, (2, count, 2, 3))
    return 500.0 * (draw[0, :, 1] - draw[0, :, 0]), 0.2 * (draw[1, :, 1] - draw[1, :, 0])


def wide(half_angle, offset=0.0, longest=inf):
    """Return a search for any half-angle: S04's where its tips fit below 89 deg, else H03's."""
    sensor = Sensor(radians(half_angle), offset, longest)
    if half_angle > 45.0 and half_angle < 90.0:
        return (
            Search.modified(sensor, RATE, radians(89)),
            Turning(turns("modified", radians(half_angle)), RATE),
        )
    return Search.basic(sensor, RATE, LIMIT), Turning(turns("basic", radians(half_angle), LIMIT), RATE)


def check(search, turning, positions, velocities, step=4.0, slack=1e-9):
    """Check that each lock is one and that none is earlier, by refined sampling.

    `slack` is relative to the distance.
    """
    sensor = search.sensor
    positions, velocities = np.broadcast_arrays(np.atleast_2d(positions), np.atleast_2d(velocities))
    locks = lock_times(search, positions, velocities)
    given = sensor.half_angle, sensor.offset, sensor.range
    locked = np.flatnonzero(locks.leg >= 0)
    when = locks.time[locked]
    where = positions[locked] + when[:, None] * velocities[locked]
    missing, length = margin(turning.boresight(when), where, *given)
    late = 2e-8 * np.linalg.norm(velocities[locked], axis=1)  # accuracy of times
    assert (missing <= slack * (length + sensor.baseline) + late).all()
    np.testing.assert_array_equal(np.isnan(locks.time), locks.leg < 0)
    ends = np.array([leg.end for leg in search.legs])
    starts = np.array([leg.start for leg in search.legs])
    assert (when <= ends[locks.leg[locked]]).all()
    assert (when >= starts[locks.leg[locked]]).all()
    times, boresights = turning.samples(step)
    until = np.where(locks.leg >= 0, locks.time, inf)
    fine = np.linspace(-step, step, 65)
    for some in np.array_split(np.arange(len(until)), max(1, len(until) // 50)):
        r, v = positions[some, None], velocities[some, None]
        missing, length = margin(boresights, r + times[:, None] * v, *given)
        early = times < until[some, None] - 1e-6
        assert (missing > -slack * (length + sensor.baseline))[early].all()
        inner = missing[:, 1:-1]
        low = (inner <= missing[:, :-2]) & (inner <= missing[:, 2:]) & early[:, 1:-1]
        depth = np.maximum(missing[:, :-2], missing[:, 2:]) - inner
        pair, k = np.nonzero(low & (inner < depth))
        near = np.clip(times[k + 1][:, None] + fine, 0.0, times[-1])
        missing, length = margin(turning.boresight(near), r[pair] + near[..., None] * v[pair], *given)
        early = near < until[some][pair][:, None] - 1e-6
        assert (missing > -slack * (length + sensor.baseline))[early].all()
    return locks


def test_s04_distribution_against_sampling():
    locks = check(S04, S04_TURNS, *s04_pairs(800, 1))
    assert (locks.leg >= 0).all()  # theorem 2


def test_times_against_root_finding():
    """Lock times agree with root finding to 1e-6 s."""
    positions, velocities = s04_pairs(40, 2)
    locks = lock_times(S04, positions, velocities)
    truth = [
        first_lock(S04_TURNS, r, v, radians(70), step=4.0) for r, v in zip(positions, velocities, strict=True)
    ]
    np.testing.assert_allclose(locks.time, truth, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("half_angle", [46.0, 89.0, 90.0, 120.0, 170.0, 1.0])
def test_any_half_angle_against_sampling(half_angle):
    search, turning = wide(half_angle)
    if 45.0 < half_angle < 90.0:
        assert (check(search, turning, *s04_pairs(50, 3)).leg >= 0).all()
    else:
        check(search, turning, *s04_pairs(50, 3))


@pytest.mark.parametrize("half_angle", [70.0, 110.0])
@pytest.mark.parametrize(("offset", "longest"), [(7.5, inf), (0.0, 300.0), (7.5, 300.0), (60.0, 150.0)])
def test_offset_and_range_against_sampling(half_angle, offset, longest):
    search, turning = wide(half_angle, offset, longest)
    positions, velocities = s04_pairs(50, 4)
    check(search, turning, positions * 0.5, velocities)
    check(search, turning, positions * 0.05, velocities * 0.05)  # also in the near field


# ---- near-singular, exact and extreme motions


def passing(count, speed, distance, seed):
    """Return pairs that pass at a distance [m] during S04's search, and the times."""
    draw = generator(seed)
    times = draw.uniform(0.0, S04.duration, count)
    velocities = draw.normal(size=(count, 3))
    velocities *= speed / np.linalg.norm(velocities, axis=1)[:, None]
    aside = np.cross(velocities, draw.normal(size=(count, 3)))
    aside *= distance / np.linalg.norm(aside, axis=1)[:, None]
    return aside - velocities * times[:, None], velocities, times


@pytest.mark.parametrize("half_angle", [10.0, 70.0])
@pytest.mark.parametrize(("speed", "distance"), [(0.1, 1e-6), (0.1, 1e-3), (10.0, 1e-3), (1000.0, 1.0)])
def test_close_passes_lock_inside_the_cone(half_angle, speed, distance):
    """Pairs in a close pass, whose direction reverses quickly, lock inside the cone only."""
    search, turning = wide(half_angle)
    positions, velocities, passes = passing(5_000, speed, distance, 5)
    locks = lock_times(search, positions, velocities)
    locked = locks.leg >= 0
    when, speeds = locks.time[locked], np.linalg.norm(velocities[locked], axis=1)
    where = positions[locked] + when[:, None] * velocities[locked]
    missing, length = margin(turning.boresight(when), where, search.sensor.half_angle)
    # 2e-8 s of motion, and the rounding of r + v t
    rounding = 4e-15 * np.linalg.norm(positions[locked], axis=1)
    assert (missing <= 1e-9 * length + 2e-8 * speeds + rounding).all()
    check(search, turning, positions[:40], velocities[:40], slack=1e-6)
    assert (abs(when - passes[locked]) < 1.0).any()


FALSE_LOCKS = [
    (
        [52.01249036262842, -2.7227675723674767, -192.6563402186273],
        [-0.026061953733657113, 0.0013643003201235305, 0.09653451844921189],
    ),
    (
        [6801.189476357445, -3443.894822365207, -25340.551127015828],
        [-2.570130779478685, 1.3014283483873106, 9.57604887364252],
    ),
]


@pytest.mark.parametrize(("position", "velocity"), FALSE_LOCKS)
def test_pass_within_rounding_is_no_lock(position, velocity):
    """|r + v t|^2 must not be summed from |r|^2, r.v and |v|^2, which lose all digits here."""
    check(S04, S04_TURNS, [position], [velocity], slack=1e-6)


@pytest.mark.parametrize(("speed", "distance"), [(0.1, 1e-6), (100.0, 1e-6), (1000.0, 1e-5)])
def test_reported_locks_of_fast_passes_exist(speed, distance):
    """Very fast passes have a lock within 1e-8 s of the reported time."""
    search, turns = wide(10.0)
    r, v, passed = passing(8_000, speed, distance, 5)
    found = lock_times(search, r, v)
    near = np.flatnonzero((found.leg >= 0) & (abs(found.time - passed) < 1e-3))
    assert len(near) > 200
    boresights = turns.boresight(found.time[near])
    places = r[near] + v[near] * found.time[near][:, None]
    around = np.linspace(-1e-8, 1e-8, 101)  # accuracy of times
    q = places[:, None] + around[:, None] * v[near][:, None]
    across = np.linalg.norm(np.cross(q, boresights[:, None]), axis=-1)
    angles = np.arctan2(across, (q * boresights[:, None]).sum(-1)).min(axis=1)
    assert angles.max() - radians(10.0) < 0.02  # rounding of r + v t at the highest speed


def test_lock_time_of_spacecraft_at_rest():
    """In the plane the time is (azimuth - half-angle) / rate at any distance."""
    azimuth = generator(6).uniform(radians(70), 2 * pi - radians(70), 1000)
    rays = np.column_stack([np.cos(azimuth), -np.sin(azimuth), np.zeros(1000)])  # about -z
    distance = 10.0 ** generator(7).uniform(-3, 7, 1000)[:, None]
    found = lock_times(S04, distance * rays, np.zeros(3))
    np.testing.assert_allclose(found.time, (azimuth - radians(70)) / RATE, rtol=0.0, atol=2e-8)


def test_boresight_is_accurate_to_rounding():
    """A very slow turn shows the margin of 1e-12, against times in 50 digits."""
    rate = 1e-6
    search = Search.basic(Sensor(radians(30)), rate, LIMIT)
    azimuth = generator(8).uniform(0.6, 2 * pi - 0.6, 300)
    rays = np.column_stack([np.cos(azimuth), -np.sin(azimuth), np.zeros(300)])
    found = lock_times(search, rays, np.zeros(3)).time
    with mp.workdps(50):
        truth = [
            (mp.atan2(-mp.mpf(y), mp.mpf(x)) % (2 * mp.pi) - mp.mpf(radians(30))) / mp.mpf(rate)
            for x, y, _ in rays
        ]
        early = np.array(
            [float((exact - mp.mpf(t)) * mp.mpf(rate)) for t, exact in zip(found, truth, strict=True)]
        )
    # rad: the margin of 1e-12 changes by sin(half-angle) per rad; the rest is rounding of the time
    assert max(early) < 1e-12 / sin(radians(30)) + 3e-15
    assert min(early) > -3e-15


@pytest.mark.parametrize("half_angle", [50.0, 70.0, 89.0, 100.0])
def test_on_the_sun_line_and_along_it(half_angle):
    search, turning = wide(half_angle)
    positions, velocities = [], []
    for height in (1e-3, 1.0, 300.0, 1e7):
        for side in (1.0, -1.0):
            for speed in (0.0, 1e-4, 0.1, 1e3):
                positions.append([0.0, 0.0, side * height])
                velocities.append([0.0, 0.0, side * speed])  # away along it
                positions.append([height, 0.0, 0.0])
                velocities.append([0.0, speed, 0.0])
                positions.append([0.0, height, side * height])
                velocities.append([speed, 0.0, 0.0])
    check(search, turning, positions, velocities)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e7])
@pytest.mark.parametrize("speed", [0.0, 1e-9, 1e-3, 1e3])
def test_all_sizes_and_speeds(scale, speed):
    draw = generator(9)
    check(S04, S04_TURNS, scale * draw.normal(size=(40, 3)), speed * draw.normal(size=(40, 3)))
    search, turning = wide(70.0, 7.5, 1000.0)
    check(search, turning, scale * draw.normal(size=(40, 3)), speed * draw.normal(size=(40, 3)))


def test_locks_scale_with_length():
    positions, velocities = s04_pairs(5000, 10)
    for offset, longest in ((0.0, inf), (7.5, 400.0)):
        base = lock_times(wide(60.0, offset, longest)[0], positions, velocities)
        for scale in (2.0**-20, 2.0**20):
            search = wide(60.0, offset * scale, longest * scale)[0]
            scaled = lock_times(search, positions * scale, velocities * scale)
            np.testing.assert_array_equal(scaled.leg, base.leg)
            np.testing.assert_allclose(scaled.time, base.time, rtol=0.0, atol=1e-9)


def test_second_round_repeats_the_first():
    """H03's rounds start alike: locks of the second are locks of the first for the propagated pair."""
    search = Search.basic(Sensor(radians(12)), RATE, LIMIT)
    positions, velocities = s04_pairs(4_000, 11)
    half = len(search.legs) // 2
    locks = lock_times(search, positions, velocities)
    later = locks.leg >= half
    shift = search.legs[half].start
    again = lock_times(search, positions[later] + shift * velocities[later], velocities[later])
    assert later.sum() > 100
    np.testing.assert_allclose(again.time + shift, locks.time[later], rtol=0.0, atol=1e-7)
    np.testing.assert_array_equal(again.leg + half, locks.leg[later])


def test_locks_are_mutual():
    """A is in B's cone, by B's own turns, when B is in A's."""
    other = Turning(turns("modified", radians(70)), RATE, "B")
    positions, velocities = s04_pairs(2000, 12)
    when = lock_times(S04, positions, velocities).time[:, None]
    missing, length = margin(other.boresight(when[:, 0]), -(positions + when * velocities), radians(70))
    assert (missing <= 1e-9 * length).all()
    sides = np.abs(missing[when[:, 0] > 0.0] / length[when[:, 0] > 0.0])
    assert sides.max() < 1e-9  # on the cone's surface


# ---- locks of milliseconds


def grazing(search, turning, count, share, seed):
    """Return positions, velocities and instants of pairs with a stationary margin of -share |q|."""
    draw = generator(seed)
    sensor = search.sensor
    times = draw.uniform(0.0, search.duration, count)
    step = 1e-3
    b = turning.boresight(times)
    turn = (turning.boresight(times + step) - turning.boresight(times - step)) / (2 * step)
    aside = np.cross(b, draw.normal(size=(count, 3)))
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    c = np.cos(sensor.half_angle) + share  # deeper inside by a share of |q|
    ray = c * b + np.sqrt(1.0 - c * c) * aside
    q = ray * 10.0 ** draw.uniform(0.0, 3.0, count)[:, None]
    where = q + sensor.baseline * b
    n = np.cos(sensor.half_angle) * ray - b  # d(margin)/dt = n.(v - 2 offset b') - b'.q
    velocities = draw.normal(size=(count, 3)) * 10.0 ** draw.uniform(-3.0, 0.5, count)[:, None]
    want = (turn * q).sum(1) - (n * (velocities - sensor.baseline * turn)).sum(1)
    velocities += n * (want / (n * n).sum(1))[:, None]
    return where - times[:, None] * velocities, velocities, times


@pytest.mark.parametrize(("half_angle", "offset"), [(15.0, 7.5), (70.0, 0.0), (110.0, 7.5)])
def test_grazing_locks_are_found(half_angle, offset):
    """Locks of milliseconds are not missed."""
    search, turning = wide(half_angle, offset)
    for share in (1e-10, 1e-7, 1e-4):
        positions, velocities, instants = grazing(search, turning, 4_000, share, 13)
        where = positions + instants[:, None] * velocities
        there, length = margin(turning.boresight(instants), where, search.sensor.half_angle, offset)
        sure = there < -0.5 * share * length  # rounding moves a few out
        assert sure.mean() > 0.99
        found = lock_times(search, positions, velocities)
        assert (found.time[sure] <= instants[sure] + 1e-9).all()
        graze = sure & (found.time > instants - 1.0) & (found.time > 0.0)
        assert graze.sum() > 1
    positions, velocities, instants = grazing(search, turning, 30, 1e-10, 14)
    check(search, turning, positions, velocities)


def test_duration_of_a_grazing_lock():
    """Spacecraft at rest just below the half-angle are seen for a short time, known in 50 digits."""
    for below in (1e-4, 1e-7, 1e-10):
        elevation, azimuth = radians(70) - below, 2.0
        ray = [
            np.cos(elevation) * np.cos(azimuth),
            -np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
        with mp.workdps(50):
            x, y, z = map(mp.mpf, ray)
            left = mp.acos(mp.cos(mp.mpf(radians(70))) * mp.sqrt(x * x + y * y + z * z) / mp.hypot(x, y))
            truth = float((mp.atan2(-y, x) - left) / mp.mpf(RATE))
            lasts = float(2 * left / mp.mpf(RATE))
        found = lock_times(S04, ray, np.zeros(3))
        assert found.time[0] == pytest.approx(
            truth, abs=1e-6 + 1e-12 / (np.cos(elevation) * RATE**2 * lasts / 2)
        )
        assert found.leg[0] == 0
    assert lasts < 0.02  # s
    missed = lock_times(S04, [np.cos(radians(70) + 1e-10), 0, np.sin(radians(70) + 1e-10)], np.zeros(3))
    assert missed.leg[0] > 0


@pytest.mark.parametrize("offset", [0.0, 7.5])
def test_range_that_is_reached_briefly(offset):
    """Sensors that are within their range for milliseconds lock."""
    longest = 200.0
    search, turning = wide(70.0, offset, longest)
    draw = generator(15)
    times = draw.uniform(0.0, search.duration, 4_000)
    b = turning.boresight(times)
    turn = (turning.boresight(times + 1e-3) - turning.boresight(times - 1e-3)) / 2e-3
    aside = np.cross(b, draw.normal(size=b.shape))
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    angle = draw.uniform(0.0, radians(69), len(b))[:, None]
    ray = np.cos(angle) * b + np.sin(angle) * aside
    q = ray * longest * (1.0 - 1e-10)
    rate = np.cross(ray, draw.normal(size=b.shape)) * 0.1  # across the line of sight
    velocities = rate + search.sensor.baseline * turn
    positions = q + search.sensor.baseline * b - times[:, None] * velocities
    found = lock_times(search, positions, velocities)
    where = positions + times[:, None] * velocities
    sure = margin(turning.boresight(times), where, radians(70), offset, longest)[0] < -longest * 0.5e-10
    assert sure.mean() > 0.99
    assert (found.time[sure] <= times[sure] + 1e-9).all()
    assert (found.time[sure] > times[sure] - 1.0).sum() > 100
    check(search, turning, positions[:30], velocities[:30])


def test_no_lock_after_leaving_the_range():
    """A spacecraft that left the range micrometres before the cone arrives does not lock."""
    search, turning = wide(70.0, 0.0, 200.0)
    instants = generator(16).uniform(100.0, 850.0, 2000)
    turned = RATE * instants + radians(70)  # azimuth of the cone's edge, below 290 deg
    rays = np.column_stack([np.cos(turned), -np.sin(turned), np.zeros(2000)])
    for speed in (0.1, 10.0):
        for early in (1e-3, 1e-4, 1e-5, 1e-6):  # s, before the cone's edge comes
            positions = rays * (200.0 - speed * (instants[:, None] - early))
            velocities = rays * speed
            keep = speed * instants < 199.0  # not from the other side
            found = lock_times(search, positions[keep], velocities[keep])
            locked = found.leg >= 0
            where = positions[keep] + found.time[:, None] * velocities[keep]
            missing, _ = margin(turning.boresight(found.time[locked]), where[locked], radians(70), 0.0, 200.0)
            assert (missing <= 2e-8 * speed + 1e-9).all()


def test_locks_at_the_end_of_a_leg():
    """Spacecraft at rest that the cone's edge reaches at the end of a tip lock."""
    ends = [leg.end for leg in S04.legs if leg.about == "body y"]
    for end in ends:
        b = S04_TURNS.boresight(end)
        before = S04_TURNS.boresight(end - 1e-3)
        ahead = b - before * (b @ before)
        ahead /= np.linalg.norm(ahead)
        for inside in (1e-9, 0.0):
            angle = radians(70) - inside
            ray = np.cos(angle) * b + np.sin(angle) * ahead
            found = lock_times(S04, 100.0 * ray, np.zeros(3))
            assert found.time[0] <= end
            check(S04, S04_TURNS, [100.0 * ray], [np.zeros(3)], slack=1e-10)


# ---- properties and run time

numbers = st.floats(-1e3, 1e3, allow_subnormal=False)
vectors = st.lists(numbers, min_size=3, max_size=3).map(np.array)


@settings(deadline=None, max_examples=25)
@given(
    vectors.filter(lambda r: np.linalg.norm(r) > 1e-6),
    vectors,
    st.floats(5.0, 175.0),
    st.sampled_from([(0.0, inf), (7.5, inf), (7.5, 100.0)]),
)
def test_any_motion(position, velocity, half_angle, variant):
    search, turning = wide(half_angle, *variant)
    check(search, turning, [position], [velocity / 1e3], step=10.0, slack=1e-7)


def extreme_pairs(count):
    draw = generator(17)
    sensors = [(1e-3, 0, inf), (10, 7.5, inf), (50, 0, 50.0), (70, 0, inf), (70, 7.5, 100.0), (90, 0, inf)]
    for half_angle, offset, longest in [*sensors, (110, 7.5, inf), (179.9, 0, inf)]:
        search = Search.basic(Sensor(radians(half_angle), offset, longest), RATE, LIMIT)
        for speed, miss in [(0.1, 0.0), (0.1, 1e-6), (1e3, 1e-6), (1e3, 2 * offset)]:
            velocities = speed * draw.normal(size=(count, 3))
            aside = np.cross(velocities, draw.normal(size=(count, 3)))
            aside *= miss / np.linalg.norm(aside, axis=1)[:, None]
            times = draw.uniform(0.0, search.duration, (count, 1))
            lock_times(search, aside - velocities * times, velocities)


def test_extreme_pairs_do_not_stall():
    """Head-on, extremely close and fast pairs do not stall the search."""
    work = Thread(target=extreme_pairs, args=(1_000,), daemon=True)
    work.start()
    work.join(timeout=60)
    assert not work.is_alive()


# ---- bad input


@pytest.mark.parametrize(
    ("position", "velocity", "message"),
    [
        (np.ones((2, 3)), np.ones((3, 3)), "shapes do not broadcast"),
        ([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]], [1.0, 0.0, 0.0], "relative_position: the two craft of pair 1"),
    ],
)
def test_invalid_input(position, velocity, message):
    with pytest.raises(ValueError, match=message):
        lock_times(S04, position, velocity)


def test_empty_single_and_broadcast_input():
    assert len(lock_times(S04, np.empty((0, 3)), np.zeros(3))) == 0
    one = lock_times(S04, *COUNTEREXAMPLE)
    many = lock_times(S04, np.tile(COUNTEREXAMPLE[0], (20_000, 1)), COUNTEREXAMPLE[1])  # over all cores
    assert (many.time == one.time[0]).all()
    assert (many.leg == one.leg[0]).all()
    assert len(many) == 20_000
