"""Lock margins: missed angles against sampled turns; states within the margins lock alike."""

from math import degrees, isnan, radians

import numpy as np
import pytest

from closeform.search.lock_times import lock_times
from closeform.search.proofs.lock_margins import lock_margins
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from turns import Turning, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = Search.modified(Sensor(radians(70)), RATE, LIMIT)
COUNTEREXAMPLE = np.array([2.08, 25.2, -305.6]), np.array([0.0, 0.0, 0.0831])  # S04 section V
SEARCHES = [
    (S04, "modified", None),
    (Search.modified(Sensor(radians(50)), RATE, radians(89)), "modified", None),
    (Search.basic(Sensor(radians(70), 7.5), RATE, LIMIT), "basic", LIMIT),
    (Search.basic(Sensor(radians(12), 7.5), RATE, LIMIT), "basic", LIMIT),
    (Search.basic(Sensor(radians(0.5)), RATE, LIMIT), "basic", LIMIT),
    (Search.basic(Sensor(radians(110), 7.5), RATE, LIMIT), "basic", LIMIT),
    (Search.basic(Sensor(radians(100)), RATE, LIMIT), "basic", LIMIT),
]


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


def pairs(count, seed, scale=1.0):
    draw = generator(seed).uniform(-1.0, 1.0, (2, count, 2, 3))
    return scale * 500.0 * (draw[0, :, 1] - draw[0, :, 0]), scale * 0.2 * (draw[1, :, 1] - draw[1, :, 0])


def late_pairs(search, count, seed, scale=1.0):
    """Return pairs of which most do not lock at once, and some late or never."""
    position, velocity = pairs(4_000, seed, scale)
    leg = lock_times(search, position, velocity).leg
    order = np.concatenate([np.flatnonzero(leg == k)[:count] for k in np.unique(leg)])
    return position[order], velocity[order]


def angles(turning, offset, start, end, r, v):
    """Return the angle [rad] of the other sensor from the boresight at 1000 times of a leg."""
    times = np.linspace(start, end, 1000)
    b = turning.boresight(times)
    q = r + times[:, None] * v - 2 * offset * b
    return np.arctan2(np.linalg.norm(np.cross(q, b), axis=1), (q * b).sum(1))


