"""Lemmas of S04 and each case of its theorem 2, on states sampled so that each case occurs."""

from math import inf, pi, radians, sin

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from closeform.search.lock_times import lock_times
from closeform.search.proofs.theorem import (
    cone_crossings,
    cone_regions,
    regions_searched,
    theorem_case,
)
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from turns import Turning, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = Search.modified(Sensor(radians(70)), RATE, LIMIT)
COUNTEREXAMPLE = [2.08, 25.2, -305.6], [0.0, 0.0, 0.0831]  # S04 section V
HALF_ANGLES = [45.5, 50.0, 60.0, 70.0, 80.0, 89.0]
ENDS = {("IPS", 1): 2160.0, ("mOPS", 1): 4283.0, ("IPS", 2): 6443.0, ("mOPS", 2): 8566.0}  # s, theory 5
# Region of craft i seen from j, if j is seen from i in region I, II, III, IV.  # S04 table 1
CORRESPONDING_REGION = {1: 3, 2: 4, 3: 1, 4: 2}
CASES = ["1", "2.a.i", "2.a.ii", "2.b.i", "2.b.ii", "3.a.i", "3.a.ii", "3.b.i", "3.b.ii.A", "3.b.ii.B"]


def modified(half_angle):
    return Search.modified(Sensor(radians(half_angle)), RATE, radians(89.9))


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


def in_cones(half_angle, position):
    """S04: |n3.e| >= cos(theta_C), theta_C = 90 deg - half-angle."""
    distance = np.linalg.norm(position, axis=-1)
    return np.abs(np.asarray(position)[..., 2]) >= distance * np.cos(pi / 2 - radians(half_angle))


def directions_in_cone(draw, count, half_angle, share=1.0):
    """Return directions inside either complementary cone, up to a share of its half-angle."""
    tilt = radians(90.0 - half_angle) * share * np.sqrt(draw.uniform(size=count))
    around = draw.uniform(0.0, 2 * pi, count)
    side = draw.choice([-1.0, 1.0], count)
    radius = np.sin(tilt)
    return np.column_stack([radius * np.cos(around), radius * np.sin(around), side * np.cos(tilt)])


# ---- regions


def test_regions_are_the_quadrants_of_figure_5():
    """Region I: lower cone, right half, that is towards n1; n1 = -x at the first mOPS, x at the second."""
    expected = {(-0.1, -1): (1, 4), (-0.1, 1): (2, 3), (0.1, 1): (3, 2), (0.1, -1): (4, 1)}
    for (x, z), (first, second) in expected.items():
        for mops, number in ((1, first), (2, second)):
            found = cone_regions(S04, [x, 0.05, z], mops)
            assert np.flatnonzero(found).tolist() == [number - 1]
    assert not cone_regions(S04, [1.0, 0.0, 0.3]).any()  # in the in-plane volume
    assert np.flatnonzero(cone_regions(S04, [0.0, 0.0, 1.0])).tolist() == [1, 2]  # on the plane between
    assert cone_regions(S04, np.ones((4, 5, 3))).shape == (4, 5, 4)
    wide = Search.modified(Sensor(radians(100)), RATE, LIMIT)
    assert not cone_regions(wide, [0.0, 0.0, 1.0]).any()


@pytest.mark.parametrize("mops", [1, 2])
def test_table_1(mops):
    """If j is in a region of i, then i is in the corresponding region of j, searched at the same time."""
    rays = directions_in_cone(generator(1), 2000, 70.0)
    seen, back = cone_regions(S04, rays, mops), cone_regions(S04, -rays, mops)
    for region, other in CORRESPONDING_REGION.items():
        np.testing.assert_array_equal(seen[:, region - 1], back[:, other - 1])
    a, b = regions_searched(S04, mops, "A"), regions_searched(S04, mops, "B")
    assert [number for _, number in a] == [1, 2, 3, 4, 1, 2]
    assert [number for _, number in b] == [3, 4, 1, 2, 3, 4]
    assert [t for t, _ in a] == [t for t, _ in b]
    assert [CORRESPONDING_REGION[number] for _, number in a] == [number for _, number in b]


@pytest.mark.parametrize("half_angle", HALF_ANGLES)
def test_cones_cover_the_searched_regions(half_angle):
    """At each of these instants the cone contains the region."""
    search = modified(half_angle)
    rays = directions_in_cone(generator(2), 3000, half_angle)
    turning = {group: Turning(turns("modified", radians(half_angle)), RATE, group) for group in "AB"}
    for mops in (1, 2):
        regions = cone_regions(search, rays, mops)
        assert regions.any(axis=1).all()
        for group in "AB":
            for t, number in regions_searched(search, mops, group):
                region = rays[regions[:, number - 1]]
                assert len(region) > 500
                cosine = region @ turning[group].boresight(t)
                assert (cosine >= np.cos(radians(half_angle)) - 1e-12).all()


