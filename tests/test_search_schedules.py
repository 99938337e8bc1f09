"""Search schedules against the turns and numbers of the papers."""

import re
from math import cos, degrees, inf, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from closeform.search.leg import greatest
from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from turns import START, Turning, first_lock, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = Search.modified(Sensor(radians(70)), RATE, LIMIT)
H03 = Search.basic(Sensor(radians(70), 7.5), RATE, LIMIT)
ENDS = [2160.0, 2245.4, 2416.1, 3136.1, 3306.9, 4026.9, 4197.6, 4283.0]  # s, theory 5; S04 figure 4
COUNTEREXAMPLE = [2.08, 25.2, -305.6], [0.0, 0.0, 0.0831]  # S04 section V
VARIANTS = [
    (S04, turns("modified", radians(70))),
    (H03, turns("basic", radians(70), LIMIT)),
    (Search.modified(Sensor(radians(50)), radians(1), radians(80)), turns("modified", radians(50))),
    (
        Search.basic(Sensor(radians(30)), radians(0.1), radians(45), radians(360), radians(33)),
        turns("basic", radians(30), radians(33), 360.0),
    ),
]


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


# ---- S04's numbers


def test_end_times_of_legs():
    """540 deg, then tips of 21.344 deg, at 0.25 deg/s: "approximately 2.4 hours" (S04)."""
    ends = np.array([leg.end for leg in S04.legs])
    np.testing.assert_allclose(ends[:8], ENDS, rtol=0.0, atol=0.05)
    np.testing.assert_allclose(ends[8:] - ends[7], ends[:8], rtol=0.0, atol=1e-9)
    assert S04.duration == pytest.approx(8566.0, abs=0.05)
    assert S04.duration / 3600 == pytest.approx(2.4, abs=0.05)
    assert [leg.start for leg in S04.legs] == [0.0, *ends[:-1]]
    assert [phase[:2] for phase in S04.phases] == [("IPS", 1), ("mOPS", 1), ("IPS", 2), ("mOPS", 2)]
    assert [leg.about for leg in S04.legs[:8]] == [
        *("sun line", "body y", "body y", "sun line"),
        *("body y", "sun line", "body y", "body y"),
    ]


def test_tip_angle_of_equation_1():
    """S04 eq. 1: 21.3 deg for 70 deg, for which the farthest corner of a region is just seen."""
    assert degrees(S04.tip_angle) == pytest.approx(21.344, abs=5e-4)
    for half_angle in np.radians([45.001, 50.0, 60.0, 70.0, 80.0, 89.9]):
        tip = Search.modified(Sensor(half_angle), RATE, radians(89.9)).tip_angle

        def missing(t, half_angle=half_angle):
            boresight = np.array([cos(t), 0.0, -sin(t)])
            around = np.linspace(
                -pi / 2, pi / 2, 1801
            )  # the region's rim: 90 deg - half-angle off the sun line
            rim = np.column_stack(
                [
                    cos(half_angle) * np.cos(around),
                    cos(half_angle) * np.sin(around),
                    0 * around - sin(half_angle),
                ]
            )
            return cos(half_angle) - (rim @ boresight).min()

        assert missing(tip) == pytest.approx(0.0, abs=1e-12)
        assert missing(tip - 1e-6) > 0.0  # not before, and on to a right angle it stays seen


def test_sky_coverage_of_the_in_plane_search():
    """S04, H03: 94 % of the sky at 70 deg."""
    assert S04.coverage("IPS") == pytest.approx(cos(radians(20)), abs=2e-5)
    assert 100 * S04.coverage("IPS") == pytest.approx(93.97, abs=0.005)
    assert S04.coverage() == pytest.approx(1.0, abs=1e-5)
    assert Search.basic(Sensor(radians(50)), RATE, LIMIT).coverage() < 1.0