def within(margins, count, seed, share=1.0):
    """Return differences dr, dv with |dr| / position + |dv| / velocity = share, in all proportions."""
    draw = generator(seed)
    rays = draw.normal(size=(2, count, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    part = draw.uniform(size=(count, 1))
    part[: count // 4], part[count // 4 : count // 2] = 0.0, 1.0
    velocity = margins.velocity if np.isfinite(margins.velocity) else 1.0
    return share * part * margins.position * rays[0], share * (1 - part) * velocity * rays[1]


def test_s04_counterexample_has_positive_measure():
    """Its state misses each earlier leg by 0.117 deg, and so do its neighbours; S04 left this open."""
    margins = lock_margins(S04, *COUNTEREXAMPLE)
    assert (S04.legs[margins.leg].phase, S04.legs[margins.leg].round) == ("mOPS", 2)
    assert margins.leg == 10
    missed = np.degrees(margins.margins[:-1])
    assert missed.min() == pytest.approx(0.117, abs=5e-4)
    assert missed.min() >= 0.117
    assert degrees(margins.depth) > 1.0
    assert margins.margins[-1] == -margins.depth
    assert margins.position > 0.2  # m
    assert margins.velocity > 1e-4  # m/s
    for share in (1.0, 0.3):
        dr, dv = within(margins, 5_000, 1, share)
        found = lock_times(S04, COUNTEREXAMPLE[0] + dr, COUNTEREXAMPLE[1] + dv)
        assert (found.leg == margins.leg).all()


@pytest.mark.parametrize("which", range(len(SEARCHES)))
def test_margins_against_sampling(which):
    """Margins are never above the least sampled angle and within the sampling error of it."""
    search, kind, tip = SEARCHES[which]
    sensor = search.sensor
    turning = Turning(turns(kind, sensor.half_angle, tip), RATE)
    kinds = set()
    for r, v in zip(*late_pairs(search, 2, 2), strict=True):
        margins = lock_margins(search, r, v)
        assert margins.leg == lock_times(search, r, v).leg[0]
        legs = search.legs if margins.leg < 0 else search.legs[: margins.leg + 1]
        assert len(margins.margins) == len(legs)
        for leg, margin in zip(legs, margins.margins, strict=True):
            least = angles(turning, sensor.offset, leg.start, leg.end, r, v).min() - sensor.half_angle
            if leg is not legs[-1] or margins.leg < 0:
                assert 0.0 <= margin <= least + 1e-12
            # bound of the turn between two samples
            between = RATE * (leg.end - leg.start) / 1000
            assert margin == pytest.approx(least, abs=between + 0.02 * abs(least))
        assert isnan(margins.depth) == (margins.leg < 0)
        assert margins.position >= 0.0
        kinds.add(margins.leg)
    assert len(kinds) >= (2 if which < 5 else 1)


@pytest.mark.parametrize("which", range(len(SEARCHES)))
def test_states_within_the_margins_lock_in_the_same_leg(which):
    """This includes the boundary and pairs that never lock."""
    search, *_ = SEARCHES[which]
    for k, (r, v) in enumerate(zip(*late_pairs(search, 3, 3, 0.05), strict=True)):
        margins = lock_margins(search, r, v)
        assert margins.velocity > 0.0
        assert margins.position > 0.0
        dr, dv = within(margins, 300, k)
        assert (lock_times(search, r + dr, v + dv).leg == margins.leg).all()


def test_margins_are_not_too_small():
    """For most pairs, a state ten times as far away locks in another leg."""
    other = 0
    position, velocity = late_pairs(S04, 4, 4)
    for k, (r, v) in enumerate(zip(position, velocity, strict=True)):
        dr, dv = within(lock_margins(S04, r, v), 500, k, share=10.0)
        there = np.linalg.norm(r + dr, axis=1) > 0.0
        other += (lock_times(S04, r + dr[there], v + dv[there]).leg != lock_margins(S04, r, v).leg).any()
    assert other > 0.5 * len(position)


def test_close_passage_has_small_margins():
    """A missed pair that passes within 1 um has margins below that."""
    search = SEARCHES[4][0]
    draw, tried = generator(5), 0
    for _ in range(20):
        time = draw.uniform(100.0, 4000.0)
        v = draw.normal(size=3) * 0.1
        aside = np.cross(v, draw.normal(size=3))
        r = aside * 1e-6 / np.linalg.norm(aside) - v * time
        margins = lock_margins(search, r, v)
        leg = margins.leg
        if leg < 0 or search.legs[leg].start > time:
            assert 0.0 < margins.position < 1e-6
            assert 0.0 < margins.velocity < 1e-6 / time
            tried += 1
        dr, dv = within(margins, 500, 6)
        assert (lock_times(search, r + dr, v + dv).leg == leg).all()
    assert tried > 5


def test_immediate_lock():
    """No leg is missed; the depth at one instant counts."""
    margins = lock_margins(S04, [100.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    assert margins.leg == 0
    assert len(margins.margins) == 1
    assert margins.depth == pytest.approx(radians(70), abs=1e-6)
    assert margins.position == pytest.approx(100.0 * np.sin(radians(70)), rel=1e-6)
    dr, dv = within(margins, 2000, 7)
    assert (lock_times(S04, np.array([100.0, 0.0, 0.0]) + dr, dv).leg == 0).all()


def test_margins_beyond_a_right_angle():
    """A narrow cone that points away has a margin above 90 deg."""
    search = Search.basic(Sensor(radians(1.0)), RATE, LIMIT, in_plane_turn=radians(20))
    r = np.array([-100.0, 0.0, 0.0])
    margins = lock_margins(search, r, np.zeros(3))
    assert degrees(margins.margins[0]) == pytest.approx(180 - 20 - 1, abs=1e-6)
    assert margins.position <= 100.0
    dr, dv = within(margins, 2000, 8)
    assert (lock_times(search, r + dr, dv).leg == margins.leg).all()


@pytest.mark.parametrize(
    ("search", "position", "velocity", "message"),
    [
        (
            Search.basic(Sensor(1.2, range=9.0), RATE, LIMIT),
            [1, 2, 3],
            [0, 0, 0],
            "search: .* unlimited range, got 9 m",
        ),
        (S04, [0, 0, 0], [1, 0, 0], "position: the two craft are at the same position"),
    ],
)
def test_invalid_input(search, position, velocity, message):
    with pytest.raises(ValueError, match=message):
        lock_margins(search, position, velocity)