# ---- lemmas


@pytest.mark.parametrize("half_angle", HALF_ANGLES)
@pytest.mark.parametrize("mops", [1, 2])
def test_lemma_1(half_angle, mops):
    """In the complementary cones for the whole of an mOPS means a lock in it.

    Tracks between two points of one cone: they cross from region to region at any time.
    """
    search, draw, count = modified(half_angle), generator(3), 20_000
    start, end = {(n, k): (a, b) for n, k, a, b in search.phases}["mOPS", mops]
    first, last = directions_in_cone(draw, count, half_angle), directions_in_cone(draw, count, half_angle)
    last *= np.sign(first[:, 2:] * last[:, 2:])  # in one cone: only the apex connects to the other
    sizes = 10.0 ** draw.uniform(0, 4, (2, count, 1))
    first, last = first * sizes[0], last * sizes[1]
    velocities = (last - first) / (end - start)
    legs = np.array([[leg.start, leg.end] for leg in search.legs if (leg.phase, leg.round) == ("mOPS", mops)])
    # locks of this mOPS alone
    alone = Search(
        search.sensor,
        RATE,
        search.sun_limit,
        search.tip_angle,
        tuple(leg for leg in search.legs if (leg.phase, leg.round) == ("mOPS", mops)),
    )
    found = lock_times(alone, first - start * velocities, velocities)
    assert (found.leg >= 0).all()
    assert (found.time >= start).all()
    assert (found.time <= legs[:, 1].max()).all()
    assert len(np.unique(found.leg)) >= 4


@pytest.mark.parametrize("half_angle", HALF_ANGLES)
@pytest.mark.parametrize("number", [1, 2])
def test_lemma_2(half_angle, number):
    """A pair outside the complementary cones during a whole IPS locks in it."""
    search, draw, count = modified(half_angle), generator(4), 10_000
    start, end = {(n, k): (a, b) for n, k, a, b in search.phases}["IPS", number]
    first, last = draw.normal(size=(2, count, 3)) * 10.0 ** draw.uniform(0, 4, (2, count, 1))
    velocities = (last - first) / (end - start)
    times = np.linspace(start, end, 80)
    inside = np.zeros(count, dtype=bool)
    for t in times:  # 27 s apart, of cones wider by half a degree
        inside |= in_cones(half_angle - 0.5, first + (t - start) * velocities)
    first, velocities = first[~inside], velocities[~inside]
    assert len(first) > 100
    alone = Search(
        search.sensor,
        RATE,
        search.sun_limit,
        search.tip_angle,
        tuple(leg for leg in search.legs if (leg.phase, leg.round) == ("IPS", number)),
    )
    found = lock_times(alone, first - start * velocities, velocities)
    assert (found.leg == 0).all()
    assert (found.time <= end).all()


def test_lemma_3_number_of_crossings():
    """A line meets the cones never, once, twice or entirely."""
    c, s = S04.sensor.cosine, sin(S04.sensor.half_angle)
    assert cone_crossings(S04, [10.0, 0.0, 0.0], [0.0, 0.0, 0.0]) == ()
    assert cone_crossings(S04, [10.0, 0.0, 0.0], [0.0, 1.0, 0.0]) == ()
    assert len(cone_crossings(S04, [10.0, 0.0, 0.0], [0.0, 0.0, 1.0])) == 2
    assert len(cone_crossings(S04, [0.0, 0.0, 10.0], [1.0, 0.0, 0.0])) == 2
    ruling = np.array([c, 0.0, s])
    assert len(cone_crossings(S04, [5.0, 3.0, 1.0], [c, 0.0, s])) in (1, 2)
    assert cone_crossings(S04, 4.0 * ruling, ruling) is None
    assert cone_crossings(S04, 4.0 * ruling, [0.0, 0.0, 0.0]) is None


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 10**9), st.floats(46.0, 89.0), st.floats(-3.0, 7.0), st.floats(-9.0, 3.0))
def test_lemma_3_crossings_in_60_digits(seed, half_angle, size, speed):
    """The roots of S04 eq. 5 in 60 digits."""
    search = modified(half_angle)
    draw = generator(seed)
    position, velocity = draw.normal(size=3) * 10.0**size, draw.normal(size=3) * 10.0**speed
    with mp.workdps(60):
        c, s = mp.cos(mp.mpf(radians(half_angle))) ** 2, mp.sin(mp.mpf(radians(half_angle))) ** 2
        r, v = [mp.mpf(x) for x in position], [mp.mpf(x) for x in velocity]

        def q(a, b):
            return c * a[2] * b[2] - s * (a[0] * b[0] + a[1] * b[1])

        discriminant = q(r, v) ** 2 - q(v, v) * q(r, r)
        flat = abs(discriminant) / (q(r, v) ** 2 + abs(q(v, v) * q(r, r)))
        if discriminant < 0:
            truth = []
        else:
            root = mp.sqrt(discriminant)
            truth = sorted([(-q(r, v) - root) / q(v, v), (-q(r, v) + root) / q(v, v)])
        truth = [float(t) for t in truth]
    found = cone_crossings(search, position, velocity)
    assert found is not None
    if flat > 1e-10:
        assert len(found) == len(truth)
        np.testing.assert_allclose(found, truth, rtol=1e-9)