def test_sun_moves_a_tenth_of_a_degree_in_three_hours():
    """S04, footnote b."""
    assert degrees(S04.sun_drift) * 3 * 3600 / S04.duration == pytest.approx(0.1, rel=0.3)
    assert degrees(S04.sun_drift) == pytest.approx(360 * S04.duration / (365.25636 * 86400), rel=1e-9)


def test_counterexample_depends_on_the_sense_of_turns():
    """The state of S04 locks in the second mOPS; swapped groups or turns about +z lock far earlier."""
    position, velocity = map(np.array, COUNTEREXAMPLE)
    found = lock_times(S04, position, velocity)
    assert found.time[0] == pytest.approx(6692.29, abs=0.005)
    leg = S04.legs[found.leg[0]]
    assert (leg.phase, leg.round) == ("mOPS", 2)
    own = Turning(turns("modified", radians(70)), RATE)
    assert first_lock(own, position, velocity, radians(70)) == pytest.approx(found.time[0], abs=1e-6)
    # A at the other's place is the same as the line of sight turned around
    swapped = first_lock(own, -position, -velocity, radians(70))
    assert swapped == pytest.approx(2408.6, abs=0.05)
    assert lock_times(S04, -position, -velocity).time[0] == pytest.approx(swapped, abs=1e-6)
    other_sense = Turning(turns("modified", radians(70)), RATE, sun=(0.0, 0.0, 1.0))
    assert first_lock(other_sense, position, velocity, radians(70)) == pytest.approx(3312.0, abs=0.05)


def test_message_names_a_sufficient_half_angle():
    """At a sun limit of 25 deg, S04 requires 67 deg."""
    with pytest.raises(ValueError, match=r"half-angle of 67\.0902 deg is sufficient"):
        Search.modified(Sensor(radians(65)), RATE, LIMIT)
    Search.modified(Sensor(radians(67.0903)), RATE, LIMIT)
    with pytest.raises(ValueError, match=r"tips of 25\.000 deg, above the limit of 25 deg"):
        Search.modified(Sensor(radians(67.0901)), RATE, LIMIT)


# ---- attitudes


