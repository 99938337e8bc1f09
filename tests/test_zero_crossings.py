"""Conflicts by the zero crossings of SP11, against the certified search and dense sampling."""

import numpy as np
import pytest

import closeform as cf

N = 1.1e-3
ORBIT = cf.Orbit(N)
PERIOD = ORBIT.period
REST = ORBIT.coast(np.zeros(6), PERIOD)
SIZES = [20.0, 40.0, 20.0]
TILT = [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
ZONES = [cf.Box(SIZES), cf.Ellipsoid(SIZES), cf.Box(SIZES, axes=TILT), cf.Ellipsoid(SIZES, axes=TILT)]
CROSSING = 2e-6  # s: crossings are bracketed to 1e-9 rad of n t, 1 µs here


def motions(kind, count=60):
    """Return relative paths of drifting, thrusting or impulsive spacecraft that pass the origin."""
    random = np.random.default_rng(5)
    ends = random.normal(size=(2, count, 6)) * np.repeat([60.0, 60.0 * N], 3)
    ends[..., 4] = -2.0 * N * ends[..., 0] + 1e-3 * random.normal(size=(2, count))
    if kind == "coast":
        return ORBIT.coast(ends[0], PERIOD)
    if kind == "transfer":
        return ORBIT.transfer(*ends, PERIOD)
    first = ORBIT.coast(ends[0], 0.3 * PERIOD)
    kicked = first.state(first.end[0]) + [0.0, 0.0, 0.0, 0.02, 0.0, -0.03]
    return cf.join([first, ORBIT.coast(kicked, 0.5 * PERIOD, first.end)])


@pytest.mark.parametrize("zone", ZONES)
@pytest.mark.parametrize("kind", ["coast", "transfer", "impulse"])
def test_conflicts_agree_with_the_certified_search_and_with_sampling(kind, zone):
    count = missed = 0
    for path in motions(kind):
        certain = cf.find_conflicts(path, REST, zone)
        found = cf.find_conflicts(path, REST, zone, method="sauter-palmer")
        count, missed = count + len(found), missed + len(certain) - len(found)
        times = np.linspace(path.start, path.end, 2000)
        inside = zone.norm(path.position(times)) <= 1.0
        for one in found:
            sure = min(certain, key=lambda conflict: abs(conflict.start - one.start))
            assert (one.start, one.end) == pytest.approx((sure.start, sure.end), abs=CROSSING)
            assert one.ratio == pytest.approx(sure.ratio, abs=1e-9)
            assert inside[(one.start < times) & (times < one.end)].all()
            inside[(one.start <= times) & (times <= one.end)] = False
        assert not inside.any() or len(found) < len(certain)
    assert count > 6
    assert 0 <= missed <= (0.25 * count if kind == "transfer" else 0)


def test_zero_crossings_miss_a_drifting_spacecraft():
    """Drift moves the peak away from the extreme of the oscillation, so that the entry is not detected."""
    # y = l - 6 tau + 16 sin tau [m] peaks 7.7 m above l at tau = 1.19, but has 6.6 m at the start pi/2
    state = cf.elements.state_from_palmer([8.0, 0.0, 2.0, -47.2, 0.0, 0.0], N)
    other = ORBIT.coast(state, PERIOD)
    assert cf.find_conflicts(other, REST, ZONES[0], method="sauter-palmer") == ()
    (conflict,) = cf.find_conflicts(other, REST, ZONES[0])
    peak = -47.2 - 6 * np.arccos(0.375) + 16 * np.sin(np.arccos(0.375))
    assert conflict.ratio == pytest.approx(-peak / 40, abs=1e-9)


def test_start_on_the_surface_is_no_conflict():
    for speed in (0.01, -0.01):
        leaving = ORBIT.coast([np.sign(speed) * 20.0, 0.0, 0.0, speed, 0.0, 0.0], 100.0)
        for one in cf.find_conflicts(leaving, REST, ZONES[0], method="sauter-palmer"):
            assert one.end <= CROSSING


def test_conflicts_of_250_orbits_are_found():
    """Starts of searches are counted from the duration."""
    low = ORBIT.coast([-1.0, -1500.0, 0.0, 0.0, 1.5 * N, 0.0], 300 * PERIOD)
    rest = ORBIT.coast(np.zeros(6), 300 * PERIOD)
    (sure,) = cf.find_conflicts(low, rest, ZONES[0])
    (found,) = cf.find_conflicts(low, rest, ZONES[0], method="sauter-palmer")
    assert (found.start, found.end) == pytest.approx((sure.start, sure.end), abs=1e-3)


@pytest.mark.parametrize(
    ("path", "zone", "changed", "words"),
    [
        (cf.Orbit(0.0).coast(np.zeros(6), 9.0), ZONES[0], {}, "method: .* requires a circular orbit"),
        (
            cf.Orbit.eccentric(0.1, semi_major_axis=8e6).coast(np.zeros(6), 9.0),
            ZONES[0],
            {},
            "method: .* requires a circular orbit",
        ),
        (REST, ZONES[0], {"errors": cf.Uncertainty(np.eye(6))}, "method: .* cannot be combined with errors"),
        (REST, cf.Cylinder(5.0, 9.0, axis=[0, 1, 0]), {}, "zone: .* requires a Box or an Ellipsoid"),
        (ORBIT.burn(np.zeros(6), [1e-4, 0, 0], 9.0), ZONES[0], {}, "path: .* transfers of minimum energy"),
        (
            ORBIT.sampled(np.array([0.0, 5.0, 9.0]), np.eye(3, 6)),
            ZONES[0],
            {},
            "path: .* transfers of minimum energy",
        ),
        (REST, ZONES[0], {"method": "nearest"}, "method: must be 'exact' or 'sauter-palmer'"),
    ],
)
def test_unsupported_paths_are_refused(path, zone, changed, words):
    with pytest.raises(ValueError, match=words) as raised:
        cf.find_conflicts(path, path, zone, **{"method": "sauter-palmer", **changed})
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("method", ["exact", "sauter-palmer"])
def test_conflict_beyond_the_common_time_needs_an_extended_path(method):
    visitor = ORBIT.coast([-20.0, -100.0, 0.0, 0.0, 30.0 * N, 0.0], 500.0)
    client = ORBIT.coast(np.zeros(6), 2000.0)
    ball = cf.Sphere(60.0)
    assert cf.find_conflicts(visitor, client, ball, method=method) == ()
    (conflict,) = cf.find_conflicts(visitor.extended(client.end), client, ball, method=method)
    reach = (100.0 - np.sqrt(60.0**2 - 20.0**2)) / (30.0 * N)  # it drifts at this rate, 20 m below
    assert conflict.start == pytest.approx(reach, abs=1e-5)
    assert conflict.end == 2000.0
    for pair in ((visitor, client), (client, visitor)):
        (same,) = cf.find_conflicts(*pair, ball, method=method, extend=True)
        assert (same.start, same.end) == pytest.approx((conflict.start, conflict.end), abs=1e-9)
    assert cf.find_conflicts(visitor, visitor.extended(100.0), ball, extend=True)[0].end == 500.0