# ---- theorem 2


def states(count, seed):
    """Return states that cross the cone surface at random times and places."""
    draw = generator(seed)
    instants = np.sort(draw.uniform(-1000.0, 9000.0, (count, 2)), axis=1) + [[0.0, 1.0]]
    tilt = radians(20.0) * draw.uniform(0.0, 3.0, (2, count)) ** 2
    around = draw.uniform(0.0, 2 * pi, count) + draw.normal(size=(2, count)) * 1.5
    height = 10.0 ** draw.uniform(0.0, 3.0, (2, count)) * draw.choice([-1.0, 1.0], count)
    radius = np.tan(np.minimum(tilt, 1.5))
    two = np.stack([radius * np.cos(around), radius * np.sin(around), np.ones_like(tilt)], axis=-1)
    two *= height[..., None]
    velocities = (two[1] - two[0]) / (instants[:, 1:] - instants[:, :1])
    return two[0] - instants[:, :1] * velocities, velocities


def late_locks():
    """Return some of the few pairs that lock in the second IPS."""
    position, velocity = states(200_000, 9)
    found = lock_times(S04, position, velocity).leg == 8
    return position[found][:100], velocity[found][:100]


def needing_second_mops(count, seed):
    """Return states that need the second mOPS."""
    draw = generator(seed)
    position, velocity = map(np.array, COUNTEREXAMPLE)
    return position + draw.uniform(-0.3, 0.3, (count, 3)), velocity + draw.uniform(-1e-4, 1e-4, (count, 3))


@pytest.fixture(scope="module")
def cases():
    position, velocity = map(
        np.concatenate, zip(states(2500, 5), late_locks(), needing_second_mops(40, 6), strict=True)
    )
    return [(r, v, theorem_case(S04, r, v)) for r, v in zip(position, velocity, strict=True)]


def test_every_case_occurs(cases):
    counts = {label: sum(case.label == label for *_, case in cases) for label in CASES}
    print(counts)
    assert sum(counts.values()) == len(cases)
    assert all(count >= 10 for count in counts.values()), counts
    volumes = {case.volume for *_, case in cases if case.label == "1"}
    assert volumes == {"in-plane", "complementary cone"}


def test_volumes_against_sampling(cases):
    """Compare the volume at each time, and the number of changes, with the definition of the cones."""
    later = np.concatenate([np.linspace(0.0, 20_000.0, 2001), 10.0 ** np.linspace(4.4, 8.0, 200)])
    for r, v, case in cases[::4]:
        inside = in_cones(70.0, r + later[:, None] * v)
        expected = (case.volume == "complementary cone") ^ (np.searchsorted(case.changes, later) % 2 == 1)
        apart = np.abs(np.subtract.outer(later, np.array(case.changes))).min(axis=1, initial=inf)
        near = apart < 1e-6 * (1 + later)
        np.testing.assert_array_equal(inside[~near], expected[~near])
        assert case.label.startswith(str(len(case.changes) + 1))
        assert list(case.changes) == sorted(case.changes)
        assert all(t >= 0.0 for t in case.changes)


def test_guarantee_holds_in_each_case(cases):
    """The proof of theorem 2 of S04, stated in times."""
    latest = {
        ("1", "in-plane"): ("IPS", 1),
        ("1", "complementary cone"): ("mOPS", 1),
        "2.a.i": ("IPS", 1),
        "2.a.ii": ("mOPS", 1),
        "2.b.i": ("mOPS", 1),
        "2.b.ii": ("IPS", 2),
        "3.a.i": ("IPS", 1),
        "3.a.ii": ("IPS", 2),
        "3.b.i": ("mOPS", 1),
        "3.b.ii.A": ("IPS", 2),
        "3.b.ii.B": ("mOPS", 2),
    }
    order = list(ENDS)
    reached = set()
    for r, v, case in cases:
        promised = latest[(case.label, case.volume) if case.label == "1" else case.label]
        assert case.latest_phase == promised
        assert case.latest == pytest.approx(ENDS[promised], abs=0.1)
        assert case.time <= case.latest
        assert order.index(case.phase) <= order.index(promised)
        reached.add((case.label, case.phase))
        starts_inside = bool(in_cones(70.0, r))
        assert (case.volume == "complementary cone") == starts_inside
        before = sum(t < case.time for t in case.changes)
        assert case.label.endswith(".i") == (bool(case.changes) and before == 0)
        assert case.label.endswith("B") == (starts_inside and before == 2)
        assert case.time == lock_times(S04, r, v).time[0]
    assert ("3.b.ii.B", ("mOPS", 2)) in reached
    assert ("2.b.ii", ("IPS", 2)) in reached