@pytest.mark.parametrize("which", range(len(VARIANTS)))
@pytest.mark.parametrize("group", ["A", "B"])
def test_attitudes_of_each_group(which, group):
    """The groups turn with opposite signs about body y, and equally about the sun line."""
    search, sequence = VARIANTS[which]
    turning = Turning(sequence, search.slew_rate, group)
    assert search.duration == pytest.approx(turning.ends[-1], rel=1e-12)
    np.testing.assert_allclose([leg.end for leg in search.legs], turning.ends, rtol=1e-12)
    times = np.sort(np.append(generator(1).uniform(0, search.duration, 2000), [0.0, search.duration]))
    attitudes = search.attitude(times, group)
    np.testing.assert_allclose(attitudes, turning.attitude(times), rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(search.boresight(times, group), attitudes[..., 2])
    np.testing.assert_allclose(
        attitudes.transpose(0, 2, 1) @ attitudes, np.broadcast_to(np.eye(3), (2002, 3, 3)), atol=1e-13
    )
    np.testing.assert_allclose(np.linalg.det(attitudes), 1.0, atol=1e-13)
    assert search.attitude(5.0, group).shape == (3, 3)
    assert search.boresight(np.full((2, 4), 5.0), group).shape == (2, 4, 3)


def test_groups_have_opposite_boresights_and_equal_sun_angles():
    for search, _ in VARIANTS:
        times = np.linspace(0.0, search.duration, 5000)
        a, b = search.attitude(times, "A"), search.attitude(times, "B")
        np.testing.assert_array_equal(a[..., 0], b[..., 0])
        np.testing.assert_array_equal(a[..., 2], -b[..., 2])
        np.testing.assert_array_equal(np.cross(b[..., 2], b[..., 0]), np.cross(-a[..., 2], a[..., 0]))


def test_no_turn_is_faster_than_the_slew_rate():
    """The attitude is continuous where legs meet."""
    for search, _ in VARIANTS:
        step = 0.25
        times = np.arange(0.0, search.duration, step)
        attitudes = Rotation.from_matrix(search.attitude(times))
        angles = (attitudes[:-1].inv() * attitudes[1:]).magnitude()
        assert angles.max() <= search.slew_rate * step * (1 + 1e-9)
        assert np.median(angles) == pytest.approx(search.slew_rate * step, rel=1e-9)


def test_sun_angle_against_samples():
    """Samples of body x reach the tip angle and no more."""
    for search, _ in VARIANTS:
        times = np.linspace(0.0, search.duration, 50_000)
        for group in ("A", "B"):
            angles = np.arccos(np.clip(-search.attitude(times, group)[..., 2, 0], -1.0, 1.0))
            assert angles.max() <= search.sun_angle + 1e-7
            assert angles.max() == pytest.approx(search.sun_angle, abs=1e-5)
        assert search.sun_angle == pytest.approx(search.tip_angle, abs=1e-7)
        assert search.sun_angle <= search.sun_limit + 1e-9
        for leg in search.legs:
            inside = np.linspace(leg.start, leg.end, 2000)
            shade = np.arccos(np.clip(-leg.attitude_at(inside)[..., 2, 0], -1.0, 1.0))
            assert leg.sun_angle == pytest.approx(shade.max(), abs=1e-6)


def test_sun_alignment_at_the_end_of_each_phase():
    """Body x points at the Sun again; IPS and mOPS reverse the boresight."""
    for search, _ in VARIANTS:
        for _, _, start, end in search.phases:
            for t in (start, end):
                assert search.attitude(t)[2, 0] == pytest.approx(-1.0, abs=1e-12)
    assert S04.boresight(2160.0) == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)  # S04: n1 = -x, then x
    assert S04.boresight(S04.legs[8].end) == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert S04.boresight(10.0)[1] < 0.0  # right-handed about -z: from +x to -y


# ---- H03


def test_basic_search_with_one_turn_as_in_h03_simulation():
    """IPS of one turn ends after 24 min; the tips are 25, 50 and 50 deg and one back of 25 deg."""
    one = Search.basic(Sensor(radians(70), 7.5), RATE, LIMIT, in_plane_turn=2 * pi)
    assert one.legs[0].end == pytest.approx(24 * 60, abs=1e-9)
    turned = [degrees(leg.angle) for leg in one.legs[1:6]]
    assert turned == pytest.approx([25, -50, 180, 50, -25])
    assert one.phases[1][3] - one.phases[1][2] == pytest.approx(330 / 0.25)
    assert one.duration == pytest.approx(2 * (360 + 330) / 0.25)
    assert H03.duration == pytest.approx(2 * (540 + 330) / 0.25)
    assert {leg.phase for leg in one.legs} == {"IPS", "OPS"}
    assert H03.tip_angle == LIMIT
    assert Search.basic(Sensor(radians(70)), RATE, LIMIT, tip_angle=radians(10)).tip_angle == radians(10)


def own_cone(height, aside, tip, offset, half_angle):
    """Return the distance by which a spacecraft's cone at best misses a point at a height along the sun line.

    The cone may be tipped by any angle up to `tip`, about any axis across the sun line.
    """
    elevation, around = np.meshgrid(np.linspace(-tip, tip, 201), np.linspace(0.0, 2 * pi, 181))
    b = np.stack([np.cos(elevation) * np.cos(around), np.cos(elevation) * np.sin(around), np.sin(elevation)])
    q = np.array([aside, 0.0, height])[:, None, None] - offset * b
    return cos(half_angle) - float(((q * b).sum(0) / np.sqrt((q * q).sum(0))).max())