@pytest.mark.parametrize("half_angle", HALF_ANGLES)
def test_guarantee_at_other_half_angles(half_angle):
    search = modified(half_angle)
    for r, v in zip(*states(150, 7), strict=True):
        case = theorem_case(search, r, v)
        assert case.time <= case.latest


def test_s04_counterexample_is_case_3bii_b():
    case = theorem_case(S04, *COUNTEREXAMPLE)
    assert (case.label, case.volume, case.phase) == ("3.b.ii.B", "complementary cone", ("mOPS", 2))
    assert case.time == pytest.approx(6692.29, abs=0.005)
    assert case.latest == pytest.approx(8566.0, abs=0.05)
    leave, enter = case.changes
    assert 2160.0 < leave < 4283.0 < enter < 6443.0  # out during the first mOPS, back during the second IPS


def test_touching_and_starting_on_the_surface():
    c, s = S04.sensor.cosine, sin(S04.sensor.half_angle)
    rim = np.array([c, 0.0, s]) * 100.0
    still = theorem_case(S04, rim, [0.0, 0.0, 0.0])
    assert (still.label, still.volume) == ("1", "complementary cone")  # the surface belongs to the cone
    out = theorem_case(S04, rim * [-1.0, 0.0, 1.0], [-0.01, 0.0, 0.0])
    assert out.volume == "complementary cone"
    assert out.changes == (0.0,)
    assert out.label == "2.b.ii"
    up = theorem_case(S04, rim, [0.0, 0.0, 0.01])
    assert (up.label, up.changes) == ("1", ())
    wide = theorem_case(Search.modified(Sensor(radians(90)), RATE, LIMIT), [0.0, 0.0, 5.0], [0.0, 0.0, 0.0])
    assert (wide.label, wide.volume, wide.time) == ("1", "in-plane", 0.0)


# ---- the planar theorem


@pytest.mark.parametrize("half_angle", [1e-1, 1e-3, 1e-5, 1e-7])
def test_planar_theorem(half_angle):
    """S04 theorem 1: in the plane, 1.5 turns lock any pair, however narrow the cone."""
    search = Search.basic(Sensor(half_angle), RATE, LIMIT)
    draw, count = generator(8), 20_000
    first, last = draw.normal(size=(2, count, 3)) * 10.0 ** draw.uniform(0, 4, (2, count, 1)) * [1, 1, 0]
    found = lock_times(search, first, (last - first) / 2160.0 * draw.uniform(0.1, 3.0, (count, 1)))
    assert (found.leg == 0).all()
    assert found.time.max() <= 2160.0
    one = Search.basic(Sensor(half_angle), RATE, LIMIT, in_plane_turn=2 * pi)
    assert (lock_times(one, first, (last - first) / 2160.0).leg != 0).any()  # which one turn does not


# ---- bad input


@pytest.mark.parametrize(
    ("search", "message"),
    [
        (Search.basic(Sensor(radians(70)), RATE, LIMIT), "search: the theorem covers only Search.modified"),
        (
            Search.modified(Sensor(radians(70), 7.5), RATE, LIMIT),
            "at the centre of mass, got an offset of 7.5 m",
        ),
        (Search.modified(Sensor(radians(70), range=500.0), RATE, LIMIT), "unlimited range, got 500 m"),
    ],
)
def test_searches_that_the_theorem_does_not_cover(search, message):
    with pytest.raises(ValueError, match=message):
        theorem_case(search, *COUNTEREXAMPLE)


@pytest.mark.parametrize(
    ("position", "velocity", "message"),
    [
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], "position: the two craft are at the same position"),
        ([10.0, 0.0, 20.0], [-0.5, 0.0, -1.0], "velocity: the craft collide at 20 s"),
    ],
)
def test_bad_states(position, velocity, message):
    with pytest.raises(ValueError, match=message):
        theorem_case(S04, position, velocity)


def test_bad_regions():
    with pytest.raises(ValueError, match=r"position: expected shape \(\.\.\., 3\)"):
        cone_regions(S04, [1.0, 2.0])
    for call in (lambda: cone_regions(S04, [1.0, 2.0, 3.0], 3), lambda: regions_searched(S04, 0)):
        with pytest.raises(ValueError, match="mops: this search has no mOPS"):
            call()
    with pytest.raises(ValueError, match='group: must be "A" or "B"'):
        regions_searched(S04, 1, "C")