def test_near_field_against_the_cone():
    """H03: it tapers to zero at 80 m along the sun line (81 m)."""
    for offset, half_angle, tip in [
        (7.5, 70.0, 25.0),
        (1.0, 60.0, 40.0),
        (20.0, 70.0, 25.0),
        (7.5, 80.0, 15.0),
        (7.5, 95.0, 25.0),  # these see backwards
        (7.5, 110.0, 25.0),
        (7.5, 150.0, 25.0),
    ]:
        search = Search.basic(Sensor(radians(half_angle), offset), RATE, radians(tip))
        cone = radians(tip), offset, radians(half_angle)
        length = brentq(lambda h, cone=cone: own_cone(h, 0.0, *cone), 1e-3, 100 * offset, xtol=1e-9)
        assert search.near_field == pytest.approx(length, rel=1e-9)
    assert H03.near_field == pytest.approx(81.0, abs=0.5)


def test_near_field_radius_against_the_cone():
    """H03 figure 6: about 7 m from the sun line, tapering to zero over 80 m."""
    for half_angle, tip in [
        (70.0, 25.0),
        (60.0, 40.0),
        (70.0, 15.0),
        (95.0, 25.0),
        (150.0, 25.0),
        (170.0, 25.0),
    ]:
        search = Search.basic(Sensor(radians(half_angle), 7.5), RATE, radians(tip))
        cone = radians(tip), 7.5, radians(half_angle)
        for height in np.array([0.02, 0.3, 0.6, 0.97]) * min(search.near_field, 60.0):
            aside = brentq(lambda a, h=height, cone=cone: own_cone(h, a, *cone), 0.0, 40.0)
            assert search.near_field_radius(height) == pytest.approx(aside, abs=0.01)  # 0.25 deg between tips
    assert H03.near_field_radius([0.0, -7.5 * sin(LIMIT), 81.0]) == pytest.approx(
        [7.5, 7.5 * cos(LIMIT), 0.0]
    )
    assert S04.near_field_radius(0.0) == 0.0
    heights = np.array(
        [20.0, 40.0, 60.0, 80.0]
    )  # where its side is the cone's edge, 25 + 70 deg above the plane
    widths = [brentq(lambda a, h=h: own_cone(h, a, LIMIT, 7.5, radians(70)), 0.0, 7.5) for h in heights]
    np.testing.assert_allclose(H03.near_field_radius(heights), widths, atol=1e-6)
    np.testing.assert_allclose(widths, (H03.near_field - heights) * np.tan(radians(5)), atol=1e-6)


def test_relaxed_sun_limit():
    """H03, footnote 5: a single tip of 40 deg each way searches whole complementary cones of 20 deg."""
    search = Search.basic(Sensor(radians(70)), RATE, LIMIT, passes=1, relaxed=True)
    own = Turning(
        [("IPS", "sun", radians(540)), *(("OPS", "y", radians(angle)) for angle in (40, -80, 40))], RATE
    )
    times = np.linspace(0.0, search.duration, 1000)
    assert search.duration == pytest.approx(own.ends[-1], rel=1e-12)
    np.testing.assert_allclose(search.attitude(times), own.attitude(times), rtol=0.0, atol=1e-12)
    assert degrees(search.sun_angle) == pytest.approx(40.0)
    assert search.coverage() == pytest.approx(1.0, abs=1e-6)
    # each pair at rest locks; with tips that are half a degree smaller, some do not
    poles = generator(4).normal(size=(2000, 3)) * [1.0, 1.0, 4.0]
    assert (lock_times(search, poles, np.zeros(3)).leg >= 0).all()
    less = Search.basic(Sensor(radians(70)), RATE, LIMIT, tip_angle=radians(39.5), passes=1, relaxed=True)
    assert (lock_times(less, poles, np.zeros(3)).leg < 0).any()
    usual = Search.basic(Sensor(radians(70)), RATE, LIMIT, passes=1)
    assert search.duration - search.legs[0].end < 0.5 * (usual.duration - usual.legs[0].end)
    assert usual.duration == pytest.approx(H03.duration / 2)
    assert [leg.phase for leg in usual.legs] == [leg.phase for leg in H03.legs if leg.round == 1]


def test_empty_and_unbounded_near_field():
    assert S04.near_field == 0.0
    assert Search.basic(Sensor(radians(70), 7.5), RATE, LIMIT, tip_angle=radians(15)).near_field == inf
    # without tips the sun line is in reach of a sensor that sees by as much more than a right angle
    assert Search.modified(Sensor(radians(100), 7.5), RATE, LIMIT).near_field == pytest.approx(
        7.5 / np.tan(radians(10))
    )


@pytest.mark.parametrize("limit", [20.0, 22.0, 24.0, 25.0, 26.0, 30.0, 33.3, 44.0])
def test_sufficient_half_angle(limit):
    with pytest.raises(ValueError, match="is sufficient") as refused:
        Search.modified(Sensor(radians(50.0)), RATE, radians(limit))
    enough = float(re.search(r"a half-angle of ([\d.]+) deg is sufficient", str(refused.value))[1])
    assert Search.modified(Sensor(radians(enough)), RATE, radians(limit)).tip_angle <= radians(limit)
    with pytest.raises(ValueError, match="is sufficient"):
        Search.modified(Sensor(radians(enough - 2e-4)), RATE, radians(limit))


def test_near_field_of_two_spacecraft():
    """Both offsets count between mass centres: no lock within 162 m on the sun line."""
    for height in (100.0, 160.0, 2 * H03.near_field - 0.1):
        assert lock_times(H03, [0.0, 0.0, height], np.zeros(3)).leg[0] == -1
    assert lock_times(H03, [0.0, 0.0, 2 * H03.near_field + 0.1], np.zeros(3)).leg[0] >= 0


# ---- alignment, coverage


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from(["A", "B"]))
def test_alignment_turn_reaches_the_start_attitude(seed, group):
    attitude = Rotation.random(random_state=seed).as_matrix()
    axis, angle, time = S04.alignment(attitude, group)
    turned = Rotation.from_rotvec(axis * angle).as_matrix() @ attitude
    np.testing.assert_allclose(turned, START[group], atol=1e-9)
    assert 0.0 <= angle <= pi + 1e-12
    assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-12)
    assert time == pytest.approx(angle / RATE, rel=1e-12)
    least = Rotation.from_matrix(START[group] @ attitude.T).magnitude()
    assert angle == pytest.approx(least, abs=1e-9)


def test_alignment_by_zero_and_half_a_turn():
    axis, angle, time = S04.alignment(START["A"])
    assert angle == time == 0.0
    assert np.linalg.norm(axis) == 1.0
    _, angle, time = S04.alignment(START["B"], "A")
    assert angle == pytest.approx(pi)
    assert time == pytest.approx(720.0)


@pytest.mark.parametrize("which", range(len(VARIANTS)))
def test_coverage_against_random_directions(which):
    """Count 8 000 directions that are within the cone at some sample."""
    search, sequence = VARIANTS[which]
    draw = generator(2).normal(size=(8_000, 3)).astype(np.float32)
    rays = draw / np.linalg.norm(draw, axis=1)[:, None]
    turning = Turning(sequence, search.slew_rate)
    for phase in (None, *dict.fromkeys(leg.phase for leg in search.legs)):
        chosen = [k for k, leg in enumerate(search.legs) if phase in (None, leg.phase)]
        chosen = [k for k in chosen if phase is None or search.legs[k].round == search.legs[chosen[0]].round]
        times = np.concatenate([np.linspace(turning.starts[k], turning.ends[k], 100) for k in chosen])
        best = (rays @ turning.boresight(times).T.astype(np.float32)).max(axis=1)
        share = (best >= cos(search.sensor.half_angle)).mean()
        tolerance = 4 * sqrt(max(share * (1 - share), 1e-4) / len(rays)) + 2e-4  # and the samples' own gaps
        assert search.coverage(phase) == pytest.approx(share, abs=tolerance)


def test_half_angles_above_90_deg_need_no_tips():
    for half_angle in (90.0, 100.0, 179.0):
        search = Search.modified(Sensor(radians(half_angle)), RATE, LIMIT)
        assert search.tip_angle == 0.0
        assert all(leg.about == "sun line" for leg in search.legs)
        assert search.duration == pytest.approx(2 * (540 + 360) / 0.25)
        assert search.coverage() == pytest.approx(1.0, abs=1e-6)
        assert search.sun_angle == pytest.approx(0.0, abs=1e-7)
        rays = generator(3).normal(size=(1000, 3))
        locks = lock_times(search, rays, np.zeros(3))
        assert (locks.leg == 0).all()


# ---- bad input

GOOD = {"slew_rate": RATE, "sun_limit": LIMIT}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slew_rate": 0.0}, "slew_rate: must be positive and finite, got 0"),
        ({"sun_limit": pi / 2}, r"sun_limit: must be below pi/2 \(90 deg\)"),
    ],
)
@pytest.mark.parametrize("kind", [Search.modified, Search.basic])
def test_invalid_numbers(kind, change, message):
    with pytest.raises(ValueError, match=message):
        kind(Sensor(radians(70)), **{**GOOD, **change})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), "half_angle: must be above 0 and below pi"),
        ((pi,), r"half_angle: must be above 0 and below pi \(180 deg\)"),
        ((1.0, -1.0), "offset: must be finite and at least 0 m"),
    ],
)
def test_invalid_sensors(arguments, message):
    with pytest.raises(ValueError, match=message):
        Sensor(*arguments)


def test_invalid_calls():
    for call, message in [
        (lambda: Search.modified(Sensor(radians(44.9)), RATE, LIMIT), "half_angle: 44.9 deg is below 45 deg"),
        (
            lambda: Search.basic(Sensor(1.0), RATE, LIMIT, tip_angle=radians(26)),
            "tip_angle: 26 deg is above the sun",
        ),
        (
            lambda: Search.basic(Sensor(1.0), RATE, LIMIT, in_plane_turn=0.0),
            "in_plane_turn: must be positive",
        ),
        (
            lambda: Search.basic(Sensor(1.0), RATE, LIMIT, passes=0),
            "passes: expected a whole number of at least 1",
        ),
        (lambda: S04.attitude(-1.0), "t: must be within the search, from 0 to 8566"),
        (lambda: S04.attitude(8567.0), "t: must be within the search"),
        (lambda: S04.boresight(np.nan), "t: must be within the search"),
        (lambda: S04.boresight(1.0, "C"), 'group: must be "A" or "B"'),
        (lambda: S04.coverage("OPS"), "phase: the phases of this search are IPS, mOPS, got 'OPS'"),
        (lambda: S04.alignment(np.eye(2)), "attitude: expected three orthonormal columns"),
        (lambda: S04.alignment(2 * np.eye(3)), "attitude: expected three orthonormal columns"),
        (lambda: S04.alignment(np.diag([1.0, 1.0, -1.0])), "attitude: left-handed columns"),
        (lambda: S04.alignment(np.eye(3), "C"), "group: must be"),
    ]:
        with pytest.raises(ValueError, match=message):
            call()


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, pi, -pi, 3.5, -5.9, 2.0 * pi, 9.0])
def test_greatest_cosine_of_a_turn(angle: float) -> None:
    """4001 angles of up to 9 rad miss the crest by (9 / 8000)^2 / 2 of an amplitude below 6 at most."""
    steady, cosine, sine = np.random.default_rng(7).normal(size=(3, 500))
    turned = np.linspace(0.0, angle, 4001)[:, None]
    sampled = (steady + cosine * np.cos(turned) + sine * np.sin(turned)).max(axis=0)
    found = greatest(steady, cosine, sine, angle)
    assert (found >= sampled - 1e-12).all()
    assert (found <= sampled + 4e-6).all()
